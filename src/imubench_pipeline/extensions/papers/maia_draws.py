"""Printed parameters of Maia et al., and the spread of single logs and reconstructions of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.score import beats, rms
from imubench_pipeline.extensions.papers.evidence import Log
from imubench_pipeline.extensions.papers.printed import parse_number, read_paper
from imubench_pipeline.noise import FLOOR, PEAK_TAU, NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, ensemble
from imubench_pipeline.typing import Array

DURATION = 36_000.0
"""s; assumed, since the paper recommends ten hours and does not say how long its logs are."""

MEMBERS = 200
"""Number of reconstructions of each set of parameters, and of logs for the comparison."""

Grid = Literal["steps", "every"]

GRIDS: tuple[Grid, ...] = ("steps", "every")
"""The paper does not print at which tau it compares two curves: the program that it names plots
1, 2, ... 9, 10, 20, ... samples; its equation 10 has every n up to half of the log."""

_CLUSTER_SIZES = 100
"""Number of cluster sizes in place of every n: the middles of equal parts."""


@dataclass(frozen=True)
class Channel:
    """One axis of one sensor with its printed values, SI."""

    name: str  # as the paper calls it
    sensor: str  # its sensor file
    channel: str
    rate: float  # Hz
    table_1: NoiseModel  # read from the curve
    table_2: NoiseModel  # optimised
    table_3: tuple[float, float]  # RMS of one reconstruction by Table 1, and by Table 2

    @property
    def log(self) -> Log:
        """The simulated log."""
        return Log(self.sensor, "sim_published", self.channel)


def _read_channels() -> dict[str, Channel]:
    figures = read_paper("maia").figures

    def model(key: str, table: str) -> NoiseModel:
        by = {row["symbol"]: parse_number(row[table]) for row in figures[key]}
        return NoiseModel(N=by["N"], B=by["B"], K=by["K"], T_B=by["T_B"])

    return {
        row["key"]: Channel(
            row["name"],
            row["sensor"],
            row["channel"],
            float(row["rate"]),
            model(row["key"], "table_1"),
            model(row["key"], "table_2"),
            (parse_number(row["state_space"]), parse_number(row["optimised"])),
        )
        for row in figures["channels"]
    }


CHANNELS = _read_channels()
"""The channels of the paper by their keys."""

MTI_GYRO = CHANNELS["mti_gyro"]

Range = tuple[float, float, float]
"""The quantiles of 5, 50 and 95 %, SI."""


@dataclass(frozen=True)
class Lottery:
    """Scores of single reconstructions against single logs of Table 2, for one grid of tau."""

    ranges: tuple[Range, Range]  # reconstructed by Table 1, and by Table 2 itself
    beats: float  # chance that a reconstruction by Table 1 has the lower RMS of two
    beyond: tuple[float, float]  # shares of them at least as large as the printed figures
    slow: float  # share of the mean square that comes of tau beyond 300 s, by Table 2


def choose_cluster_sizes(channel: Channel, grid: str) -> NDArray[np.int64]:
    """Return the cluster sizes of a grid of `GRIDS`, or ("read") of reading a curve, shape (m,)."""
    longest = round(DURATION * channel.rate) // 2
    if grid == "steps":
        steps = np.outer(10 ** np.arange(len(str(longest))), np.arange(1, 10)).ravel()
        return steps[steps <= longest]
    if grid == "every":
        chosen = (np.arange(_CLUSTER_SIZES) + 0.5) * longest / _CLUSTER_SIZES
    else:
        chosen = np.geomspace(1.0, DURATION / 9.0, _CLUSTER_SIZES) * channel.rate
    return np.rint(chosen).astype(np.int64)


@cache
def simulate_lottery(channel: Channel, grid: Grid) -> Lottery:
    """Return the spread of Table 3 for logs with the model of Table 2.

    Each of `MEMBERS` logs stands for the measured one, and is held against as many reconstructions
    by Table 1 and, of other draws, by Table 2.
    """
    n = choose_cluster_sizes(channel, grid)
    measured, *drawn = (curves[grid] for curves in _simulate_deviations(channel))
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
        (_compute_range(of_each[0]), _compute_range(of_each[1])),
        float(np.mean(chances)),
        (beyond[0], beyond[1]),
        float(square[:, n > 300.0 * channel.rate].sum() / square.sum()),
    )


@cache
def simulate_readings(channel: Channel) -> dict[str, Range]:
    """Return what reading the curves of single logs of Table 2 gives of N, B, K and T_B.

    N is read at 1 s, K at a ninth of the log, B and T_B at the lowest point between them.
    """
    tau = choose_cluster_sizes(channel, "read") / channel.rate
    curves = _simulate_deviations(channel)[0]["read"]
    return {
        "N": _compute_range(curves[:, 0] * math.sqrt(tau[0])),
        "B": _compute_range(curves.min(axis=1) / FLOOR),
        "K": _compute_range(curves[:, -1] * math.sqrt(3.0 / tau[-1])),
        "T_B": _compute_range(tau[curves.argmin(axis=1)] / PEAK_TAU),
    }


@cache
def _simulate_deviations(channel: Channel) -> tuple[dict[str, Array], ...]:
    """Return Allan deviations: of logs of Table 2, of draws by Table 1, of others by Table 2."""
    grids = {grid: choose_cluster_sizes(channel, grid) for grid in (*GRIDS, "read")}
    together = np.unique(np.concatenate(list(grids.values())))
    samples = round(DURATION * channel.rate)

    def of(model: NoiseModel, use: str) -> dict[str, Array]:
        rng = channel_rng(1, channel.sensor, channel.channel, use)
        curves = np.sqrt(ensemble(model, channel.rate, samples, together, MEMBERS, rng))
        return {grid: curves[:, np.searchsorted(together, n)] for grid, n in grids.items()}

    return (
        of(channel.table_2, "measured"),
        of(channel.table_1, "table 1"),
        of(channel.table_2, "table 2"),
    )


def _compute_range(values: Array) -> Range:
    lower, median, upper = np.quantile(values, [0.05, 0.5, 0.95]).tolist()
    return lower, median, upper


@cache
def find_lowest_point(model: NoiseModel) -> tuple[float, float]:
    """Return tau, s, and Allan deviation, SI, of the lowest point of a curve from 1 s on."""
    tau = np.geomspace(1.0, DURATION / 2.0, 20_001)
    variance = model.allan_variance(tau)
    place = int(np.argmin(variance))
    return float(tau[place]), math.sqrt(float(variance[place]))
