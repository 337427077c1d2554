"""Split the lines of a text log into cells; recognise numbers, dates and missing values."""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

MAX_COLUMNS = 1 << 15  # largest number of columns of a record
_NAME_SEPARATOR = re.compile(r"\s{2,}|\t")


@dataclass(frozen=True)
class Split:
    """Rule for splitting a line into cells."""

    delimiter: str
    runs: bool = False  # a run of spaces or tabs is one delimiter

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
        """Return the names of a header line; single spaces are kept if ``width`` names result."""
        names = self.cells(text)
        if self.runs and width is not None and len(names) != width:
            apart = _NAME_SEPARATOR.split(text.strip())
            names = apart if len(apart) == width else names
        return [name.strip() for name in names]

    def quotes(self, text: str) -> bool:
        """Return whether a cell of a line is enclosed in quotes."""
        if '"' not in text:
            return False
        sign = re.escape(self.delimiter)
        # Possessive, since backtracking over a line of spaces would take cubic time.
        spaces = rf"[^\S{sign}]*+"
        cell = rf'(?:^|{sign}){spaces}"[^"]*+"(?={spaces}(?:$|{sign}))'
        return re.search(cell, text) is not None

    def __str__(self) -> str:
        return "runs of spaces" if self.runs else repr(self.delimiter)


Decimal = Literal[".", ","]

_MISSING_WORDS = (
    *("nan", "na", "n/a", "#n/a", "#na", "null", "none", "missing", "invalid", "error", "err"),
    *("overflow", "ovf", "ovl", "ol", "over", "#value!", "#num!", "#div/0!"),
)
_MICROSOFT_SPECIAL_VALUES = ("1.#QNAN", "1.#SNAN", "1.#IND", "1.#INF", "1.#J", "1.#R")
_MISSING_SIGNS = "-*?#."
_MAX_REPEATED_SIGNS = 24
_PADDINGS = ("{}", " {}", "  {}", "{} ")

_STAMP = re.compile(r"\s*\d{1,4}[-./:]\d{1,2}[-./:]\d{1,4}[\dTZ:.,/+\s-]*")


def _list_missing_cells() -> tuple[str, ...]:
    words = [form(word) for word in _MISSING_WORDS for form in (str.lower, str.upper, str.title)]
    words += ["NaN", "-nan", "-NaN", "-NAN", "+nan", "+NaN", "+NAN"]
    # With the zeros that %f appends.
    words += [
        sign + word + "0" * n
        for word in _MICROSOFT_SPECIAL_VALUES
        for sign in ("", "-")
        for n in range(17)
    ]
    words += [sign * n for sign in _MISSING_SIGNS for n in range(1, _MAX_REPEATED_SIGNS + 1)]
    padded = {form.format(word) for word in words for form in _PADDINGS}
    return tuple(sorted(padded | {" " * n for n in range(_MAX_REPEATED_SIGNS + 1)}))


MISSING_CELLS = _list_missing_cells()  # missing values as written, with spaces around them
_STRIPPED_MISSING = frozenset(cell.strip() for cell in MISSING_CELLS)


def is_missing(cell: str) -> bool:
    """Return whether a cell is a missing value."""
    return cell.strip() in _STRIPPED_MISSING


def is_number(cell: str, decimal: Decimal | None = None) -> bool:
    """Return whether a cell is a number; with point or comma if ``decimal`` is None."""
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
    """Return whether all cells are numbers or missing values."""
    return all(is_number(cell) or is_missing(cell) for cell in cells)


def is_datum(cell: str) -> bool:
    """Return whether a cell is a number, a date, a time of day or a missing value."""
    return is_number(cell) or is_missing(cell) or _STAMP.fullmatch(cell) is not None
