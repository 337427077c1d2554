"""What the figures of a resting sensor are held against: what its file prints, or what is usual."""

from __future__ import annotations

import math
from dataclasses import dataclass

from imubench_pipeline.datasheets.comparable import bias_comparables
from imubench_pipeline.datasheets.suspicion import NEAR_PRINTED, printed_figures
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor
from imubench_pipeline.units import to_si

_UNDER_PRINTED = 2.5
"""Times below a printed noise density that is usual: a low-pass hides nothing from
`levels.density_of`."""

_USUAL_GYRO = (math.radians(5e-4), math.radians(0.06))
"""rad/s/√Hz: beyond the figures that the shipped sensor files print, 0.0015 to 0.035 °/s/√Hz."""

_LARGEST_OFFSET = math.radians(30.0)
_LEAST_OFFSET = math.radians(2.0)
_OFFSET_OF_CLASS = {"industrial": math.radians(12.0), "tactical": _LEAST_OFFSET}
"""rad/s. The shipped sensor files print at most 3 °/s (typ) of industrial sensors, 0.2 °/s of
tactical ones, and 20 °/s of others."""

_OVER_PRINTED = {"max": 1.5}
_OVER_TYPICAL = 4.0
"""Times the printed offset that one has: where typ and max are both printed, max is three times
typ, and mounting adds to it."""


@dataclass(frozen=True)
class Expected:
    """What is usual of a quantity of a sensor at rest.

    Attributes
    ----------
    noise : (float, float) or None
        Least and most white noise density, SI/√Hz, two-sided.
    noise_from : str
        What says so.
    offset : float
        Largest mean of a gyro that an offset explains, rad/s.
    offset_from : str
    bandwidth : float or None
        The widest that is printed, Hz.
    printed : float or None
        White noise density that the datasheet prints, SI/√Hz, two-sided.
    """

    noise: tuple[float, float] | None
    noise_from: str
    offset: float = _LARGEST_OFFSET
    offset_from: str = "of any gyro"
    bandwidth: float | None = None
    printed: float | None = None


def expected(sensor: Sensor | None, quantity: str) -> Expected:
    """Return what is usual of a quantity of a sensor, by its file where that prints it.

    Parameters
    ----------
    sensor : Sensor or None
        None: nothing is known of it.
    quantity : str
        ``gyro`` or ``accel``.
    """
    usual = _USUAL_GYRO if quantity == "gyro" else None
    if sensor is None:
        return Expected(usual, "of a gyro")
    printed = printed_figures(sensor, quantity).get("N")
    noise = usual if printed is None else (printed / _UNDER_PRINTED, printed * NEAR_PRINTED)
    noise_from = "of a gyro" if printed is None else "that its datasheet prints"
    return Expected(noise, noise_from, *_offset(sensor), _bandwidth(sensor, quantity), printed)


def _offset(sensor: Sensor) -> tuple[float, str]:
    """Return the largest offset of the gyro of a sensor, rad/s, and what says so."""
    printed = [
        row.value * _OVER_PRINTED.get(row.figure.kind, _OVER_TYPICAL)
        for axis in "xyz"
        for row in bias_comparables(sensor.datasheet, f"gyro_{axis}")
        if row.quantity in ("offset", "bias_repeatability")
        and row.figure is not None
        and row.value is not None
    ]
    if printed:
        largest = min(max(*printed, _LEAST_OFFSET), _LARGEST_OFFSET)
        return largest, "by the offset that its datasheet prints"
    words = (sensor.price_class or "").lower().replace(",", " ").split()
    word = next((word for word in words if word in _OFFSET_OF_CLASS), None)
    if word is None:
        return _LARGEST_OFFSET, "of any gyro"
    return _OFFSET_OF_CLASS[word], f"of a gyro of price class {word}"


def _bandwidth(sensor: Sensor, quantity: str) -> float | None:
    """Return the widest bandwidth that a sensor file prints, Hz."""
    assert quantity in QUANTITIES
    sheet = getattr(sensor.datasheet, quantity)
    widest = [
        to_si(value, figure.unit, "frequency")
        for figure in (sheet.printed("bandwidth") if sheet else ())
        for axis in "xyz"
        for value in _values(figure.on_axis(axis))
    ]
    return max(widest, default=None)


def _values(printed: float | tuple[float, ...] | None) -> tuple[float, ...]:
    if printed is None:
        return ()
    return printed if isinstance(printed, tuple) else (printed,)
