"""Estimates of an Earth-rate experiment by every method, over time.

The noise model is an estimate with limits, so that the standard deviations have a range, too
(`compute_sigma_ranges`): 95 % of the values for models drawn from these limits. The effect of
weights from a wrong model is of second order and neglected.
"""

from __future__ import annotations

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
from imubench_pipeline.noise.sigma_range import sigma_range
from imubench_pipeline.typing import Array

GIVEN = {"known_rate": STARTS["degrees"], "known_rate_radians": STARTS["radians"]}
"""The methods with known rate, which cannot estimate it, and the start of each, (rad/s)^2."""

METHODS = ("pairs", "triples", "filter", "smoother", *GIVEN)
"""All methods, in the order of display."""

_MAX_POINTS = 400

Range = dict[str, float]


@dataclass(frozen=True)
class Course:
    """Estimates of one method over time."""

    method: str  # one of `METHODS`
    time: Array  # shape (k,); s from the first sample of the log
    # shape (k,); estimate from the data up to then, rad/s; by the smoother from all of the data
    rate: Array
    sigma: Array | None  # shape (k,); its standard deviation, rad/s; None where the method has none
    reason: str | None = None  # why there is no estimate: the arrays are empty then
    # s of data after which it stays within a tenth of the known rate, for methods with one
    settled: float | None = None


@dataclass(frozen=True)
class Courses:
    """The estimates of one experiment, and their data."""

    courses: tuple[Course, ...]  # one per method
    measured: Measured
    longest: int  # largest number of samples of a block
    # drift_time, drift, drift_sigma: shape (b,); middle of each block in s from the first sample of
    # the log; slow error of the gyro in it, including the bias, from all data, and its standard
    # deviation, rad/s
    drift_time: Array
    drift: Array
    drift_sigma: Array


def compute_white_sigma(model: NoiseModel, blocks: Blocks) -> float:
    """Return the lower limit of sigma, N / sqrt(T) / cos(latitude), rad/s, for T s of data.

    T is the total time of the samples in the blocks.
    """
    return model.N / math.sqrt(blocks.time_in_blocks) / math.cos(blocks.latitude)


def estimate_courses(
    log: Array,
    experiment: Experiment,
    model: NoiseModel,
    papers: NoiseModel,
    turn_on_bias: float | None = None,
) -> Courses:
    """Estimate the Earth's rate by every method.

    The log, shape (n,), is in rad/s, NaN where a sample is missing; the noise model has N. N, B
    with T_B, and K of ``papers`` are for the filter of Silva et al. The filter starts with the
    variance of the turn-on bias, rad/s (None: unknown), and the stationary variances of its Gauss-
    Markov processes. Raises ValueError if the dwells are all of one sense, or no block of them has
    enough samples.
    """
    if len({dwell.sense for dwell in experiment.dwells}) < 2:
        raise ValueError("all dwells are of one position: the rate cannot be told from the bias")
    longest = choose_block_length(experiment, model)
    measured = block_means([log], experiment, longest)
    blocks, means = measured.blocks, measured.means
    first = blocks.start[0] / blocks.rate
    rate_filter = RateFilter(
        blocks, model, turn_on_bias=UNINFORMATIVE_SIGMA if turn_on_bias is None else turn_on_bias
    )
    filtered = rate_filter.run(means)
    smoothed = rate_filter.smooth(filtered)
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
    courses += [
        Course(
            "filter",
            first + filtered.time[from_second],
            filtered.rate[0, from_second],
            filtered.rate_sigma[from_second],
        ),
        Course("smoother", whole, np.full(2, smoothed.rate[0]), np.full(2, smoothed.rate_sigma)),
        *(_track_known_rate(log, experiment, papers, method) for method in GIVEN),
    ]
    middle, drift = first + blocks.middle, smoothed.drift[0]
    return Courses(tuple(courses), measured, longest, middle, drift, smoothed.drift_sigma)


def _track_known_rate(
    log: Array, experiment: Experiment, papers: NoiseModel, method: str
) -> Course:
    try:
        tracked = track(log, experiment, papers, EARTH_RATE, GIVEN[method])
    except ValueError as error:
        return Course(method, np.empty(0), np.empty(0), None, str(error))
    after = settled(tracked.mean, experiment.rate, EARTH_RATE)
    return Course(method, tracked.sample / experiment.rate, tracked.mean, None, settled=after)


def thin(points: int) -> Iterator[int]:
    """Yield the indices of points to display, half of them spaced logarithmically, half evenly.

    There are about 400.
    """
    if points <= _MAX_POINTS:
        yield from range(points)
        return
    even = np.linspace(0, points - 1, _MAX_POINTS // 2)
    early = np.geomspace(1, points, _MAX_POINTS // 2) - 1
    yield from np.unique(np.rint(np.concatenate([even, early])).astype(np.int64)).tolist()


def compute_sigma_ranges(
    blocks: Blocks, model: NoiseModel, drawn: Sequence[NoiseModel], turn_on_bias: float | None
) -> dict[str, Range]:
    """Return the limits of the standard deviation of each method at the end of a run.

    By method ``sigma_lower`` and ``sigma_upper``, rad/s, over models drawn from the limits of the
    parameters of the estimated model. Methods without an estimate are left out, and all methods
    without draws. The standard deviation of the fixed bias is in rad/s; None: unknown.
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
            limits = sigma_range(sigma, model, drawn)
        except (ValueError, LinAlgError):
            continue  # no pair or triple in these dwells; the estimate has the reason
        ranges[method] = {"sigma_lower": float(limits.lower), "sigma_upper": float(limits.upper)}
    if "filter" in ranges:
        ranges["smoother"] = ranges["filter"]  # equal at the end of the run
    return ranges
