"""What a logger states of its log in the lines before the first record."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

_RATE = re.compile(
    r"\b(?:update|sampl\w*|output|data|logging)[ _]?(?:data[ _]?)?(?:rate|freq\w*)\W{1,4}?"
    r"(?P<figure>\d+(?:[.,]\d+)?)\s*(?P<kilo>k)?(?:hz|sps)\b",
    re.IGNORECASE,
)
_START = re.compile(
    r"\bstart(?:ed)?[ _]?(?:time|date|at)?\W{1,4}?"
    r"(?P<date>\d{4}[-/]\d\d[-/]\d\d)[T ]+(?P<time>\d\d:\d\d(?::\d\d(?:[.,]\d{1,9})?)?)",
    re.IGNORECASE,
)


def stated_rate(lines: Iterable[str]) -> float | None:
    """Return the sampling rate that lines such as ``// Update Rate: 100.0Hz`` state, Hz.

    None where none is stated, or several that differ, such as one a sensor.
    """
    rates = set()
    for line in lines:
        for found in _RATE.finditer(line):
            figure = float(found["figure"].replace(",", "."))
            rates.add(figure * (1000.0 if found["kilo"] else 1.0))
    (rate,) = rates if len(rates) == 1 else (None,)
    return rate or None


def stated_start(lines: Iterable[str]) -> str | None:
    """Return the date and time (ISO 8601) of lines such as ``// Start Time: 2024-05-01 12:00``."""
    for line in lines:
        if found := _START.search(line):
            text = f"{found['date'].replace('/', '-')}T{found['time'].replace(',', '.')}"
            try:
                return str(np.datetime64(text, "ms"))
            except ValueError:
                continue  # no such day
    return None
