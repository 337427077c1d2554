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


def at_ends(drive: Drive, length: float) -> NDArray[np.int64]:
    """Return the last epoch of each outage of a length in s."""
    ends = [o.begin + o.length for o in drive.outages if o.length == length]
    return np.searchsorted(drive.times, np.array(ends) + 1e-9) - 1


def within(drive: Drive, length: float | None) -> NDArray[np.bool_]:
    """Return which epochs are in outages of a length in s; None: those with fixes, once warm."""
    if length is None:
        return np.asarray(drive.available & (drive.times > WARM_UP))
    chosen = np.zeros(len(drive.times), dtype=np.bool_)
    for outage in drive.outages:
        if outage.length == length:
            since = drive.times - outage.begin
            chosen |= (since > 1e-9) & (since < length + 1e-9)
    return chosen


def squares(drive: Drive, outcome: Outcome, error: str, length: float | None) -> Array:
    """Return the mean square of an error of each run, shape (R,).

    At the end of outages of a length in s, or, None, at all fixes.
    """
    chosen = at_ends(drive, length) if length is not None else np.flatnonzero(within(drive, None))
    errors = outcome.errors[:, chosen][:, :, _COLUMNS[error]]
    return np.asarray(np.mean(np.sum(errors**2, axis=2), axis=1))


def predicted(drive: Drive, outcome: Outcome, error: str, length: float | None) -> float:
    """Return the root mean square of an error that the filter expects, likewise."""
    chosen = at_ends(drive, length) if length is not None else np.flatnonzero(within(drive, None))
    variances = outcome.variances[:, chosen][:, :, _COLUMNS[error]]
    return math.sqrt(float(np.mean(np.sum(variances, axis=2))))


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
    stretches = len(at_ends(drive, length)) if length is not None else int(drive.times[-1] // 60)
    least = math.sqrt(0.95 * 0.05 / (len(of_runs) * max(stretches, 1)))
    return Share(float(of_runs.mean()), max(scatter, least))
