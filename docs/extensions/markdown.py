"""Tables and cells in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def cell(text: object) -> str:
    """Return a text as a cell of a table may hold it."""
    words = " ".join(str(text).split())
    for letter in "\\|*_<$[`":
        words = words.replace(letter, f"\\{letter}")
    return words


def code(text: object) -> str:
    """Return a text as code, in a cell; nothing for none."""
    words = str(text).replace("|", "\\|")
    return f"`` {words} ``" if "`" in words else f"`{words}`" if words else ""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of cells that are Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"
