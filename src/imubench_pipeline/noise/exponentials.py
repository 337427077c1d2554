"""Phi functions of exponentials for the closed forms of Gauss-Markov processes and lines."""

import cmath
import math
from functools import lru_cache
from typing import TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

_MAX_ARGUMENT_FOR_SERIES = 2.0  # below it the recurrence of phi and the squared response cancel
_MAX_SERIES_TERMS = 48
_SERIES_TOLERANCE = 1e-18  # relative size of the last term of a series, below the last digit
_ARRAY_SERIES_TERMS = 28  # the next term is below 2^28 / 28! = 9e-22 of the first

ComplexArray = NDArray[np.complex128]
Real = TypeVar("Real", float, Array)


@overload
def evaluate_phi(order: int, z: complex) -> complex: ...
@overload
def evaluate_phi(order: int, z: Array | ComplexArray) -> ComplexArray: ...
def evaluate_phi(order: int, z: complex | Array | ComplexArray) -> complex | ComplexArray:
    """Return phi_k(z), the integral of (1 - s)^(k-1) / (k-1)! e^(z s) over s from 0 to 1.

    phi_k(z) = z^-k (e^z - sum_{j<k} z^j / j!) = sum_n z^n / (n + k)!, k from 0 (M. Hochbruck and A.
    Ostermann, "Exponential integrators", Acta Numerica 19, 2010).
    """
    if isinstance(z, np.ndarray):
        small = np.abs(z) < _MAX_ARGUMENT_FOR_SERIES
        far = np.where(small, _MAX_ARGUMENT_FOR_SERIES, z)
        values = np.exp(far)
        for j in range(order):
            values = (values - 1.0 / math.factorial(j)) / far
        if small.any():
            series = [1.0 / math.factorial(n + order) for n in range(_ARRAY_SERIES_TERMS)]
            near = np.polynomial.polynomial.polyval(np.where(small, z, 0.0), series)
            values = np.where(small, near, values)
        return np.asarray(values, dtype=np.complex128)
    return _evaluate_scalar_phi(order, z)


@lru_cache(maxsize=1 << 12, typed=True)  # an error budget repeats its windows and times
def _evaluate_scalar_phi(order: int, z: complex) -> complex:
    if abs(z) < _MAX_ARGUMENT_FOR_SERIES:
        term: complex = 1.0 / math.factorial(order)
        total = term
        for n in range(1, _MAX_SERIES_TERMS):
            term *= z / (n + order)
            total += term
            if abs(term) < _SERIES_TOLERANCE * abs(total):
                break
        return total
    value = cmath.exp(z)
    for j in range(order):
        value = (value - 1.0 / math.factorial(j)) / z
    return value


def evaluate_decay(order: int, x: Real) -> Real:
    """Return phi_k(-x) for x from 0 and k = ``order``: it is 1/k! at 0 and decreases."""
    return evaluate_phi(order, -x).real


def integrate_squared_response(order: int, x: Real) -> Real:
    """Return x^-(2m+3) times the integral of E(v)^2 from 0 to x, E(v) = v^(m+1) phi_{m+1}(-v).

    E is the response to a pulse of a Gauss-Markov process with unit correlation time and m + 1
    integrations; m is ``order``. With E_k(x) = x^k phi_k(-x), for which
    E_k' = E_{k-1} = x^(k-1) / (k-1)! - E_k, integration by parts gives

        sum_{j=0..m} (-1)^j x^(m-j) / (m-j)! E_{m+2+j}(x) - E_{m+1}(x)^2 / 2.
    """
    if isinstance(x, np.ndarray):
        small = x < _MAX_ARGUMENT_FOR_SERIES
        response = _sum_squared_response(order, np.where(small, _MAX_ARGUMENT_FOR_SERIES, x))
        if not small.any():
            return response
        series = np.polynomial.polynomial.polyval(
            np.where(small, x, 0.0), _expand_squared_response(order)
        )
        return np.where(small, series, response)
    if x < _MAX_ARGUMENT_FOR_SERIES:
        near = 0.0
        for coefficient in reversed(_expand_squared_response(order)):
            near = near * x + coefficient
        return near
    return _sum_squared_response(order, x)


def _sum_squared_response(order: int, x: Real) -> Real:
    m = order
    parts = [(-1) ** j * evaluate_decay(m + 2 + j, x) / math.factorial(m - j) for j in range(m + 1)]
    return (sum(parts) - 0.5 * evaluate_decay(m + 1, x) ** 2) / x


@lru_cache(maxsize=8)
def _expand_squared_response(order: int) -> tuple[float, ...]:
    powers = np.arange(_MAX_SERIES_TERMS)
    single = [(-1.0) ** n / math.factorial(n + order + 1) for n in powers]
    square = np.convolve(single, single)[:_MAX_SERIES_TERMS]
    return tuple((square / (2 * order + 3 + powers)).tolist())
