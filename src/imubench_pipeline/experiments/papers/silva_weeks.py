"""What reading the curve of a week gives, and of 48 h: 003, section 5.1, on simulated logs.

The logs have the four printed numbers at 1 Hz instead of 32: what they tell of K and T_B, whose
slopes lie beyond tau of 30 s, is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.experiments.earth_rate.simulation import PAPER_MODEL
from imubench_pipeline.experiments.papers.claims import Found, nothing
from imubench_pipeline.experiments.papers.evidence import Evidence, Log
from imubench_pipeline.noise.simulate import channel_rng, simulate

LOGS = 20
"""Weeks, and logs of 48 h, that are read."""

_RATE = 1.0  # Hz
_WEEK, _TWO_DAYS = 168, 48  # h


@cache
def read_values(hours: int) -> Mapping[str, tuple[float, ...]]:
    """Return what reading the curves of `LOGS` logs of a length gives, where it shows, in SI."""
    shown: dict[str, list[float]] = {name: [] for name in PARAMETERS}
    for number in range(LOGS):
        rng = channel_rng(1, "sirrs01_03", "gyro_x", f"{hours} h, {number}")
        log = simulate(PAPER_MODEL, _RATE, round(hours * 3600 * _RATE), rng)
        estimate = reading.read(allan_variance(log, _RATE, overlap="octave"))
        for name, values in shown.items():
            value = estimate.parameters[name].value
            if value is not None:
                values.append(value)
    return {name: tuple(values) for name, values in shown.items()}


def of_weeks(name: str, log: Log, without: str) -> Callable[[Evidence], Found]:
    """Return what finds a parameter by reading weeks: the median and 90 % of the logs.

    Nothing, for the reason `without`, where a run has no such log at rest.
    """

    def found(run: Evidence) -> Found:
        if not run.has(log.sensor, log.recording):
            return nothing(without)
        values = read_values(_WEEK)[name]
        lower, median, upper = np.percentile(values, [5.0, 50.0, 95.0])
        return Found(
            value=float(median),
            lower=float(lower),
            upper=float(upper),
            words=f"median and 90 % of weeks; shown by {len(values)} of {LOGS}, and by "
            f"{len(read_values(_TWO_DAYS)[name])} of {LOGS} logs of {_TWO_DAYS} h",
        )

    return found
