"""Evaluate runs of a tuning: errors at the end of outages, and consistency of the filter (NEES).

A root mean square is over runs and outages. Its interval follows from the scatter of the
independent runs, on a logarithmic scale. Tunings with the same signals are compared run by run, so
that their ratio is more precise than either. If NEES is within its 95 % bounds in 95 % of the
epochs, the errors agree with the covariance of the filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

from imubench_pipeline.extensions.aided.error_state import DEGREES_OF_FREEDOM, GROUPS
from imubench_pipeline.extensions.aided.runs import WARM_UP, Drive, Outcome
from imubench_pipeline.typing import Array

ERRORS = ("position", "velocity", "heading")
"""Evaluated errors: horizontal position and velocity, and heading; m, m/s, rad."""

_ERROR_COLUMNS = {"position": [0, 1], "velocity": [3, 4], "heading": [8]}


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % limits."""

    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Share:
    """A share of the epochs and its standard error, at least from the scatter of the runs."""

    value: float
    error: float


def select_epochs(drive: Drive, length: float | None) -> NDArray[np.bool_]:
    """Return a mask of the epochs in outages of this length, s; None: fixes after warm-up."""
    if length is None:
        return np.asarray(drive.available & (drive.times > WARM_UP))
    chosen = np.zeros(len(drive.times), dtype=np.bool_)
    chosen[drive.of_outages(length)] = True
    return chosen


def compute_mean_squares(drive: Drive, outcome: Outcome, error: str, length: float | None) -> Array:
    """Return the mean square of an error of each run, shape (R,), at the end of outages.

    They have this length, s; None: at all fixes.
    """
    return _average_epochs(drive, outcome.errors[:, :, _ERROR_COLUMNS[error]] ** 2, length)


def predict_root_mean_square(
    drive: Drive, outcome: Outcome, error: str, length: float | None
) -> float:
    """Return the root mean square of an error by the variances of the filter."""
    return math.sqrt(
        _average_epochs(drive, outcome.variances[:, :, _ERROR_COLUMNS[error]], length).mean()
    )


def _average_epochs(drive: Drive, parts: Array, length: float | None) -> Array:
    """Return the mean over epochs of the sum of parts, shape (R, E, parts), of each run.

    For outages at their exact end; between two epochs the squares are interpolated linearly.
    """
    total = parts.sum(axis=2)
    if length is None:
        return np.asarray(total[:, select_epochs(drive, None)].mean(axis=1))
    last = drive.of_outages(length)[:, -1]
    beyond = (last[0] - drive.of_outages(length)[0, 0] + 1) - length / drive.period
    return np.asarray(((1.0 - beyond) * total[:, last] + beyond * total[:, last - 1]).mean(axis=1))


def compute_root_mean_square(of_runs: Array) -> Interval:
    """Return the root of the mean of mean squares, shape (R,), with limits from their scatter."""
    mean = float(of_runs.mean())
    return _compute_interval(math.sqrt(mean), of_runs / mean)


def compute_ratio(of_runs: Array, others: Array) -> Interval:
    """Return the ratio of two such roots of the same runs, shapes (R,)."""
    square = float(of_runs.mean() / others.mean())
    return _compute_interval(math.sqrt(square), (of_runs - square * others) / of_runs.mean())


def _compute_interval(value: float, relative: Array) -> Interval:
    """Return limits of a root, from the scatter of the relative terms of its square."""
    runs = len(relative)
    spread = 0.5 * float(relative.std(ddof=1)) / math.sqrt(runs)
    factor = math.exp(float(t.ppf(0.975, runs - 1)) * spread)
    return Interval(value, value / factor, value * factor)


def compute_nees_share(
    drive: Drive, outcome: Outcome, group: str, length: float | None
) -> Share | None:
    """Return the share of epochs whose NEES of a group is within 95 % bounds; None if unknown."""
    place = GROUPS.index(group)
    nees = outcome.normalised[:, select_epochs(drive, length), place]
    if np.isnan(nees).any():
        return None
    low, high = (float(chi2.ppf(chance, DEGREES_OF_FREEDOM[place])) for chance in (0.025, 0.975))
    of_runs = np.mean((nees > low) & (nees < high), axis=1)
    scatter = float(of_runs.std(ddof=1)) / math.sqrt(len(of_runs))
    # A few runs may all be inside by chance: one outage or minute counts as one independent epoch.
    stretches = len(drive.of_outages(length)) if length is not None else int(drive.times[-1] // 60)
    least = math.sqrt(0.95 * 0.05 / (len(of_runs) * max(stretches, 1)))
    return Share(float(of_runs.mean()), max(scatter, least))
