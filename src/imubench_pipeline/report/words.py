"""Uncertainty in words, and verdicts in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from imubench_pipeline.report.practical import (
    PageUnit,
    duration_text,
    interval_text,
    number_text,
)

Row = Mapping[str, Any]

_ROUGH = 0.3
"""Half of an interval over its value from which a percentage would hide its asymmetry."""

_VERDICTS = ("passes", "probably passes", "probably fails", "surely fails", "not enough data")


def untold(row: Row, unit: PageUnit, duration: float | None) -> str:
    """Return in a sentence why a parameter has no plain value; empty where it has one.

    Parameters
    ----------
    row : mapping
        Of the table ``parameters``.
    unit : PageUnit
    duration : float or None
        Length of the recording, s.
    """
    symbol, status = row["parameter"], row["status"]
    if status == "ok":
        return ""
    if status == "absent":
        below = ""
        if row["upper"] is not None:
            below = f": it is below {unit.text(row['upper'], 2)} {unit.sign}"
        return f"The data do not ask for {symbol}{below}."
    if status == "not_identified":
        of = f" from {duration_text(duration)} of data" if duration else ""
        between = ""
        if row["lower"] is not None and row["upper"] is not None:
            ends = f"{unit.text(row['lower'], 2)} and {unit.text(row['upper'], 2)} {unit.sign}"
            between = f" (it lies between {ends})"
        return f"{symbol} cannot be told{of}{between}{_enough(row, duration)}."
    reason = (row["reason"] or status.replace("_", " ")).rstrip(".")
    return f"{symbol}: {reason}{_enough(row, duration)}."


def _enough(row: Row, duration: float | None) -> str:
    needed = row["duration_needed"]
    if needed is None or (duration is not None and needed <= duration):
        return ""
    return f"; {duration_text(needed)} would do for 10 %"


def precision(row: Row, unit: PageUnit) -> str:
    """Return how well a value is known: ``± 4 %``, or its interval; empty where not known."""
    if row["value"] is None or row["lower"] is None or row["upper"] is None or not row["value"]:
        return ""
    half = (row["upper"] - row["lower"]) / 2.0 / abs(row["value"])
    if half > _ROUGH:
        return interval_text(row, unit, 2)
    return f"± {number_text(100.0 * half, 2)} %"


def requirement_verdict(groups: Sequence[Mapping[str, Any]], names: Mapping[str, str]) -> str:
    """Return which sensor fulfils a requirement best, and how the others stand, in sentences.

    Parameters
    ----------
    groups : sequence of mapping
        As `imubench_pipeline.report.meaning.rankings` gives them, the best first.
    names : mapping
        Name of each sensor as it is shown.
    """
    ranked = [group for group in groups if group["rank"] != "–"]
    if not groups:
        return "No recording answers it."
    if not ranked:
        return "No sensor can be ranked for it: " + _others(groups, names)
    best = ranked[0]
    decides = next(limit for limit in best["limits"] if limit["decides"])
    said = names[best["sensor"]] + (" (simulated)" if best["simulated"] else "")
    text = (
        f"{said} is the best of {len(groups)} and {best['verdict']}: "
        f"{decides['limit']}: {decides['sigma']} {decides['unit']} expected "
        f"({decides['interval']}), {decides['allowed']} {decides['unit']} allowed (1σ)."
    )
    if best["tied_with"]:
        tied = ", ".join(names[one] for one in best["tied_with"].split(", "))
        text += f" It cannot be told apart from {tied}."
    return text + " " + _others([g for g in groups if g is not best], names)


def _others(groups: Sequence[Mapping[str, Any]], names: Mapping[str, str]) -> str:
    """Return how many sensors have each verdict, and which where they are few."""
    parts = []
    verdicts = dict.fromkeys([*_VERDICTS, *(group["verdict"] for group in groups)])
    for verdict in verdicts:
        own = [names[group["sensor"]] for group in groups if group["verdict"] == verdict]
        if own:
            listed = ", ".join(own) if len(own) <= 4 else f"{len(own)} sensors"
            parts.append(f"{_CAPITALS.get(verdict, verdict.capitalize())}: {listed}.")
    return " ".join(parts)


_CAPITALS = {
    "passes": "Pass too",
    "probably passes": "Probably pass",
    "probably fails": "Probably fail",
    "surely fails": "Surely fail",
    "not enough data": "Too little data",
}


def counted(number: int, one: str, many: str | None = None) -> str:
    """Return a number with its noun: ``1 recording``, ``3 recordings``."""
    return f"{number} {one if number == 1 else many or one + 's'}"
