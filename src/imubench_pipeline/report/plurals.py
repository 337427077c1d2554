"""Numbers with their nouns, for pages and for the terminal, where a run begins at once."""

from __future__ import annotations


def counted(number: int, singular: str, plural: str | None = None) -> str:
    """Return a number with its noun: ``1 recording``, ``3 recordings``."""
    return f"{number} {singular if number == 1 else plural or singular + 's'}"
