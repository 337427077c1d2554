"""Errors that occur in use and that a static log does not show, for one axis of a sensor.

Each error is a figure of the sensor, a standard deviation, times a factor that depends on the use:

- ``turn_on_bias``: a bias that no static window removes. Levelling turns an accelerometer bias into
  a tilt, bias / g;
- ``temperature``: coefficient times change. With a static window, the temperature changes linearly
  from the window to the end; without one, the whole change acts from the beginning.
  ``temperature_squared``: the same for a measured curvature;
- ``scale_factor``, ``nonlinearity``, and ``scale_factor_temperature`` times the change: for a gyro,
  times the angle turned, in attitude and heading; for an accelerometer, times the change of speed,
  as ``misalignment`` is. They act evenly. In position and velocity, a turn acts as in `turns`;
- ``g_sensitivity``: for a gyro, times the acceleration by speed and in turns. Vibration averages to
  zero and leaves an angle: the figure times the velocity of the vibration at its lowest frequency;
- ``vibration_rectification``: times the square of the rms of the vibration.

Causes are independent of each other and of the noise; a figure has no sign. A figure that a sensor
does not print is the worst of its class (`datasheets.class_limits`).
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType

from pydantic import TypeAdapter

from imubench_pipeline.datasheets.class_limits import STATEMENTS, find_limit, read_sigma
from imubench_pipeline.datasheets.printed_noise import End
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.estimators.estimate import SIGMAS
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.states import Cause, Measured, Origin, SourcePath
from imubench_pipeline.navigation.error_budget.turns import Turn
from imubench_pipeline.noise.growth import Calibrated, SensorStart, Uncalibrated, of_constant
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor, quantity_of


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Size of an error of one axis."""

    sigma: float  # 1 sigma, SI
    # likely, best: median and best of the class, if sigma is the worst of the class; else None
    likely: float | None = None
    best: float | None = None
    origin: Origin = "measured"
    spread: float = 0.0  # 1 sigma of the figure itself, if it is an estimate

    def at(self, end: End) -> "Figure":
        """Return the figure; if it is the worst of a class, with the class's median or best."""
        value = {"in_use": None, "likely": self.likely, "best": self.best}[end]
        return self if value is None else replace(self, sigma=value)


STATED_FIGURE = Figure(sigma=0.0, origin="requirement")
"""Figure that is stated in a requirement."""

Figures = Mapping[Cause, Figure]
"""Figures of one axis, by cause."""

NO_FIGURES: Figures = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class Use:
    """Motion and environment of a sensor in dead reckoning; 0 for none."""

    temperature_change: float = 0.0  # K
    turns: float = 0.0  # rad, about the vertical, and for the attitude about the axis of the gyro
    speed_change: float = 0.0  # m/s along the axis of the accelerometer
    speed: float = 0.0  # m/s, in turns
    vibration: float = 0.0  # rms, m/s^2
    vibration_frequency: float = 10.0  # its lowest frequency, Hz
    over: float = 1.0  # time during which temperature, heading and speed change evenly, s


NO_USE = Use()


def of_pulse(order: int, time: float, over: float) -> float:
    """Return the growth, s^(m+1), of a unit error that lasts from 0 to T: c(t) - c(t - T).

    c is `of_constant`. ``order`` is m, the number of integrations minus one; t is ``time`` and T is
    ``over``, both in s.
    """
    return of_constant(order, time) - of_constant(order, max(time - over, 0.0))


def of_rise(order: int, time: float, over: float) -> float:
    """Return the growth of an error that rises linearly to 1 in a time T, and remains there.

    This is (c'(t) - c'(t - T)) / T, with c' = `of_constant` of ``order + 1``. At t = T, it is
    1 / (m+2) times the growth of a constant error of 1. The arguments are as in `of_pulse`.
    """
    return of_pulse(order + 1, time, over) / over


def of_squared_rise(order: int, time: float, over: float) -> float:
    """Return the growth of the square of the error of `of_rise`, s^(m+1).

    This is 2 (c''(t) - c''(t - T) - T c'(t - T)) / T^2, with c' and c'' = `of_constant` of
    ``order + 1`` and ``order + 2``.
    """
    later = of_constant(order + 1, max(time - over, 0.0))
    return 2.0 * (of_pulse(order + 2, time, over) - over * later) / over**2


Lever = tuple[Cause, float | complex, SourcePath | None]
"""A cause, the error from a figure of 1 (complex: a vector in the plane), and its path."""


def list_levers(
    measured: Measured, order: int, time: float, start: SensorStart, use: Use, *, direct: bool
) -> Iterator[Lever]:
    """Yield, for each cause in a use, the lever: the error along one axis from a figure of 1.

    ``order`` is m, 0 to 2; ``time`` is in s. ``direct``: the sensor measures the quantity of the
    error or its rate, so that its scale factor matters. A lever is in s^(m+1) times the unit of the
    use.
    """
    constant = of_constant(order, time)
    calibrated = isinstance(start, Calibrated)
    if isinstance(start, Uncalibrated) and start.bias is None:
        yield "turn_on_bias", constant, None
        if measured == "accel":  # in a tilted axis gravity is a bias
            yield "misalignment", STANDARD_GRAVITY * constant, None
    if change := use.temperature_change:
        rise = of_rise(order, time, use.over) if calibrated else constant
        square = of_squared_rise(order, time, use.over) if calibrated else constant
        yield "temperature", change * rise, None
        yield "temperature_squared", change**2 * square, None
    evenly = of_pulse(order, time, use.over) / use.over
    if direct and measured == "gyro" and use.turns:
        yield from _list_scale_factors(use.turns * evenly, use)
    if direct and measured == "accel" and use.speed_change:
        # Along the way, and across it.
        yield from _list_scale_factors(complex(use.speed_change * evenly), use)
        yield "misalignment", 1j * use.speed_change * evenly, None
    if measured == "gyro":
        if use.speed_change:
            yield "g_sensitivity", use.speed_change * evenly, None
        if use.vibration:
            # Of three axes; the angle swings, and is off by its first phase on average.
            angle = math.sqrt(3.0) * use.vibration / (2.0 * math.pi * use.vibration_frequency)
            swing = of_constant(order - 1, time) if order else math.sqrt(2.0)
            yield "g_sensitivity", angle * swing, None
    if use.vibration:
        yield "vibration_rectification", use.vibration**2 * constant, None


def _list_scale_factors(
    lever: float | complex, use: Use, path: SourcePath | None = None
) -> Iterator[Lever]:
    yield "scale_factor", lever, path
    yield "nonlinearity", lever, path
    if use.temperature_change:
        yield "scale_factor_temperature", use.temperature_change * lever, path


def list_turn_levers(
    measured: Measured, quantity: str, time: float, use: Use, *, levelled: bool
) -> Iterator[Lever]:
    """Yield the levers of a turn at speed, for attitude, heading, velocity and position.

    ``levelled``: the initial tilt is from the accelerometers. It cancels their constant error until
    the vehicle turns, because the error turns with the vehicle and the tilt does not.
    """
    if use.turns <= 0.0:
        return
    turn, speed = Turn(use.turns, use.over, use.speed), use.speed  # it may be on the spot
    if quantity in ("velocity", "position"):
        order = 0 if quantity == "velocity" else 1
        if measured == "accel":
            lateral = turn.accelerometer(order, time)
            yield from _list_scale_factors(lateral, use, "turn")
            yield "misalignment", 1j * lateral, "turn"
            if levelled:
                carried = abs(turn.misalignment(order, time))
                yield "misalignment", carried, "turn"
                yield "turn_on_bias", carried / STANDARD_GRAVITY, "turn"
            return
        # Two horizontal gyros tilt about two axes, alike in all directions.
        about, tilting = turn.scale_factor(order, time), abs(turn.misalignment(order, time))
        yield from _list_scale_factors(about, use, "turn")
        yield "misalignment", tilting, "turn"
        # The centripetal acceleration is the speed times the rate.
        yield "g_sensitivity", speed * about, "turn"
        yield "g_sensitivity", speed * tilting, "turn"
    elif measured == "gyro":
        turned = use.turns * min(time / use.over, 1.0)
        if quantity == "attitude":
            # The largest tilt so far: it is least again after a full circle.
            tilt = 2.0 * math.sin(min(turned, math.pi) / 2.0)
            yield "misalignment", tilt, "turn"
            yield "g_sensitivity", speed * tilt, "turn"
        elif quantity == "heading":
            yield "g_sensitivity", speed * turned, "turn"
        else:
            across = turn.cross_track(time)
            yield from _list_scale_factors(abs(across), use, "turn")
            yield "g_sensitivity", speed * abs(across), "turn"


_CAUSE_OF_COEFFICIENT: Mapping[str, Cause] = {
    "sensitivity": "temperature",
    "quadratic": "temperature_squared",
}


def read_figures(sensor: Sensor | None, quantity: str) -> dict[Cause, Figure]:
    """Return the sizes of a quantity's errors in use: printed, or the worst of the class."""
    figures: dict[Cause, Figure] = {}
    for cause in STATEMENTS:
        if (quantity, cause) == ("accel", "g_sensitivity"):
            continue
        printed = read_sigma(sensor, quantity, cause) if sensor else None
        if printed is not None:
            figures[cause] = Figure(sigma=printed, origin="datasheet")
        else:
            limit = find_limit(sensor.grade if sensor else None, quantity, cause)
            figures[cause] = Figure(
                sigma=limit.worst, likely=limit.median, best=limit.best, origin="class limit"
            )
    return figures


def state_figures(sensor: Sensor | None) -> dict[str, dict[str, dict[str, object]]]:
    """Return the figures of both quantities as plain values, for the settings of a step."""
    return {
        quantity: {
            cause: asdict(figure) for cause, figure in read_figures(sensor, quantity).items()
        }
        for quantity in QUANTITIES
    }


def read_stated_figures(stated: object) -> dict[str, Figures]:
    """Return figures from the plain values of `state_figures`."""
    return TypeAdapter(dict[str, dict[Cause, Figure]]).validate_python(stated)  # type: ignore[return-value]  # a dict is a mapping


def read_log_figures(rows: Iterable[TemperatureRow]) -> dict[Cause, Figure]:
    """Return the figures of the errors in use that the thermal fit of a channel determines, SI."""
    figures: dict[Cause, Figure] = {}
    for row in rows:
        if row.parameter not in _CAUSE_OF_COEFFICIENT or row.status != "ok" or row.value is None:
            continue
        spread = 0.0
        if row.lower is not None and row.upper is not None:
            spread = (row.upper - row.lower) / (2.0 * SIGMAS)
        figures[_CAUSE_OF_COEFFICIENT[row.parameter]] = Figure(sigma=abs(row.value), spread=spread)
    return figures


def collect_figures_in_use(
    sensor: Mapping[str, Figures], channels: Iterable[str], temperature: Iterable[TemperatureRow]
) -> dict[str, Figures]:
    """Return the figures of the errors in use by channel, and of the sensor by quantity.

    The temperature effect that a log determines replaces the figure of the sensor.
    """
    rows = list(temperature)
    return dict(sensor) | {
        channel: dict(sensor[quantity_of(channel)])
        | read_log_figures(row for row in rows if row.channel == channel)
        for channel in channels
    }
