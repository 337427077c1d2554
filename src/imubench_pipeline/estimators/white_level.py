"""N as the Allan deviation shows it at tau of a second and more.

White noise of density N_0 with a Gauss-Markov process faster than a second has the level N_0 at
tau far below T_B, and N^2 = N_0^2 + S_B T_B^2 far above it. Where the first level is not visible,
such a process is part of N, and is removed from the model, so that it is not counted twice.
"""

import math
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import BROADBAND_TIME
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_noise_model
from imubench_pipeline.noise import compute_driving_density
from imubench_pipeline.typing import Array

_MAX_PROCESS_SHARE = 0.06  # Share of the Allan variance that hardly changes the white slope
_MIN_TAU_OVER_TIME = 25.0  # Tau over T_B at which the level of both must be visible
_MIN_WHITE_SAMPLES = 15.0  # Longest cluster with this slope, where white noise is visible


def count_fast_processes(maximum: Maximum, rate: float) -> int:
    """Return the number of processes faster than a second that are part of the visible N.

    At tau far below T_B the Allan variance is N^2 / tau + S_B tau / 3: there the white noise is not
    visible. At tau far above T_B slower noise must not hide the level of both. ``rate`` in Hz.
    """
    fast = maximum.times < BROADBAND_TIME
    powers, times = maximum.process_powers[fast], maximum.times[fast]
    driving = float(np.sum(powers * compute_driving_density(1.0, 1.0) / times))
    if not driving > 0.0:
        return 0
    longest = maximum.parameter("N") * math.sqrt(3.0 * _MAX_PROCESS_SHARE / driving)
    merged, tau = merge_fast_processes(maximum, len(times)), _MIN_TAU_OVER_TIME * times[-1:]
    model = replace(make_noise_model(merged), R=0.0)
    level = float(model.allan_variance(tau)[0] * tau[0]) / model.N**2
    hidden, visible = longest < _MIN_WHITE_SAMPLES / rate, level < 1.0 + 2.0 * _MAX_PROCESS_SHARE
    return len(times) if hidden and visible else 0


def merge_fast_processes(maximum: Maximum, number: int) -> Maximum:
    """Return a fit with its ``number`` fastest processes merged into the white noise."""
    if not number:
        return maximum
    linear, powers = len(maximum.terms.linear), maximum.powers.copy()
    densities = _white_densities(maximum.process_powers[:number], maximum.times[:number])
    powers[maximum.terms.linear.index("N")] += float(np.sum(densities))
    return replace(
        maximum,
        terms=replace(maximum.terms, gauss_markov=maximum.terms.gauss_markov - number),
        powers=np.delete(powers, np.s_[linear : linear + number]),
        times=maximum.times[number:],
    )


def merge_fast_draws(posterior: Posterior, terms: Terms, number: int) -> Posterior:
    """Return draws of a model with its ``number`` fastest processes merged into white noise.

    All processes of a draw that are faster than a second are merged too: a draw has them in the
    order of T_B, and a weak process may be faster than the strong one.
    """
    if not number:
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


def _white_densities(squares: Array, times: Array) -> Array:
    """Return the density of Gauss-Markov processes of B^2 and T_B far below 1 / T_B."""
    return np.asarray(squares * compute_driving_density(1.0, 1.0) * times)
