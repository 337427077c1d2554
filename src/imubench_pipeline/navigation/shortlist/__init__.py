"""Shortlist before buying: the catalogue sensors that are worth logging for a requirement.

`figures` reads datasheets in all conventions that they may use. `classes` fills unpublished figures
with the ranges measured on sensors of the same class. `rows` compares the best and the worst case
with the limits of a requirement.
"""
