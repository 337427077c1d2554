"""How integrals of flicker noise grow: closed forms.

Flicker noise, S(f) = B^2 / (2 pi f), has no variance. An error in which a constant cancels has
one all the same: with a kernel h whose integral is 0,

    sigma^2 = -(B^2 / pi) times the double integral of h(s) h(s') ln|s - s'|,

because -(B^2 / pi) ln|tau| is the generalised covariance of flicker noise (I. M. Gelfand and
G. E. Shilov, "Generalized Functions", vol. 1, 1964: the Fourier transform of 1/|f|). Where a
constant does not cancel, the noise needs a beginning. It begins at switch-on, as white noise
integrated to the power 1/2 from there (M. S. Keshner, "1/f noise", Proc. IEEE 70(3), 1982;
N. J. Kasdin, Proc. IEEE 83(5), 1995), whose covariance at times a and b after switch-on is

    (B^2 / pi) ln((sqrt(b) + sqrt(a)) / |sqrt(b) - sqrt(a)|),

about (B^2 / pi) ln(4 a / |b - a|) long after it.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from imubench_pipeline.typing import Array

_SERIES_FROM = 4.0
"""Windows so many times as long as the motion: the closed form cancels, the series does not."""

_LONGEST_SERIES = 28

_RESPONSES = ((2.0,), (1.0, 1.0 / 3.0), (1.0 / 3.0, 1.0 / 6.0, 1.0 / 30.0))
"""Integral of (1-s)^m/m! (s+v)^(-1/2) over s from 0 to 1 with v = sinh^2(a), m = 0, 1, 2.

It is e^-a times a polynomial of e^-2a with these coefficients.
"""


def since_switch_on(order: int, on_time: float) -> float:
    """Return the variance of the (m+1)-fold integral over a unit of time, for B = 1, m to 2.

    1 / ((2m+2) Gamma(m+3/2)^2) from what drives the noise during the motion, and a sum of a and of
    e^(-2a), e^(-4a) ... from what drove it before, with sinh^2(a) = on_time, the time from switch-
    on to the motion over the length of the motion. For m = 0 it is (2/pi) (1 + a - (1 - e^(-4a)) /
    4).
    """
    angle = math.asinh(math.sqrt(on_time))
    logarithmic, decaying = _before(order)
    rates = 2.0 * np.arange(1, len(decaying) + 1)
    before = logarithmic * angle - float(decaying / rates @ np.expm1(-rates * angle))
    return _during(order) + before


def after_window(order: int, window: float) -> float:
    """Return the variance of the (m+1)-fold integral less the mean over a window, for B = 1.

    The integral is over a unit of time right after the window; m is 0 to 2. For m = 0 and a window
    r

        (1/pi) (1 + r) (ln(1 + 1/r) + ln(1 + r) / r),

    which is 4 ln 2 / pi, twice the Allan variance, for r = 1.
    """
    constant = 1.0 / math.factorial(order + 1)
    of_mean = 1.5 - math.log(window)
    total = (
        _motion_alone(order)
        + constant**2 * of_mean
        - 2.0 * constant * _motion_and_window(order, window)
    )
    return total / math.pi


def _during(order: int) -> float:
    """Return the part of `since_switch_on` that is driven during the motion."""
    return 1.0 / ((2 * order + 2) * math.gamma(order + 1.5) ** 2)


@lru_cache(maxsize=3)
def _before(order: int) -> tuple[float, Array]:
    """Return what multiplies a, and e^-2a, e^-4a ... in the derivative of `since_switch_on`."""
    response = np.array(_RESPONSES[order])
    coefficients = np.convolve(np.convolve(response, response), [1.0, 0.0, -1.0]) / (2.0 * math.pi)
    return float(coefficients[0]), coefficients[1:]


def _motion_alone(order: int) -> float:
    """Return minus the double integral of k(s) k(s') ln|s - s'| with k = (1 - s)^m / m!.

    It is what `since_switch_on` is long after switch-on: 3/2 for m = 0, 7/16 for m = 1.
    """
    _, decaying = _before(order)
    rates = 2.0 * np.arange(1, len(decaying) + 1)
    return math.pi * (_during(order) + float(np.sum(decaying / rates)))


def _motion_and_window(order: int, window: float) -> float:
    """Return minus the mean over w, from 0 to r, of the integral of k(s) ln(s + w) over s."""
    m, r = order, window
    if r >= _SERIES_FROM:
        total = 1.0 / math.factorial(m + 1) - (_harmonic(m + 2) - 1.0) / math.factorial(m + 2) / r
        total -= math.log(r) * (_moment(m, 0) + _moment(m, 1) / r) + _moment(m, 1) / r
        for j in range(2, _LONGEST_SERIES):
            total -= (-1) ** j * _moment(m, j) / (j * (j - 1) * r**j)
        return total
    # With L_n(x) = x^n / n! (ln x - H_n), the n-fold integral of ln x, it is
    # -(L_n(1 + r) - L_n(1) - sum_{i<=m} L_{n-i}(r) / i!) / r with n = m + 2.
    n = m + 2
    factorial = math.factorial(n)
    power = sum(math.comb(n, i) * r ** (i - 1) for i in range(1, n + 1))
    total = ((1.0 + r) ** n * math.log1p(r) / r - _harmonic(n) * power) / factorial
    for i in range(m + 1):
        left = n - i
        integral = r ** (left - 1) * (math.log(r) - _harmonic(left)) / math.factorial(left)
        total -= integral / math.factorial(i)
    return -total


def _moment(order: int, power: int) -> float:
    """Return the integral of (1 - s)^m / m! s^j over s from 0 to 1: j! / (m + j + 1)!."""
    return math.factorial(power) / math.factorial(order + power + 1)


def _harmonic(n: int) -> float:
    return math.fsum(1.0 / i for i in range(1, n + 1))
