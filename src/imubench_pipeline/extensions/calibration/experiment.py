"""An Earth-rate experiment: dwells at two opposite positions, and the means of blocks within them.

At rest a gyro with a horizontal axis to the north reads the Earth's rate times the cosine of the
latitude, to the south the same with the opposite sign, and its bias both times. All estimates use
means of blocks of samples within one dwell.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.missing import yield_present_samples
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.terms.base import SampleBlocks
from imubench_pipeline.typing import Array

Integers = NDArray[np.int64]

_MIN_PRESENT_SHARE = 0.5  # of the samples of a block, or its mean is left out


@dataclass(frozen=True)
class Dwell:
    """Samples at rest in one position; ValueError without a sample, or if sense is not 1 or -1."""

    # start, stop: first sample of the log, and the one past the last
    start: int
    stop: int
    sense: int  # 1: the axis points north; -1: south

    def __post_init__(self) -> None:
        if not 0 <= self.start < self.stop:
            raise ValueError(f"a dwell from sample {self.start} to {self.stop} has no sample")
        if self.sense not in (1, -1):
            raise ValueError(f"sense is {self.sense}, expected 1 (north) or -1 (south)")


@dataclass(frozen=True)
class Experiment:
    """Dwells in order of time, rate and latitude; ValueError if out of order or range."""

    dwells: Sequence[Dwell]  # at least one; two of one sense in a row: a turn was missed
    rate: float  # sampling rate, Hz
    latitude: float  # rad

    def __post_init__(self) -> None:
        if not self.dwells:
            raise ValueError("an experiment has no dwells, expected at least one")
        for before, after in pairwise(self.dwells):
            if after.start < before.stop:
                raise ValueError(
                    f"a dwell begins at sample {after.start}, expected {before.stop} or later: the "
                    "previous dwell ends there"
                )
        if not (math.isfinite(self.rate) and self.rate > 0):
            raise ValueError(f"the rate is {self.rate} Hz, expected a frequency above 0")
        if not abs(self.latitude) < math.pi / 2.0:
            raise ValueError(
                f"latitude is {self.latitude}, expected an angle between the poles, in rad"
            )

    @classmethod
    def regular(
        cls,
        *,
        dwell: float,
        turning: float,
        dwells: int,
        rate: float,
        latitude: float,
        first: int = 1,
    ) -> "Experiment":
        """Return dwells of equal length; the sense alternates (1, -1); arguments in s, Hz, rad."""
        length = max(round(dwell * rate), 1)
        period = length + max(round(turning * rate), 0)
        return cls(
            tuple(Dwell(i * period, i * period + length, first * (-1) ** i) for i in range(dwells)),
            rate,
            latitude,
        )

    @property
    def samples_in_dwells(self) -> int:
        """Number of samples in dwells."""
        return sum(dwell.stop - dwell.start for dwell in self.dwells)

    def blocks(self, longest: int) -> "Blocks":
        """Divide the dwells of a log without gaps into blocks of at most ``longest`` samples."""
        if longest < 1:
            raise ValueError(f"longest is {longest}, expected at least 1 sample")
        edges = []
        for dwell in self.dwells:
            length = dwell.stop - dwell.start
            count = -(-length // longest)
            edges.append(dwell.start + np.arange(count + 1) * length // count)
        number = [len(of_dwell) - 1 for of_dwell in edges]
        start = np.concatenate([of_dwell[:-1] for of_dwell in edges])
        stop = np.concatenate([of_dwell[1:] for of_dwell in edges])
        sense = np.array([dwell.sense for dwell in self.dwells], dtype=np.float64)
        return Blocks(
            start=start,
            stop=stop,
            count=stop - start,
            sense=np.repeat(sense, number),
            dwell=np.repeat(np.arange(len(edges)), number),
            rate=self.rate,
            latitude=self.latitude,
        )


@dataclass(frozen=True, kw_only=True)
class Blocks(SampleBlocks):
    """Blocks of samples, each within one dwell, in their order."""

    sense: Array  # shape (b,); 1 north, -1 south
    dwell: Integers  # shape (b,); number of the dwell, from 0, rising
    latitude: float  # rad

    def __len__(self) -> int:
        return len(self.start)

    @property
    def seen(self) -> Array:
        """Sensitivity of each block to the Earth's rate, (b,): cos(latitude) times 1 or -1."""
        return self.sense * math.cos(self.latitude)

    @property
    def end(self) -> Array:
        """Time at the end of each block, s from the first sample, shape (b,)."""
        return np.asarray((self.stop - self.start[0]) / self.rate)

    @property
    def duration(self) -> float:
        """Time from the first sample to the end of the last block, s."""
        return float(self.stop[-1] - self.start[0]) / self.rate

    @property
    def time_in_blocks(self) -> float:
        """Total duration of the samples present, s."""
        return float(self.count.sum()) / self.rate

    def check_means(self, means: Array) -> None:
        """Raise ValueError unless the means are finite and of shape (runs, b)."""
        if means.ndim != 2 or means.shape[1] != len(self):
            raise ValueError(
                f"the means have the shape {means.shape}, expected {len(self)} columns"
            )
        if not np.isfinite(means).all():
            raise ValueError("a block mean is not finite; leave its block out")

    def chosen(self, which: NDArray[np.bool_] | NDArray[np.int64] | slice) -> "Blocks":
        """Return the selected blocks; ``which``: a mask, shape (b,), indices, or a slice."""
        arrays = ("start", "stop", "count", "sense", "dwell")
        return replace(self, **{name: getattr(self, name)[which] for name in arrays})

    def of_dwells(self) -> "Blocks":
        """Return one block per dwell, which covers all blocks of the dwell."""
        first = np.flatnonzero(np.diff(self.dwell, prepend=-1))
        last = np.append(first[1:], len(self)) - 1
        count = np.add.reduceat(self.count, first)
        return replace(self.chosen(first), stop=self.stop[last], count=count)

    def means_of_dwells(self, means: Array) -> Array:
        """Return the means of dwells, (runs, dwells), from means of blocks, shape (runs, b)."""
        first = np.flatnonzero(np.diff(self.dwell, prepend=-1))
        total = np.add.reduceat(means * self.count, first, axis=1)
        return np.asarray(total / np.add.reduceat(self.count, first))


@dataclass(frozen=True)
class Measured:
    """The block means of a log, and the left-out samples."""

    blocks: Blocks  # blocks with enough samples present
    means: Array  # shape (1, b); rad/s, a row for the one log
    missing: int  # samples within dwells that are missing (NaN)
    left_out: int  # samples present in blocks with too few


def block_means(parts: Iterable[Array], experiment: Experiment, longest: int) -> Measured:
    """Average a log over blocks of at most ``longest`` samples within dwells, in one pass.

    The mean is over the samples present; a block with more than half missing is left out. With a
    third of all samples missing, a standard deviation is right to 1 %, or 3 % too small for a
    correlation time of two samples. The parts of the log are in order, rad/s, shape (n,) each; NaN
    where a sample is missing. ValueError if the log is too short, or all blocks are left out.
    """
    whole = experiment.blocks(longest)
    total, count = np.zeros(len(whole)), np.zeros(len(whole), dtype=np.int64)
    length = 0

    def counted() -> Iterator[Array]:
        nonlocal length
        for part in parts:
            length += len(part)
            yield part

    for place, present in yield_present_samples(counted(), whole.start, whole.stop):
        total += np.bincount(place, weights=present, minlength=len(whole))
        count += np.bincount(place, minlength=len(whole))
    if length < whole.stop[-1]:
        raise ValueError(f"the log has {length} samples, expected {whole.stop[-1]} by the dwells")
    enough = count >= np.maximum(_MIN_PRESENT_SHARE * whole.count, 1)
    if not enough.any():
        raise ValueError("no block has enough samples, expected half of a block or more")
    return Measured(
        replace(whole.chosen(enough), count=count[enough]),
        (total[enough] / count[enough])[None, :],
        int((whole.count - count).sum()),
        int(count[~enough].sum()),
    )


def block_mean_covariance(model: NoiseModel, blocks: Blocks) -> Array:
    """Return the covariance of the means of b blocks in closed form, (rad/s)^2, shape (b, b).

    It is the covariance of the samples, as `noise.simulate` draws them, summed over the blocks,
    without the fixed bias and the Earth's rate. The random walk counts from the first sample of the
    first block; flicker noise is its bank of Gauss-Markov processes.
    """
    total = np.zeros((len(blocks), len(blocks)))
    for term in model.realised(1.0 / blocks.rate, longest_tau(blocks)):
        total += term.mean_covariance(blocks)
    return total


def longest_tau(blocks: Blocks) -> float:
    """Return the longest tau of flicker noise, s: the duration, and at least 2 samples."""
    return max(blocks.duration, 2.0 / blocks.rate)
