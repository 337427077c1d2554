"""Agreement of a model's curve, and of logs simulated from it, with the measured curve.

At long tau the curve of one simulated log scatters widely: a single draw (Maia et al., Table 3)
ranks no method. The scores use the curve of the model, and the distribution over many draws. Each
tau is weighted by the precision of the measured curve.
"""

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.typing import Array

SUREST = 0.02
"""Relative error below which the weight is constant: else the shortest tau alone would count."""


@dataclass(frozen=True)
class Scores:
    """Scores of one model; for draws, the median of single ones and its 90 % range."""

    rms: float
    """Weighted RMS over tau of the model's Allan deviation less the measured one, rad/s or m/s²."""
    rms_log10: float  # the same of the difference of log10, decades
    drawn: float
    drawn_lower: float
    drawn_upper: float
    """``rms`` of single draws."""
    drawn_log10: float
    drawn_log10_lower: float
    drawn_log10_upper: float
    """``rms_log10`` of single draws."""
    whole: float
    whole_lower: float
    whole_upper: float
    """RMS of single draws with equal weights up to the longest tau, as in Maia et al., Table 3."""
    inside_band: float  # share of the measured curve inside the 95 % band of the draws


def weights(error: Array) -> Array:
    """Return the weight of each tau, sum 1, from its relative standard error; shapes (m,)."""
    weight = 1.0 / (error**2 + SUREST**2)
    return np.asarray(weight / weight.sum())


def rms(one: Array, other: Array, weight: Array | None = None) -> Array:
    """Return the RMS difference of curves, along the last axis; weights of shape (m,), sum 1."""
    return np.asarray(np.sqrt(np.average((one - other) ** 2, axis=-1, weights=weight)))


def beats(one: Array, other: Array) -> float:
    """Return the probability that a value of ``one``, shape (k,), is below a value of ``other``."""
    place = np.searchsorted(np.sort(other), one, side="right")
    return float(1.0 - np.mean(place) / other.size)


def score(measured: Array, error: Array, model: Array, draws: Array) -> Scores:
    """Score the curves of a model, shape (m,), and of its draws, (k, m), against ``measured``.

    Curves in SI. ``error``, (m,): relative standard error of ``measured``; it gives the weights.
    """
    weight = weights(error)
    lower, upper = np.quantile(draws, [0.025, 0.975], axis=0)
    logarithm = np.log10(measured)
    return Scores(
        float(rms(model, measured, weight)),
        float(rms(np.log10(model), logarithm, weight)),
        *_spread(rms(draws, measured, weight)),
        *_spread(rms(np.log10(draws), logarithm, weight)),
        *_spread(rms(draws, measured)),
        inside_band=float(np.mean((measured >= lower) & (measured <= upper))),
    )


def _spread(values: Array) -> tuple[float, float, float]:
    """Return the median, and the ends of the 90 % range."""
    lower, median, upper = np.quantile(values, [0.05, 0.5, 0.95])
    return float(median), float(lower), float(upper)
