"""The limits of an Allan curve from the spectrum that was fitted to the same log.

The power law at each tau ignores noise a decade away, which the fitted model includes. A log that
happens to show little random walk has too low a curve at its end: the upper limit there allows for
a walk one standard error above the fitted one. (Without this, the coverage was 90 to 93 %.)
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import FITTED, POWER_LAW, AllanCurve
from imubench_pipeline.allan.phase import Presence, Span
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.whittle import make_noise_model
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.spectral_degrees import compute_degrees_of_freedom
from imubench_pipeline.typing import Array

_MIN_CLUSTERS = 100
_MIN_TAU_TIMES_BAND = 1.0  # Below it the curve contains frequencies that were not fitted


def add_fitted_limits(
    curve: AllanCurve,
    likelihood: Likelihood,
    segments: tuple[Span, ...] | None = None,
    presence: Presence | None = None,
) -> AllanCurve:
    """Return a curve with the degrees of freedom that the fitted spectrum implies.

    The smaller of these degrees of freedom and the values of the identified power law apply where
    the model does not explain the log, and at tau so short that the curve shows frequencies that
    were not fitted. Without a fit the curve is unchanged. ``segments`` are the first and
    one-past-last sample of each segment; ``presence`` is needed if samples are missing.
    """
    if not likelihood.candidates or likelihood.band is None:
        return curve
    chosen, rate = likelihood.candidates[0], curve.rate
    sinusoids = [line.term for line in likelihood.lines if line.narrow]
    model = replace(make_noise_model(chosen.maximum), sinusoids=sinusoids)

    def degrees_at(model: NoiseModel, points: NDArray[np.bool_]) -> tuple[Array, Array]:
        sizes, log = curve.cluster_size[points], (curve.samples, segments, presence)
        return compute_degrees_of_freedom(model, rate, sizes, *log, curve.share[points])

    edf, upper = degrees_at(model, np.ones(len(curve.tau), dtype=np.bool_))
    walk = likelihood.estimates[0].parameters.get("K")
    most_walk = walk.upper if walk is not None else None
    few = curve.cluster_size * _MIN_CLUSTERS > curve.samples
    if most_walk is not None and most_walk > model.K and few.any():
        walking = replace(model, K=(model.K + most_walk) / 2.0)
        upper[few] = np.minimum(upper[few], degrees_at(walking, few)[1])
    doubtful = np.full(len(curve.tau), chosen.goodness.verdict != "explained")
    if likelihood.band.highest < 0.5 * rate * (1.0 - 1e-9):
        doubtful |= curve.tau * likelihood.band.highest < _MIN_TAU_TIMES_BAND
    fitted = ~doubtful | (edf < curve.edf)
    return replace(
        curve,
        edf=np.where(fitted, edf, curve.edf),
        edf_upper=np.where(fitted, upper, curve.edf_upper),
        edf_source=tuple(FITTED if is_fitted else POWER_LAW for is_fitted in fitted),
    )
