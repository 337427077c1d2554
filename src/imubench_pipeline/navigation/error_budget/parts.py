"""Parts of an error budget: the contributions of its sources."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from imubench_pipeline.model.states import Measured, SourcePath
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget.in_use import Figure
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.typing import Array

Quantity = Literal["attitude", "heading", "velocity", "position", "cross_track"]


def describe_term(measured: Measured, term: Term, through: SourcePath | None = None) -> ErrorSource:
    """Return a noise term as the source of an error."""
    values = term.values
    return ErrorSource(term.word, measured, through, values.get("T_B"), values.get("frequency"))


@dataclass(frozen=True)
class Contribution:
    """Contribution of one source to an error."""

    source: ErrorSource
    sigma: float  # 1 sigma, rad, m/s or m
    figure: Figure | None = None  # the figure that it follows from, if it is not noise
    # error in the horizontal plane, the real part along the axis; None: an error along the axis,
    # and an independent one of the same size across it
    vector: complex | None = None


@dataclass(frozen=True)
class Budget:
    """An error and its contributions, which are independent of each other."""

    time: float  # s
    # attitude (a tilt) and heading in rad, velocity in m/s, position and cross-track error in m
    quantity: Quantity
    contributions: Sequence[Contribution]

    @property
    def total(self) -> float:
        """The error, 1 sigma: the root of the sum of the squares of the contributions."""
        return math.hypot(*(contribution.sigma for contribution in self.contributions))

    def to_radius(self, confidence: float) -> "Budget":
        """Return the budget of the error in the plane, of velocity or position.

        A contribution along one axis acts along the other, too. The total is R / z. With the
        probability ``confidence``, the error is within the radius R, and an error along one axis is
        within z standard deviations.
        """
        along = math.fsum(part.sigma**2 for part in self.contributions if part.vector is None)
        vectors = [part.vector for part in self.contributions if part.vector is not None]
        factor = float(compute_radius_factor(along, vectors, confidence))
        return replace(
            self,
            contributions=[
                replace(
                    part,
                    sigma=factor * part.sigma * (math.sqrt(2.0) if part.vector is None else 1.0),
                )
                for part in self.contributions
            ],
        )


def compute_radius_factor(
    along: float | Array,
    vectors: Sequence[complex | NDArray[np.complexfloating]],
    confidence: float,
) -> Array:
    """Return the factor of `tabulate_radii` for a sum of independent errors, shape () or (draws,).

    ``along`` is the variance, along each of two axes, of errors without a direction; ``vectors``
    are errors with a direction.
    """
    # The variances along the main axes are the mean plus and minus this.
    mean = along + sum(np.abs(vector) ** 2 for vector in vectors) / 2.0
    apart = np.abs(sum(vector**2 for vector in vectors)) / 2.0
    ratio = np.sqrt(np.maximum(mean - apart, 0.0) / np.maximum(mean + apart, _NO_VARIANCE))
    return np.asarray(np.interp(ratio, *tabulate_radii(confidence)))


_NO_VARIANCE = 1e-300  # divides 0 without an error
_RADIUS_STEPS = 33
_ANGLES = 4096


@cache
def tabulate_radii(confidence: float) -> tuple[Array, Array]:
    """Return ratios of the standard deviations along two axes, and factors for the radius.

    A factor is R / (z sqrt(s1^2 + s2^2)), with the standard deviations s1 and s2 and the two-sided
    normal quantile z of ``confidence``. The probability within a radius R is the mean, over all
    angles a, of (1 - exp(-R^2 g / 2)) / (g s1 s2), with g = cos(a)^2 / s1^2 + sin(a)^2 / s2^2.
    """
    ratios = np.linspace(0.0, 1.0, _RADIUS_STEPS)
    z = NormalDist().inv_cdf((1.0 + confidence) / 2.0)
    angle = (np.arange(_ANGLES) + 0.5) * math.pi / _ANGLES
    factors = [1.0]
    for ratio in ratios[1:]:
        g = np.cos(angle) ** 2 + np.sin(angle) ** 2 / ratio**2

        def excess(radius: float, g: Array = g, ratio: float = ratio) -> float:
            return float(np.mean(-np.expm1(-(radius**2) * g / 2.0) / (g * ratio))) - confidence

        factors.append(brentq(excess, 1e-3, 20.0) / (z * math.hypot(1.0, ratio)))
    return ratios, np.array(factors)
