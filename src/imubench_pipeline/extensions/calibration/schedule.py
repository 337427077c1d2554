"""The steady rates of a rate table: from its schedule, or from a column with the table's rate.

The ramps between two steady rates are left out, and a settling time of table and gyro after each
ramp.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from imubench_pipeline.extensions.calibration.experiment import Blocks, Dwell, Experiment
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Schedule:
    """Steady rates of a rate table, in order of time; ValueError if they are not consistent."""

    stretches: Sequence[Dwell]  # samples of each; their sense is not used
    table_rates: Array  # shape (stretches,); with respect to the Earth, of the gyro's sign, rad/s
    rate: float  # sampling rate, Hz

    def __post_init__(self) -> None:
        if len(self.table_rates) != len(self.stretches):
            raise ValueError(
                f"found {len(self.table_rates)} table rates, expected {len(self.stretches)}"
            )
        if not np.isfinite(self.table_rates).all():
            raise ValueError("a table rate is not finite, expected numbers in rad/s")
        _ = self.experiment  # stretches in order, and a sampling rate above 0

    @classmethod
    def from_steps(
        cls, steps: Sequence[tuple[float, float, float]], rate: float, *, settling: float = 0.0
    ) -> "Schedule":
        """Return the schedule of steps: start and end, s, and rate, rad/s; the sampling rate in Hz.

        The settling time, s, at their start is left out; ValueError if a step then has no sample.
        """
        stretches = []
        for start, stop, table_rate in steps:
            # The first sample not before a time, with a tolerance for rounding.
            first, last = (math.ceil(time * rate - 1e-6) for time in (start + settling, stop))
            if not 0 <= first < last:
                raise ValueError(
                    f"the step of {table_rate:g} rad/s from {start:g} to {stop:g} s has no sample "
                    f"after {settling:g} s of settling; expected a longer step"
                )
            stretches.append(Dwell(first, last, 1))
        return cls(tuple(stretches), np.array([step[2] for step in steps]), rate)

    @classmethod
    def from_column(
        cls, column: Array, rate: float, *, tolerance: float, shortest: float, settling: float = 0.0
    ) -> "Schedule":
        """Find the steady rates in a column with the table's rate, rad/s, shape (n,).

        A sample is steady if the column varies by at most ``tolerance`` in half of ``shortest``, s,
        about it. A stretch lasts ``shortest`` or more, and varies by at most twice the tolerance;
        ``settling``, s, at its start is left out. ``rate`` is the sampling rate, Hz. Raises
        ValueError for wrong arguments, or without a steady rate.
        """
        if not tolerance >= 0:
            raise ValueError(f"tolerance is {tolerance}, expected a rate, 0 or more, in rad/s")
        if not shortest > settling >= 0:
            raise ValueError(f"shortest is {shortest} s, expected more than {settling} s settling")
        window = 2 * max(round(shortest * rate / 4.0), 1) + 1
        filled = np.where(np.isfinite(column), column, np.inf)
        highest = maximum_filter1d(filled, window, mode="nearest")
        lowest = minimum_filter1d(filled, window, mode="nearest")
        with np.errstate(invalid="ignore"):
            steady = (highest - lowest <= tolerance) & np.isfinite(highest)
        change = np.diff(steady.astype(np.int8), prepend=0, append=0)
        half = window // 2
        stretches: list[Dwell] = []
        rates: list[float] = []
        for start, stop in zip(
            np.flatnonzero(change == 1), np.flatnonzero(change == -1), strict=True
        ):
            # The window about the first steady sample is steady, too.
            before = stretches[-1].stop if stretches else 0
            first, last = max(int(start) - half, before), min(int(stop) + half, len(column))
            part = column[first:last]
            if (last - first) / rate < shortest or np.ptp(part) > 2.0 * tolerance:
                continue
            first += round(settling * rate)
            stretches.append(Dwell(first, last, 1))
            rates.append(float(np.mean(column[first:last])))
        if not stretches:
            raise ValueError(
                f"the table's rate is nowhere steady to {tolerance:g} rad/s for {shortest:g} s"
            )
        return cls(tuple(stretches), np.array(rates), rate)

    @property
    def experiment(self) -> Experiment:
        """The stretches as dwells, for block means; the latitude is 0, and not used."""
        return Experiment(tuple(self.stretches), self.rate, 0.0)

    def of_blocks(self, blocks: Blocks) -> Array:
        """Return the table's rate in each block of `experiment`, rad/s, shape (b,)."""
        return np.asarray(self.table_rates[blocks.dwell])
