"""The Allan variance of any smooth spectrum of samples, by quadrature."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.typing import Array

_POINTS = 16
"""Of Gauss and Legendre in a panel."""

_OCTAVES = 40
"""Panels below the first zero of sin^4(n w/2): the rest is 1e-12 of a random walk's."""

_PERIODS = 64
"""Periods of sin^4(n w/2) that are resolved; beyond, 3/8 stands for it, wrong by 4e-8 of white
noise (the first term of the asymptotic series of the rest, 0.23/X^3 against pi/4)."""


def nodes(n: int) -> tuple[Array, Array]:
    """Return frequencies and weights that integrate a spectrum to the Allan variance.

    sigma^2(n T) = (1/pi) int_0^pi P(w) 2 sin^4(n w/2) / (n^2 sin^2(w/2)) dw

    by Gauss and Legendre, in panels of an octave of w up to the first zero of sin^4, where P is
    smooth over log w, then of one period; the many periods of a long cluster at high frequencies
    are replaced by their mean, again in octaves.

    Parameters
    ----------
    n : int
        Samples in a cluster, from 1.

    Returns
    -------
    (ndarray, ndarray)
        Angular frequencies, rad a sample, and weights: the Allan variance is
        ``weights @ P(omega)``.

    Raises
    ------
    ValueError
        If n is below 1.
    """
    if n < 1:
        raise ValueError(f"a cluster has {n} samples, expected 1 or more")
    end = n * np.pi / 2.0  # of x = n w / 2
    first = min(np.pi, end)
    x, dx = _octaves(first * 2.0**-_OCTAVES, first)
    resolved = min(_PERIODS * np.pi, end)
    edges = np.append(np.arange(np.pi, resolved - 1e-9, np.pi), resolved)
    if len(edges) > 1:
        more, width = _linear(edges)
        x, dx = np.append(x, more), np.append(dx, width)
    fourth = np.sin(x) ** 4
    if end > resolved:
        far, width = _octaves(resolved, end)
        x, dx = np.append(x, far), np.append(dx, width)
        fourth = np.append(fourth, np.full(len(far), 3.0 / 8.0))
    omega = 2.0 * x / n
    weights = 2.0 / np.pi * fourth / (n * np.sin(omega / 2.0)) ** 2 * 2.0 / n * dx
    return omega, weights


def allan_of_spectrum(spectrum: Callable[[Array], NDArray[Any]], sizes: ArrayLike) -> NDArray[Any]:
    """Return the Allan variance of samples of a given spectrum.

    Parameters
    ----------
    spectrum : callable
        Takes angular frequencies in rad a sample, shape (k,), and returns SI^2, shape (k, ...).
    sizes : array_like of int, shape (m,)
        n, samples in a cluster.

    Returns
    -------
    ndarray, shape (m, ...)
        SI^2.
    """
    found = []
    for n in np.atleast_1d(np.asarray(sizes, dtype=np.int64)):
        omega, weights = nodes(int(n))
        found.append(np.tensordot(weights, spectrum(omega), axes=1))
    return np.array(found)


@lru_cache(maxsize=1)
def _rule() -> tuple[Array, Array]:
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    return np.asarray(points), np.asarray(weights)


def _linear(edges: Array) -> tuple[Array, Array]:
    """Return points and weights in panels between edges."""
    points, weights = _rule()
    middle, half = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges) / 2.0
    return (middle[:, None] + half[:, None] * points).ravel(), np.outer(half, weights).ravel()


def _octaves(start: float, end: float) -> tuple[Array, Array]:
    """Return points and weights in panels of about an octave, linear in the logarithm."""
    number = max(1, int(np.ceil(np.log2(end / start) - 1e-9)))
    u, du = _linear(np.linspace(np.log(start), np.log(end), number + 1))
    x = np.exp(u)
    return x, du * x
