"""How late the mean of the filter that is given the rate stays near it: 003, figures 10 to 13.

One run is one draw, and draws differ tenfold: many are simulated of the four printed numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cache

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.experiments.earth_rate.known_rate import STARTS, settled, track
from imubench_pipeline.experiments.earth_rate.simulation import (
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_RATE,
    paper_run,
    simulate_log,
)
from imubench_pipeline.experiments.papers.claims import Found, nothing
from imubench_pipeline.experiments.papers.evidence import Evidence
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.simulate.model import SensorModel

RUNS = 100
"""Simulated of each of the four."""

_BIAS = math.radians(0.05)  # rad/s; assumed


@cache
def settling_times(run: str) -> Mapping[str, tuple[float, ...]]:
    """Return when the mean of each simulated run settles, s, by the unit of P_0; inf: not in it."""
    design = paper_run(PAPER_MINUTES[run])
    model = SensorModel(noise=PAPER_MODEL, bias=_BIAS)
    times: dict[str, list[float]] = {name: [] for name in STARTS}
    for number in range(RUNS):
        rng = channel_rng(1, "sirrs01_03", "gyro_x", f"run {run}, {number}")
        log = simulate_log(model, design, earth_rate=EARTH_RATE, transient=0.0, rng=rng)
        for name, start in STARTS.items():
            mean = track(log, design, PAPER_MODEL, EARTH_RATE, start).mean
            times[name].append(settled(mean, PAPER_RATE, EARTH_RATE))
    return {name: tuple(values) for name, values in times.items()}


def settling(run: str, sensor: str, without: str) -> Callable[[Evidence], Found]:
    """Return what finds when runs settle: the median of them.

    Nothing, for the reason `without`, where there is no such simulated run.
    """

    def found(evidence: Evidence) -> Found:
        if not evidence.has(sensor, f"sim_run_{run}"):
            return nothing(without)
        times = {name: np.array(values) for name, values in settling_times(run).items()}
        own = times["degrees"]
        # Of a run that has not settled no more is known than that it takes longer than it lasts.
        early, median = np.percentile(own, [5.0, 50.0], method="higher")
        late = f"not in its {PAPER_MINUTES[run]:.0f} min"
        words = f"{100.0 * np.mean(np.isinf(own)):.0f} % {late}, 5 % by {early:.0f} s"
        other = np.percentile(times["radians"], 50.0, method="higher")
        if math.isinf(median):
            words = f"{late}; {words}"
        return Found(
            value=float(median) if math.isfinite(median) else None,
            words=f"median of {RUNS} simulated runs: {words}; with P₀ in (rad/s)² the median is "
            f"{late if math.isinf(other) else f'{other:.0f} s'}",
            verdict="differs",
        )

    return found
