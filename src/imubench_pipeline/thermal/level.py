"""How well the mean of a log is known, with the noise that it has."""

from __future__ import annotations

import math
from collections.abc import Iterable

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.spectrum import Spectrum


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
    """
    return math.sqrt(sum(share * _variance(model, spectrum) for model, share in models))


def _variance(model: NoiseModel, spectrum: Spectrum) -> float:
    T, whole = 1.0 / spectrum.rate, spectrum.duration
    total = model.N**2 / whole + model.K**2 * whole / 3.0
    for term in model.realised(T, whole):
        T_B = getattr(term, "T_B", None)
        if T_B is not None:
            variance = float(term.state_space(T).initial_variance[0, 0])
            x = whole / T_B
            total += 2.0 * variance / x * (1.0 + math.expm1(-x) / x)
    return total
