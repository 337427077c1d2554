"""Densities, folding and Allan variance, written apart from the library."""

from collections.abc import Callable

import numpy as np

Array = np.ndarray


def butterworth(f: Array, cutoff: float, order: int) -> Array:
    """|H|^2 from the poles of the filter, not from its closed form."""
    poles = np.exp(1j * np.pi * (0.5 + (2 * np.arange(order) + 1) / (2 * order)))
    s = 1j * np.asarray(f)[..., None] / cutoff
    return np.abs(np.prod(-poles) / np.prod(s - poles, axis=-1)) ** 2


def gauss_markov(f: Array, B: float, T_B: float) -> Array:
    driving = 2 * B**2 * np.log(2) / (np.pi * 0.4365**2 * T_B)
    return driving / (1 / T_B**2 + (2 * np.pi * f) ** 2)


def folded(density: Callable[[Array], Array], f: Array, rate: float, folds: int = 400) -> Array:
    """Two-sided density of the samples: the sum over the images, the far ones as an integral."""
    k = np.arange(-folds, folds + 1)
    near = density(np.abs(f[:, None] + k * rate)).sum(axis=1)
    edges = np.geomspace((folds + 0.5) * rate, 1e4 * folds * rate, 4001)
    return near + 2 * np.trapezoid(density(edges) * edges, np.log(edges)) / rate


def allan_variance(
    density: Callable[[Array], Array], n: Array, rate: float, lowest: float
) -> Array:
    """Integral of the folded density times the filter of the Allan variance of samples."""
    f = np.concatenate(
        [np.geomspace(lowest, 1e-3 * rate, 8_000), np.linspace(1e-3 * rate, rate / 2, 24_000)[1:]]
    )
    S = np.concatenate([folded(density, part, rate, 40) for part in np.array_split(f, 40)])
    found = []
    for size in n:
        x = np.pi * f / rate
        found.append(np.trapezoid(4 * S * np.sin(size * x) ** 4 / (size * np.sin(x)) ** 2, f))
    return np.array(found)
