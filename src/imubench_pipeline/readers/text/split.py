"""A line of text -> its cells, with each delimiter that loggers use."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass

MOST_COLUMNS = 1 << 17
"""A line with more is no record of a log."""

_APART = re.compile(r"\s{2,}|\t")


@dataclass(frozen=True)
class Split:
    """How a line is divided into cells."""

    delimiter: str
    runs: bool = False
    """A run of spaces or tabs is one delimiter."""

    def cells(self, text: str) -> list[str]:
        """Return the cells of a line."""
        if self.runs:
            return text.replace('"', "").split(None, MOST_COLUMNS)
        if '"' in text:
            try:
                return next(csv.reader([text], delimiter=self.delimiter, skipinitialspace=True))
            except csv.Error:
                pass  # a stray quote in a long line
        return text.split(self.delimiter, MOST_COLUMNS)

    def names(self, text: str, width: int | None = None) -> list[str]:
        """Return the names of a header line; between runs of spaces a name may have a space."""
        names = self.cells(text)
        if self.runs and width is not None and len(names) != width:
            apart = _APART.split(text.strip())
            names = apart if len(apart) == width else names
        return [name.strip() for name in names]

    def quotes(self, text: str) -> bool:
        """Tell whether a cell of a line stands in quotes, both of them at its ends."""
        if '"' not in text:
            return False
        sign = re.escape(self.delimiter)
        # Spaces are never given back, or a line of spaces would take the cube of its length.
        spaces = rf"[^\S{sign}]*+"
        cell = rf'(?:^|{sign}){spaces}"[^"]*+"(?={spaces}(?:$|{sign}))'
        return re.search(cell, text) is not None

    def __str__(self) -> str:
        return "runs of spaces" if self.runs else repr(self.delimiter)
