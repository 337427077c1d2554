"""Reasons and notes in words: why a value is absent or doubtful, and its assumptions.

Each is a clause, which may be followed by sentences; it begins in lower case and has no full stop
at its end.
"""
