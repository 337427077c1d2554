"""What stands in the cells of a text log: numbers, and what loggers write for none."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

MAX_COLUMNS = 1 << 15
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
            return text.replace('"', "").split(None, MAX_COLUMNS)
        if '"' in text:
            try:
                return next(csv.reader([text], delimiter=self.delimiter, skipinitialspace=True))
            except csv.Error:
                pass  # a stray quote in a long line
        return text.split(self.delimiter, MAX_COLUMNS)

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


Decimal = Literal[".", ","]

_WORDS = (
    *("nan", "na", "n/a", "#n/a", "#na", "null", "none", "missing", "invalid", "error", "err"),
    *("overflow", "ovf", "ovl", "ol", "over", "#value!", "#num!", "#div/0!"),
)
_MICROSOFT = ("1.#QNAN", "1.#SNAN", "1.#IND", "1.#INF", "1.#J", "1.#R")
_REPEATED = "-*?#."
_LONGEST_REPEATED = 24
_PADDED = ("{}", " {}", "  {}", "{} ")


_STAMP = re.compile(r"\s*\d{1,4}[-./:]\d{1,2}[-./:]\d{1,4}[\dTZ:.,/+\s-]*")


def _missing() -> tuple[str, ...]:
    words = [form(word) for word in _WORDS for form in (str.lower, str.upper, str.title)]
    words += ["NaN", "-nan", "-NaN", "-NAN", "+nan", "+NaN", "+NAN"]
    # With the zeros that %f puts behind it.
    words += [sign + word + "0" * n for word in _MICROSOFT for sign in ("", "-") for n in range(17)]
    words += [sign * n for sign in _REPEATED for n in range(1, _LONGEST_REPEATED + 1)]
    padded = {form.format(word) for word in words for form in _PADDED}
    return tuple(sorted(padded | {" " * n for n in range(_LONGEST_REPEATED + 1)}))


MISSING = _missing()
"""The cells that stand for no number, as written, with the spaces around them."""

_BARE = frozenset(cell.strip() for cell in MISSING)


def is_missing(cell: str) -> bool:
    """Tell whether a cell stands for a number that is not there."""
    return cell.strip() in _BARE


def is_number(cell: str, decimal: Decimal | None = None) -> bool:
    """Tell whether a cell is a number; with either sign of the decimal where none is given."""
    text = cell.strip()
    if decimal != "." and text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    elif decimal == "," and "." in text:
        return False
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text


def are_figures(cells: Sequence[str]) -> bool:
    """Tell whether cells are numbers, or stand for some."""
    return all(is_number(cell) or is_missing(cell) for cell in cells)


def is_datum(cell: str) -> bool:
    """Tell whether a cell is a number, a date or a time of day, or stands for one."""
    return is_number(cell) or is_missing(cell) or _STAMP.fullmatch(cell) is not None
