"""What runs say of a tuning: errors at the end of outages, and whether they are as it claims.

A root mean square is over runs and outages; its interval is by the scatter of the runs, which are
independent, on a logarithmic scale. Tunings that ran on the same signals are compared run by run:
their ratio is surer than either. Where NEES is within its 95 % bounds in 95 % of the epochs,
errors are as large as the filter says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

from imubench_pipeline.experiments.aided.error_state import DEGREES, GROUPS
from imubench_pipeline.experiments.aided.runs import WARM_UP, Drive, Outcome
from imubench_pipeline.typing import Array

ERRORS = ("position", "velocity", "heading")
"""What is measured: in the plane, in the plane, and about the vertical; m, m/s, rad."""

_COLUMNS = {"position": [0, 1], "velocity": [3, 4], "heading": [8]}


@dataclass(frozen=True)
class Interval:
    """A figure with its 95 % limits."""

    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Share:
    """A share of the epochs with its standard error, by the scatter of the runs or more."""

    value: float
    error: float


def within(drive: Drive, length: float | None) -> NDArray[np.bool_]:
    """Return which epochs are in outages of a length in s; None: those with fixes, once warm."""
    if length is None:
        return np.asarray(drive.available & (drive.times > WARM_UP))
    chosen = np.zeros(len(drive.times), dtype=np.bool_)
    chosen[drive.of_outages(length)] = True
    return chosen


def squares(drive: Drive, outcome: Outcome, error: str, length: float | None) -> Array:
    """Return the mean square of an error of each run, shape (R,).

    At the end of outages of a length in s, or, None, at all fixes.
    """
    return _means(drive, outcome.errors[:, :, _COLUMNS[error]] ** 2, length)


def predicted(drive: Drive, outcome: Outcome, error: str, length: float | None) -> float:
    """Return the root mean square of an error that the filter expects, likewise."""
    return math.sqrt(_means(drive, outcome.variances[:, :, _COLUMNS[error]], length).mean())


def _means(drive: Drive, parts: Array, length: float | None) -> Array:
    """Return the mean over epochs of the sum of parts, shape (R, E, parts), of each run.

    At the very end of outages, which may lie between two epochs: squares are taken as linear there.
    """
    total = parts.sum(axis=2)
    if length is None:
        return np.asarray(total[:, within(drive, None)].mean(axis=1))
    last = drive.of_outages(length)[:, -1]
    beyond = (last[0] - drive.of_outages(length)[0, 0] + 1) - length / drive.period
    return np.asarray(((1.0 - beyond) * total[:, last] + beyond * total[:, last - 1]).mean(axis=1))


def root_mean_square(of_runs: Array) -> Interval:
    """Return the root of the mean of mean squares, shape (R,), with limits by their scatter."""
    mean = float(of_runs.mean())
    return _interval(math.sqrt(mean), of_runs / mean)


def ratio(of_runs: Array, others: Array) -> Interval:
    """Return the ratio of two such roots of the same runs, shapes (R,)."""
    square = float(of_runs.mean() / others.mean())
    return _interval(math.sqrt(square), (of_runs - square * others) / of_runs.mean())


def _interval(value: float, relative: Array) -> Interval:
    """Return limits of a root, by the scatter of parts relative to what it is the root of."""
    runs = len(relative)
    spread = 0.5 * float(relative.std(ddof=1)) / math.sqrt(runs)
    factor = math.exp(float(t.ppf(0.975, runs - 1)) * spread)
    return Interval(value, value / factor, value * factor)


def inside(drive: Drive, outcome: Outcome, group: str, length: float | None) -> Share | None:
    """Return the share of epochs whose NEES of a group of `GROUPS` is within its 95 % bounds.

    None where the truth of the group is not known.
    """
    place = GROUPS.index(group)
    nees = outcome.normalised[:, within(drive, length), place]
    if np.isnan(nees).any():
        return None
    low, high = (float(chi2.ppf(chance, DEGREES[place])) for chance in (0.025, 0.975))
    of_runs = np.mean((nees > low) & (nees < high), axis=1)
    scatter = float(of_runs.std(ddof=1)) / math.sqrt(len(of_runs))
    # Few runs may all be inside by chance: an outage, or a minute with fixes, is worth one epoch.
    stretches = len(drive.of_outages(length)) if length is not None else int(drive.times[-1] // 60)
    least = math.sqrt(0.95 * 0.05 / (len(of_runs) * max(stretches, 1)))
    return Share(float(of_runs.mean()), max(scatter, least))
