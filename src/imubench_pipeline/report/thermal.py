"""Effect of temperature and of the sensor's low-pass filter on a channel, for the pages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from imubench_pipeline.estimators.estimate import SENSOR
from imubench_pipeline.model.estimates import LowPassRow, ParameterRow, TemperatureRow
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.words.numbers import count_digits, number_text, sentence

_TEMPERATURE_TERMS = (
    ("sensitivity", "temperature_sensitivity", "sensitivity"),
    ("quadratic", "temperature_quadratic", "quadratic term"),
    ("lag", "thermal_lag", "thermal lag"),
    ("bias", "bias_at_reference", "bias at T₀"),
)
_LOW_PASS_TERMS = (("cutoff", "cutoff", "cut-off"), (SENSOR, SENSOR, "N before the low-pass"))
_UNIT_SYMBOLS = {"sensitivity": "sensitivity", "quadratic": "quadratic"}
_UNIT_SYMBOLS |= {"bias": "signal", SENSOR: "N"}
"""Symbol of the unit, for quantities whose unit the reader can choose."""

_Figure = TemperatureRow | LowPassRow | ParameterRow
_FIXED_UNITS = {"lag": "s", "cutoff": "Hz"}
_SHOWN_TAU = np.array([100.0, 300.0, 1_000.0, 3_000.0, 10_000.0, 30_000.0])
"""Averaging times for which the effect of temperature is stated, s."""

_NOT_COMPENSATED = (
    "Ranking, datasheet comparison and budgets use the log with its temperature effect. The "
    "method “temperature compensated” gives the noise at constant temperature."
)
_MIN_SHOWN_RATIO = 1.05
"""Ratio of Allan deviations without and with compensation from which it is stated."""


def list_thermal_figures(channel: ChannelView) -> Iterator[Mapping[str, object]]:
    """Yield the lines of the table: temperature effect, if it was fitted, and low-pass."""
    estimated = channel.parameters.get("likelihood", ())
    before = {row.parameter: row for row in estimated if row.parameter == SENSOR}
    low_pass: Mapping[str, _Figure] = {**channel.low_pass, **before}
    entries: tuple[tuple[Mapping[str, _Figure], str, str, str], ...] = (
        *((channel.temperature, *names) for names in _TEMPERATURE_TERMS),
        *((low_pass, *names) for names in _LOW_PASS_TERMS),
    )
    for rows, name, term, words in entries:
        row = rows.get(name)
        if row is None or row.status == "absent":
            continue
        truth = channel.truth.get(name) if name != "bias" else None
        yield {
            "term": term,
            "words": words,
            "unit": f"{channel.quantity}.{_UNIT_SYMBOLS[name]}" if name in _UNIT_SYMBOLS else None,
            "sign": _FIXED_UNITS.get(name),
            "value": row.value,
            "lower": row.lower,
            "upper": row.upper,
            "digits": count_digits(row.value, row.lower, row.upper, name),
            "status": "" if row.status == "ok" else row.status,
            "truth": truth.value if truth else None,
            "why": sentence(row.reason),
        }


def describe_thermal(channel: ChannelView, system: System) -> list[str]:
    """Return the results for temperature and low-pass, as sentences."""
    lines = []
    temperature, low_pass = channel.temperature, channel.low_pass
    if temperature:
        sensitivity = temperature["sensitivity"]
        if sensitivity.compensated:
            unit = choose_page_unit(channel.quantity, "sensitivity", system)
            size = f"{unit.text(sensitivity.value)} {unit.sign}"
            change = f"The bias changes with temperature by {size}."
            lines += [change + _describe_reduction(channel), _NOT_COMPENSATED]
        else:
            lines.append(f"The temperature effect is not removed: {sensitivity.reason}.")
        lines.append(f"The mean temperature T₀ is {number_text(temperature['T_0'].value)} °C.")
    if low_pass and low_pass["cutoff"].status == "absent":
        lines.append("The spectrum shows no low-pass of the sensor.")
    elif low_pass:
        cutoff, order = low_pass["cutoff"].value, low_pass["cutoff"].order
        kind = "first order" if order == 1 else "Butterworth"
        kind += f", order {order}" if order not in (None, 1) else ""
        if cutoff is not None:
            lines.append(
                f"The sensor's own low-pass has its cut-off at {number_text(cutoff)} Hz ({kind})."
            )
    return lines


def _describe_reduction(channel: ChannelView) -> str:
    """Return the factors by which compensation lowers the Allan deviation, as a sentence."""
    left = channel.compensated
    if not left:
        return ""
    ratio = np.interp(np.log(left["tau"]), np.log(channel.tau), channel.adev) / left["adev"]
    taus = _SHOWN_TAU[(_SHOWN_TAU >= left["tau"][0]) & (_SHOWN_TAU <= left["tau"][-1])]
    at = np.interp(np.log(taus), np.log(left["tau"]), ratio)
    parts = [
        f"{number_text(float(factor), 3)} at τ = {number_text(float(tau))} s"
        for tau, factor in zip(taus, at, strict=True)
        if factor > _MIN_SHOWN_RATIO
    ]
    if not parts:
        return ""
    return f" Compensated, the Allan deviation is lower by a factor of {', '.join(parts)}."
