"""Summaries of results for notebooks and terminals: a title, a small table, remarks."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

V = TypeVar("V")
_MAX_ROWS = 60  # max. number of rows in a summary


def summarise(
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    notes: Sequence[str] = (),
) -> str:
    """Return the summary of a result, with aligned columns."""
    lines = [title]
    if rows:
        shown = [heads, *rows[:_MAX_ROWS]]
        widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
        for row in shown:
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            lines.append(("  " + "  ".join(cells)).rstrip())
    if len(rows) > _MAX_ROWS:
        lines.append(f"... and {len(rows) - _MAX_ROWS} rows more: to_pandas()")
    return "\n".join([*lines, *notes])


class ByChannel(Mapping[str, V]):
    """Mapping from channels to their results."""

    _by_channel: Mapping[str, V]

    def __getitem__(self, channel: str) -> V:
        return self._by_channel[channel]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_channel)

    def __len__(self) -> int:
        return len(self._by_channel)


def cut(text: str, most: int = 60) -> str:
    """Shorten a text for a cell to at most ``most`` characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."
