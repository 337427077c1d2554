"""Summaries of results for notebooks and terminals: a title, a small table, remarks."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import TypeVar

V = TypeVar("V")
_MAX_ROWS = 60  # max. number of rows in a summary


@dataclass(frozen=True)
class Summary:
    """Summary of a result."""

    title: str
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()

    def text(self) -> str:
        """Return the summary as text, with aligned columns."""
        lines = [self.title]
        if self.rows:
            shown = [self.heads, *self.rows[:_MAX_ROWS]]
            widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
            for row in shown:
                cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
                lines.append(("  " + "  ".join(cells)).rstrip())
        return "\n".join([*lines, *self._remarks()])

    def html(self) -> str:
        """Return the summary as HTML."""
        parts = [f"<div><strong>{escape(self.title)}</strong>"]
        if self.rows:
            parts.append("<table><thead><tr>")
            parts += [f"<th>{escape(head)}</th>" for head in self.heads]
            parts.append("</tr></thead><tbody>")
            for row in self.rows[:_MAX_ROWS]:
                cells = "".join(f"<td>{escape(cell)}</td>" for cell in row)
                parts.append(f"<tr>{cells}</tr>")
            parts.append("</tbody></table>")
        parts += [f"<div>{escape(note)}</div>" for note in self._remarks()]
        return "".join([*parts, "</div>"])

    def _remarks(self) -> list[str]:
        more = len(self.rows) - _MAX_ROWS
        return [*([f"... and {more} rows more: to_pandas()"] if more > 0 else []), *self.notes]


class Shown(ABC):
    """A result with a summary as its representation."""

    @abstractmethod
    def _summary(self) -> Summary:
        """Return the summary."""

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()


class ShownMapping(Shown, Mapping[str, V]):
    """Results by channel."""

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
