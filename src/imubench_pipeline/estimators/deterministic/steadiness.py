"""Whether the power of the fast noise stays the same from the beginning of a log to its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.estimators.deterministic.means import Means

_SECTIONS = 16
_FEWEST = 16
"""Blocks of a section."""

_TREND = 4.5
"""Standard errors of a slope, of 14 degrees of freedom: a chance of 1 in 2000."""

_LEAST_TREND = 0.02
"""Relative change of N over the log that is worth a finding."""

_VARIES = 45.0
"""Chi-squared of 15 degrees of freedom: a chance of 1 in 10,000."""

_LEAST_SPREAD = 0.05
"""Relative standard deviation of N over the sections that is worth a finding."""


@dataclass(frozen=True)
class Steadiness:
    """How the density of the fast noise changes over a log.

    Attributes
    ----------
    trend, trend_error : float
        Relative change of the density N from beginning to end, and its standard error.
    spread : float
        Relative standard deviation of N over sections of the log beyond chance.
    chi_squared : float
        Of the sections about their mean.
    start, end : float
        Of the part that was looked at, s.
    """

    trend: float
    trend_error: float
    spread: float
    chi_squared: float
    start: float
    end: float

    @property
    def grows(self) -> bool:
        """Whether N changes steadily."""
        return abs(self.trend) > _TREND * self.trend_error and abs(self.trend) > _LEAST_TREND

    @property
    def varies(self) -> bool:
        """Whether N changes otherwise."""
        return self.chi_squared > _VARIES and self.spread > _LEAST_SPREAD


def steadiness_of(means: Means) -> Steadiness | None:
    """Return how the power of the fast noise changes over the longest part of a log.

    Returns
    -------
    Steadiness or None
        None for a short log, or one of constant samples.
    """
    part = max(means.parts, key=lambda one: len(one.power))
    size = len(part.power) // _SECTIONS
    if size < _FEWEST or means.block < 2:
        return None
    sections = part.power[: size * _SECTIONS].reshape(_SECTIONS, size)
    there = np.isfinite(sections)
    if (there.sum(axis=1) < _FEWEST // 2).any():
        return None
    count = there.sum(axis=1)
    power = np.nansum(sections, axis=1) / count
    if not (power > 0.0).all():
        return None
    # Heavy tails and bursts scatter the powers of blocks, which widens this with them.
    scatter = np.sqrt(np.nansum((sections - power[:, None]) ** 2, axis=1) / (count - 1) / count)
    level = np.log(power)
    error = scatter / power
    x = np.linspace(-0.5, 0.5, _SECTIONS) * (_SECTIONS - 1) / _SECTIONS
    slope = float(x @ (level - level.mean()) / (x @ x))
    left = level - level.mean() - slope * x
    residual = float(left @ left) / (_SECTIONS - 2)
    slope_error = float(np.sqrt(max(residual, float(np.mean(error**2))) / (x @ x)))
    weight = 1.0 / np.maximum(error, 1e-12) ** 2
    middle = float(weight @ level / weight.sum())
    chi_squared = float(weight @ (level - middle) ** 2)
    beyond = max(float(np.var(level, ddof=1) - np.mean(error**2)), 0.0)
    start = part.start / means.rate
    return Steadiness(
        # N is the square root of the power.
        trend=float(np.expm1(0.5 * slope)),
        trend_error=0.5 * slope_error * float(np.exp(0.5 * slope)),
        spread=0.5 * float(np.sqrt(beyond)),
        chi_squared=chi_squared,
        start=start,
        end=start + size * _SECTIONS * means.interval,
    )
