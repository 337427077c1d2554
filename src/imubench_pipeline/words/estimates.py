"""Estimates in words: their status, interval, model, and the reason for a missing value."""

from collections.abc import Mapping

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.states import Status
from imubench_pipeline.words import numbers

STATUS_WORDS: Mapping[Status, str] = {
    "ok": "estimated",
    "doubtful": "doubtful",
    "not_shown": "not determined",
    "at_bound": "bounded",
    "not_identified": "not determined",
    "absent": "not in the model",
    "does_not_decide": "not used",
}
"""Status of an estimate as people read it."""

_SYMBOLS = {
    "N_sensor": "N (sensor)",
    "B_curve": "B (curve)",
    "sigma_min": "σ_min",
    "tau_min": "τ_min",
    "bias": "fixed bias",
}

_MAX_SYMMETRIC = 0.3  # maximum half-width of an interval over its value that ± describes


def status_text(status: str) -> str:
    """Return the status of an estimate, or of a result of an experiment, in words."""
    known = (words for code, words in STATUS_WORDS.items() if code == status)
    return next(known, status.replace("_", " "))


def symbol_text(symbol: str) -> str:
    """Return the printed symbol of a parameter."""
    return _SYMBOLS.get(symbol, symbol)


def estimate_text(row: ParameterRow, unit: numbers.Unit, duration: float | None) -> str:
    """Return the reason for the status of an estimate; ``duration``: length of the recording, s."""
    symbol, status = symbol_text(row.parameter), row.status
    if status == "ok":
        return f"{symbol}: {row.reason.rstrip('.')}." if row.reason else ""
    if status == "absent":
        text = f"{symbol} is not in the model: the data do not support it"
        _, below = unit.estimate_texts(None, None, row.upper)
        return text + f"; {below} {unit.sign}" * (row.upper is not None) + "."
    if status == "not_identified":
        text = f"{symbol} is not determined"
        text += f" by {numbers.duration_text(duration)} of data" if duration else ""
        if row.lower is not None and row.upper is not None:
            text += (
                f"; 95 % interval: {numbers.interval_text(row.lower, row.upper, unit)} {unit.sign}"
            )
        return f"{text}{_describe_needed(row, duration)}."
    reason = (row.reason or STATUS_WORDS[status]).rstrip(".")
    return f"{symbol}: {reason}{_describe_needed(row, duration)}."


def _describe_needed(row: ParameterRow, duration: float | None) -> str:
    needed = row.duration_needed
    if needed is None or (duration is not None and needed <= duration):
        return ""
    return f"; ± 10 % needs {numbers.duration_text(needed)}"


def precision_text(row: ParameterRow, unit: numbers.Unit) -> str:
    """Return the uncertainty of a value: ``± 4 %``, or its interval; empty if not known."""
    if row.value is None or row.lower is None or row.upper is None or not row.value:
        return ""
    half = (row.upper - row.lower) / 2.0 / abs(row.value)
    if half > _MAX_SYMMETRIC:
        return numbers.interval_text(row.lower, row.upper, unit, row.value)
    return f"± {numbers.percent_text(half, 2)}"


def model_text(name: str) -> str:
    """Return a model with its number of spectral lines: ``N+F + 3 spectral lines``."""
    terms = name.split("+")
    lines = terms.count("S")
    rest = "+".join(term for term in terms if term != "S")
    return f"{rest} + {numbers.counted(lines, 'spectral line')}" if lines else rest
