"""How well the mean of a log is known, with the noise that it has."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from imubench_pipeline.noise.growth import mean_variance

_UPPER_OF_RMS = 2.24
"""The 97.5 % limit of the size of a normal variate, over its standard deviation."""


def with_likely_walk(model: NoiseModel, K: Parameter) -> NoiseModel:
    """Return a model with a random walk as strong as it may be where the log does not show one.

    The most likely walk is then often none at all, which would leave the mean all too sure: the
    rms of K over its posterior, half a normal distribution, is taken.

    Parameters
    ----------
    model : NoiseModel
        With a random walk, of which nothing may be left.
    K : Parameter
        As it is told: its upper limit counts where it is absent.
    """
    if K.status != "absent" or K.upper is None:
        return model
    return replace(model, K=max(model.K, K.upper / _UPPER_OF_RMS))


def mean_error(models: Iterable[tuple[NoiseModel, float]], spectrum: Spectrum) -> float:
    """Return the standard deviation of the mean of a log about the bias at its beginning.

    A random walk counts from 0 at the beginning of the log: sigma^2 = N^2 / D + K^2 D / 3 and, of
    a process of variance v, 2 v T_B / D (1 - T_B / D (1 - e^(-D / T_B))), D long.

    Parameters
    ----------
    models : iterable of (NoiseModel, float)
        Models that the log does not rule out and their shares of 1: a walk that is too weak to be
        the choice may still carry the mean away.
    spectrum : Spectrum
        Of the log: its rate, and its length.

    Returns
    -------
    float
        rad/s or m/s².
    """
    return math.sqrt(sum(share * _variance(model, spectrum) for model, share in models))


def _variance(model: NoiseModel, spectrum: Spectrum) -> float:
    T, whole = 1.0 / spectrum.rate, spectrum.duration
    # What begins at 0 has been on since the beginning of the log; a ramp is no part of the bias.
    return sum(
        mean_variance(term, whole, 0.0)
        for term in model.realised(T, whole)
        if isinstance(term, WhiteNoise | GaussMarkov | RandomWalk)
    )
