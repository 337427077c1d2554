"""Sentences about data, made from typed values: the only package with texts for readers."""
