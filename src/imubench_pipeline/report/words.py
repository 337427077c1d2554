"""Uncertainty in words, and verdicts in sentences."""

from __future__ import annotations

import re
from collections.abc import Sequence

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.experiments import CalibrationRow, EarthRateRow
from imubench_pipeline.report.practical import PageUnit, interval_text, symbol_text
from imubench_pipeline.words.numbers import counted, duration_text, percent_text

_ROUGH = 0.3
"""Half of an interval over its value from which a percentage would hide its asymmetry."""


def untold(row: ParameterRow, unit: PageUnit, duration: float | None) -> str:
    """Return in a sentence why a parameter has no plain value, or what it is of; may be empty.

    Of a row of ``parameters``, and the length of the recording, s.
    """
    symbol, status = symbol_text(row.parameter), row.status
    if status == "ok":
        return f"{symbol}: {row.reason.rstrip('.')}." if row.reason else ""
    if status == "absent":
        below = ""
        if row.upper is not None:
            below = f": it is below {unit.text(row.upper, 2)} {unit.sign}"
        return f"The data do not ask for {symbol}{below}."
    if status == "not_identified":
        of = f" from {duration_text(duration)} of data" if duration else ""
        between = ""
        if row.lower is not None and row.upper is not None:
            ends = f"{unit.text(row.lower, 2)} and {unit.text(row.upper, 2)} {unit.sign}"
            between = f" (it lies between {ends})"
        return f"{symbol} cannot be told{of}{between}{_enough(row, duration)}."
    reason = (row.reason or status.replace("_", " ")).rstrip(".")
    return f"{symbol}: {reason}{_enough(row, duration)}."


def _enough(row: ParameterRow, duration: float | None) -> str:
    needed = row.duration_needed
    if needed is None or (duration is not None and needed <= duration):
        return ""
    return f"; {duration_text(needed)} would do for 10 %"


def precision(row: ParameterRow, unit: PageUnit) -> str:
    """Return how well a value is known: ``± 4 %``, or its interval; empty where not known."""
    if row.value is None or row.lower is None or row.upper is None or not row.value:
        return ""
    half = (row.upper - row.lower) / 2.0 / abs(row.value)
    if half > _ROUGH:
        return interval_text(row.lower, row.upper, unit, 2)
    return f"± {percent_text(half, 2)}"


def model_text(name: str) -> str:
    """Return the terms of a model, its lines counted: ``N+F + 3 lines``."""
    terms = name.split("+")
    lines = terms.count("S")
    rest = "+".join(term for term in terms if term != "S")
    return f"{rest} + {counted(lines, 'line')}" if lines else rest


def sentence(text: str | None) -> str:
    """Return a text as a sentence: a capital first, a full stop at the end; empty if none."""
    return text[:1].upper() + text[1:].rstrip(".") + "." if text else ""


def started_text(started: str | None) -> str:
    """Return date and time as they are read easily, without a fraction of zero."""
    return _ISO.sub(r"\1 \2", started or "")


_ISO = re.compile(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d(?::\d\d)?)(?:\.0+(?!\d))?")


def noise_words(rows: Sequence[EarthRateRow | CalibrationRow]) -> str:
    """Return by which noise model figures of a recording are weighed, in a sentence."""
    fitted = next((row for row in rows if row.model), None)
    if fitted is None:
        return ""
    origin = f", from {fitted.model_from}" if fitted.model_from else ""
    return f"Noise model: {fitted.model}{origin}."
