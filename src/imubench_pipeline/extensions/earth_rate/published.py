"""Compare published Earth-rate estimates with the scatter that the published noise allows.

An estimate from pairs of dwells scatters about the true rate with the standard deviation of
`extensions.earth_rate.pairs`, by the noise of the printed figures. If noise does not explain the
error of a printed estimate v of the rate w (Silva et al., eq. 14), another cause must, whose size
follows from the printed figures. With P the time between turns, D the data in a dwell and L the
latitude:

- a bias that drifts by r moves a pair that begins in the north by -r P / (2 cos L);
- an angle a of turning that remains in each dwell, with the sign of the turn, by a / (D cos L);
- turns miscounted so that the part f of the time has the wrong sense: v = (1 - 2 f) w;
- an axis that deviates from the meridian by A: v = w cos A;
- a wrong clock, so that the dwells are cut s dwells too late: v = (1 - 2 s) w up to one dwell.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import (
    Blocks,
    Experiment,
    Measured,
    block_means,
)
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.calibration.states import UNINFORMATIVE_SIGMA
from imubench_pipeline.extensions.earth_rate.bound import choose_block_length, compute_final_bound
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, settled, track
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs, by_triples
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

GIVEN = {"known_rate": STARTS["degrees"], "known_rate_radians": STARTS["radians"]}
"""The methods with known rate, which cannot estimate it, and the start of each, (rad/s)^2."""

METHODS = ("pairs", "triples", "filter", "smoother", *GIVEN)  # in the order of display
_MAX_POINTS = 400
_TESTED_CLOCK_ERRORS = 20_001
_TAIL_PROBABILITY = (1.0 - 0.95) / 2.0  # beyond each 95 % limit
_Z_95 = 1.96  # half width, in standard deviations, of the interval with 95 % of the estimates

Range = dict[str, float]


@dataclass(frozen=True)
class Course:
    """Estimates of one method over time."""

    method: str  # one of `METHODS`
    time: Array  # shape (k,); s from the first sample of the log
    rate: Array  # shape (k,); estimate from the data up to then, or all of it, rad/s
    sigma: Array | None  # shape (k,); its standard deviation, rad/s; None where the method has none
    reason: str | None = None  # reason without an estimate; the arrays are then empty
    settled: float | None = None  # s of data to within a tenth of the known rate


@dataclass(frozen=True)
class Courses:
    """The estimates of one experiment by every method, with the block means that they use."""

    courses: tuple[Course, ...]  # one per method
    measured: Measured
    longest: int  # largest number of samples of a block
    drift: Course  # smoothed slow error with the bias, at the middle of each block


def compute_white_sigma(model: NoiseModel, blocks: Blocks) -> float:
    """Return sigma of the rate from white noise only, N / sqrt(T) / cos(latitude), rad/s.

    T is the total time in blocks, s.
    """
    return model.N / math.sqrt(blocks.time_in_blocks) / math.cos(blocks.latitude)


def estimate_courses(
    log: Array,
    experiment: Experiment,
    model: NoiseModel,
    papers: NoiseModel,
    turn_on_bias: float | None = None,
) -> Courses:
    """Estimate the Earth's rate by every method; ``papers``: model for the filter of Silva et al.

    The log, shape (n,), is in rad/s, NaN where a sample is missing; the turn-on bias is a standard
    deviation, rad/s (None: unknown). Raises ValueError if all dwells have the same sense (one
    position only), or as `block_means`.
    """
    if len({dwell.sense for dwell in experiment.dwells}) < 2:
        raise ValueError("all dwells have one position: rate and bias cannot be separated")
    longest = choose_block_length(experiment, model)
    measured = block_means([log], experiment, longest)
    blocks, means = measured.blocks, measured.means
    first = blocks.start[0] / blocks.rate
    rate_filter = RateFilter(
        blocks, model, turn_on_bias=UNINFORMATIVE_SIGMA if turn_on_bias is None else turn_on_bias
    )
    filtered = rate_filter.run(means)
    drift, drift_sigma = rate_filter.smooth(filtered)
    # Before the second position the rate and the bias are not separable.
    from_second = slice(int(np.argmax(blocks.sense != blocks.sense[0])), None)
    whole = np.array([first, first + blocks.duration])
    courses = []
    for method, estimate in (("pairs", by_pairs), ("triples", by_triples)):
        try:
            found = estimate(means, blocks, model)
            courses.append(Course(method, first + found.time, found.rate[0], found.sigma))
        except ValueError as error:
            courses.append(Course(method, np.empty(0), np.empty(0), np.empty(0), str(error)))
    filter_rate, filter_sigma = filtered.rate[0, from_second], filtered.rate_sigma[from_second]
    courses += [
        Course("filter", first + blocks.end[from_second], filter_rate, filter_sigma),
        Course("smoother", whole, np.full(2, filter_rate[-1]), np.full(2, filter_sigma[-1])),
    ]
    for method, start in GIVEN.items():
        try:
            tracked = track(log, experiment, papers, EARTH_RATE, start)
        except ValueError as error:
            courses.append(Course(method, np.empty(0), np.empty(0), None, str(error)))
            continue
        after = settled(tracked.mean, experiment.rate, EARTH_RATE)
        time = tracked.sample / experiment.rate
        courses.append(Course(method, time, tracked.mean, None, settled=after))
    smoothed = Course("smoother", first + blocks.middle, drift[0], drift_sigma)
    return Courses(tuple(courses), measured, longest, smoothed)


def thin(points: int) -> Iterator[int]:
    """Yield the indices of some 400 points to display, half of them logarithmic, half even."""
    if points <= _MAX_POINTS:
        yield from range(points)
        return
    even = np.linspace(0, points - 1, _MAX_POINTS // 2)
    early = np.geomspace(1, points, _MAX_POINTS // 2) - 1
    yield from np.unique(np.rint(np.concatenate([even, early])).astype(np.int64)).tolist()


def compute_sigma_ranges(
    blocks: Blocks, drawn: Sequence[NoiseModel], turn_on_bias: float | None
) -> dict[str, Range]:
    """Return the 95 % limits of the standard deviation of each method at the end of a run, rad/s.

    They are quantiles over the models ``drawn`` within the limits of the parameters. Methods
    without an estimate are left out. ``turn_on_bias``: sigma of the fixed bias, rad/s, or unknown.
    """
    if not drawn:
        return {}
    zeros = np.zeros((1, len(blocks)))
    bias = math.inf if turn_on_bias is None else turn_on_bias
    methods: dict[str, Callable[[NoiseModel], float]] = {
        "pairs": lambda one: float(by_pairs(zeros, blocks, one).sigma[-1]),
        "triples": lambda one: float(by_triples(zeros, blocks, one).sigma[-1]),
        "filter": lambda one: compute_final_bound(blocks, one, bias),
    }
    ranges: dict[str, Range] = {}
    for method, sigma in methods.items():
        try:
            values = [sigma(one) for one in drawn]
        except (ValueError, LinAlgError):
            continue  # no pair or triple in these dwells; the estimate has the reason
        lower, upper = np.quantile(values, [_TAIL_PROBABILITY, 1.0 - _TAIL_PROBABILITY]).tolist()
        ranges[method] = {"sigma_lower": lower, "sigma_upper": upper}
    if "filter" in ranges:
        ranges["smoother"] = ranges["filter"]  # equal at the end of the run
    return ranges


@dataclass(frozen=True)
class AllowedSigmas:
    """Standard deviations that the noise gives the estimates of a run, rad/s."""

    white: float  # by white noise alone
    sigma: float  # of the mean over pairs
    sigma_filter: float


def compute_allowed_sigmas(design: Experiment, model: NoiseModel) -> AllowedSigmas:
    """Return the standard deviations that the noise of a model gives the estimates of a run."""
    blocks = design.blocks(choose_block_length(design, model))
    return AllowedSigmas(
        white=compute_white_sigma(model, blocks),
        sigma=float(by_pairs(np.zeros((1, len(blocks))), blocks, model).sigma[-1]),
        sigma_filter=float(RateFilter(blocks, model).rate_sigma[-1]),
    )


def judge_error(off: float) -> str:
    """Return "within the noise" or "beyond the noise" for an error in standard deviations."""
    return "within the noise" if abs(off) <= _Z_95 else "beyond the noise"


@dataclass(frozen=True)
class PrintedRun:
    """A published run of turns, or a part of such a run."""

    duration: float  # s
    value: float  # printed estimate, rad/s
    sigma: float  # standard deviation of the mean over pairs by noise, rad/s

    def without(self, last: "PrintedRun") -> "PrintedRun":
        """Return the run without its last part; the two have no pair of dwells in common."""
        rest = self.duration - last.duration
        value = (self.duration * self.value - last.duration * last.value) / rest
        # Disjoint pairs: the variances of both parts add up, weighted by their lengths squared.
        squares = (self.duration * self.sigma) ** 2 - (last.duration * last.sigma) ** 2
        return PrintedRun(rest, value, math.sqrt(max(squares, 0.0)) / rest)


def compute_needed_drift(off: float, period: float, latitude: float) -> float:
    """Return the bias drift, rad/s^2, that explains an error ``off``, rad/s; period of turns, s."""
    return -2.0 * math.cos(latitude) * off / period


def compute_needed_angle(off: float, dwell: float, latitude: float) -> float:
    """Return the angle of turning in each dwell, rad, that explains an error ``off``, rad/s."""
    return off * dwell * math.cos(latitude)


def compute_wrong_share(value: float, true: float) -> float | None:
    """Return the fraction of a run with inverted sense that explains a value; None if none does."""
    part = 0.5 * (1.0 - value / true)
    return part if 0.0 <= part <= 1.0 else None


def compute_needed_heading(value: float, true: float) -> float | None:
    """Return the angle between axis and meridian, rad, that explains a value; None if none does."""
    return math.acos(value / true) if abs(value) <= abs(true) else None


def compute_separation(one: PrintedRun, other: PrintedRun) -> float:
    """Return the difference of two estimates from disjoint pairs, in standard deviations."""
    return (one.value - other.value) / math.hypot(one.sigma, other.sigma)


@dataclass(frozen=True)
class WarmUp:
    """A bias that settles as exp(-t / time_constant)."""

    time_constant: float  # s
    total: float  # change of the bias over the run, rad/s


def fit_warm_up(first: float, last: float, duration: float, last_duration: float) -> WarmUp | None:
    """Fit a warm-up to mean drifts, rad/s^2, before and in the last part; None if none fits."""
    if not 0.0 < last / first < 1.0:
        return None
    rest = duration - last_duration

    def ratio(time_constant: float) -> float:
        before = -math.expm1(-rest / time_constant) / rest
        decayed = math.exp(-rest / time_constant)
        return decayed * -math.expm1(-last_duration / time_constant) / last_duration / before

    # The ratio rises with the time constant: bisection.
    low, high = 1e-3 * duration, 1e4 * duration
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if ratio(middle) < last / first else (low, middle)
    return WarmUp(low, first * rest + last * last_duration)


def fit_single_miscount(whole: PrintedRun, last: PrintedRun, true: float) -> float:
    """Return the least misfit, in sigma, if all senses after one turn are inverted."""
    first = whole.without(last)
    flips = np.linspace(0.0, whole.duration, 6001)
    before = np.clip(flips / first.duration, 0.0, 1.0)
    after = np.clip((flips - first.duration) / last.duration, 0.0, 1.0)
    misfits = [
        np.hypot(
            (sign * (2.0 * before - 1.0) * true - first.value) / first.sigma,
            (sign * (2.0 * after - 1.0) * true - last.value) / last.sigma,
        ).min()
        for sign in (1.0, -1.0)
    ]
    return float(min(misfits))


def fit_clock_error(parts: Sequence[PrintedRun], period: float, true: float) -> tuple[float, float]:
    """Return the relative clock error, up to 1/20, that fits best, and the misfit in sigma."""
    errors = np.linspace(0.0, 0.05, _TESTED_CLOCK_ERRORS)
    edges = np.cumsum([0.0, *(part.duration for part in parts)])
    squares = np.zeros(_TESTED_CLOCK_ERRORS)
    for part, start, stop in zip(parts, edges[:-1], edges[1:], strict=True):
        ratio = (
            _integrate_slipped(errors * stop / period) - _integrate_slipped(errors * start / period)
        ) / np.where(errors > 0.0, errors * part.duration / period, 1.0)
        ratio[0] = 1.0
        squares += ((ratio * true - part.value) / part.sigma) ** 2
    best = int(np.argmin(squares))
    return float(errors[best]), math.sqrt(float(squares[best]))


def _integrate_slipped(slip: Array) -> Array:
    """Return the integral from 0 of the share of the rate left if dwells begin so much late."""
    place = np.mod(slip, 2.0)
    return np.where(place <= 1.0, place - place**2, (place - 1.0) * (place - 2.0))
