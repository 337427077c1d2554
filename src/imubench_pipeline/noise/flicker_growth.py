"""Growth of the integrals of flicker noise: closed forms.

Flicker noise, S(f) = B^2 / (2 pi f), has no variance. An error in which a constant cancels has a
finite variance. For a kernel h with integral 0 it is

    sigma^2 = -(B^2 / pi) times the double integral of h(s) h(s') ln|s - s'|,

because -(B^2 / pi) ln|tau| is the generalised covariance of flicker noise (I. M. Gelfand and
G. E. Shilov, "Generalized Functions", vol. 1, 1964: the Fourier transform of 1/|f|). If a constant
does not cancel, the noise needs a start. It starts at switch-on, as the half-order integral of
white noise (M. S. Keshner, "1/f noise", Proc. IEEE 70(3), 1982; N. J. Kasdin, Proc. IEEE 83(5),
1995). Its covariance at times a and b after switch-on is

    (B^2 / pi) ln((sqrt(b) + sqrt(a)) / |sqrt(b) - sqrt(a)|),

or approximately (B^2 / pi) ln(4 a / |b - a|) long after switch-on.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from imubench_pipeline.typing import Array

_MIN_WINDOW_FOR_SERIES = 4.0
"""Ratio of window to motion above which the series is used, since the closed form cancels."""

_MAX_SERIES_TERMS = 28

_RESPONSE_COEFFICIENTS = ((2.0,), (1.0, 1.0 / 3.0), (1.0 / 3.0, 1.0 / 6.0, 1.0 / 30.0))
"""Integral of (1-s)^m/m! (s+v)^(-1/2) over s from 0 to 1 with v = sinh^2(a), m = 0, 1, 2.

It is e^-a times a polynomial of e^-2a with these coefficients.
"""


def since_switch_on(order: int, on_time: float) -> float:
    """Return the variance of the (m+1)-fold integral over a unit of time, for B = 1, m to 2.

    It is 1 / ((2m+2) Gamma(m+3/2)^2) from the driving noise during the motion, and a combination of
    a and e^(-2a), e^(-4a) ... from the driving noise before it. Here sinh^2(a) = on_time, the time
    from switch-on to the motion over the length of the motion. For m = 0 it is (2/pi) (1 + a - (1 -
    e^(-4a)) / 4).
    """
    angle = math.asinh(math.sqrt(on_time))
    logarithmic, decaying = _expand_before_motion(order)
    rates = 2.0 * np.arange(1, len(decaying) + 1)
    before = logarithmic * angle - float(decaying / rates @ np.expm1(-rates * angle))
    return _integrate_during_motion(order) + before


def after_window(order: int, window: float) -> float:
    """Return the variance of the (m+1)-fold integral less the mean over a window, for B = 1.

    The integral is over a unit of time directly after the window; m is 0 to 2. For m = 0 and a
    window r it is

        (1/pi) (1 + r) (ln(1 + 1/r) + ln(1 + r) / r),

    which is 4 ln 2 / pi, twice the Allan variance, for r = 1.
    """
    constant = 1.0 / math.factorial(order + 1)
    of_mean = 1.5 - math.log(window)
    total = (
        _integrate_motion(order)
        + constant**2 * of_mean
        - 2.0 * constant * _integrate_motion_and_window(order, window)
    )
    return total / math.pi


def _integrate_during_motion(order: int) -> float:
    """Return the part of `since_switch_on` from the driving noise during the motion."""
    return 1.0 / ((2 * order + 2) * math.gamma(order + 1.5) ** 2)


@lru_cache(maxsize=3)
def _expand_before_motion(order: int) -> tuple[float, Array]:
    """Return the coefficients of a, and of e^-2a ..., in d/da of `since_switch_on`."""
    response = np.array(_RESPONSE_COEFFICIENTS[order])
    coefficients = np.convolve(np.convolve(response, response), [1.0, 0.0, -1.0]) / (2.0 * math.pi)
    return float(coefficients[0]), coefficients[1:]


def _integrate_motion(order: int) -> float:
    """Return minus the double integral of k(s) k(s') ln|s - s'| with k = (1 - s)^m / m!.

    It is the constant of `since_switch_on` long after switch-on: 3/2 for m = 0, 7/16 for m = 1.
    """
    _, decaying = _expand_before_motion(order)
    rates = 2.0 * np.arange(1, len(decaying) + 1)
    return math.pi * (_integrate_during_motion(order) + float(np.sum(decaying / rates)))


def _integrate_motion_and_window(order: int, window: float) -> float:
    """Return minus the mean over w, from 0 to r, of the integral of k(s) ln(s + w) over s."""
    m, r = order, window
    if r >= _MIN_WINDOW_FOR_SERIES:
        total = (
            1.0 / math.factorial(m + 1) - (_sum_harmonic(m + 2) - 1.0) / math.factorial(m + 2) / r
        )
        total -= (
            math.log(r) * (_evaluate_moment(m, 0) + _evaluate_moment(m, 1) / r)
            + _evaluate_moment(m, 1) / r
        )
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
