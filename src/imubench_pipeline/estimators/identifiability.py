"""Cramér-Rao bounds of a noise model's parameters, and the log duration that they require.

The information matrix of the Whittle likelihood is I_ij = 1/2 sum_k nu_k d_i log S_k
d_j log S_k, with nu_k ordinates in bin k and S_k the density (P. Whittle, Ark. Mat. 2, 1953).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from imubench_pipeline.estimators.spectrum import SINGLE, WIDTH, Spectrum
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

TARGET_RELATIVE_ERROR = 0.1
"""Relative standard deviation at which `find_durations_needed` calls a parameter known."""

_MIN_DURATION_RATIO, _MAX_DURATION_RATIO = 1e-4, 1e4
_DURATIONS_PER_DECADE = 6


def compute_relative_bounds(whittle: Whittle, maximum: Maximum) -> Array:
    """Return the Cramér-Rao bound of each parameter of a fit, relative to it.

    Shape (m,): the parameters in the order of `Maximum.powers`, then T_B, then R; infinite for a
    term that is 0.
    """
    sensitivity = whittle.sensitivity(maximum)
    if maximum.terms.ramp:
        sensitivity[-1] *= maximum.ramp
    bounds = np.full(len(sensitivity), np.inf)
    size = np.linalg.norm(sensitivity, axis=1)
    sensitive = size > 1e-9
    if sensitive.any():
        # QR of the sensitivities: forming the information would square their condition number.
        root = np.linalg.qr((sensitivity[sensitive] / size[sensitive, None]).T, mode="r")
        if np.abs(np.diag(root)).min() > 0.0:
            inverse = np.linalg.inv(root)
            bounds[sensitive] = np.linalg.norm(inverse, axis=1) / size[sensitive]
    return bounds


def make_ideal_spectrum(rate: float, duration: float, highest: float) -> Spectrum:
    """Return the bins of a gapless log of a duration, up to a frequency, without data.

    Raises
    ------
    ValueError
        If no ordinate lies below the frequency.
    """
    samples = math.floor(rate * duration + 1e-6)
    count = min(math.floor(2.0 * highest * duration + 1e-6), samples - 1)
    if count < 1:
        raise ValueError(f"a log of {duration:.3g} s has no ordinate up to {highest:.3g} Hz")
    edges = list(range(1, min(SINGLE, count) + 1))
    while edges[-1] < count:
        edges.append(min(max(edges[-1] + 1, int(edges[-1] * WIDTH)), count))
    first = np.array([*edges[:-1], count] if count <= SINGLE else edges[:-1], dtype=np.float64)
    last = np.append(first[1:], count + 1.0) - 1.0
    frequency = (first + last) / 4.0 / duration
    odd = np.where((first == last) & (first % 2 == 1), 1.0, 0.0)
    return Spectrum(
        frequency=frequency,
        lower=(first - 0.5) / 2.0 / duration,
        upper=(last + 0.5) / 2.0 / duration,
        ordinates=last - first + 1.0,
        density=np.ones(len(first)),
        block=np.ones(len(first), dtype=np.int64),
        length=np.full(len(first), duration),
        # The coefficients of a unit ramp, for k << L.
        ramp=odd * 8.0 * duration**3 / (np.pi * np.maximum(first, 1.0)) ** 4,
        cross=np.zeros(len(first)),
        rate=rate,
        duration=duration,
        mean=0.0,
    )


def compute_cramer_rao_bounds(
    model: NoiseModel, rate: float, duration: float, highest: float
) -> dict[str, float]:
    """Return the Cramér-Rao bounds of a model's parameters in a log, relative to their values.

    The keys are as in `list_parameter_names`. Rate and highest frequency used are in Hz.
    """
    values = {"Q": model.Q, "N": model.N, "F": 0.0 if model.T_B else model.B, "K": model.K}
    letters = "".join(letter for letter, value in values.items() if value > 0)
    processes = [(model.B, model.T_B)] if model.B > 0 and model.T_B else []
    processes += [(process.B, process.T_B) for process in model.further_processes]
    processes.sort(key=lambda process: process[1])
    powers = [values[letter] ** 2 for letter in letters] + [B**2 for B, _ in processes]
    times = np.array([time for _, time in processes], dtype=np.float64)
    terms = Terms(letters, len(processes), model.R != 0)
    maximum = Maximum(terms, np.array(powers), times, model.R, 0.0)
    errors = _compute_relative_errors(make_ideal_spectrum(rate, duration, highest), maximum)
    return dict(zip(list_parameter_names(terms), errors, strict=True))


def list_parameter_names(terms: Terms) -> list[str]:
    """Return the names of the parameters in the order of the bounds: a second B is B 2."""
    names = ["B" if letter == "F" else letter for letter in terms.linear]
    offset = "F" in terms.linear
    numbers = [f" {i}" if i > 1 else "" for i in range(1 + offset, 1 + offset + terms.gauss_markov)]
    names += [f"B{number}" for number in numbers] + [f"T_B{number}" for number in numbers]
    return names + ["R"] * terms.ramp


def find_durations_needed(
    maximum: Maximum, rate: float, duration: float, highest: float
) -> list[float | None]:
    """Return the log duration, s, that determines each parameter to `TARGET_RELATIVE_ERROR`.

    In the order of `compute_relative_bounds`; None where 10,000 times the duration does not
    suffice. Rate and highest frequency used are in Hz.
    """
    lengths = np.geomspace(
        duration * _MIN_DURATION_RATIO,
        duration * _MAX_DURATION_RATIO,
        1 + round(math.log10(_MAX_DURATION_RATIO / _MIN_DURATION_RATIO) * _DURATIONS_PER_DECADE),
    )
    lengths = lengths[lengths * 2.0 * min(highest, 0.5 * rate) > 4.0 * maximum.terms.parameters]
    excesses: dict[int, Array] = {}

    def excess(place: int) -> Array:
        if place not in excesses:
            errors = _compute_relative_errors(
                make_ideal_spectrum(rate, float(lengths[place]), highest), maximum
            )
            excesses[place] = np.log(errors / TARGET_RELATIVE_ERROR)
        return excesses[place]

    return [
        _find_crossing(np.log(lengths), excess, excesses, number)
        for number in range(len(list_parameter_names(maximum.terms)))
    ]


def _find_crossing(
    log_lengths: Array, excess: Callable[[int], Array], excesses: dict[int, Array], number: int
) -> float | None:
    """Return the length at which the error of a parameter falls to `TARGET_RELATIVE_ERROR`.

    ``excess`` returns log(error / `TARGET_RELATIVE_ERROR`) of all parameters at an index of the
    lengths. The search starts from the indices in ``excesses``, which are already evaluated.
    """
    low, high = -1, len(log_lengths)
    for place, values in excesses.items():
        if values[number] > 0.0:
            low = max(low, place)
        else:
            high = min(high, place)
    steps = 0
    while high - low > 1:
        place = (low + high) // 2
        left = excesses[low][number] if low >= 0 else np.inf
        right = excesses[high][number] if high < len(log_lengths) else -np.inf
        if steps % 3 < 2 and (np.isfinite(left) or np.isfinite(right)):
            # Interpolate, or extrapolate with error ~ length^(-1/2) where one end is known.
            if not np.isfinite(left):
                where = log_lengths[high] + 2.0 * right
            elif not np.isfinite(right):
                where = log_lengths[low] + 2.0 * left
            else:
                part = left / (left - right)
                where = log_lengths[low] + part * (log_lengths[high] - log_lengths[low])
            guess = int(np.searchsorted(log_lengths, where))
            # First the index before the crossing, then the one after it.
            place = min(max(guess - (low < guess - 1), low + 1), high - 1)
        if excess(place)[number] > 0.0:
            low = place
        else:
            high = place
        steps += 1
    if high == len(log_lengths):
        return None
    if low < 0 or not np.isfinite(excesses[low][number]):
        return float(np.exp(log_lengths[high]))
    left, right = excesses[low][number], excesses[high][number]
    part = left / (left - right)
    return float(np.exp(log_lengths[low] + part * (log_lengths[high] - log_lengths[low])))


def _compute_relative_errors(spectrum: Spectrum, maximum: Maximum) -> Array:
    """Return the relative Cramér-Rao bounds of a model, given the bins of a spectrum."""
    times = maximum.times if len(maximum.times) else np.array([1.0])
    whittle = _UntabulatedWhittle(spectrum, float(times[0]) / 2.0, float(times[-1]) * 2.0)
    return compute_relative_bounds(whittle, maximum)


class _UntabulatedWhittle(Whittle):
    """A likelihood that computes Gauss-Markov shapes on demand, without the table of shapes."""

    def gauss_markov(self, time: float) -> Array:
        """Return the density of a Gauss-Markov process of B = 1 in each bin."""
        return self.shape_of.gauss_markov(time)
