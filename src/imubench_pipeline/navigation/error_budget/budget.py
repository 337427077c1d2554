"""Error budgets: attitude, heading, velocity and position after dead reckoning, by source.

All budgets here assume:

- one horizontal axis: the accelerometer along it and the gyro across it, whose tilt projects
  gravity into that accelerometer. The other axis is alike (`Budget.to_radius`). Errors in use are
  included if a use is stated (`in_use`); a heading error acts on velocity and position in a turn;
- for the cross-track error, a vehicle whose odometer gives the way and whose gyro the heading, at a
  constant speed;
- small angles, up to about 0.2 rad;
- a flat Earth that does not turn, g = 9.80665 m/s^2: no Schuler feedback, whose absence overstates
  errors by 0.3 % at most after 60 s, and by 3 to 10 % after 600 s (36 % of an initial tilt);
- independent sensors with independent noise terms, and deterministic terms of random sign.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.model.states import MEASURED, Measured
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget import in_use, parts
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated, SensorStart, Uncalibrated, of_constant

GYRO_ORDER: dict[parts.Quantity, int] = {
    "attitude": 0,
    "heading": 0,
    "velocity": 1,
    "position": 2,
    "cross_track": 1,
}
ACCEL_ORDER: dict[parts.Quantity, int] = {"velocity": 0, "position": 1}
"""Number of integrations minus one, m of `growth`."""


_MIN_TIME = 1e-6
_MAX_TIME = 1e9
_CROSSING_POINTS = 4096
"""Number of times at which the error is evaluated if lines make it oscillate."""


@dataclass(frozen=True, kw_only=True)
class Start:
    """Initial conditions of dead reckoning.

    A levelled tilt is the mean error of the accelerometers in their static window, divided by g.
    It cancels this error, so that only later changes of it act on velocity and position.
    """

    gyro: SensorStart
    accel: SensorStart
    # initial tilt, 1 sigma, rad, from a source that is independent of the accelerometers; None:
    # levelled by the accelerometers
    tilt: float | None = 0.0
    heading: float = 0.0  # initial heading error, 1 sigma, rad

    @classmethod
    def calibrated(cls, window: float) -> "Start":
        """Return a levelled start; the means of the static window, s, give the sensors' biases."""
        return cls(gyro=Calibrated(window), accel=Calibrated(window), tilt=None)


def budget(
    quantity: parts.Quantity,
    time: float,
    *,
    gyro: NoiseModel,
    accel: NoiseModel,
    start: Start,
    use: in_use.Use = in_use.NO_USE,
    gyro_figures: in_use.Figures = in_use.NO_FIGURES,
    accel_figures: in_use.Figures = in_use.NO_FIGURES,
) -> parts.Budget:
    """Return the error after a time of dead reckoning, by source.

    The noise of the gyro is integrated once to the attitude and the heading, twice and three times
    with g to velocity and position; the noise of the accelerometer once and twice; an initial tilt
    adds g t and g t^2 / 2 times itself (see `Term.growth`). White noise alone gives, after t, N
    sqrt(t), g N sqrt(t^3/3) and g N sqrt(t^5/20) from the gyro, N sqrt(t) and N sqrt(t^3/3) from
    the accelerometer. White noise in the window is independent of the noise in motion and has a
    separate contribution; every other term has one, since window and motion are correlated.

    The time t is in s. The gyro is across the axis, or for the heading points up; the accelerometer
    is along the axis, and the heading does not need it. ``gyro_figures`` and ``accel_figures`` are
    the sizes of errors other than noise, by cause.

    References
    ----------
    P. D. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems",
    2nd ed., Artech House 2013; D. H. Titterton and J. L. Weston, "Strapdown Inertial Navigation
    Technology", 2nd ed., IEE 2004.
    """
    order = GYRO_ORDER[quantity]
    factor = get_angle_factor(quantity, use)
    contributions = list(of_sensor("gyro", gyro, order, time, start.gyro, factor))
    if quantity in ACCEL_ORDER:
        contributions.extend(of_sensor("accel", accel, ACCEL_ORDER[quantity], time, start.accel))
    if quantity in ("heading", "cross_track"):
        heading = start.heading * (factor * time if quantity == "cross_track" else 1.0)
        source = ErrorSource("initial_heading")
        contributions.append(parts.Contribution(source, heading, in_use.STATED_FIGURE))
    elif start.tilt is not None:
        tilt = start.tilt * factor * of_constant(order - 1, time)
        source = ErrorSource("initial_tilt")
        contributions.append(parts.Contribution(source, tilt, in_use.STATED_FIGURE))
    elif quantity == "attitude" and isinstance(start.accel, Calibrated):
        for term in accel.terms:
            sigma = math.sqrt(term.mean_variance(start.accel.window, 0.0)) / STANDARD_GRAVITY
            source = parts.describe_term("accel", term, "initial_tilt")
            contributions.append(parts.Contribution(source, sigma))
    for measured, (cause, lever, through) in _list_levers(quantity, time, start, use):
        figure = (gyro_figures if measured == "gyro" else accel_figures).get(cause)
        if figure is not None:
            source = ErrorSource(cause, measured, through)
            vector = lever * figure.sigma if isinstance(lever, complex) else None
            part = parts.Contribution(source, abs(lever) * figure.sigma, figure, vector)
            contributions.append(part)
    return parts.Budget(time, quantity, contributions)


def get_angle_factor(quantity: parts.Quantity, use: in_use.Use) -> float:
    """Return the factor of an integrated gyro error: gravity, the speed for a track, or 1."""
    if quantity == "cross_track":
        return use.speed
    return STANDARD_GRAVITY if GYRO_ORDER[quantity] > 0 else 1.0


def _list_levers(
    quantity: parts.Quantity, time: float, start: Start, use: in_use.Use
) -> Iterator[tuple[Measured, in_use.Lever]]:
    order, factor = GYRO_ORDER[quantity], get_angle_factor(quantity, use)
    direct = quantity == "heading"  # vehicles turn about the vertical
    levers = in_use.list_levers("gyro", order, time, start.gyro, use, direct=direct)
    for cause, size, through in levers:
        yield "gyro", (cause, factor * size, through)
    if quantity in ACCEL_ORDER:
        levers = in_use.list_levers(
            "accel", ACCEL_ORDER[quantity], time, start.accel, use, direct=True
        )
        yield from (("accel", lever) for lever in levers)
    levelled = start.tilt is None
    for measured in MEASURED:
        for lever in in_use.list_turn_levers(measured, quantity, time, use, levelled=levelled):
            yield measured, lever
    if quantity == "attitude" and levelled:
        yield "accel", ("turn_on_bias", 1.0 / STANDARD_GRAVITY, "initial_tilt")
        yield "accel", ("misalignment", 1.0, "initial_tilt")


def of_sensor(
    measured: Measured,
    model: NoiseModel,
    order: int,
    time: float,
    start: SensorStart,
    factor: float = 1.0,
) -> Iterator[parts.Contribution]:
    """Yield the contributions of one sensor axis, after ``order + 1`` integrations.

    ``order`` is m, 0 to 2; the time is in s, and the sigmas are multiplied by ``factor``.
    """
    for term in model.terms:
        for through, sigma in term.sources(order, time, start):
            yield parts.Contribution(parts.describe_term(measured, term, through), factor * sigma)
    if isinstance(start, Uncalibrated) and start.bias is not None:
        grown = factor * start.bias * of_constant(order, time)
        yield parts.Contribution(ErrorSource("turn_on_bias", measured), grown, in_use.STATED_FIGURE)


def time_until(
    limit: float, at: Callable[[float], parts.Budget], *, oscillates: bool = False
) -> float | None:
    """Return the time, s, at which an error reaches a limit; ``at`` returns the budget at a time.

    The total of a `budget` increases with time, because the errors at two times never have a
    negative correlation. With lines or turns it may oscillate; if ``oscillates``, as with lines,
    the first crossing is found among 4096 times. The result is 0 if the error exceeds the limit
    from the beginning, None if it does not within 30 years. The limit is 1 sigma, rad, m/s or m.
    """

    def excess(time: float) -> float:
        return at(time).total - limit

    if excess(_MIN_TIME) >= 0:
        return 0.0
    earlier, later = _MIN_TIME, 2.0 * _MIN_TIME
    while excess(later) < 0:
        if later > _MAX_TIME:
            return None
        earlier, later = later, 2.0 * later
    if oscillates:
        times = np.linspace(0.0, later, _CROSSING_POINTS + 1)[1:]
        first = next(i for i, time in enumerate(times) if excess(float(time)) >= 0)
        earlier, later = (float(times[first - 1]) if first else _MIN_TIME), float(times[first])
    return float(brentq(excess, earlier, later, xtol=1e-12, rtol=1e-12))
