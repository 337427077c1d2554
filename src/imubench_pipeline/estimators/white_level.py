"""N with the processes that are faster than a second: the level of the -1/2 slope beyond them.

White noise of density N_0 with a Gauss-Markov process has the level N_0 at tau far below T_B, and
N^2 = N_0^2 + S_B T_B^2 far above it. A process that is part of N is removed from the model, so that
it is not counted twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import BROADBAND_TIME
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Maximum, Terms
from imubench_pipeline.noise.terms import compute_driving_density
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves as texts


def count_fast_processes(maximum: Maximum) -> int:
    """Return how many processes of a fit are faster than a second, and count into N."""
    return int(np.sum(maximum.times < BROADBAND_TIME)) if "N" in maximum.terms.linear else 0


def merge_fast_processes(maximum: Maximum, number: int, folding: float) -> Maximum:
    """Return a fit whose ``number`` fastest processes are white noise.

    ``folding`` is the density of white noise in the log over the density before the low-pass.
    """
    if number == 0:
        return maximum
    linear, powers = len(maximum.terms.linear), maximum.powers.copy()
    densities = _white_densities(maximum.process_powers[:number], maximum.times[:number])
    powers[maximum.terms.linear.index("N")] += float(np.sum(densities)) / folding
    return replace(
        maximum,
        terms=replace(maximum.terms, gauss_markov=maximum.terms.gauss_markov - number),
        powers=np.delete(powers, np.s_[linear : linear + number]),
        times=maximum.times[number:],
    )


def merge_fast_draws(posterior: Posterior, terms: Terms, number: int) -> Posterior:
    """Return draws of a model whose ``number`` fastest processes are part of its white noise.

    The processes of a draw are in the order of T_B: where one is merged, all faster than a second
    are, as a weak process may be faster than the strong one.
    """
    if number == 0:
        return posterior
    linear, parameters = len(terms.linear), posterior.parameters.copy()
    merged = posterior.times < BROADBAND_TIME
    merged[:, :number] = True
    biases = parameters[:, linear:]
    densities = _white_densities(biases**2, posterior.times) * merged
    biases[merged] = 0.0
    place = terms.linear.index("N")
    parameters[:, place] = np.sqrt(parameters[:, place] ** 2 + densities.sum(axis=1))
    return replace(
        posterior,
        parameters=np.delete(parameters, np.s_[linear : linear + number], axis=1),
        times=posterior.times[:, number:],
    )


def describe_white_level(times: Sequence[float]) -> str | None:
    """Return a description of an N with processes of correlation times, s, if there are any."""
    return texts.white_level_with_processes(times) if times else None


def _white_densities(squares: Array, times: Array) -> Array:
    """Return the density of Gauss-Markov processes of B^2 and T_B far below 1 / T_B."""
    return np.asarray(squares * compute_driving_density(1.0, 1.0) * times)
