"""Sentences about data, made from typed values: the only room with texts that people read."""
