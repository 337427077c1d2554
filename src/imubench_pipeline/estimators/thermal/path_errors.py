"""Effect of errors of the temperature path: on the estimate, and on the residual.

A register determines the path only within its resolution. Errors that correlate with the
temperature move s, q and the lag; the rest, times s, remains in the log as additional noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.thermal.path import lagged_path
from imubench_pipeline.estimators.thermal.regression import Regression, Regressors
from imubench_pipeline.estimators.whittle import Terms, Whittle
from imubench_pipeline.typing import Array

_MAX_NEGLIGIBLE_ERROR = 0.02
"""Contribution of path errors to a bin, in its standard errors, below which it is ignored."""

_MAX_ROUNDS = 40
_TOLERANCE = 1e-3
_MIN_NOISE_FRACTION = 0.1
"""Minimum fraction of the power of a bin that is noise, so that each bin keeps some weight."""


@dataclass(frozen=True)
class PathErrors:
    """What the drawn paths of a temperature do."""

    moved: Array
    """(d, p + 1): how each draw moves the regressors of temperature (p), SI per K and K², and the
    lag, s."""
    density: Array
    """(b,): mean density of what they leave in each bin of the spectrum, (rad/s)²/Hz or
    (m/s²)²/Hz."""


def compute_path_errors(
    regressors: Regressors, regression: Regression, weights: Array
) -> PathErrors:
    """Return what the drawn paths do to an estimate, to first order.

    ``weights``, shape (b,), are nu / S of the bins used, as `Regressors.at` takes them.
    """
    path, p = regressors.path, regressors.thermal
    knots, slope = regressors.knots(regression.lag), regressors.slope(regression)
    step = max(
        0.05 * regression.lag, 0.5 * float(np.median(np.diff(path.sample))) / regressors.rate
    )
    by_lag = slope * (regressors.knots(regression.lag + step) - knots) / step
    columns = regressors.columns(regression.lag)
    columns.extend(regressors.coefficients.of_knots(path, [by_lag]))
    full = np.zeros(len(regressors.used))
    full[regressors.used] = weights
    gram = regressors.coefficients.products(columns).gram
    information = np.einsum("b,bij->ij", full, gram)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    # A lag that the log hardly tells must not carry the error of the path away.
    inverse = np.linalg.inv(information / np.outer(scale, scale) + 1e-6 * np.eye(len(scale)))
    errors = [
        slope * lagged_path(path, draw - path.value, regressors.rate, regression.lag)
        for draw in path.draws
    ]
    moved, density = [], np.zeros(len(full))
    for other in regressors.coefficients.of_knots(path, errors):
        shared = regressors.coefficients.products([*columns, other]).gram[:, -1]
        own = inverse @ ((full @ shared[:, :-1]) / scale) / scale
        moved.append(own)
        density += shared[:, -1] - 2.0 * shared[:, :-1] @ own
        density += np.einsum("i,bij,j->b", own, gram, own)
    at = np.array(moved)
    return PathErrors(
        np.column_stack([at[:, :p], at[:, -1]]), np.maximum(density / len(errors), 0.0)
    )


def subtract_path_errors(
    left: Spectrum, used: NDArray[np.bool_], whittle: Whittle, terms: Terms, errors: Array
) -> Spectrum:
    """Return the spectrum that tells of the noise alone, not of what errors of the path leave.

    A bin of density S of noise and P of errors tells of the noise as one of density S, measured S /
    (S + P) times as high, with (S / (S + P))^2 of its ordinates. S is that of a noise model fitted
    to what is left so, in turn with the parts. Bins that are not ``used``, and all where P is small
    beside S, stay as they are.

    Parameters
    ----------
    left : Spectrum
        Of what temperature leaves, errors of the path and all.
    whittle : Whittle
        The likelihood in the bins used.
    errors : ndarray, shape (b,)
        P, (rad/s)²/Hz or (m/s²)²/Hz.

    References
    ----------
    D. A. Harville, "Maximum likelihood approaches to variance component estimation", J. Am. Stat.
    Assoc. 72, 1977.
    """
    fitted, added = left.select(used), errors[used]
    density = whittle.density(whittle.of(fitted).maximum(terms))
    if not (added * np.sqrt(fitted.ordinates) > _MAX_NEGLIGIBLE_ERROR * density).any():
        return left
    part_of_noise = np.ones(len(added))
    for _ in range(_MAX_ROUNDS):
        before, part_of_noise = (
            part_of_noise,
            np.maximum(density / (density + added), _MIN_NOISE_FRACTION),
        )
        if np.abs(part_of_noise - before).max() < _TOLERANCE:
            break
        own = whittle.of(_of_noise(fitted, part_of_noise))
        density = own.density(own.maximum(terms))
    everywhere = np.ones(len(used))
    everywhere[used] = part_of_noise
    return _of_noise(left, everywhere)


def _of_noise(spectrum: Spectrum, part: Array) -> Spectrum:
    """Return the spectrum of noise that makes up a part of each bin's power."""
    return replace(
        spectrum,
        ordinates=spectrum.ordinates * part**2,
        density=spectrum.density * part,
        cross=spectrum.cross * part,
        ramp=spectrum.ramp * part,
    )
