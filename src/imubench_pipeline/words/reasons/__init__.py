"""Reasons and notes of results in words: why a value is absent or doubtful, or what it assumes.

Each is a clause, which may be followed by sentences; it begins in lower case and has no full stop
at its end.
"""
