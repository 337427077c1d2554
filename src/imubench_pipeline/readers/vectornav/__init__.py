"""ASCII sentences of VectorNav."""
