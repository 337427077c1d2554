"""Parameters read from curves of one week and of 48 h (Silva et al., section 5.1), simulated.

The logs have the four printed numbers at 1 Hz instead of 32. Their information about K and T_B is
the same, since these slopes lie above a tau of 30 s.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.extensions.earth_rate.simulation import PAPER_MODEL
from imubench_pipeline.extensions.papers.claims import Result, no_result
from imubench_pipeline.extensions.papers.evidence import Evidence, Log
from imubench_pipeline.noise.simulate import channel_rng, simulate

LOGS = 20
"""Number of simulated logs of each length."""

_RATE = 1.0  # Hz
_WEEK, _TWO_DAYS = 168, 48  # h


@cache
def read_values(hours: int) -> Mapping[str, tuple[float, ...]]:
    """Return the parameters read from the curves of `LOGS` logs, SI, without missing ones."""
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


def evaluate_weeks(name: str, log: Log, without: str) -> Callable[[Evidence], Result]:
    """Return the evaluation of a parameter read from logs of a week: median and 90 % interval.

    It has no result, with the reason `without`, if a run has no such log at rest.
    """

    def evaluate(run: Evidence) -> Result:
        if not run.has(log.sensor, log.recording):
            return no_result(without)
        values = read_values(_WEEK)[name]
        lower, median, upper = np.percentile(values, [5.0, 50.0, 95.0])
        return Result(
            value=float(median),
            lower=float(lower),
            upper=float(upper),
            words=f"median and 90 % of weeks; shown by {len(values)} of {LOGS}, and by "
            f"{len(read_values(_TWO_DAYS)[name])} of {LOGS} logs of {_TWO_DAYS} h",
        )

    return evaluate
