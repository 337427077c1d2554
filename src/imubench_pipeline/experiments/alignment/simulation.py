"""Simulated runs of a triad at rest: block means of many runs, from their exact distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.experiments.alignment.triad import Positions, Site, Triad
from imubench_pipeline.experiments.earth_rate.simulation import simulate_runs
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Runs:
    """Simulated runs of one design, and their truth.

    Attributes
    ----------
    means : ndarray, shape (runs, b, 6)
        Block means of gyros and accelerometers x, y, z, rad/s and m/s^2.
    drift : ndarray, shape (runs, b, 6)
        Mean of each axis' slow error over each block, its bias included.
    """

    means: Array
    drift: Array


def true_means(positions: Positions, site: Site, attitude: Array) -> Array:
    """Return what a triad without error shows.

    Parameters
    ----------
    positions : Positions
    site : Site
    attitude : ndarray, shape (3, 3)
        In the first position.

    Returns
    -------
    ndarray, shape (b, 6)
        Gyros and accelerometers x, y, z, rad/s and m/s^2.
    """
    to_body = np.swapaxes(attitude @ positions.of_blocks, 1, 2)
    return np.concatenate([to_body @ site.earth_rate, to_body @ site.specific_force], axis=1)


def simulate_triad(
    triad: Triad,
    positions: Positions,
    site: Site,
    attitude: Array,
    *,
    runs: int,
    rng: np.random.Generator,
) -> Runs:
    """Draw the block means of many runs.

    Parameters
    ----------
    triad : Triad
        The fixed biases are drawn for each run.
    positions : Positions
    site : Site
    attitude : ndarray, shape (3, 3)
        In the first position.
    runs : int
    rng : numpy.random.Generator
    """
    drawn = [
        simulate_runs(
            model, positions.blocks, earth_rate=0.0, turn_on_bias=bias, runs=runs, rng=stream
        )
        for (model, bias), stream in zip(triad.axes, rng.spawn(6), strict=True)
    ]
    errors = np.stack([one.means for one in drawn], axis=2)
    drift = np.stack([one.drift for one in drawn], axis=2)
    return Runs(errors + true_means(positions, site, attitude), drift)
