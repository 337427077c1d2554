"""Shortlist before buying: the catalogue sensors that are worth logging for a requirement."""
