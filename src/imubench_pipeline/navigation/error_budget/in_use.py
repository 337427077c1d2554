"""Errors that occur in use and that a static log does not show, for one axis of a sensor.

Each error is a figure of the sensor, a standard deviation, times a factor that depends on the use:

- ``turn_on_bias``, ``repeatability``: a bias that no static window removes. Levelling turns an
  accelerometer bias into a tilt, bias / g;
- ``temperature``: coefficient times change. With a static window, the temperature changes linearly
  from the window to the end; without one, the whole change acts from the beginning.
  ``temperature_squared``: the same for a measured curvature;
- ``scale_factor``, ``nonlinearity``: for a gyro, times the angle turned, in attitude and heading;
  for an accelerometer, times the change of speed, in velocity and position. Both act evenly;
- ``g_sensitivity``: for a gyro, times the vibration, as if it were constant: a bound.
  ``vibration_rectification``: times the square of the rms of the vibration.

Causes are independent of each other and of the noise; a figure has no sign.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from imubench_pipeline.datasheets.class_limits import SIGMAS_OF_KIND
from imubench_pipeline.datasheets.comparable import Comparable, PrintedAxis
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.states import Cause, Measured, Origin
from imubench_pipeline.noise.growth import Calibrated, SensorStart, Uncalibrated, of_constant
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, Datasheet
from imubench_pipeline.words.reasons import budgets as texts

_SUBSTITUTE_CAUSES: Mapping[tuple[Measured, Cause], Cause] = {
    ("gyro", "turn_on_bias"): "repeatability",
    ("accel", "turn_on_bias"): "repeatability",
    ("gyro", "g_sensitivity"): "vibration_rectification",
}
"""Figure that replaces another one that is not known."""

BIAS_CAUSES: tuple[Cause, ...] = ("turn_on_bias", "repeatability")
"""Causes of a bias that is not calibrated."""

_REQUIRED_CAUSES: frozenset[Cause] = frozenset(
    ("turn_on_bias", "temperature", "scale_factor", "g_sensitivity")
)
"""Causes that are reported as missing without a figure. For an accelerometer,
``vibration_rectification`` is too."""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Size of an error of one axis."""

    sigma: float | None = None  # 1 sigma, SI; None if not known
    origin: Origin = "not known"
    kind: str | None = None  # kind of a printed figure: typ, max, 1sigma ...
    convention: str | None = None  # how it was converted to a standard deviation
    spread: float = 0.0  # 1 sigma of the figure itself, if it is an estimate
    reason: str | None = None  # why it is not known


STATED_FIGURE = Figure(origin="requirement", convention=texts.STATED_SIGMA)
"""Figure that is stated in a requirement."""

Figures = Mapping[Cause, Figure]
"""Figures of one axis, by cause."""

NO_FIGURES: Figures = MappingProxyType({})


def check_not_negative(**values: float) -> None:
    """Raise a ValueError with the name of a number that is negative or not finite."""
    for name, value in values.items():
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} is {value}, expected a number from 0")


@dataclass(frozen=True, kw_only=True)
class Use:
    """Motion and environment of a sensor in dead reckoning; 0 for none.

    A ValueError is raised if a number is negative or not finite, or the time is not above 0.
    """

    temperature_change: float = 0.0  # K
    turns: float = 0.0  # rad about the axis of the gyro
    speed_change: float = 0.0  # m/s along the axis of the accelerometer
    vibration: float = 0.0  # rms, m/s^2
    over: float = 1.0  # time during which temperature, heading and speed change evenly, s

    def __post_init__(self) -> None:
        for name in ("temperature_change", "turns", "speed_change", "vibration"):
            check_not_negative(**{name: getattr(self, name)})
        if not (math.isfinite(self.over) and self.over > 0):
            raise ValueError(f"over is {self.over}, expected a time above 0")


NO_USE = Use()


def of_pulse(order: int, time: float, over: float) -> float:
    """Return the growth of a unit error that lasts for T: c(t) - c(t - T), see `of_constant`.

    ``order`` is m, the number of integrations minus one; t and T are in s, and T begins at 0.
    """
    return of_constant(order, time) - of_constant(order, max(time - over, 0.0))


def of_rise(order: int, time: float, over: float) -> float:
    """Return the growth of an error that rises linearly to 1 in a time T, and remains there.

    (c'(t) - c'(t - T)) / T with c' of ``order + 1`` (see `of_constant`): t^(m+1) / (m+2)! at t = T,
    1 / (m+2) of the growth of a constant 1. The arguments are as in `of_pulse`.
    """
    return of_pulse(order + 1, time, over) / over


def of_squared_rise(order: int, time: float, over: float) -> float:
    """Return the growth of the square of the error of `of_rise`, s^(m+1).

    2 (c''(t) - c''(t - T) - T c'(t - T)) / T^2, with c' and c'' of ``order + 1`` and ``order + 2``.
    """
    later = of_constant(order + 1, max(time - over, 0.0))
    return 2.0 * (of_pulse(order + 2, time, over) - over * later) / over**2


def levers(
    measured: Measured, order: int, time: float, start: SensorStart, use: Use, *, seen: bool
) -> Iterator[tuple[Cause, float]]:
    """Yield each cause that occurs in a use, and its lever: the error from a figure of 1.

    ``order`` is m, 0 to 2, the time in s. ``seen``: the sensor measures the quantity of the error
    or its rate, so that its scale factor matters. A lever is in s^(m+1) times the unit of the use.
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
    """Return whether an error in use is not known because a figure is missing."""

    def has_figure(candidate: Cause) -> bool:
        return candidate in figures and figures[candidate].sigma is not None

    asked = cause in _REQUIRED_CAUSES or (measured, cause) == ("accel", "vibration_rectification")
    otherwise = _SUBSTITUTE_CAUSES.get((measured, cause))
    return asked and not has_figure(cause) and not (otherwise and has_figure(otherwise))


DATASHEET_KEY_OF_CAUSE: Mapping[Cause, str] = {
    "turn_on_bias": "offset",
    "repeatability": "bias_repeatability",
    "temperature": "temperature_coefficient",
    "scale_factor": "scale_factor_error",
    "nonlinearity": "nonlinearity",
    "g_sensitivity": "g_sensitivity",
    "vibration_rectification": "vibration_rectification",
}
"""Datasheet key of the figure for each cause."""

_CONVENTIONS: Mapping[str, str] = {
    "1sigma": texts.PRINTED_SIGMA,
    "typ": texts.TYPICAL_AS_SIGMA,
    "derived": texts.TYPICAL_AS_SIGMA,
    "range": texts.RANGE_AS_UNIFORM,
    "max": texts.MAXIMUM_AS_SIGMAS,
}
"""How a figure was converted to a standard deviation, by its kind."""

SIGMAS = 1.96  # half the width of a 95 % interval

_CAUSE_OF_COEFFICIENT: Mapping[str, Cause] = {
    "sensitivity": "temperature",
    "quadratic": "temperature_squared",
}


def read_datasheet_figures(datasheet: Datasheet, channel: str) -> dict[Cause, Figure]:
    """Return the datasheet figures of the errors in use of a channel, SI."""
    axis = PrintedAxis.of(datasheet, channel)
    names = FIGURE_DIMENSIONS[axis.quantity]
    figures: dict[Cause, Figure] = {}
    for cause, name in DATASHEET_KEY_OF_CAUSE.items():
        if name not in names:
            continue
        like = Comparable(name, name, None)
        rows = axis.read(name, like, axis.si(name))
        by_kind: dict[str, list[float]] = {}
        for row in rows:
            if row.figure and row.value is not None:
                by_kind.setdefault(row.figure.kind, []).append(row.value)
        kind = next((kind for kind in SIGMAS_OF_KIND if kind in by_kind), None)
        if kind is None:
            obstacle = next((row.obstacle for row in rows if row.obstacle), None)
            figures[cause] = Figure(reason=obstacle or axis.unpublished(like, name).reason)
        else:
            figures[cause] = Figure(
                sigma=max(by_kind[kind]) / SIGMAS_OF_KIND[kind],
                origin="datasheet",
                kind=kind,
                convention=_CONVENTIONS[kind],
            )
    return figures


def read_log_figures(rows: Iterable[TemperatureRow]) -> dict[Cause, Figure]:
    """Return the figures of the errors in use that the thermal fit of a channel determines, SI."""
    figures: dict[Cause, Figure] = {}
    for row in rows:
        if row.parameter not in _CAUSE_OF_COEFFICIENT or row.status != "ok" or row.value is None:
            continue
        spread = 0.0
        if row.lower is not None and row.upper is not None:
            spread = (row.upper - row.lower) / (2.0 * SIGMAS)
        figures[_CAUSE_OF_COEFFICIENT[row.parameter]] = Figure(
            sigma=abs(row.value), origin="measured", convention=texts.OF_THIS_UNIT, spread=spread
        )
    return figures


def collect_figures_in_use(
    datasheet: Datasheet, channels: Iterable[str], temperature: Iterable[TemperatureRow]
) -> dict[str, dict[Cause, Figure]]:
    """Return the figures of the errors in use by channel, from datasheet and log."""
    rows = list(temperature)
    return {
        channel: read_datasheet_figures(datasheet, channel)
        | read_log_figures(row for row in rows if row.channel == channel)
        for channel in channels
    }
