"""The tables of Maia et al., typed by hand from the paper, and what follows from them alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.score import beats, rms
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, ensemble
from imubench_pipeline.typing import Array

DURATION = 36_000.0
"""s; assumed, since the paper recommends ten hours and does not say how long its logs are."""

MEMBERS = 200
"""Reconstructions of each set of parameters, and logs that they are held against."""

_POINTS = 100
"""Averaging times, even in log tau from a sample to half of the log: the grid of the program that
the paper used."""


@dataclass(frozen=True)
class Channel:
    """One axis of one sensor, with what the paper prints of it; SI throughout."""

    name: str  # as the paper calls it
    sensor: str  # its sensor file
    channel: str
    rate: float  # Hz
    table_1: NoiseModel  # read from the curve
    table_2: NoiseModel  # optimised
    table_3: tuple[float, float]  # RMS of one reconstruction by Table 1, and by Table 2


def _model(N: float, B: float, K: float, T_B: float) -> NoiseModel:
    return NoiseModel(N=N, B=B, T_B=T_B, K=K)


CHANNELS = (
    Channel(
        "MTi-7 accelerometer", "mti_7", "accel_x", 100.0,
        _model(9.5e-4, 3.6e-4, 1.5e-5, 84.6), _model(9.6e-4, 3.4e-4, 1.7e-5, 38.3),
        (3.9e-4, 1.0e-4),
    ),
    Channel(
        "MTi-7 gyro", "mti_7", "gyro_x", 100.0,
        _model(8.5e-5, 5.7e-5, 1.0e-6, 223.5), _model(8.4e-5, 6.7e-5, 8.2e-7, 89.5),
        (4.2e-5, 8.6e-6),
    ),
    Channel(
        "C102-F9R accelerometer", "c102_f9r", "accel_x", 50.0,
        _model(1.1e-3, 7.2e-4, 1.5e-5, 18.5), _model(1.1e-3, 7.2e-4, 2.0e-5, 148.9),
        (4.2e-4, 1.2e-4),
    ),
    Channel(
        "C102-F9R gyro", "c102_f9r", "gyro_x", 50.0,
        _model(5.8e-3, 3.0e-3, 1.3e-4, 29.0), _model(5.7e-3, 3.4e-3, 8.7e-5, 68.3),
        (1.8e-3, 5.0e-4),
    ),
)  # fmt: skip

MTI_ACCEL, MTI_GYRO, C102_ACCEL, C102_GYRO = CHANNELS

TABLE_4 = {
    "N": {"accel_x": 12.0e-4, "gyro_x": 12.0e-5},
    "B": {"accel_x": 3.0e-4, "gyro_x": 4.8e-5},
}
"""What the manufacturer says of the MTi-7, as the paper prints it."""


@dataclass(frozen=True)
class Lottery:
    """How single reconstructions score against single logs of Table 2: medians, 90 % ranges."""

    state_space: tuple[float, float, float]  # reconstructed by Table 1: 5 %, 50 %, 95 %; SI
    optimised: tuple[float, float, float]  # by Table 2 itself, likewise
    beats: float  # chance that a reconstruction by Table 1 has the lower RMS of two
    beyond: tuple[float, float]  # shares of them at least as large as the printed figures
    slow: float  # share of the mean square that comes of tau beyond 300 s, by Table 2


def sizes(channel: Channel) -> NDArray[np.int64]:
    """Return the cluster sizes of the paper's program, shape (m,)."""
    samples = round(DURATION * channel.rate)
    grid = np.logspace(0.0, math.log10((samples - 1) / 2.0), _POINTS)
    return np.unique(np.ceil(grid)).astype(np.int64)


@lru_cache(maxsize=len(CHANNELS))
def lottery(channel: Channel) -> Lottery:
    """Return how Table 3 would spread, had the logs been the model of Table 2.

    Each of `MEMBERS` logs stands for the measured one, and is held against as many reconstructions
    by Table 1 and, of other draws, by Table 2.
    """
    n = sizes(channel)
    measured = _draws(channel, channel.table_2, "measured", n)
    drawn = [
        _draws(channel, model, use, n)
        for model, use in ((channel.table_1, "table 1"), (channel.table_2, "table 2"))
    ]
    of_each = [rms(one[:, None, :], measured[None, :, :]) for one in drawn]
    chances = [
        beats(first, second) for first, second in zip(of_each[0].T, of_each[1].T, strict=True)
    ]
    square = (drawn[1] - measured) ** 2
    beyond = [
        float(np.mean(values >= printed))
        for values, printed in zip(of_each, channel.table_3, strict=True)
    ]
    return Lottery(
        _range(of_each[0]),
        _range(of_each[1]),
        float(np.mean(chances)),
        (beyond[0], beyond[1]),
        float(square[:, n > 300.0 * channel.rate].sum() / square.sum()),
    )


def _draws(channel: Channel, model: NoiseModel, use: str, n: NDArray[np.int64]) -> Array:
    rng = channel_rng(1, channel.sensor, channel.channel, use)
    samples = round(DURATION * channel.rate)
    return np.sqrt(ensemble(model, channel.rate, samples, n, MEMBERS, rng))


def _range(values: Array) -> tuple[float, float, float]:
    lower, median, upper = np.quantile(values, [0.05, 0.5, 0.95]).tolist()
    return lower, median, upper


@cache
def lowest_point(model: NoiseModel) -> tuple[float, float]:
    """Return tau, s, and Allan deviation, SI, of the lowest point of a curve from 1 s on."""
    tau = np.geomspace(1.0, DURATION / 2.0, 20_001)
    variance = model.allan_variance(tau)
    place = int(np.argmin(variance))
    return float(tau[place]), math.sqrt(float(variance[place]))
