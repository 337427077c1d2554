"""Short logs of a gyro that is turned, with turns where a test wants them."""

import math
from collections.abc import Sequence

import numpy as np

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

DEGREE = math.pi / 180.0
RATE = 32.0
PAPER = NoiseModel(N=0.0122 * DEGREE, B=0.0027 * DEGREE, T_B=238.1, K=6.8314e-5 * DEGREE)
EARTH = 7.292115e-5
TURN = 1.5


def turned(
    starts: Sequence[float],
    duration: float,
    *,
    peak: float = 3.0,
    first: int = 1,
    noise: NoiseModel = PAPER,
    rate: float = RATE,
    seed: int = 1,
) -> np.ndarray:
    """Return a log with turns of 1.5 s from ``starts`` on, their transients of ``peak`` deg/s."""
    log = simulate(noise, rate, round(duration * rate), np.random.default_rng(seed)) + 0.002
    time = np.arange(len(log)) / rate
    turns = np.sum([time >= start + TURN / 2 for start in starts], axis=0, initial=0)
    log += first * (-1.0) ** turns * EARTH
    for start in starts:
        bump(log, start, TURN, peak, rate)
    return log


def bump(log: np.ndarray, start: float, length: float, peak: float, rate: float = RATE) -> None:
    """Add half a sine wave of a peak in deg/s."""
    first, count = round(start * rate), max(1, round(length * rate))
    log[first : first + count] += peak * DEGREE * np.sin(np.pi * (np.arange(count) + 0.5) / count)
