"""Logs of known noise, made with numpy and scipy alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

RATE = 20.0
N, SIGMA, T_B, K = 1e-4, 1.5e-4, 80.0, 1e-6
"""SI: of a gyro whose bias instability is well seen; SIGMA is the deviation of the process."""


def gauss_markov(rng: np.random.Generator, samples: int, sigma: float, time: float) -> Array:
    """Return a first-order Gauss-Markov process in its stationary state."""
    decay = np.exp(-1.0 / RATE / time)
    drive = sigma * np.sqrt(1.0 - decay**2) * rng.standard_normal(samples)
    drive[0] = sigma * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -decay], drive))


def static_log(seed: int, hours: float = 3.0, walk: float = K) -> Array:
    """Return white noise, a Gauss-Markov process and a random walk."""
    rng = np.random.default_rng(seed)
    samples = int(hours * 3600 * RATE)
    white = N * np.sqrt(RATE) * rng.standard_normal(samples)
    walked = walk / np.sqrt(RATE) * np.cumsum(rng.standard_normal(samples))
    return np.asarray(white + gauss_markov(rng, samples, SIGMA, T_B) + walked)


def times(log: Array) -> Array:
    """Return the time of each sample, s."""
    return np.arange(len(log)) / RATE
