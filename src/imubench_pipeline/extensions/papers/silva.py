"""Counterparts of the lines of Silva et al. (SiRRS01-03, Earth's rotation)."""

import math
from collections.abc import Mapping
from functools import cache

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.extensions.calibration.tables import CalibrationRow
from imubench_pipeline.extensions.earth_rate import known_rate
from imubench_pipeline.extensions.earth_rate import published as causes
from imubench_pipeline.extensions.earth_rate.published import PrintedRun, compute_allowed_sigmas
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    ASSUMED_TURNING,
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_PERIOD,
    PAPER_RATE,
    design_paper_run,
    simulate_log,
)
from imubench_pipeline.extensions.earth_rate.tables import EarthRateRow
from imubench_pipeline.extensions.papers.printed import Evidence, Log, Result, read_paper
from imubench_pipeline.noise import FLOOR, PEAK_TAU
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.simulate.model import SensorModel

DEGREE = math.pi / 180.0
SENSOR = "sirrs01_03"
AT_REST = Log(SENSOR, "sim_published", "gyro_x")
# Estimates of the Earth's rate by run, deg/s (section 6)
PRINTED = {row["run"]: float(row["rate"]) for row in read_paper("silva").figures["runs"]}

RUNS = 100  # simulations of each of the four runs
LOGS = 20  # simulated logs of a week, and of 48 h
_ASSUMED_BIAS = math.radians(0.05)  # rad/s; assumed
_WEEK, _TWO_DAYS = 168, 48  # h

_Z_95 = 1.96


def count_covariance_steps(_: Evidence) -> Result:
    """Count the samples after which the covariance of equation 13 as printed overflows."""
    sigmas = known_rate.as_printed(PAPER_MODEL, PAPER_RATE, 20, known_rate.STARTS["degrees"])
    return Result(fields={"steps": int(np.isfinite(sigmas).sum())})


def get_estimate_at_rest(run: Evidence, name: str, method: str) -> Result | None:
    """Return the estimate of a parameter by a method, from the log at rest."""
    row = run.parameter(AT_REST, name, method)
    if row is None:
        return None
    if row.value is None:
        status = "no such slope" if method == "curve" else row.status.replace("_", " ")
        return Result(words=status, verdict="differs", reason=row.reason)
    return Result(value=row.value, lower=row.lower, upper=row.upper)


def find_lowest_point(_: Evidence, quantity: str) -> Result:
    """Return tau, deviation or T_B at the lowest point of the printed curve, SI."""
    tau = np.geomspace(1.0, 1e4, 40_001)
    variance = PAPER_MODEL.allan_variance(tau)
    place = int(np.argmin(variance))
    lowest = float(tau[place])
    assert PAPER_MODEL.T_B is not None
    return {
        "tau": Result(value=lowest, printed=PAPER_MODEL.T_B * 1.89),
        "deviation": Result(value=math.sqrt(float(variance[place])), printed=FLOOR * PAPER_MODEL.B),
        "T_B": Result(value=lowest / PEAK_TAU),
    }[quantity]


def count_turns(evidence: Evidence, run: str) -> float | None:
    """Return the number of turns that were detected in a simulated run."""
    rows = evidence.rows(
        EarthRateRow, sensor=SENSOR, recording=f"sim_run_{run}", part="whole", method="pairs"
    )
    turns = rows[0].turns if rows else None
    return None if turns is None else float(turns)


@cache
def make_printed_run(run: str) -> PrintedRun:
    """Return a printed run, with the sigma that the printed noise gives the mean over pairs."""
    duration = 60.0 * PAPER_MINUTES[run]
    sigma = compute_allowed_sigmas(design_paper_run(PAPER_MINUTES[run]), PAPER_MODEL).sigma
    return PrintedRun(duration, PRINTED[run] * DEGREE, float(sigma))


def compute_error_in_sigma(_: Evidence, run: str) -> Result:
    """Return the error of a printed estimate, in standard deviations of the mean of pairs."""
    printed = make_printed_run(run)
    return Result(fields={"off": (printed.value - EARTH_RATE) / printed.sigma})


def compute_allowed_rates(evidence: Evidence, run: str) -> Result:
    """Return the Earth's rate, and the 95 % range of estimates with the printed noise, rad/s."""
    half = _Z_95 * make_printed_run(run).sigma
    return Result(
        value=EARTH_RATE,
        lower=EARTH_RATE - half,
        upper=EARTH_RATE + half,
        fields=compute_error_in_sigma(evidence, run).fields,
    )


def explain_errors(_: Evidence) -> Result:
    """Return the size of each cause that would explain runs 2, 3 and 4, with limits."""
    runs = {run: make_printed_run(run) for run in "234"}
    last = make_printed_run("4, last 13 min")
    first = runs["4"].without(last)

    def drift(run: PrintedRun) -> float:
        return causes.compute_needed_drift(run.value - EARTH_RATE, PAPER_PERIOD, ASSUMED_LATITUDE)

    fields: dict[str, object] = {}
    for name, run in runs.items():
        parts = [first, last] if name == "4" else [run]
        off, data = run.value - EARTH_RATE, PAPER_PERIOD - ASSUMED_TURNING
        angle = causes.compute_needed_angle(off, data, ASSUMED_LATITUDE)
        heading = causes.compute_needed_heading(run.value, EARTH_RATE) or 0.0
        fields |= {
            f"drift_{name}": drift(run) * run.duration / DEGREE,  # deg/s over the run
            f"wrong_{name}": 100 * (causes.compute_wrong_share(run.value, EARTH_RATE) or 0.0),  # %
            f"angle_{name}": abs(angle) / DEGREE,
            f"clock_{name}": 100 * causes.fit_clock_error(parts, PAPER_PERIOD, EARTH_RATE)[0],  # %
            f"heading_{name}": heading / DEGREE,
            f"noise_{name}": abs(off) / run.sigma / _Z_95,
            f"factor_{name}": run.value / EARTH_RATE,
        }
    warmed = causes.fit_warm_up(drift(first), drift(last), runs["4"].duration, last.duration)
    assert warmed is not None  # of the printed numbers
    return Result(
        fields=fields
        | {
            "minutes": warmed.time_constant / 60.0,
            "samples": warmed.total / PAPER_MODEL.N / math.sqrt(PAPER_RATE),
            "apart": causes.compute_separation(last, first),
            "alone": causes.fit_single_miscount(runs["4"], last, EARTH_RATE),
            "least": math.cos(ASSUMED_LATITUDE),
        }
    )


@cache
def simulate_settling_times(run: str) -> Mapping[str, tuple[float, ...]]:
    """Return the settling time of each simulated run, s, by the unit of P_0; inf: not settled."""
    design = design_paper_run(PAPER_MINUTES[run])
    model = SensorModel(noise=PAPER_MODEL, bias=_ASSUMED_BIAS)
    times: dict[str, list[float]] = {name: [] for name in known_rate.STARTS}
    for number in range(RUNS):
        rng = channel_rng(1, SENSOR, "gyro_x", f"run {run}, {number}")
        log = simulate_log(model, design, earth_rate=EARTH_RATE, transient=0.0, rng=rng)
        for name, start in known_rate.STARTS.items():
            mean = known_rate.track(log, design, PAPER_MODEL, EARTH_RATE, start).mean
            times[name].append(known_rate.settled(mean, PAPER_RATE, EARTH_RATE))
    return {name: tuple(values) for name, values in times.items()}


def summarise_settling(evidence: Evidence, run: str) -> Result | None:
    """Return the median settling time of the simulated runs, s."""
    if not evidence.has(SENSOR, f"sim_run_{run}"):
        return None
    times = {name: np.array(values) for name, values in simulate_settling_times(run).items()}
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
    """Return the parameters read from `LOGS` logs of ``hours`` h, SI, without missing values."""
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
    fields = shown | {"logs": LOGS, "hours": _TWO_DAYS}
    return Result(value=median, lower=lower, upper=upper, fields=fields)


def compute_error_of_mean(_: Evidence) -> Result:
    """Return the sigma of the Earth's rate, deg/h, from 1000 samples by P_0, and from one pair."""
    hour = DEGREE / 3600.0
    along_axis = {
        name: float(known_rate.mean_sigma(PAPER_MODEL, PAPER_RATE, 1000, start, 0.0)[-1])
        for name, start in known_rate.STARTS.items()
    }
    pair = compute_allowed_sigmas(design_paper_run(2.0 * PAPER_PERIOD / 60.0), PAPER_MODEL).sigma
    errors = {name: one / math.cos(ASSUMED_LATITUDE) / hour for name, one in along_axis.items()}
    return Result(fields=errors | {"rate": EARTH_RATE / hour, "pair": pair / hour})


def compute_filter_gain(_: Evidence) -> Result:
    """Return the least and greatest reduction of sigma by a filter with unknown rate, %."""
    gains = []
    for run in PRINTED:
        sigmas = compute_allowed_sigmas(design_paper_run(PAPER_MINUTES[run]), PAPER_MODEL)
        gains.append(100.0 * (1.0 - sigmas.sigma_filter / sigmas.sigma))
    return Result(fields={"least": min(gains), "most": max(gains)})


def get_aligned_heading(run: Evidence) -> Result | None:
    """Return the heading of the triad, half the width of its interval, and the truth, degrees."""
    rows = run.rows(
        CalibrationRow, sensor=f"{SENSOR}_triad", recording="sim_aligned", parameter="heading"
    )
    row = rows[0] if rows else None
    if row is None or row.value is None or row.lower is None or row.upper is None:
        return None
    if row.duration is None or row.truth is None:
        return None
    return Result(
        fields={
            "heading": row.value / DEGREE,
            "half": (row.upper - row.lower) / 2.0 / DEGREE,
            "minutes": row.duration / 60.0,
            "truth": row.truth / DEGREE,
        }
    )
