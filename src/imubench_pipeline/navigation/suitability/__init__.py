"""Check the suitability of a sensor for an application: hard requirements and conditions."""
