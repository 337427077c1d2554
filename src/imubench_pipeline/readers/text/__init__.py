"""Logs in text: what separates, heads and stamps their records is found in the file."""
