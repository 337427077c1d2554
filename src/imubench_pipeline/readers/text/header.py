"""Interpret the lines before the first record of a text log: names, units, statements."""

import re
from collections.abc import Iterable, Sequence

import numpy as np

from imubench_pipeline.readers.text.cells import is_missing, is_number

_RULE = re.compile(r"[-=_+]{2,}")
_UNIT_CELL = re.compile(
    r"[(\[{<].*[)\]}>]|[-–.]*|"
    r"(?:[munpkMµμ]|milli|micro)?(?:s|sec|seconds?|g|rad|deg|degrees?|dps|m|T|gauss|Gauss|Hz|V|Pa|"
    r"bar|[°º]?C|K|[°º])(?:\W.*|²)?|min|h|samples?|counts?|LSB"
)
_WORDS_ONLY = re.compile(r"[^\W\d]*(?:[\s./()\[\]-]+[^\W\d]+)*[.)\]]?")


def find_header(lines: Sequence[Sequence[str]]) -> int | None:
    """Return the index of the first line with the most column names; None if no line has names.

    ``lines``: the cells of each line before the first record; empty if it is not split like the
    record.
    """
    best, header = 0, None
    for index, cells in enumerate(lines):
        if any(is_number(cell) for cell in cells) or has_units(cells):
            continue
        names = len({cell for cell in cells if not is_missing(cell)})
        if 2 * names >= len(cells) and names > best:
            best, header = names, index
    return header


def has_units(cells: Sequence[str]) -> bool:
    """Return whether most cells of a line are units."""
    texts = [cell.strip() for cell in cells if cell.strip()]
    units = sum(_UNIT_CELL.fullmatch(text) is not None for text in texts)
    return not all(map(is_missing, texts)) and 2 * units > len(texts)


def complete_names(names: list[str], record: list[str]) -> list[str]:
    """Return a name for each cell of a record, apart from a final delimiter; empty on mismatch."""
    if len(names) == len(record) + 1 and not names[-1]:
        return names[:-1]
    if len(names) + 1 == len(record) and not record[-1].strip():
        return [*names, ""]
    return names if len(names) == len(record) else []


def is_heading(cells: Sequence[str]) -> bool:
    """Return whether a line below the names has units or words, or is a ruling line."""
    texts = [cell.strip() for cell in cells]
    ruled = all(_RULE.fullmatch(text) for text in texts)
    return ruled or has_units(texts) or all(_WORDS_ONLY.fullmatch(text) for text in texts)


def are_units(row: list[str], places: set[int]) -> bool:
    """Return whether a line below the header has only texts at ``places``, or is a ruling line."""
    if all(_RULE.fullmatch(cell.strip()) for cell in row):
        return True
    cells = [row[place].strip() for place in places if place < len(row)]
    texts = [cell for cell in cells if not is_missing(cell)]
    return bool(texts) and not any(is_number(text) or text[0].isdigit() for text in texts)


SIMULATED = "SIMULATED by imubench, not measured"  # comment at the top of simulated text logs
_SIMULATED_MARKS = {SIMULATED, "SIMULATED, not measured"}  # the second is of earlier versions


def is_simulated(lines: Iterable[str]) -> bool:
    """Return whether a line is the mark of a simulated log, apart from quotes and empty cells."""
    return any(
        line.strip().strip("\"',;\t").lstrip("#%;!/ ").rstrip() in _SIMULATED_MARKS
        for line in lines
    )


_RATE_STATEMENT = re.compile(
    r"\b(?:update|sampl\w*|output|data|logging)[ _]?(?:data[ _]?)?(?:rate|freq\w*)\W{1,4}?"
    r"(?P<figure>\d+(?:[.,]\d+)?)\s*(?P<kilo>k)?(?:hz|sps)\b",
    re.IGNORECASE,
)
_START_STATEMENT = re.compile(
    r"\bstart(?:ed)?[ _]?(?:time|date|at)?\W{1,4}?"
    r"(?P<date>\d{4}[-/]\d\d[-/]\d\d)[T ]+(?P<time>\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)",
    re.IGNORECASE,
)


def find_stated_rate(lines: Iterable[str]) -> float | None:
    """Return the only rate that lines such as ``// Update Rate: 100.0Hz`` state, Hz, or None."""
    rates = set()
    for line in lines:
        for match in _RATE_STATEMENT.finditer(line):
            rates.add(float(match["figure"].replace(",", ".")) * (1000.0 if match["kilo"] else 1.0))
    (rate,) = rates if len(rates) == 1 else (None,)
    return rate or None


def find_stated_start(lines: Iterable[str]) -> str | None:
    """Return the start (ISO 8601) in lines such as ``// Start Time: 2024-05-01 12:00``."""
    for line in lines:
        if match := _START_STATEMENT.search(line):
            text = f"{match['date'].replace('/', '-')}T{match['time'].replace(',', '.')}"
            try:
                return str(np.datetime64(text, "ms"))
            except ValueError:
                continue  # no such day
    return None
