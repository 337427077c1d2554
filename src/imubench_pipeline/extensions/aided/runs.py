"""Repeat runs of a filter with several tunings on the same signals."""

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

from imubench_pipeline.extensions.aided.axis_states import AxisStates, StackedStates, stack_axes
from imubench_pipeline.extensions.aided.error_state import DEGREES_OF_FREEDOM, GROUPS, run_filter
from imubench_pipeline.extensions.aided.strapdown import write_rotation
from imubench_pipeline.extensions.aided.trajectories import Signals, Trajectory
from imubench_pipeline.typing import Array

FIX_INTERVAL = 1.0  # time between two fixes, s, rounded to whole samples
MAX_STEP = 0.1  # longest step over which transition and noise are accumulated, s
INITIAL_TILT_SIGMA, INITIAL_HEADING_SIGMA = math.radians(0.5), math.radians(2.0)  # rad
WARM_UP = 120.0  # time with GNSS before the evaluation begins, s
RECOVERY_TIME = 40.0  # time with GNSS between two outages, s


def schedule_outages(duration: float, lengths: Sequence[float]) -> list[tuple[float, float]]:
    """Return begin and length of outages, s, repeated until a run of this duration, s, ends."""
    outages: list[tuple[float, float]] = []
    begin = WARM_UP
    while True:
        for length in lengths:
            if begin + length > duration:
                return outages
            outages.append((begin, length))
            begin += length + RECOVERY_TIME


@dataclass(frozen=True)
class Outcome:
    """Results of a tuning, from R runs of E fixes; see `error_state.run_filter`."""

    errors: Array  # (R, E, 9)
    variances: Array  # (R, E, 9)
    normalised: Array  # (R, E, 6)
    states: int  # number of states of the filter


class Drive:
    """A trajectory with outages of GNSS (begin and length, s), on which filters are run."""

    def __init__(self, trajectory: Trajectory, outages: Sequence[tuple[float, float]]) -> None:
        self.trajectory = trajectory
        rate = trajectory.sampling
        self.every = max(round(rate * FIX_INTERVAL), 1)
        widest = min(math.ceil(rate * MAX_STEP), self.every)
        # The longest step that divides the time between two fixes.
        self.width = next(width for width in range(widest, 0, -1) if self.every % width == 0)
        self.steps = self.every // self.width
        self.at: NDArray[np.int64] = np.arange(self.every, len(trajectory.rate) + 1, self.every)
        self.times = self.at / rate
        self.available = np.ones(len(self.at), dtype=np.bool_)
        # An outage lasts from a fix to the first one after its end. If its length is not a multiple
        # of the period, the error at its exact end is interpolated between two epochs.
        self.period = self.every / rate
        self._last_fixes: dict[float, list[int]] = {}  # before each outage, by its length
        for begin, length in outages:
            last = int(np.searchsorted(self.times, begin + 1e-9)) - 1
            end = last + self._epochs(length)
            if end < len(self.times):
                self._last_fixes.setdefault(length, []).append(last)
                self.available[last + 1 : end + 1] = False
        heading = min(INITIAL_HEADING_SIGMA, trajectory.gnss.heading)
        attitude = [INITIAL_TILT_SIGMA, INITIAL_TILT_SIGMA, heading]
        self._sigmas = np.array([*trajectory.gnss.spread[:6], *attitude])

    def _epochs(self, length: float) -> int:
        return math.ceil(length / self.period - 1e-6)

    def of_outages(self, length: float) -> NDArray[np.int64]:
        """Return the epochs of each outage of this length, s, shape (outages, epochs)."""
        lasts = np.array(self._last_fixes.get(length, []), dtype=np.int64)
        return np.add.outer(lasts, 1 + np.arange(self._epochs(length)))

    def stacked(self, axes: Sequence[AxisStates]) -> StackedStates:
        """Return the states of six axes over the steps of this drive."""
        return stack_axes(axes, self.trajectory.sampling, self.width, self.steps)

    def filter(self, stacked: StackedStates, signals: Signals) -> tuple[Array, Array, Array, Array]:
        """Run the filter once; the result is as in `error_state.run_filter`."""
        way = self.trajectory
        off = self._sigmas * signals.start
        turn = np.empty((3, 3))
        write_rotation(-off[6], -off[7], -off[8], turn)
        return run_filter(
            signals.rate,
            signals.force,
            1.0 / way.sampling,
            way.earth,
            signals.fixes,
            self.available,
            way.gnss.spread,
            way.position[self.at],
            way.velocity[self.at],
            way.attitude[self.at],
            signals.bias,
            way.position[0] - off[:3],
            way.velocity[0] - off[3:6],
            turn @ way.attitude[0],
            np.diag(self._sigmas**2),
            stacked,
            self.width,
        )

    def repeat(
        self,
        tunings: Mapping[str, Sequence[AxisStates]],
        signals: Callable[[int], Signals],
        runs: int,
        threads: int = 1,
    ) -> dict[str, Outcome]:
        """Run every tuning on the same signals; ``signals`` takes the number of the run."""
        stacked = {name: self.stacked(axes) for name, axes in tunings.items()}

        def once(number: int) -> dict[str, tuple[Array, ...]]:
            of_run = signals(number)
            return {name: self.filter(each, of_run)[:3] for name, each in stacked.items()}

        with ThreadPoolExecutor(max(1, threads)) as pool:
            done = list(pool.map(once, range(runs)))
        outcomes = {}
        for name, states in stacked.items():
            errors, variances, normalised = (
                np.stack([each[name][part] for each in done]) for part in range(3)
            )
            outcomes[name] = Outcome(errors, variances, normalised, states.states)
        return outcomes


ERRORS = {"position": [0, 1], "velocity": [3, 4], "heading": [8]}
"""Columns of the evaluated errors: horizontal position and velocity, and heading; m, m/s, rad."""


Interval = tuple[float, float, float]
"""A value with its 95 % limits, lower and upper."""


@dataclass(frozen=True)
class Share:
    """A fraction of the epochs, with its standard error from the scatter of the runs or more."""

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
    """Return mean squares of an error after outages of a length, s (None: at fixes), shape (R,)."""
    return _average_epochs(drive, outcome.errors[:, :, ERRORS[error]] ** 2, length)


def predict_root_mean_square(
    drive: Drive, outcome: Outcome, error: str, length: float | None
) -> float:
    """Return the root mean square of an error that the variances of the filter predict."""
    return math.sqrt(_average_epochs(drive, outcome.variances[:, :, ERRORS[error]], length).mean())


def _average_epochs(drive: Drive, parts: Array, length: float | None) -> Array:
    """Return the mean over epochs, or exact ends of outages, of sums of parts, (R, E, parts)."""
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
    """Return the ratio of two rms errors, with limits, from mean squares by run, shapes (R,).

    The numerator is from ``of_runs``; ``others`` has the same unit.
    """
    square = float(of_runs.mean() / others.mean())
    return _compute_interval(math.sqrt(square), (of_runs - square * others) / of_runs.mean())


def _compute_interval(value: float, relative: Array) -> Interval:
    """Return limits of a root, from the scatter of the relative terms of its square."""
    runs = len(relative)
    spread = 0.5 * float(relative.std(ddof=1)) / math.sqrt(runs)
    factor = math.exp(float(t.ppf(0.975, runs - 1)) * spread)
    return value, value / factor, value * factor


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
