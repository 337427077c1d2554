"""The estimates of an Earth-rate experiment by every method, as they grow with time.

How sure their standard deviations are is told by their range over noise models (`sigma_ranges`):
the noise model is an estimate with limits. Each standard deviation is computed again for models
drawn from these; 95 % of the values lie between its limits. What weights that come of another
model than the true one add to it is of the second order, and left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.linalg import LinAlgError

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.experiments.earth_rate.bound import block_length, bound
from imubench_pipeline.experiments.earth_rate.experiment import (
    Blocks,
    Experiment,
    Measured,
    block_means,
)
from imubench_pipeline.experiments.earth_rate.kalman import RateFilter
from imubench_pipeline.experiments.earth_rate.known_rate import STARTS, settled, track
from imubench_pipeline.experiments.earth_rate.pairs import Differences, by_pairs, by_triples
from imubench_pipeline.experiments.earth_rate.states import UNINFORMATIVE_SIGMA
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.sigma_range import sigma_range
from imubench_pipeline.typing import Array

GIVEN = {"known_rate": STARTS["degrees"], "known_rate_radians": STARTS["radians"]}
"""The methods that are given the rate, and cannot find it; with the start of each, (rad/s)^2."""

METHODS = ("pairs", "triples", "filter", "smoother", *GIVEN)
"""In the order in which they are shown."""

_KEPT = 400

Range = dict[str, float]


@dataclass(frozen=True)
class Course:
    """What one method says as the data come in."""

    method: str  # one of `METHODS`
    time: Array  # shape (k,); s from the first sample of the log
    # shape (k,); estimate from the data up to then, rad/s; by the smoother from all of the data
    rate: Array
    sigma: Array | None  # shape (k,); its standard deviation, rad/s; None where the method has none
    reason: str | None = None  # why there is no estimate: the arrays are empty then
    # s of data after which it stays within a tenth of the rate that it was given, where it was
    settled: float | None = None


@dataclass(frozen=True)
class Courses:
    """The estimates of one experiment, and what they are made of."""

    courses: tuple[Course, ...]  # one a method
    measured: Measured
    longest: int  # samples of a block at most
    # drift_time, drift, drift_sigma: shape (b,); middle of each block in s from the first sample of
    # the log; the gyro's slow error in it with its bias, from all of the data, and its standard
    # deviation, rad/s
    drift_time: Array
    drift: Array
    drift_sigma: Array


def white_sigma(model: NoiseModel, blocks: Blocks) -> float:
    """Return N / sqrt(T) / cos(latitude), rad/s, below which no estimate from T s of data can be.

    T is the time that the samples of the blocks stand for.
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

    The filter starts with the variance of the turn-on bias (of no knowledge, where it is not
    stated), its Gauss-Markov processes with their stationary one.

    Parameters
    ----------
    log : ndarray, shape (n,)
        rad/s; NaN where a sample is missing.
    experiment : Experiment
        Dwells of both senses.
    model : NoiseModel
        Of the gyro, with N.
    papers : NoiseModel
        N, B with T_B, and K, for the paper's filter.
    turn_on_bias : float or None
        Standard deviation of the fixed bias, rad/s; None: not known.

    Raises
    ------
    ValueError
        If the dwells are all of one sense, or no block of them has enough samples.
    """
    if len({dwell.sense for dwell in experiment.dwells}) < 2:
        raise ValueError("all dwells are of one position: the rate cannot be told from the bias")
    longest = block_length(experiment, model)
    measured = block_means([log], experiment, longest)
    blocks, means = measured.blocks, measured.means
    first = blocks.start[0] / blocks.rate
    rate_filter = RateFilter(
        blocks, model, turn_on_bias=UNINFORMATIVE_SIGMA if turn_on_bias is None else turn_on_bias
    )
    filtered = rate_filter.run(means)
    smoothed = rate_filter.smooth(filtered)
    # Before the second position is seen the rate is not told from the bias.
    from_second = slice(int(np.argmax(blocks.sense != blocks.sense[0])), None)
    whole = np.array([first, first + blocks.duration])
    courses = (
        _differences("pairs", blocks, lambda: by_pairs(means, blocks, model)),
        _differences("triples", blocks, lambda: by_triples(means, blocks, model)),
        Course(
            "filter",
            first + filtered.time[from_second],
            filtered.rate[0, from_second],
            filtered.rate_sigma[from_second],
        ),
        Course("smoother", whole, np.full(2, smoothed.rate[0]), np.full(2, smoothed.rate_sigma)),
        *(_tracked(log, experiment, papers, method) for method in GIVEN),
    )
    return Courses(
        courses, measured, longest, first + blocks.middle, smoothed.drift[0], smoothed.drift_sigma
    )


def _differences(method: str, blocks: Blocks, estimate: Callable[[], Differences]) -> Course:
    try:
        differences = estimate()
    except ValueError as error:
        return Course(method, np.empty(0), np.empty(0), np.empty(0), str(error))
    first = blocks.start[0] / blocks.rate
    return Course(method, first + differences.time, differences.rate[0], differences.sigma)


def _tracked(log: Array, experiment: Experiment, papers: NoiseModel, method: str) -> Course:
    try:
        tracked = track(log, experiment, papers, EARTH_RATE, GIVEN[method])
    except ValueError as error:
        return Course(method, np.empty(0), np.empty(0), None, str(error))
    return Course(
        method,
        tracked.sample / experiment.rate,
        tracked.mean,
        None,
        settled=settled(tracked.mean, experiment.rate, EARTH_RATE),
    )


def thin(points: int) -> Iterator[int]:
    """Yield places of a course that show it: as many at its begin as later, and its end.

    About 400 are kept.
    """
    if points <= _KEPT:
        yield from range(points)
        return
    even = np.linspace(0, points - 1, _KEPT // 2)
    early = np.geomspace(1, points, _KEPT // 2) - 1
    yield from np.unique(np.rint(np.concatenate([even, early])).astype(np.int64)).tolist()


def sigma_ranges(
    blocks: Blocks, model: NoiseModel, drawn: Sequence[NoiseModel], turn_on_bias: float | None
) -> dict[str, Range]:
    """Return the limits of the standard deviation of each method at the end of a run.

    By method ``sigma_lower`` and ``sigma_upper``, rad/s, over models drawn from the limits of the
    parameters of the estimated one; none where nothing is drawn, or the method has no estimate. The
    standard deviation of the fixed bias is in rad/s; None: not known.
    """
    if not drawn:
        return {}
    zero_means = np.zeros((1, len(blocks)))
    bias = math.inf if turn_on_bias is None else turn_on_bias

    def filtered(drawn_model: NoiseModel) -> float:
        return bound(blocks, drawn_model, bias)

    methods: dict[str, Callable[[NoiseModel], float]] = {
        "pairs": lambda drawn_model: float(by_pairs(zero_means, blocks, drawn_model).sigma[-1]),
        "triples": lambda drawn_model: float(by_triples(zero_means, blocks, drawn_model).sigma[-1]),
        "filter": filtered,
    }
    ranges: dict[str, Range] = {}
    for method, sigma in methods.items():
        try:
            limits = sigma_range(sigma, model, drawn)
        except (ValueError, LinAlgError):
            continue  # no pair or triple in these dwells, which the estimate says
        ranges[method] = {"sigma_lower": float(limits.lower), "sigma_upper": float(limits.upper)}
    if "filter" in ranges:
        ranges["smoother"] = ranges["filter"]  # at the end of the run they are one
    return ranges
