"""Flicker noise, continuous and sampled, and its approximation by Gauss-Markov processes.

Flicker noise, S(f) = B^2 / (2 pi f), has no variance. An error in which a constant cancels has a
finite variance. For a kernel h with integral 0 it is

    sigma^2 = -(B^2 / pi) times the double integral of h(s) h(s') ln|s - s'|,

because -(B^2 / pi) ln|tau| is the generalised covariance of flicker noise (I. M. Gelfand and
G. E. Shilov, "Generalized Functions", vol. 1, 1964: the Fourier transform of 1/|f|). If a constant
does not cancel, the noise starts at switch-on, as the half-order integral of white noise
(M. S. Keshner, "1/f noise", Proc. IEEE 70(3), 1982; N. J. Kasdin, Proc. IEEE 83(5), 1995). Its
covariance at times a and b after switch-on is

    (B^2 / pi) ln((sqrt(b) + sqrt(a)) / |sqrt(b) - sqrt(a)|),

or approximately (B^2 / pi) ln(4 a / |b - a|) long after switch-on.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from imubench_pipeline.noise.growth import Calibrated, SensorStart
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms import gauss_markov
from imubench_pipeline.noise.terms.base import Drive, Reading, Role, SampleBlocks, Term
from imubench_pipeline.noise.terms.power_laws import WhiteNoise
from imubench_pipeline.typing import Array

_MIN_LAG_FOR_SERIES = 100  # blocks; at longer lags the closed form of the covariance cancels
_MIN_WINDOW_FOR_SERIES = 4.0  # window over motion; above it the closed form cancels
_MAX_SERIES_TERMS = 28

_RESPONSE_COEFFICIENTS = ((2.0,), (1.0, 1.0 / 3.0), (1.0 / 3.0, 1.0 / 6.0, 1.0 / 30.0))
"""Integral of (1-s)^m/m! (s+v)^(-1/2) over s from 0 to 1 with v = sinh^2(a), m = 0, 1, 2.

It is e^-a times a polynomial of e^-2a with these coefficients.
"""

_MEMBERS_PER_DECADE = 2.5
_POINTS_PER_DECADE = 20
_LAST_TIME_FACTOR = 4.0  # longest correlation time over the one that peaks at the end
_MAX_EXACT_SIZE = 1 << 12  # largest cluster with an exact sum for the Allan variance


@dataclass(frozen=True)
class Flicker(Term):
    """Flicker noise, 1/f, with B as in IEEE Std 952.

    `fit_flicker_bank` approximates it by Gauss-Markov processes, which have finite states.
    """

    B: float
    symbol = "F"
    label = "flicker noise"
    standard_name = "bias instability (flicker)"
    word = "flicker"
    role = Role.SLOW
    parameters = (gauss_markov.BIAS_INSTABILITY,)

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return B^2 / (2 pi f)."""
        return self.B**2 / (2.0 * np.pi * np.abs(frequency))

    def allan_variance(self, tau: Array) -> Array:
        """Return (2 ln 2 / pi) B^2 at every tau."""
        return gauss_markov.FLOOR**2 * self.B**2 * np.ones_like(tau)

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return 2 B^2 / (pi n^2) times the integral of sin^4(n x) / sin^3(x) from 0 to pi/2."""
        table = _tabulate_integrals()
        # 1/sin^3(x) = 1/x^3 + 1/(2x) + ...: the second term adds (3/16) ln n and a constant.
        most, growth = _MAX_EXACT_SIZE, 3.0 / 16.0
        beyond = table[-1] - math.log(2.0) * most**2 - growth * math.log(most)
        large = math.log(2.0) + (growth * np.log(n) + beyond) / n**2
        index = np.clip(np.rint(n), 1, most).astype(np.int64)
        return 2.0 / np.pi * self.B**2 * np.where(n <= most, table[index - 1] / index**2, large)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Return B^2 / sqrt(2 - 2 cos(omega)), which does not depend on the interval."""
        return self.B**2 / np.abs(2.0 * np.sin(omega / 2.0))

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Return -B^2 / (4 pi) times the integral of (1 - cos(2 k x)) / sin^3(x) from 0 to pi/2.

        k is the lag. For long lags it is B^2 / (2 pi) k^2 ln(k), as in continuous time. A multiple
        of k^2 is left out. All lags of a call use the same formula.
        """
        k = np.abs(lags)
        if k.max() <= 2 * _MAX_EXACT_SIZE:
            sums = -0.5 * _tabulate_sums()[np.rint(k).astype(np.int64)]
        else:
            sums = k**2 * np.log(np.maximum(k, 1.0))
        return np.asarray(0.5 / np.pi * self.B**2 * sums)

    def state_space(self, interval: float) -> StateSpace:
        """Raise ValueError: there is no finite state space."""
        raise ValueError("flicker noise has no finite state space; use realised() to approximate")

    @property
    def drive(self) -> Drive:
        """Flicker noise of this B."""
        return Drive(flicker=self.B)

    def realised(self, interval: float, longest: float) -> Sequence[Term]:
        """Return the Gauss-Markov processes, and white noise, of `fit_flicker_bank`."""
        return fit_flicker_bank(self.B, interval, longest)

    def as_unit(self) -> tuple[float, Term]:
        """Return B^2, and the term with B = 1."""
        return self.B**2, Flicker(1.0)

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return B^2 t^(2m+2) times `integrate_after_window` or `integrate_since_switch_on`.

        It is the variance of the integrated error; m is ``order``, and t is ``time``.
        """
        scale = self.B**2 * time ** (2 * order + 2)
        if isinstance(start, Calibrated):
            return scale * integrate_after_window(order, start.window / time)
        return scale * integrate_since_switch_on(order, start.on_time / time)

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Return -(B^2 / pi) times the second difference of k^2 (ln k - 3/2) / 2; k: lag."""
        k = np.maximum(lags, 1.0)
        far = np.maximum(k, _MIN_LAG_FOR_SERIES)
        series = np.log(far) - 1.0 / (12.0 * far**2) - 1.0 / (60.0 * far**4)
        near = np.minimum(k, _MIN_LAG_FOR_SERIES)
        closed = 0.5 * (
            _integrate_logarithm_twice(near + 1.0)
            - 2.0 * _integrate_logarithm_twice(near)
            + _integrate_logarithm_twice(near - 1.0)
        )
        # The mean of ln|s - s'| over two blocks of length 1 at a distance of k.
        mean = np.where(lags == 0.0, -1.5, np.where(k < _MIN_LAG_FOR_SERIES, closed, series))
        return -(self.B**2) / math.pi * mean

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """Raise TypeError: it has no covariance."""
        raise TypeError("flicker noise has no covariance; use realised() to approximate it")

    def reading(self, lowest_tau: float) -> Reading:
        """Return 0.664 B, the level at every tau, read where the curve is lowest."""
        return Reading(lowest_tau, gauss_markov.FLOOR * self.B, "B", gauss_markov.FLOOR)

    @property
    def in_words(self) -> str:
        """The value of B, SI, in words."""
        return f"flicker noise B = {self.B:.3e}"


def _integrate_logarithm_twice(x: Array) -> Array:
    """Return twice the double integral of ln x."""
    return x**2 * (np.log(np.maximum(x, 1e-300)) - 1.5)


def fit_flicker_bank(B: float, interval: float, longest: float) -> list[Term]:
    """Return Gauss-Markov processes whose samples have the Allan variance of flicker noise.

    Their correlation times are spaced evenly on a log scale from half a sampling interval, five in
    two decades; white noise replaces shorter ones. The variances are fitted to the Allan variance
    of sampled flicker noise by non-negative least squares. The band of tau is from the sampling
    ``interval`` to ``longest``, s; ValueError if it is empty.
    """
    if not 0 < interval < longest:
        raise ValueError(f"tau is {interval} to {longest} s, expected 0 < interval < longest")
    times, levels, white = _fit_unit_bank(round(math.log10(longest / interval), 6))
    terms: list[Term] = [
        gauss_markov.GaussMarkov(B * level, interval * time)
        for time, level in zip(times, levels, strict=True)
        if level > 0
    ]
    return [*terms, WhiteNoise(B * white * math.sqrt(interval))] if white else terms


@lru_cache(maxsize=16)
def _fit_unit_bank(decades: float) -> tuple[Array, Array, float]:
    """Return correlation times, their B, and N, for B = 1 and tau from 1 s to 10^decades s."""
    from scipy.optimize import nnls  # half a second at the start of each command

    first, last = 0.5, max(10.0**decades / gauss_markov.PEAK_TAU * _LAST_TIME_FACTOR, 1.0)
    members = 1 + math.ceil(math.log10(last / first) * _MEMBERS_PER_DECADE)
    times = np.geomspace(first, last, members)
    n = np.unique(np.rint(np.geomspace(1.0, 10.0**decades, 2 + int(decades * _POINTS_PER_DECADE))))
    wanted = Flicker(1.0).sampled_allan_variance(n, 1.0)
    shapes = [gauss_markov.GaussMarkov(1.0, time).sampled_allan_variance(n, 1.0) for time in times]
    powers, _ = nnls(np.column_stack([*shapes, 1.0 / n]) / wanted[:, None], np.ones_like(n))
    return times, np.sqrt(powers[:-1]), math.sqrt(powers[-1])


@lru_cache(maxsize=1)
def _tabulate_integrals() -> Array:
    """Return the integral of sin^4(n x) / sin^3(x) from 0 to pi/2, n = 1 to `_MAX_EXACT_SIZE`."""
    # sin^4(n x) = (3 - 4 cos(2 n x) + cos(4 n x)) / 8
    integral = _tabulate_sums()
    sizes = np.arange(1, _MAX_EXACT_SIZE + 1)
    return np.asarray((4.0 * integral[sizes] - integral[2 * sizes]) / 8.0)


@lru_cache(maxsize=1)
def _tabulate_sums() -> Array:
    """Return the integral of (1 - cos(2 m x)) / sin^3(x) from 0 to pi/2 for m from 0."""
    # Its second difference over m is a constant, which cancels, less 8 (1 + ... + 1/(2m - 1)).
    m = np.arange(1, 2 * _MAX_EXACT_SIZE)
    steps = np.cumsum(np.concatenate(([0.0], -8.0 * np.cumsum(1.0 / (2.0 * m - 1.0)))))
    return np.concatenate(([0.0, 0.0], np.cumsum(steps)[1:]))  # of m = 0, 1, 2 ...


def integrate_since_switch_on(order: int, on_time: float) -> float:
    """Return the variance of the (m+1)-fold integral over a unit of time, for B = 1.

    The ``order`` m is 0 to 2. The driving noise during the motion adds 1 / ((2m+2) Gamma(m+3/2)^2),
    the noise before the motion a combination of a, e^(-2a), e^(-4a) ... Here sinh^2(a) is
    ``on_time``, the time from switch-on to the motion divided by the length of the motion. For
    m = 0 the variance is (2/pi) (1 + a - (1 - e^(-4a)) / 4).
    """
    angle = math.asinh(math.sqrt(on_time))
    logarithmic, decaying = _expand_before_motion(order)
    rates = 2.0 * np.arange(1, len(decaying) + 1)
    before = logarithmic * angle - float(decaying / rates @ np.expm1(-rates * angle))
    return _integrate_during_motion(order) + before


def integrate_after_window(order: int, window: float) -> float:
    """Return the variance of the (m+1)-fold integral after a static window, for B = 1.

    The mean over the window is first subtracted from the noise. The integral is over a unit of time
    directly after the window; ``order`` m is 0 to 2. For m = 0 and a ``window`` of r units it is

        (1/pi) (1 + r) (ln(1 + 1/r) + ln(1 + r) / r),

    which is 4 ln 2 / pi, twice the Allan variance, for r = 1.
    """
    # Minus the double integral of k(s) k(s') ln|s - s'| with k = (1 - s)^m / m!: the constant of
    # `integrate_since_switch_on` long after switch-on, 3/2 for m = 0 and 7/16 for m = 1.
    _, decaying = _expand_before_motion(order)
    rates = 2.0 * np.arange(1, len(decaying) + 1)
    motion = math.pi * (_integrate_during_motion(order) + float(np.sum(decaying / rates)))
    constant = 1.0 / math.factorial(order + 1)
    mean = constant**2 * (1.5 - math.log(window))
    return (motion + mean - 2.0 * constant * _integrate_motion_and_window(order, window)) / math.pi


def _integrate_during_motion(order: int) -> float:
    """Return the part of `integrate_since_switch_on` from the driving noise during the motion."""
    return 1.0 / ((2 * order + 2) * math.gamma(order + 1.5) ** 2)


@lru_cache(maxsize=3)
def _expand_before_motion(order: int) -> tuple[float, Array]:
    """Return the coefficients of a, and of e^-2a ..., in d/da of `integrate_since_switch_on`."""
    response = np.array(_RESPONSE_COEFFICIENTS[order])
    coefficients = np.convolve(np.convolve(response, response), [1.0, 0.0, -1.0]) / (2.0 * math.pi)
    return float(coefficients[0]), coefficients[1:]


def _integrate_motion_and_window(order: int, window: float) -> float:
    """Return minus the mean over w, from 0 to r, of the integral of k(s) ln(s + w) over s."""
    m, r = order, window
    if r >= _MIN_WINDOW_FOR_SERIES:
        harmonic = (_sum_harmonic(m + 2) - 1.0) / math.factorial(m + 2)
        first = _evaluate_moment(m, 1) / r
        total = 1.0 / math.factorial(m + 1) - harmonic / r
        total -= math.log(r) * (_evaluate_moment(m, 0) + first) + first
        for j in range(2, _MAX_SERIES_TERMS):
            total -= (-1) ** j * _evaluate_moment(m, j) / (j * (j - 1) * r**j)
        return total
    # With L_n(x) = x^n / n! (ln x - H_n), the n-fold integral of ln x, it is
    # -(L_n(1 + r) - L_n(1) - sum_{i<=m} L_{n-i}(r) / i!) / r with n = m + 2.
    n = m + 2
    factorial = math.factorial(n)
    power = sum(math.comb(n, i) * r ** (i - 1) for i in range(1, n + 1))
    total = ((1.0 + r) ** n * math.log1p(r) / r - _sum_harmonic(n) * power) / factorial
    for i in range(m + 1):
        left = n - i
        integral = r ** (left - 1) * (math.log(r) - _sum_harmonic(left)) / math.factorial(left)
        total -= integral / math.factorial(i)
    return -total


def _evaluate_moment(order: int, power: int) -> float:
    """Return the integral of (1 - s)^m / m! s^j over s from 0 to 1: j! / (m + j + 1)!."""
    return math.factorial(power) / math.factorial(order + power + 1)


def _sum_harmonic(n: int) -> float:
    return math.fsum(1.0 / i for i in range(1, n + 1))
