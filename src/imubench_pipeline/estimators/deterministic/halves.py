"""Comparison of the slow noise on both halves of a log, by a likelihood ratio."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from imubench_pipeline.estimators.deterministic.means import Means
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates
from imubench_pipeline.estimators.spectral_shapes import Shapes
from imubench_pipeline.estimators.whittle import Maximum
from imubench_pipeline.typing import Array

_MIN_BLOCKS = 256
"""Blocks that a part needs to be halved."""

_POWER_RATIOS = np.concatenate(([0.0], np.geomspace(1e-4, 1e4, 241)))
"""Grid of the ratio of slow power in a half of the log to the whole log."""

_WHITE_ROUNDS = 4
_MIN_WHITE_RATIO = 0.1

_MAX_LOG_LIKELIHOOD_RATIO = 13.0
"""Twice the log likelihood ratio above which the halves differ.

It is the 99.97 % quantile of chi-squared, as the other terms are fixed although they are uncertain.
"""


@dataclass(frozen=True)
class Halves:
    """The slow noise of the two halves of a log, with the other terms fixed."""

    of: Literal["K", "slow noise"]  # the random walk, or all terms but the white noise together
    first: float
    second: float
    """Ratio of the slow-noise amplitude in each half to the whole log."""
    ratio: float  # twice the log likelihood ratio of two values against one
    begin: float
    middle: float
    end: float
    """Limits of the halves, s from the first sample."""

    @property
    def differ(self) -> bool:
        """Whether one value does not fit both halves."""
        return self.ratio > _MAX_LOG_LIKELIHOOD_RATIO


def compare_halves(means: Means, noise: Maximum) -> Iterator[Halves]:
    """Yield comparisons of the slow noise on the two halves of the longest part of a log.

    First for the random walk, if there is one, then for all slow noise; none for short logs.
    ``means`` are without deterministic signals, ``noise`` is the fit to the whole log.
    """
    part = means.longest
    half = len(part.mean) // 2
    if half < _MIN_BLOCKS // 2:
        return
    densities = []
    for first in (0, half):
        half_part = replace(part, mean=part.mean[first : first + half], power=part.power[:half])
        ordinates = Ordinates(replace(means, parts=(half_part,)))
        if not ordinates.is_usable:
            return
        densities.append(_compute_densities(ordinates, noise))
    begin = part.start / means.rate
    length = half * means.interval
    for name in ("K", "slow noise"):
        scaled = "K" if name == "K" else "FKG"
        likelihoods = [
            _evaluate_log_likelihoods(nu, data, columns, scaled) for nu, data, columns in densities
        ]
        earlier, later = likelihoods
        if earlier is None or later is None:
            continue
        best = [int(np.argmax(earlier)), int(np.argmax(later))]
        ratio = 2.0 * float(earlier[best[0]] + later[best[1]] - np.max(earlier + later))
        yield Halves(
            "K" if name == "K" else "slow noise",
            math.sqrt(_POWER_RATIOS[best[0]]),
            math.sqrt(_POWER_RATIOS[best[1]]),
            ratio,
            begin,
            begin + length,
            begin + 2.0 * length,
        )


def _compute_densities(
    ordinates: Ordinates, noise: Maximum
) -> tuple[Array, Array, dict[str, Array]]:
    """Return ordinates and density of each bin, and the density of each term in it."""
    spectrum = ordinates.spectrum(ordinates.coefficient, np.ones_like(ordinates.length))
    shapes = Shapes(spectrum)
    units = {"N": shapes.white, "F": shapes.flicker, "K": shapes.random_walk}
    columns = {letter: noise.parameter(letter) ** 2 * units[letter]() for letter in "NFK"}
    columns["G"] = np.zeros(len(spectrum.density))
    for B, time in zip(noise.biases, noise.times, strict=True):
        columns["G"] += B**2 * shapes.gauss_markov(float(time))
    return spectrum.ordinates, spectrum.density, columns


def _evaluate_log_likelihoods(
    nu: Array, data: Array, columns: dict[str, Array], scaled: str
) -> Array | None:
    """Return the log likelihood of a half for each power of ``scaled`` terms; None: they are 0."""
    slow = sum((columns[name] for name in scaled), np.zeros(len(nu)))
    if not slow.any() or not columns["N"].any():
        return None
    white = columns["N"]
    others = [columns[name] for name in columns if name not in scaled and name != "N"]
    rest = sum(others, np.zeros(len(nu))) + _POWER_RATIOS[:, None] * slow
    # White noise has its own power on each half, lest a change of it appear as slow noise.
    power = np.ones((len(rest), 1))
    for _ in range(_WHITE_ROUNDS):
        weight = nu / (rest + power * white) ** 2
        above = np.sum(weight * white * (data - rest), axis=1)
        power = (above / np.sum(weight * white**2, axis=1))[:, None]
        power = np.clip(power, _MIN_WHITE_RATIO, 1.0 / _MIN_WHITE_RATIO)
    density = rest + power * white
    return np.asarray(-0.5 * np.sum(nu * (np.log(density) + data / density), axis=1))
