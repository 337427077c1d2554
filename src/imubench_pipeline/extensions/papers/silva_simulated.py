"""Counterparts of lines of Silva et al. that take many simulated logs.

Settling times (Figures 10 to 13) differ tenfold between single runs. Curves of a week (section 5.1)
are of logs at 1 Hz instead of 32: their information about K and T_B is the same, since these slopes
lie above a tau of 30 s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, settled, track
from imubench_pipeline.extensions.earth_rate.simulation import (
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_RATE,
    paper_run,
    simulate_log,
)
from imubench_pipeline.extensions.papers.evidence import Evidence, Result
from imubench_pipeline.extensions.papers.silva import AT_REST, SENSOR
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.simulate.model import SensorModel

RUNS = 100
"""Number of simulations of each of the four runs."""

LOGS = 20
"""Number of simulated logs of a week, and of 48 h."""

_ASSUMED_BIAS = math.radians(0.05)  # rad/s; assumed
_WEEK, _TWO_DAYS = 168, 48  # h


@cache
def settling_times(run: str) -> Mapping[str, tuple[float, ...]]:
    """Return the settling time of each simulated run, s, by the unit of P_0; inf: not settled."""
    design = paper_run(PAPER_MINUTES[run])
    model = SensorModel(noise=PAPER_MODEL, bias=_ASSUMED_BIAS)
    times: dict[str, list[float]] = {name: [] for name in STARTS}
    for number in range(RUNS):
        rng = channel_rng(1, SENSOR, "gyro_x", f"run {run}, {number}")
        log = simulate_log(model, design, earth_rate=EARTH_RATE, transient=0.0, rng=rng)
        for name, start in STARTS.items():
            mean = track(log, design, PAPER_MODEL, EARTH_RATE, start).mean
            times[name].append(settled(mean, PAPER_RATE, EARTH_RATE))
    return {name: tuple(values) for name, values in times.items()}


def settling_time(evidence: Evidence, run: str) -> Result | None:
    """Return the median settling time of the simulated runs, s."""
    if not evidence.has(SENSOR, f"sim_run_{run}"):
        return None
    times = {name: np.array(values) for name, values in settling_times(run).items()}
    own = times["degrees"]
    # The settling time of an unsettled run is only known to exceed its duration.
    early, median = np.percentile(own, [5.0, 50.0], method="higher")
    other = np.percentile(times["radians"], 50.0, method="higher")
    late = f"not in its {PAPER_MINUTES[run]:.0f} min"
    words = f"{100.0 * np.mean(np.isinf(own)):.0f} % {late}, 5 % by {early:.0f} s"
    return Result(
        value=float(median) if math.isfinite(median) else None,
        fields={
            "runs": RUNS,
            "times": words if math.isfinite(median) else f"{late}; {words}",
            "other": late if math.isinf(other) else f"{other:.0f} s",
        },
    )


@cache
def read_values(hours: int) -> Mapping[str, tuple[float, ...]]:
    """Return the parameters read from the curves of `LOGS` logs, SI, without missing ones."""
    shown: dict[str, list[float]] = {name: [] for name in PARAMETERS}
    for number in range(LOGS):
        rng = channel_rng(1, SENSOR, "gyro_x", f"{hours} h, {number}")
        log = simulate(PAPER_MODEL, 1.0, hours * 3600, rng)
        estimate = reading.read(allan_variance(log, 1.0, overlap="octave"))
        for name, values in shown.items():
            value = estimate.parameters[name].value
            if value is not None:
                values.append(value)
    return {name: tuple(values) for name, values in shown.items()}


def read_weeks(run: Evidence, name: str) -> Result | None:
    """Return a parameter read from logs of a week: median and 90 % interval."""
    if not run.has(AT_REST.sensor, AT_REST.recording):
        return None
    values = read_values(_WEEK)[name]
    lower, median, upper = np.percentile(values, [5.0, 50.0, 95.0]).tolist()
    shown = {"weeks": len(values), "short": len(read_values(_TWO_DAYS)[name])}
    return Result(
        value=median,
        lower=lower,
        upper=upper,
        fields=shown | {"logs": LOGS, "hours": _TWO_DAYS},
    )
