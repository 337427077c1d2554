"""The functions of exponentials that the closed forms of Gauss-Markov processes and lines need."""

from __future__ import annotations

import cmath
import math
from functools import lru_cache

import numpy as np

_SERIES_BELOW = 2.0
"""Below, the recurrence of phi and the sum of `squared_response` cancel; their series do not."""

_LONGEST_SERIES = 48


def phi(order: int, z: complex) -> complex:
    """Return phi_k(z), the integral of (1 - s)^(k-1) / (k-1)! e^(z s) over s from 0 to 1.

    phi_k(z) = z^-k (e^z - sum_{j<k} z^j / j!) = sum_n z^n / (n + k)!, k from 0.

    References
    ----------
    M. Hochbruck and A. Ostermann, "Exponential integrators", Acta Numerica 19, 2010.
    """
    if abs(z) < _SERIES_BELOW:
        term: complex = complex(1.0 / math.factorial(order))
        total = term
        for n in range(1, _LONGEST_SERIES):
            term *= z / (n + order)
            total += term
        return total
    value = cmath.exp(z)
    for j in range(order):
        value = (value - 1.0 / math.factorial(j)) / z
    return value


def decay(order: int, x: float) -> float:
    """Return phi_k(-x) for a real x from 0: 1/k! at 0, and then falling."""
    return phi(order, -x).real


def squared_response(order: int, x: float) -> float:
    """Return x^-(2m+3) times the integral of E(v)^2 from 0 to x, E(v) = v^(m+1) phi_{m+1}(-v).

    E is what a pulse grows to through a Gauss-Markov process of unit correlation time and m + 1
    integrations. With E_k(x) = x^k phi_k(-x), for which E_k' = E_{k-1} = x^(k-1) / (k-1)! - E_k,
    the integral is by parts

        sum_{j=0..m} (-1)^j x^(m-j) / (m-j)! E_{m+2+j}(x) - E_{m+1}(x)^2 / 2.
    """
    m = order
    if x < _SERIES_BELOW:
        return float(np.polynomial.polynomial.polyval(x, _squared_series(m)))
    total = sum((-1) ** j * decay(m + 2 + j, x) / math.factorial(m - j) for j in range(m + 1))
    return (total - 0.5 * decay(m + 1, x) ** 2) / x


@lru_cache(maxsize=8)
def _squared_series(order: int) -> tuple[float, ...]:
    """Return the coefficients of the power series of `squared_response`."""
    powers = np.arange(_LONGEST_SERIES)
    single = [(-1.0) ** n / math.factorial(n + order + 1) for n in powers]
    square = np.convolve(single, single)[:_LONGEST_SERIES]
    return tuple(square / (2 * order + 3 + powers))
