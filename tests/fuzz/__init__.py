"""Mutated logs of every format, read until a reader does what it never should."""
