"""A first-order Gauss-Markov process, as a model of the bias instability."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise.exponentials import evaluate_decay, integrate_squared_response
from imubench_pipeline.noise.growth import SensorStart, Uncalibrated, of_constant
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace
from imubench_pipeline.noise.terms import base
from imubench_pipeline.noise.terms.power_laws import RandomWalk
from imubench_pipeline.typing import Array

PEAK = 0.4365  # peak of the Allan deviation of a Gauss-Markov process over sqrt(S_B T_B)
PEAK_TAU = 1.8926  # tau of that peak over T_B
FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)  # bias instability plateau over B: 0.664
BIAS_INSTABILITY = base.TermParameter("B", "bias instability", 1.0, 0.0)
"""B of a Gauss-Markov process, and of flicker noise with an equally high Allan deviation."""

CORRELATION_TIMES = base.SearchRange(samples=20.0, of_log=1 / 5)
"""Search range: a shorter correlation is due to a filter, not to bias instability; a longer one is
indistinguishable from a random walk."""

_QUADRATURE_NODES, _QUADRATURE_WEIGHTS = np.polynomial.legendre.leggauss(24)

_INTEGRATION_LIMITS = (0.0, 0.003, 0.03, 0.2, 1.0)  # dense at 0, where short T_B bend
_MAX_RATIO_FOR_SERIES = 0.5
_SERIES_COEFFICIENTS = [
    (-1) ** (k + 1) * (2.0**k - 4.0) / (2.0 * math.factorial(k)) for k in range(3, 24)
]
"""Power series in tau/T_B, used for small ratios, where the bracket of Maia et al., eq. 26,
cancels."""

_MAX_RATIO_FOR_WALK = 1e-3
"""Largest ratio of cluster length to T_B for the random walk approximation, with an error of a
thousandth; for smaller ratios the second differences of the covariance of sums cancel."""

_ROWS_PER_BLOCK = 256  # rows of a covariance that are computed together


@dataclass(frozen=True)
class GaussMarkov(base.Term):
    """First-order Gauss-Markov process as a model of bias instability (Maia et al., eq. 4-8)."""

    B: float
    T_B: float
    symbol = "GM"
    label = "Gauss-Markov"
    standard_name = "bias instability (GM)"
    word = "GM"
    role = base.Role.GAUSS_MARKOV
    parameters = (
        BIAS_INSTABILITY,
        base.TermParameter("T_B", "correlation time", 0.0, 1.0, search=CORRELATION_TIMES),
    )

    @property
    def density(self) -> float:
        """S_B = 2 B^2 ln 2 / (pi 0.4365^2 T_B), density of the driving white noise."""
        return compute_driving_density(self.B, self.T_B)

    @property
    def _variance(self) -> float:
        """V = S_B T_B / 2, variance of the stationary process."""
        return self.density * self.T_B / 2.0

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return S_B T_B^2 / (1 + (2 pi f T_B)^2)."""
        return self.density * self.T_B**2 / (1.0 + (2.0 * np.pi * frequency * self.T_B) ** 2)

    def allan_variance(self, tau: Array) -> Array:
        """Return eq. 26 of Maia et al., with the sign corrected: e^(-tau/T_B)."""
        return self.density * evaluate_gauss_markov_shape(tau, self.T_B)

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return the exact value for samples of the process, from the sum of its covariances."""
        return self.density * evaluate_sampled_shape(n, interval, self.T_B)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Return (S_B T_B / 2) (1 - p^2) / (1 - 2 p cos(omega) + p^2), p = e^(-interval/T_B)."""
        p = math.exp(-interval / self.T_B)
        gap = math.expm1(-interval / self.T_B) ** 2 + p * 4.0 * np.sin(omega / 2.0) ** 2
        return -self._variance * math.expm1(-2.0 * interval / self.T_B) / gap

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Return -v (p e^(-|k| T/T_B) / (1 - p)^2 + |k| (1 + p) / (2 (1 - p))), p = e^(-T/T_B).

        v is S_B T_B / 2, k the lag, T the interval. For clusters far shorter than T_B the process
        counts as a random walk.
        """
        if n * interval < _MAX_RATIO_FOR_WALK * self.T_B:
            return RandomWalk(math.sqrt(self.density)).sum_covariance(lags, n, interval)
        k, p, rest = np.abs(lags), math.exp(-interval / self.T_B), -math.expm1(-interval / self.T_B)
        decayed = p / rest**2 * np.exp(-k * (interval / self.T_B))
        return -self._variance * (decayed + k * ((1.0 + p) / (2.0 * rest)))

    def state_space(self, interval: float) -> StateSpace:
        """Return a stationary model: Phi = e^(-interval/T_B), Q_d = S_B T_B / 2 (1 - Phi^2)."""
        drive = -self._variance * math.expm1(-2.0 * interval / self.T_B)
        return StateSpace.scalar(math.exp(-interval / self.T_B), drive, self._variance)

    def continuous_space(self) -> ContinuousSpace:
        """Return a model with F = -1/T_B and Q = S_B."""
        F, Q = np.array([[-1.0 / self.T_B]]), np.array([[self.density]])
        return ContinuousSpace(F, Q, np.ones(1))

    @property
    def drive(self) -> base.Drive:
        """A process of driving density S_B with the correlation time T_B."""
        return base.Drive(process=base.Process(self.T_B, self.density))

    @property
    def gauss_markov(self) -> "GaussMarkov":
        """The term itself."""
        return self

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return S_B (T_B^(2m+3) P_m(x) + c^2 T_B (P_0(y) / y^2 + (d_x - d_y)^2 / 2)).

        It is the variance of the integrated error. m is ``order``, t ``time``, W the static window,
        c = t^(m+1) / (m+1)!, x = t/T_B, and y = W/T_B. P_m(x) is the integral of E_{m+1}^2 from 0
        to x, with E_k(x) = x^k phi_k(-x) (`exponentials.evaluate_phi`). The decay of the state at
        the start is d_x = (m+1)! x phi_{m+2}(-x) forward, and d_y = y phi_2(-y) backward.
        Uncalibrated, it is S_B (T_B^(2m+3) P_m(x) + c^2 T_B (1 - d_x)^2 / 2).
        """
        x, constant = time / self.T_B, of_constant(order, time)
        driven = time ** (2 * order + 3) * integrate_squared_response(order, x)
        if isinstance(start, Uncalibrated):
            remaining = math.factorial(order + 1) * evaluate_decay(order + 1, x)
            return self.density * (driven + (constant * remaining) ** 2 * self.T_B / 2.0)
        y = start.window / self.T_B
        # The losses are subtracted, not the retained parts, which would cancel for long T_B.
        forward = math.factorial(order + 1) * x * evaluate_decay(order + 2, x)
        lost = forward - y * evaluate_decay(2, y)
        in_window = start.window * integrate_squared_response(0, y)
        return self.density * (driven + constant**2 * (in_window + self.T_B * lost**2 / 2.0))

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """Return S_B times the integral of h(s)^2 from 0 to t, for the first and second integral.

        First: h = T_B (1 - e^(-s/T_B)). Second: h = T_B s - T_B^2 (1 - e^(-s/T_B)). t is ``time``.
        """
        x = time / self.T_B
        first, second = np.zeros_like(x), np.zeros_like(x)
        for start, stop in pairwise(_INTEGRATION_LIMITS):
            half = (stop - start) / 2.0
            node = x[:, None] * (start + half * (1.0 + _QUADRATURE_NODES))
            lost = np.expm1(-node)
            first += x * half * (lost**2 @ _QUADRATURE_WEIGHTS)
            # node - 1 + e^(-node) cancels for small arguments.
            series = 1.0 - node / 3.0 * (1.0 - node / 4.0 * (1.0 - node / 5.0 * (1.0 - node / 6.0)))
            response = np.where(node < 1e-2, node**2 / 2.0 * series, node + lost)
            second += x * half * (response**2 @ _QUADRATURE_WEIGHTS)
        return self.density * self.T_B**3 * first, self.density * self.T_B**5 * second

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Return v ((1 - e^-x) / x)^2 e^(-(k-1) x), and 2 v (x - 1 + e^-x) / x^2 at k = 0.

        Here k is the lag, x = ``block`` / T_B and v = S_B T_B / 2.
        """
        x = block / self.T_B
        apart = (math.expm1(-x) / x) ** 2 * np.exp(-(np.maximum(lags, 1.0) - 1.0) * x)
        return self._variance * np.where(lags == 0.0, 2.0 * (x + math.expm1(-x)) / x**2, apart)

    def mean_covariance(self, blocks: base.SampleBlocks) -> Array:
        """Return v s_n s_m p^lag, with s_n = (1 - p^n) / (n (1 - p)), p = e^(-T/T_B).

        v is S_B T_B / 2, T the interval; n and m are the samples of two blocks. The lag is from the
        last sample of the earlier block to the first of the later one. The diagonal is
        v (n (1 + p) / (1 - p) - 2 p (1 - p^n) / (1 - p)^2) / n^2.
        """
        n = (blocks.stop - blocks.start).astype(np.float64)
        x = 1.0 / (blocks.rate * self.T_B)
        lost = -math.expm1(-x)
        decayed = -np.expm1(-n * x)
        gain, variance = decayed / (n * lost), self._variance
        covariance = np.empty((len(n), len(n)))
        # Row by row, since the temporary matrices of thousands of rows would be large.
        for first in range(0, len(n), _ROWS_PER_BLOCK):
            rows = slice(first, first + _ROWS_PER_BLOCK)
            after = np.subtract.outer(blocks.start[rows] + 1.0, blocks.stop)
            before = np.subtract.outer(blocks.start + 1.0, blocks.stop[rows]).T
            lag = np.maximum(np.maximum(after, before), 0.0)
            covariance[rows] = variance * np.outer(gain[rows], gain) * np.exp(-x * lag)
        p = math.exp(-x)
        own = (n * (1.0 + p) / lost - 2.0 * p * decayed / lost**2) / n**2
        np.fill_diagonal(covariance, variance * own)
        return covariance

    def reading(self, lowest_tau: float) -> base.Reading:
        """Return 0.664 B, the level at the peak, tau = 1.89 T_B."""
        return base.Reading(PEAK_TAU * self.T_B, FLOOR * self.B, "B", FLOOR, peak=True)

    @property
    def in_words(self) -> str:
        """The values of B, SI, and T_B, in words."""
        return f"Gauss-Markov process B = {self.B:.3e}, T_B = {self.T_B:.4g} s"


def compute_driving_density(B: float, T_B: float) -> float:
    """Return S_B of a bias instability B with correlation time T_B (Maia et al., eq. 8)."""
    return 2.0 * B**2 * math.log(2.0) / (math.pi * PEAK**2 * T_B)


def compute_bias_instability(density: float, T_B: float) -> float:
    """Return B of a Gauss-Markov process with driving density S_B (Maia et al., eq. 8)."""
    return math.sqrt(density * T_B * math.pi * PEAK**2 / (2.0 * math.log(2.0)))


def evaluate_gauss_markov_shape(tau: Array, T_B: float | Array) -> Array:
    """Return the Allan variance of a Gauss-Markov process divided by S_B, s.

    Maia et al., eq. 26; Farrell et al. 2022, eq. 63. Tau and T_B may be arrays that broadcast.

    (T_B^2/tau) (1 - (T_B/(2 tau)) (3 - 4 e^(-tau/T_B) + e^(-2 tau/T_B)))
    """
    ratio = np.asarray(tau, dtype=np.float64) / T_B
    small = ratio < _MAX_RATIO_FOR_SERIES
    x = np.where(small, 1.0, ratio)
    decayed = np.exp(-x)
    shape = np.asarray((1.0 - (3.0 - decayed * (4.0 - decayed)) / (2.0 * x)) / x)
    if small.any():
        r = ratio[small]
        series = np.full_like(r, _SERIES_COEFFICIENTS[-1])
        for coefficient in _SERIES_COEFFICIENTS[-2::-1]:  # in place: half the time of polyval
            series *= r
            series += coefficient
        shape[small] = r * series
    return np.asarray(T_B * shape)


def evaluate_sampled_shape(n: ArrayLike, interval: float, T_B: float) -> Array:
    """Return the Allan variance of a sampled Gauss-Markov process divided by S_B, s.

    (T_B / (2 n^2)) (n (1+p)/(1-p) - p (3 - 4 p^n + p^(2n)) / (1-p)^2) with p = e^(-T/T_B), T the
    interval and n samples per cluster; from the sum of the covariances of the samples.
    """
    n = np.asarray(n, dtype=np.float64)
    p = math.exp(-interval / T_B)
    q = -math.expm1(-interval / T_B)
    x = n * interval / T_B
    # 3 - 4 p^n + p^2n = 2 (1 - p^n) + (1 - p^n)^2, a sum without cancellation.
    decay = -np.expm1(-x)
    closed = (n * (1.0 + p) / q - p * decay * (2.0 + decay) / q**2) / n**2
    # For clusters far shorter than T_B this cancels. The continuous form does not; the effect of
    # sampling is added from the moments sum_ij w_i w_j |i - j|^m of the samples.
    h = interval / T_B
    added = h / (3.0 * n) - h**3 / 6.0 * (n / 3.0 + 1.0 / (15.0 * n))
    continuous = 2.0 / T_B * evaluate_gauss_markov_shape(n * interval, T_B) + added
    return T_B / 2.0 * np.where(x < 3e-3, continuous, closed)
