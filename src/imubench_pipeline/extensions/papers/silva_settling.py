"""Settling time of the mean of the filter with known rate (Silva et al., figures 10 to 13).

Single runs differ tenfold, so that many are simulated with the four printed numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, settled, track
from imubench_pipeline.extensions.earth_rate.simulation import (
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_RATE,
    paper_run,
    simulate_log,
)
from imubench_pipeline.extensions.papers.claims import Result, no_result
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.simulate.model import SensorModel

RUNS = 100
"""Number of simulations of each of the four runs."""

_ASSUMED_BIAS = math.radians(0.05)  # rad/s; assumed


@cache
def settling_times(run: str) -> Mapping[str, tuple[float, ...]]:
    """Return the settling time of each simulated run, s, by the unit of P_0; inf: not settled."""
    design = paper_run(PAPER_MINUTES[run])
    model = SensorModel(noise=PAPER_MODEL, bias=_ASSUMED_BIAS)
    times: dict[str, list[float]] = {name: [] for name in STARTS}
    for number in range(RUNS):
        rng = channel_rng(1, "sirrs01_03", "gyro_x", f"run {run}, {number}")
        log = simulate_log(model, design, earth_rate=EARTH_RATE, transient=0.0, rng=rng)
        for name, start in STARTS.items():
            mean = track(log, design, PAPER_MODEL, EARTH_RATE, start).mean
            times[name].append(settled(mean, PAPER_RATE, EARTH_RATE))
    return {name: tuple(values) for name, values in times.items()}


def evaluate_settling(run: str, sensor: str, without: str) -> Callable[[Evidence], Result]:
    """Return the evaluation of the settling time: the median of the simulated runs.

    It has no result, with the reason `without`, if there is no such simulated run.
    """

    def evaluate(evidence: Evidence) -> Result:
        if not evidence.has(sensor, f"sim_run_{run}"):
            return no_result(without)
        times = {name: np.array(values) for name, values in settling_times(run).items()}
        own = times["degrees"]
        # The settling time of an unsettled run is only known to exceed its duration.
        early, median = np.percentile(own, [5.0, 50.0], method="higher")
        late = f"not in its {PAPER_MINUTES[run]:.0f} min"
        words = f"{100.0 * np.mean(np.isinf(own)):.0f} % {late}, 5 % by {early:.0f} s"
        other = np.percentile(times["radians"], 50.0, method="higher")
        if math.isinf(median):
            words = f"{late}; {words}"
        return Result(
            value=float(median) if math.isfinite(median) else None,
            words=f"median of {RUNS} simulated runs: {words}; with P₀ in (rad/s)² the median is "
            f"{late if math.isinf(other) else f'{other:.0f} s'}",
            verdict="differs",
        )

    return evaluate
