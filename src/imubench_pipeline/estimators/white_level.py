"""N as the Allan deviation shows it: the level of its first -1/2 stretch.

White noise of density N_0 with a Gauss-Markov process faster than a second has the level N_0 at
tau far below T_B, and N^2 = N_0^2 + S_B T_B^2 far above it. A process that is part of N is removed
from the model, so that it is not counted twice.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.estimate import BROADBAND_TIME
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Maximum, Terms
from imubench_pipeline.noise.terms import compute_driving_density
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves as texts

MIN_DECADES = 0.7  # Length of a stretch
MIN_CLUSTER = 3  # Samples; fewer show the register and the sensor's filter
MAX_ERROR = 0.03  # Relative standard error of the deviation within a stretch

FLAT_WITHIN, MAX_FLAT_WITHIN = 0.03, 0.06
"""Maximum distance from the median: the first, or two standard errors up to the second."""


@dataclass(frozen=True)
class WhiteStretch:
    """The first stretch of slope -1/2 of an Allan deviation."""

    level: float  # median of sigma sqrt(tau), SI
    first: float  # shortest tau, s
    last: float  # longest tau, s


def find_white_stretch(curve: AllanCurve) -> WhiteStretch | None:
    """Return the first -1/2 stretch of an Allan deviation; None without one.

    The first 0.7 decade or more, from clusters of 3 samples on, whose points all lie within 3 % of
    their median (or two standard errors, at most 6 %), up to a standard error of 3 %.
    """
    n, averaged = curve.cluster_size.astype(np.float64), curve.averaged
    degrees = 1.5 * curve.samples / (2.0 * n) * 4.0 * n**2 / (4.0 * n**2 + 5.0) - 1.0
    error = 0.5 * np.sqrt(2.0 / np.maximum(degrees, 1.0))
    # Where samples are missing, white noise is averaged over fewer than n: as at a shorter tau.
    level = curve.deviation * np.sqrt(averaged / curve.rate)
    within = np.clip(2.0 * error, FLAT_WITHIN, MAX_FLAT_WITHIN)
    for start in np.flatnonzero(n >= MIN_CLUSTER):
        stop = start
        while stop < len(n) and error[stop] < MAX_ERROR:
            part = level[start : stop + 1]
            middle = np.median(part)
            if not middle > 0.0 or np.any(np.abs(part / middle - 1.0) > within[start : stop + 1]):
                break
            stop += 1
        if stop > start and math.log10(n[stop - 1] / n[start]) >= MIN_DECADES:
            first, last = float(curve.tau[start]), float(curve.tau[stop - 1])
            return WhiteStretch(float(np.median(level[start:stop])), first, last)
    return None


def count_fast_processes(maximum: Maximum, folding: float, stretch: WhiteStretch | None) -> int:
    """Return how many of the fastest processes of a fit count into N; 0 without a stretch.

    With them N is nearest to the level of the stretch. ``folding`` is the density of white noise in
    the log over the density before the low-pass.
    """
    if stretch is None or "N" not in maximum.terms.linear:
        return 0
    fast = int(np.sum(maximum.times < BROADBAND_TIME))
    densities = _white_densities(maximum.process_powers[:fast], maximum.times[:fast])
    squared = folding * maximum.parameter("N") ** 2 + np.append(0.0, np.cumsum(densities))
    away = np.abs(np.log(np.maximum(squared, 1e-300) / stretch.level**2))
    return int(np.argmin(away))


def merge_fast_processes(
    maximum: Maximum, number: int, folding: float, level: float = 1.0
) -> Maximum:
    """Return a fit whose ``number`` fastest processes are white noise, N times ``level``."""
    if (number, level) == (0, 1.0):
        return maximum
    linear, powers = len(maximum.terms.linear), maximum.powers.copy()
    densities = _white_densities(maximum.process_powers[:number], maximum.times[:number])
    place = maximum.terms.linear.index("N")
    powers[place] = level**2 * (powers[place] + float(np.sum(densities)) / folding)
    return replace(
        maximum,
        terms=replace(maximum.terms, gauss_markov=maximum.terms.gauss_markov - number),
        powers=np.delete(powers, np.s_[linear : linear + number]),
        times=maximum.times[number:],
    )


def merge_fast_draws(
    posterior: Posterior, terms: Terms, number: int, level: float = 1.0
) -> Posterior:
    """Return draws of a model whose ``number`` fastest processes are part of its white noise.

    The processes of a draw are in the order of T_B: where one is merged, all faster than a second
    are, as a weak process may be faster than the strong one.
    """
    if (number, level) == (0, 1.0):
        return posterior
    linear, parameters = len(terms.linear), posterior.parameters.copy()
    merged = (posterior.times < BROADBAND_TIME) & (number > 0)
    merged[:, :number] = True
    biases = parameters[:, linear:]
    densities = _white_densities(biases**2, posterior.times) * merged
    biases[merged] = 0.0
    place = terms.linear.index("N")
    parameters[:, place] = level * np.sqrt(parameters[:, place] ** 2 + densities.sum(axis=1))
    return replace(
        posterior,
        parameters=np.delete(parameters, np.s_[linear : linear + number], axis=1),
        times=posterior.times[:, number:],
    )


def describe_white_level(stretch: WhiteStretch | None, times: Sequence[float]) -> str | None:
    """Return a description of an N with processes of correlation times, s, or without a stretch."""
    if stretch is None:
        return texts.white_level_of_model(MIN_DECADES)
    if not times:
        return None
    return texts.white_level_of_curve(stretch.first, stretch.last, times)


def _white_densities(squares: Array, times: Array) -> Array:
    """Return the density of Gauss-Markov processes of B^2 and T_B far below 1 / T_B."""
    return np.asarray(squares * compute_driving_density(1.0, 1.0) * times)
