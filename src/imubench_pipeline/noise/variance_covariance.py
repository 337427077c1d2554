"""Covariance of the Allan variance estimates of one log, at all cluster sizes.

Estimates at different tau use the same samples, so that neighbours are correlated. For a Gaussian
log their covariance follows from the spectrum of the samples.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.typing import Array

_STRATA_PER_DECADE = 640
_MIN_PHASE_OF_LARGEST = 1e-3  # rad in the largest cluster; integrands are flat below it
_GOLDEN_SECTION = (np.sqrt(5.0) - 1.0) / 2.0

_CLUSTERS_LOST_AT_ENDS = 1.5
"""Effective loss of clusters at the ends of a log.

Two are lost because a difference spans two clusters. Half a cluster is gained, because correlated
differences have fewer neighbours near the ends. Exact double sums over white noise, random walks
and Gauss-Markov processes of any T_B give 1.2 to 1.7.
"""


def compute_variance_covariance(
    model: NoiseModel, rate: float, samples: int, sizes: NDArray[np.int64]
) -> Array:
    """Return the covariance of the Allan variance estimates of a Gaussian log.

    With P the spectrum of the samples and |H_n|^2 = 4 sin^4(n w/2) / (n^2 sin^2(w/2)),

        cov(n, m) = 1/(2 M) 1/(2 pi) int P^2 |H_n|^2 |H_m|^2 dw,   M = L - 3/2 min(n, m) + 1,

    integrated with stratified sampling in log w, one point per stratum. The error of the standard
    deviation is below 1.5 % for tau up to a ninth of the log, and 5 % up to a quarter. ``sizes``,
    shape (m,), are the cluster sizes n, at most L/2; L is ``samples``. The covariance, (rad/s)^4 or
    (m/s²)^4, (m, m), is positive semi-definite. (D. Percival and A. Walden, "Wavelet Methods for
    Time Series Analysis", 2000, section 8.3; the factor M here is fitted to exact sums.)
    """
    n = np.asarray(sizes, dtype=np.float64)
    omega, width = _make_strata(int(sizes.max()))
    half = omega / 2.0
    spectrum = model.sampled_spectrum(omega, rate) / np.sin(half) ** 2
    # The integral over all frequencies is twice the integral over the positive ones.
    shaped = _shape_differences(tuple(n.tolist())) * (4.0 * spectrum * np.sqrt(width / np.pi))
    shaped /= (n**2)[:, None]
    effective = samples - _CLUSTERS_LOST_AT_ENDS * np.minimum.outer(n, n) + 1.0
    return np.asarray(shaped @ shaped.T / (2.0 * effective))


@lru_cache(maxsize=4)  # the channels and methods of a log have the same sizes
def _shape_differences(sizes: tuple[float, ...]) -> Array:
    """Return sin^4(n w/2) of all sizes n and strata, shape (sizes, strata)."""
    omega, _ = _make_strata(int(max(sizes)))
    shaped = np.sin(np.outer(sizes, omega / 2.0))
    shaped *= shaped
    shaped *= shaped
    return shaped


@lru_cache(maxsize=16)
def _make_strata(largest: int) -> tuple[Array, Array]:
    """Return a frequency in each stratum, rad per sample, and the widths of the strata."""
    # The factors sin^4(n w/2) oscillate many times within a stratum of high frequency. Points at
    # multiples of the golden section (a low-discrepancy sequence) give their mean.
    lowest = _MIN_PHASE_OF_LARGEST / largest
    number = int(np.ceil(_STRATA_PER_DECADE * np.log10(np.pi / lowest)))
    edges = np.concatenate(([0.0], np.geomspace(lowest, np.pi, number)))
    width = np.diff(edges)
    place = np.modf((np.arange(number) + 0.5) * _GOLDEN_SECTION)[0]
    return edges[:-1] + place * width, width
