"""Values in the sentences of findings, in the units that readers expect."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Literal

from imubench_pipeline.units import convert_from_si
from imubench_pipeline.words.numbers import Unit, interval_text

Kind = Literal["signal", "level", "density"]
"""What is shown: samples and their mean, the level of slow noise and bias, or white noise."""

_UNITS: Mapping[tuple[str, Kind], tuple[str, str]] = {
    ("gyro", "signal"): ("°/s", "angular_rate"),
    ("gyro", "level"): ("°/h", "angular_rate"),
    ("gyro", "density"): ("°/s/√Hz", "gyro_density"),
    ("accel", "signal"): ("mg", "acceleration"),
    ("accel", "level"): ("µg", "acceleration"),
    ("accel", "density"): ("µg/√Hz", "accel_density"),
}


@cache
def unit_of(channel: str, kind: Kind) -> Unit:
    """Return the unit in which values of a channel, or of ``gyro`` or ``accel``, are shown."""
    sign, dimension = _UNITS[channel.partition("_")[0], kind]
    return Unit(sign, convert_from_si(1.0, sign, dimension))


def value_text(value: float, channel: str, kind: Kind, digits: int = 3) -> str:
    """Return a value of a channel, SI, with its unit: ``0.24 °/s/√Hz``."""
    unit = unit_of(channel, kind)
    return f"{unit.text(value, digits)} {unit.sign}"


def estimate_text(value: float, lower: float, upper: float, unit: Unit) -> str:
    """Return an estimate with its 95 % interval: ``30 °/h (95 %: 28 to 32 °/h)``."""
    digits = unit.digits(value, lower, upper)
    limits = interval_text(lower, upper, unit, digits)
    return f"{unit.text(value, digits)} {unit.sign} (95 %: {limits} {unit.sign})"
