"""Flicker noise, continuous and sampled, and its approximation by Gauss-Markov processes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from imubench_pipeline.noise.flicker_growth import after_window, since_switch_on
from imubench_pipeline.noise.growth import Calibrated, SensorStart
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.noise.terms.gauss_markov import (
    BIAS_INSTABILITY,
    FLOOR,
    PEAK_TAU,
    GaussMarkov,
    sampled_gauss_markov_shape,
)
from imubench_pipeline.noise.terms.traits import Drive, Reading, Role, SampleBlocks
from imubench_pipeline.noise.terms.white_noise import WhiteNoise
from imubench_pipeline.typing import Array

_MIN_LAG_FOR_SERIES = 100
"""Least lag, in blocks, at which the series of the covariance is used, since the closed form
cancels."""

_MEMBERS_PER_DECADE = 2.5
_POINTS_PER_DECADE = 20
_LAST_TIME_FACTOR = 4.0
"""Ratio of the longest correlation time of the bank to the one with its peak at the end of the
band."""

_MAX_EXACT_SIZE = 1 << 12
"""Largest cluster size with an exact sum for the Allan variance of sampled flicker noise."""


@dataclass(frozen=True)
class Flicker(Term):
    """Flicker noise, 1/f: bias instability B as IEEE Std 952 defines it.

    It has no finite state space; `bank` approximates it.
    """

    B: float
    symbol = "F"
    label = "flicker noise"
    standard_name = "bias instability (flicker)"
    word = "flicker"
    role = Role.SLOW
    parameters = (BIAS_INSTABILITY,)
    states = ()

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """B^2 / (2 pi f)."""
        return self.B**2 / (2.0 * np.pi * np.abs(frequency))

    def allan_variance(self, tau: Array) -> Array:
        """(2 ln 2 / pi) B^2 at every tau."""
        return FLOOR**2 * self.B**2 * np.ones_like(tau)

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """2 B^2 / (pi n^2) times the integral of sin^4(n x) / sin^3(x) from 0 to pi/2."""
        return 2.0 / np.pi * self.B**2 * sampled_flicker_shape(n)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """B^2 / sqrt(2 - 2 cos(omega))."""
        return self.B**2 / np.abs(2.0 * np.sin(omega / 2.0))

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """B^2 / (2 pi) k^2 ln(k), as sampled."""
        return 0.5 / np.pi * self.B**2 * sampled_flicker_sums(np.abs(lags))

    def state_space(self, interval: float) -> StateSpace:
        """Raise ValueError: there is no finite state space."""
        raise ValueError("flicker noise has no finite state space; take its Gauss-Markov bank")

    def continuous_space(self) -> ContinuousSpace | None:
        """None, see `state_space`."""
        return None

    @property
    def drive(self) -> Drive:
        """B of flicker noise."""
        return Drive(flicker=self.B)

    def realised(self, interval: float, longest: float) -> Sequence[Term]:
        """Return its `bank`."""
        return bank(self.B, interval, longest)

    def as_unit(self) -> tuple[float, Term]:
        """B^2 and B = 1."""
        return self.B**2, Flicker(1.0)

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """B^2 t^(2m+2) times a function of the window, or the time since switch-on, over t.

        See `noise.flicker_growth`.
        """
        scale = self.B**2 * time ** (2 * order + 2)
        if isinstance(start, Calibrated):
            return scale * after_window(order, start.window / time)
        return scale * since_switch_on(order, start.on_time / time)

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """0: flicker noise has no finite state that could be known.

        A filter predicts with the `bank`, see `realised`.
        """
        return np.zeros_like(time), np.zeros_like(time)

    def block_covariance(self, lags: Array, block: float) -> Array:
        """-(B^2 / pi) times the second difference of k^2 (ln k - 3/2) / 2."""
        return -(self.B**2) / math.pi * _average_logarithm(lags)

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """Raise TypeError: it has no covariance."""
        raise TypeError("flicker noise has no covariance; take its Gauss-Markov bank")

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Raise TypeError: block sums are drawn from its bank."""
        raise TypeError("flicker noise has no finite state space; take its Gauss-Markov bank")

    def reading(self, lowest_tau: float) -> Reading:
        """0.664 B at every tau; read where the curve is lowest."""
        return Reading(lowest_tau, FLOOR * self.B, "B", FLOOR)

    @property
    def in_words(self) -> str:
        """B."""
        return f"flicker noise B = {self.B:.3e}"


def _average_logarithm(lags: Array) -> Array:
    """Return the mean of ln|s - s'| over two blocks of length 1 at a distance of k."""
    k = np.maximum(lags, 1.0)
    far = np.maximum(k, _MIN_LAG_FOR_SERIES)
    series = np.log(far) - 1.0 / (12.0 * far**2) - 1.0 / (60.0 * far**4)
    near = np.minimum(k, _MIN_LAG_FOR_SERIES)
    closed = 0.5 * (
        _integrate_logarithm_twice(near + 1.0)
        - 2.0 * _integrate_logarithm_twice(near)
        + _integrate_logarithm_twice(near - 1.0)
    )
    return np.where(lags == 0.0, -1.5, np.where(k < _MIN_LAG_FOR_SERIES, closed, series))


def _integrate_logarithm_twice(x: Array) -> Array:
    """Return twice the double integral of ln x."""
    return x**2 * (np.log(np.maximum(x, 1e-300)) - 1.5)


def bank(B: float, interval: float, longest: float) -> list[Term]:
    """Return Gauss-Markov processes whose samples have the Allan variance of flicker noise.

    Their correlation times are spaced evenly on a log scale from half a sampling interval, five in
    two decades; white noise replaces shorter ones. The variances are fitted to the Allan variance
    of sampled flicker noise by non-negative least squares.

    Parameters
    ----------
    B : float
        Bias instability, rad/s or m/s²; the plateau is 0.664 B.
    interval : float
        Sampling interval, s: the shortest tau of the band.
    longest : float
        Longest tau of the band, s.

    Returns
    -------
    list of Term
        Gauss-Markov processes, and white noise.

    Raises
    ------
    ValueError
        If the band is empty.
    """
    if not 0 < interval < longest:
        raise ValueError(f"the band from {interval} to {longest} s is empty")
    times, levels, white = _fit_unit_bank(round(math.log10(longest / interval), 6))
    terms: list[Term] = [
        GaussMarkov(B * level, interval * time)
        for time, level in zip(times, levels, strict=True)
        if level > 0
    ]
    return [*terms, WhiteNoise(B * white * math.sqrt(interval))] if white else terms


def ripple(interval: float, longest: float) -> tuple[float, float]:
    """Return the largest relative errors of a bank within its band.

    The first is for the sampled Allan variance at tau from ``interval`` to ``longest``, the second
    for the spectrum of the samples at frequencies from 1 / (2 longest) to Nyquist. Both are
    relative to sampled flicker noise.
    """
    terms = bank(1.0, interval, longest)
    points = math.ceil(math.log10(longest / interval) * _POINTS_PER_DECADE * 2)
    n = np.unique(np.rint(np.geomspace(1.0, longest / interval, points)))
    omega = np.pi / n
    variance = np.sum([term.sampled_allan_variance(n, interval) for term in terms], axis=0)
    density = np.sum([term.sampled_spectrum(omega, interval) for term in terms], axis=0)
    flicker = Flicker(1.0)
    return (
        float(np.max(np.abs(variance / flicker.sampled_allan_variance(n, interval) - 1.0))),
        float(np.max(np.abs(density / flicker.sampled_spectrum(omega, interval) - 1.0))),
    )


@lru_cache(maxsize=16)
def _fit_unit_bank(decades: float) -> tuple[Array, Array, float]:
    """Return correlation times, their B, and N, for B = 1 and tau from 1 s to 10^decades s."""
    first, last = 0.5, max(10.0**decades / PEAK_TAU * _LAST_TIME_FACTOR, 1.0)
    members = 1 + math.ceil(math.log10(last / first) * _MEMBERS_PER_DECADE)
    times = np.geomspace(first, last, members)
    n = np.unique(np.rint(np.geomspace(1.0, 10.0**decades, 2 + int(decades * _POINTS_PER_DECADE))))
    wanted = Flicker(1.0).sampled_allan_variance(n, 1.0)
    shapes = [
        GaussMarkov(1.0, time).density * sampled_gauss_markov_shape(n, 1.0, time) for time in times
    ]
    powers, _ = nnls(np.column_stack([*shapes, 1.0 / n]) / wanted[:, None], np.ones_like(n))
    return times, np.sqrt(powers[:-1]), math.sqrt(powers[-1])


def sampled_flicker_shape(n: ArrayLike) -> Array:
    """Return n^-2 times the integral of sin^4(n x) / sin^3(x) from 0 to pi/2; ln 2 for large n."""
    sizes = np.asarray(n, dtype=np.float64)
    table = _tabulate_integrals()
    # 1/sin^3(x) = 1/x^3 + 1/(2x) + ...: the second term adds (3/16) ln n and a constant.
    beyond = table[-1] - math.log(2.0) * _MAX_EXACT_SIZE**2 - 3.0 / 16.0 * math.log(_MAX_EXACT_SIZE)
    index = np.clip(np.rint(sizes), 1, _MAX_EXACT_SIZE).astype(np.int64)
    large = math.log(2.0) + (3.0 / 16.0 * np.log(sizes) + beyond) / sizes**2
    return np.where(sizes <= _MAX_EXACT_SIZE, table[index - 1] / index**2, large)


def sampled_flicker_sums(lags: Array) -> Array:
    """Return the covariance of cumulative sums at integer lags, except a multiple of lag^2.

    It is minus half the integral of (1 - cos(2 k x)) / sin^3(x) from 0 to pi/2, which for long lags
    is k^2 ln(k), as in continuous time. All lags of a call use the same formula.
    """
    if lags.max() <= 2 * _MAX_EXACT_SIZE:
        return -0.5 * _tabulate_sums()[np.rint(lags).astype(np.int64)]
    return np.asarray(lags**2 * np.log(np.maximum(lags, 1.0)))


@lru_cache(maxsize=1)
def _tabulate_integrals() -> Array:
    """Return the integral of sin^4(n x) / sin^3(x) from 0 to pi/2 for n = 1 to `_MAX_EXACT_SIZE`.

    sin^4(n x) = (3 - 4 cos(2 n x) + cos(4 n x)) / 8.
    """
    integral = _tabulate_sums()
    sizes = np.arange(1, _MAX_EXACT_SIZE + 1)
    return np.asarray((4.0 * integral[sizes] - integral[2 * sizes]) / 8.0)


@lru_cache(maxsize=1)
def _tabulate_sums() -> Array:
    """Return the integral of (1 - cos(2 m x)) / sin^3(x) from 0 to pi/2, m to 2 `_MAX_EXACT_SIZE`.

    Its second difference over m is a constant less 8 (1 + 1/3 + ... + 1/(2m - 1)). The constant
    cancels in the second differences of sums.
    """
    m = np.arange(1, 2 * _MAX_EXACT_SIZE)
    steps = np.cumsum(np.concatenate(([0.0], -8.0 * np.cumsum(1.0 / (2.0 * m - 1.0)))))
    return np.concatenate(([0.0, 0.0], np.cumsum(steps)[1:]))  # of m = 0, 1, 2 ...
