"""What temperature and the sensor's own low-pass do to a channel, as a page says it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from imubench_pipeline.estimators.estimate import SENSOR
from imubench_pipeline.model.estimates import LowPassRow, ParameterRow, TemperatureRow
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.words.numbers import limit_digits, number_text, sentence

_TEMPERATURE = (
    ("sensitivity", "temperature_sensitivity", "sensitivity"),
    ("quadratic", "temperature_quadratic", "square of the temperature"),
    ("lag", "thermal_lag", "lag"),
    ("bias", "bias_at_reference", "bias at T₀"),
)
_LOW_PASS = (("cutoff", "cutoff", "cut-off"), (SENSOR, SENSOR, "N before the low-pass"))
_TRUTHS = {"bias": None}
_SWITCHED = {"sensitivity": "sensitivity", "quadratic": "quadratic", "bias": "signal", SENSOR: "N"}
"""Unit of the page of what is shown in the units that the reader chooses."""

_Figure = TemperatureRow | LowPassRow | ParameterRow

_FIXED = {"lag": "s", "cutoff": "Hz"}
_AT = np.array([100.0, 300.0, 1_000.0, 3_000.0, 10_000.0, 30_000.0])
_AS_IT_COMES = (
    "Ranking, datasheet and budgets take the log as it comes, with what temperature does to it: "
    "so it is in use, and so are the logs of sensors without readings. Method compensated has the "
    "noise that is left, of which a datasheet of constant temperature speaks."
)
_SEEN = 1.05
"""How many times lower an Allan deviation must be to be worth a word."""


def figures(channel: ChannelView) -> Iterator[dict[str, Any]]:
    """Yield the lines of the table: temperature's, where its effect was sought; the low-pass's."""
    estimated = channel.parameters.get("likelihood", ())
    before = {row.parameter: row for row in estimated if row.parameter == SENSOR}
    low_pass: Mapping[str, _Figure] = {**channel.low_pass, **before}
    entries: tuple[tuple[Mapping[str, _Figure], str, str, str], ...] = (
        *((channel.temperature, *names) for names in _TEMPERATURE),
        *((low_pass, *names) for names in _LOW_PASS),
    )
    for rows, name, term, words in entries:
        row = rows.get(name)
        if row is None or row.status == "absent":
            continue
        truth = channel.truth.get(_TRUTHS.get(name, name) or "")
        yield {
            "term": term,
            "words": words,
            "unit": f"{channel.quantity}.{_SWITCHED[name]}" if name in _SWITCHED else None,
            "sign": _FIXED.get(name),
            "value": row.value,
            "lower": row.lower,
            "upper": row.upper,
            "digits": limit_digits(row.lower, row.upper, 4),
            "status": "" if row.status == "ok" else row.status,
            "truth": truth.value if truth else None,
            "why": sentence(row.reason),
        }


def answer(channel: ChannelView, system: System) -> list[str]:
    """Return in sentences what was found of temperature and low-pass."""
    lines = []
    temperature, low_pass = channel.temperature, channel.low_pass
    if temperature:
        sensitivity = temperature["sensitivity"]
        if sensitivity.compensated:
            unit = page_unit(channel.quantity, "sensitivity", system)
            lines.append(
                f"The bias follows the temperature by {unit.text(sensitivity.value, 3)} "
                f"{unit.sign}.{_falls(channel)}"
            )
            lines.append(_AS_IT_COMES)
        else:
            lines.append(f"Temperature is not taken out: {sensitivity.reason}.")
        lines.append(f"T₀, the mean temperature, is {number_text(temperature['T_0'].value)} °C.")
    if low_pass and low_pass["cutoff"].status == "absent":
        lines.append("The spectrum shows no low-pass of the sensor.")
    elif low_pass:
        order = low_pass["cutoff"].order
        kind = "of first order" if order == 1 else "as a Butterworth filter"
        kind += f" of order {order}" if order not in (None, 1) else ""
        if low_pass["cutoff"].value is not None:
            cutoff = number_text(low_pass["cutoff"].value)
            lines.append(f"The sensor's own low-pass cuts off at {cutoff} Hz, {kind}.")
    return lines


def _falls(channel: ChannelView) -> str:
    """Return how much lower the Allan deviation is without what temperature adds."""
    left = channel.compensated
    if not left:
        return ""
    ratio = np.interp(np.log(left["tau"]), np.log(channel.tau), channel.adev) / left["adev"]
    taus = _AT[(_AT >= left["tau"][0]) & (_AT <= left["tau"][-1])]
    at = np.interp(np.log(taus), np.log(left["tau"]), ratio)
    parts = [
        f"{number_text(float(fall), 3)} times at τ = {number_text(float(tau))} s"
        for tau, fall in zip(taus, at, strict=True)
        if fall > _SEEN
    ]
    return f" Without it the Allan deviation is lower: {', '.join(parts)}." if parts else ""
