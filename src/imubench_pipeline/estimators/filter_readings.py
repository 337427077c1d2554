"""What the filters that a log allows make of N before the filter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.estimators.estimate import SIGMAS
from imubench_pipeline.estimators.filter_fits import FilterTrial
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.typing import Array

_TWIN = 0.1
"""Weight of the same first-order filter applied to the samples: it looks like that before the
sampling, whose folds are in N."""


@dataclass(frozen=True)
class Reading:
    """What a filter that the log allows makes of N.

    Attributes
    ----------
    weight : float
        Of the filter, by its likelihood.
    below, at, above : float
        Logarithm of N at the lower limit of the cut-off, at its best and at its upper limit, less
        that of the filter that was chosen.
    """

    weight: float
    below: float
    at: float
    above: float


@dataclass(frozen=True)
class Allowed:
    """A filter that the log does not rule out.

    Attributes
    ----------
    filter : Tried
        At its best cut-off.
    half_width : float
        Half of the 95 % interval of the logarithm of its cut-off.
    """

    filter: FilterTrial
    half_width: float

    def at(self, x: float) -> FilterTrial:
        """Return it at a logarithm of the cut-off, Hz."""
        return replace(self.filter, cutoff=math.exp(x))


@dataclass(frozen=True)
class OfModel:
    """What the filters make of N in a model of the noise, each fitted together with it.

    Attributes
    ----------
    readings : sequence of Reading
        Over N at the cut-off that was chosen, in the same model.
    gained : float
        Log likelihood of the model with a cut-off of its own, less that with the chosen one.
    """

    readings: Sequence[Reading]
    gained: float


def also_after_sampling(reading: Reading, trial: FilterTrial, rate: float) -> Reading:
    """Return the reading of the same first-order filter applied to the samples.

    Its shape is the same, and it folds nothing into N.

    Parameters
    ----------
    reading : Reading
    trial : Tried
        An analogue filter of first order.
    rate : float
        Hz.
    """
    gain = 0.5 * math.log(float(LowPass(trial.cutoff).folded_power(0.0, rate)))
    return Reading(
        _TWIN * reading.weight, reading.below + gain, reading.at + gain, reading.above + gain
    )


def draw_factors(readings: Sequence[Reading], number: int, rng: np.random.Generator) -> Array:
    """Return draws of N over its value for the filter that was chosen, shape (number,).

    Parameters
    ----------
    readings : sequence of Reading
        At least one.
    number : int
    rng : numpy.random.Generator
    """
    weight = np.array([reading.weight for reading in readings])
    which = rng.choice(len(weight), number, p=weight / weight.sum())
    below, at, above = (
        np.array([getattr(reading, name) for reading in readings])[which]
        for name in ("below", "at", "above")
    )
    normal = rng.standard_normal(number)
    side = np.where(normal < 0.0, at - below, above - at)
    return np.asarray(np.exp(at + normal / SIGMAS * side))
