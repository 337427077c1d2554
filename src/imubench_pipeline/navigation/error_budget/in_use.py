"""Errors that come in use and that no static log shows: what an axis of a sensor adds to them.

Each cause is a figure of the sensor, a standard deviation, times what the use makes of it:

- ``turn_on_bias``, ``repeatability``: a bias that no static window takes off. Levelling at rest
  turns that of an accelerometer into a tilt, bias / g, and gyrocompassing that of a gyro into an
  error of north;
- ``temperature``: coefficient times change. With a static window the temperature moves linearly
  from there on and has changed by the whole at the end; without one the bias holds elsewhere, and
  the whole change is there from the beginning. ``temperature_squared``: the same of a measured
  curvature;
- ``scale_factor``, ``nonlinearity``: of a gyro times the angle turned about its axis, in attitude
  and heading (what such a tilt does to velocity and position is left out: vehicles mostly turn
  about the vertical); of an accelerometer times the change of speed along its axis, in velocity and
  position. Both come evenly over the time that is asked. A nonlinearity counts as that part of
  what is turned: at rates far below the full scale that it is printed of;
- ``g_sensitivity``: of a gyro, times the vibration, as if all of it were acceleration that lasts;
  vibration about zero averages out, so this is a bound. ``vibration_rectification``: times the
  square of the rms of the vibration.

Causes are independent of each other and of the noise; a figure has no sign.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from imubench_pipeline.noise.growth import Calibrated, SensorStart, Uncalibrated, of_constant
from imubench_pipeline.settings.printed import Measured

Cause = Literal[
    "turn_on_bias",
    "repeatability",
    "temperature",
    "temperature_squared",
    "scale_factor",
    "nonlinearity",
    "g_sensitivity",
    "vibration_rectification",
]
Origin = Literal["measured", "datasheet", "requirement", "not known"]

CAUSE_NAMES: Mapping[Cause, str] = {
    "turn_on_bias": "turn-on bias",
    "repeatability": "repeatability",
    "temperature": "temperature",
    "temperature_squared": "temperature squared",
    "scale_factor": "scale factor",
    "nonlinearity": "nonlinearity",
    "g_sensitivity": "g-sensitivity",
    "vibration_rectification": "vibration rectification",
}
"""What each cause is called in a source."""

_SUBSTITUTE_CAUSES: Mapping[tuple[Measured, Cause], Cause] = {
    ("gyro", "turn_on_bias"): "repeatability",
    ("accel", "turn_on_bias"): "repeatability",
    ("gyro", "g_sensitivity"): "vibration_rectification",
}
"""The figure that also tells how large an error may be, where one is not known."""

BIAS_CAUSES: tuple[Cause, ...] = ("turn_on_bias", "repeatability")
"""The causes of a bias that nothing has taken off."""

_REQUIRED_CAUSES: frozenset[Cause] = frozenset(
    ("turn_on_bias", "temperature", "scale_factor", "g_sensitivity")
)
"""The causes that are missed where nothing is known; of an accelerometer the last one, too."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """How large an error of one axis is.

    Attributes
    ----------
    sigma : float or None
        1 sigma, SI; None: not known.
    origin : str
    kind : str or None
        Of a printed figure: typ, max, 1sigma ...
    convention : str or None
        How it became a standard deviation.
    spread : float
        1 sigma of the figure itself, where it is an estimate.
    reason : str or None
        Why it is not known.
    """

    sigma: float | None = None
    origin: Origin = "not known"
    kind: str | None = None
    convention: str | None = None
    spread: float = 0.0
    reason: str | None = None


STATED_FIGURE = Figure(origin="requirement", convention="as it is stated, 1 sigma")
"""Of what a requirement states."""

Figures = Mapping[Cause, Figure]
"""What is known of one axis."""

NO_FIGURES: Figures = MappingProxyType({})


def check_not_negative(**values: float) -> None:
    """Raise a ValueError that names a number, if it is not finite or negative."""
    for name, value in values.items():
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} is {value}, expected a number from 0")


@dataclass(frozen=True, kw_only=True)
class Use:
    """What happens to a sensor in dead reckoning; 0: it does not.

    Parameters
    ----------
    temperature_change : float
        K.
    turns : float
        About the axis of the gyro, rad.
    speed_change : float
        Along the axis of the accelerometer, m/s.
    vibration : float
        rms, m/s^2.
    over : float
        The time in which temperature, heading and speed change, s; what is turned and sped up
        comes evenly, and afterwards no more.

    Raises
    ------
    ValueError
        If one is negative or not finite, or the time is not above 0.
    """

    temperature_change: float = 0.0
    turns: float = 0.0
    speed_change: float = 0.0
    vibration: float = 0.0
    over: float = 1.0

    def __post_init__(self) -> None:
        for name in ("temperature_change", "turns", "speed_change", "vibration"):
            check_not_negative(**{name: getattr(self, name)})
        if not (math.isfinite(self.over) and self.over > 0):
            raise ValueError(f"over is {self.over}, expected a time above 0")


NO_USE = Use()


def of_pulse(order: int, time: float, over: float) -> float:
    """Return what an error of 1 grows to that lasts a time: c(t) - c(t - T), see `of_constant`.

    ``order`` is m, integrations but one; t and T in s, T begins at 0.
    """
    return of_constant(order, time) - of_constant(order, max(time - over, 0.0))


def of_rise(order: int, time: float, over: float) -> float:
    """Return what an error grows to that rises linearly to 1 in a time T, and stays there.

    (c'(t) - c'(t - T)) / T with c' of ``order + 1`` (see `of_constant`): t^(m+1) / (m+2)! at t = T,
    a (m+2)nd of what a constant 1 grows to. The arguments are those of `of_pulse`.
    """
    return of_pulse(order + 1, time, over) / over


def of_squared_rise(order: int, time: float, over: float) -> float:
    """Return what the square of the error of `of_rise` grows to, s^(m+1).

    2 (c''(t) - c''(t - T) - T c'(t - T)) / T^2, with c' and c'' of ``order + 1`` and ``order + 2``.
    """
    later = of_constant(order + 1, max(time - over, 0.0))
    return 2.0 * (of_pulse(order + 2, time, over) - over * later) / over**2


def levers(
    measured: Measured, order: int, time: float, start: SensorStart, use: Use, *, seen: bool
) -> Iterator[tuple[Cause, float]]:
    """Yield each cause that there is in a use, and what a figure of 1 grows to.

    ``order`` is m, 0 to 2, and the time in s; ``seen``: what the sensor measures is the error that
    is asked for, or a rate of it, so that its scale factor counts. A lever is in s^(m+1) times the
    unit of the use.
    """
    constant = of_constant(order, time)
    calibrated = isinstance(start, Calibrated)
    if isinstance(start, Uncalibrated) and start.bias is None:
        yield "turn_on_bias", constant
        yield "repeatability", constant
    if change := use.temperature_change:
        rise = of_rise(order, time, use.over) if calibrated else constant
        square = of_squared_rise(order, time, use.over) if calibrated else constant
        yield "temperature", change * rise
        yield "temperature_squared", change**2 * square
    moved = use.turns if measured == "gyro" else use.speed_change
    if seen and moved:
        lever = moved / use.over * of_pulse(order, time, use.over)
        yield "scale_factor", lever
        yield "nonlinearity", lever
    if use.vibration:
        if measured == "gyro":
            yield "g_sensitivity", use.vibration * constant
        yield "vibration_rectification", use.vibration**2 * constant


def needed(measured: Measured, cause: Cause, figures: Figures) -> bool:
    """Tell whether an error that is there in use is not known, because a figure is missing."""

    def has_figure(candidate: Cause) -> bool:
        return candidate in figures and figures[candidate].sigma is not None

    asked = cause in _REQUIRED_CAUSES or (measured, cause) == ("accel", "vibration_rectification")
    otherwise = _SUBSTITUTE_CAUSES.get((measured, cause))
    return asked and not has_figure(cause) and not (otherwise and has_figure(otherwise))
