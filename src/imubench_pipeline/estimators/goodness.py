"""Goodness-of-fit tests of a model, on the standardised residuals of a spectrum."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erfc, polygamma, psi

from imubench_pipeline.model.states import GoodnessVerdict
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra as texts

MIN_FIT_CHANCE = 1e-3  # Probability below which a fit is rejected


@dataclass(frozen=True)
class Goodness:
    """Result of the goodness-of-fit tests of a model."""

    deviance: float  # mean deviance of a bin; about 1.0 where the model is right
    chance: float
    """Chance of so large a deviance, or so long runs of bins on one side, if the model is right."""
    verdict: GoodnessVerdict
    where: str  # the frequencies at which the spectrum is furthest from the model


def assess_goodness_of_fit(
    nu: Array, data: Array, density: Array, frequency: Array, parameters: int
) -> Goodness:
    """Test the standardised residuals of a binned spectrum, its columns of shape (b,).

    Two tests, each at half the chance: the deviance sum nu (r - 1 - log r) with r = I / S, measured
    over fitted density, whose mean and variance equal those of chi-squared variates; and the
    correlation of neighbouring residuals, which shows a shape that the model does not have.
    ``parameters`` are the free ones of the model.
    """
    ratio = np.maximum(data, 1e-300 * density) / density
    deviance = nu * (ratio - 1.0 - np.log(ratio))
    # With x = nu r chi-squared: E[r - 1 - log r] = log(nu/2) - psi(nu/2).
    expected = nu * (np.log(nu / 2.0) - psi(nu / 2.0))
    variance = nu**2 * (polygamma(1, nu / 2.0) - 2.0 / nu)
    bins = len(nu)
    free = max(bins - parameters, 1)
    far = (deviance.sum() - expected.sum() * free / bins) / math.sqrt(float(variance.sum()))
    # Wilson and Hilferty: the cube root of r is very nearly normal.
    ninth = 2.0 / (9.0 * nu)
    residual = (np.cbrt(ratio) - (1.0 - ninth)) / np.sqrt(ninth)
    residual = residual - residual.mean()
    spread = max(float(residual @ residual), 1e-300)
    correlation = float(residual[1:] @ residual[:-1]) / spread * math.sqrt(bins)
    chance = min(1.0, 2.0 * min(0.5 * float(erfc(z / math.sqrt(2.0))) for z in (far, correlation)))
    return Goodness(
        deviance=float(deviance.sum() / expected.sum() * bins / free),
        chance=chance,
        verdict="explained" if chance >= MIN_FIT_CHANCE else "not explained",
        where=_describe_worst_band(residual, frequency),
    )


def _describe_worst_band(residual: Array, frequency: Array) -> str:
    """Return a description of the sixth of a decade with the largest mean residual."""
    group = np.floor(np.log10(frequency) * 6.0)
    best, text = -1.0, ""
    for number in np.unique(group):
        inside = group == number
        total = float(residual[inside].sum()) / math.sqrt(float(inside.sum()))
        if abs(total) > best:
            best = abs(total)
            first, last = frequency[inside][[0, -1]]
            text = texts.worst_band(float(first), float(last), best, above=total > 0)
    return text
