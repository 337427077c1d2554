"""Counterparts of the lines of Silva et al. (SiRRS01-03, Earth's rotation) without simulations."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.tables import CalibrationRow
from imubench_pipeline.extensions.earth_rate import hypotheses as causes
from imubench_pipeline.extensions.earth_rate.hypotheses import PrintedRun
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, as_printed, mean_sigma
from imubench_pipeline.extensions.earth_rate.published import RunDesign, allowed_sigmas
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    ASSUMED_TURNING,
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_PERIOD,
    PAPER_RATE,
)
from imubench_pipeline.extensions.earth_rate.tables import EarthRateRow
from imubench_pipeline.extensions.papers.evidence import Evidence, Log, Result
from imubench_pipeline.extensions.papers.printed import read_paper
from imubench_pipeline.noise import FLOOR, PEAK_TAU

DEGREE = math.pi / 180.0
SENSOR = "sirrs01_03"
AT_REST = Log(SENSOR, "sim_published", "gyro_x")
PRINTED = {row["run"]: float(row["rate"]) for row in read_paper("silva").figures["runs"]}
"""Estimates of the Earth's rate by run, deg/s (section 6)."""

_DESIGN = RunDesign(PAPER_PERIOD, ASSUMED_TURNING, PAPER_RATE, ASSUMED_LATITUDE)
_Z_95 = 1.96


def covariance_as_printed(_: Evidence) -> Result:
    """Count the samples after which the covariance of equation 13 as printed overflows."""
    sigmas = as_printed(PAPER_MODEL, PAPER_RATE, 20, STARTS["degrees"])
    return Result(fields={"steps": int(np.isfinite(sigmas).sum())})


def estimate_at_rest(run: Evidence, name: str, method: str) -> Result | None:
    """Return an estimate of the log at rest."""
    row = run.parameter(AT_REST, name, method)
    if row is None:
        return None
    if row.value is None:
        status = "no such slope" if method == "curve" else row.status.replace("_", " ")
        return Result(words=status, verdict="differs", reason=row.reason)
    return Result(value=row.value, lower=row.lower, upper=row.upper)


@cache
def find_lowest_point() -> tuple[float, float]:
    """Return tau and deviation of the lowest point of the curve of the four printed numbers, SI."""
    tau = np.geomspace(1.0, 1e4, 40_001)
    variance = PAPER_MODEL.allan_variance(tau)
    place = int(np.argmin(variance))
    return float(tau[place]), math.sqrt(float(variance[place]))


def lowest_cluster_time(_: Evidence) -> Result:
    """Return tau of the lowest point, with 1.89 T_B, s."""
    assert PAPER_MODEL.T_B is not None
    return Result(value=find_lowest_point()[0], printed=PAPER_MODEL.T_B * 1.89)


def lowest_deviation(_: Evidence) -> Result:
    """Return the deviation at the lowest point, with 0.664 B, rad/s."""
    return Result(value=find_lowest_point()[1], printed=FLOOR * PAPER_MODEL.B)


def read_correlation_time(_: Evidence) -> float:
    """Return T_B as read at the lowest point, s."""
    return find_lowest_point()[0] / PEAK_TAU


def count_turns(evidence: Evidence, run: str) -> float | None:
    """Return the number of turns that were detected in a simulated run."""
    rows = evidence.rows(
        EarthRateRow, sensor=SENSOR, recording=f"sim_run_{run}", part="whole", method="pairs"
    )
    turns = rows[0].turns if rows else None
    return None if turns is None else float(turns)


@cache
def printed_run(run: str) -> PrintedRun:
    """Return a run as printed, with the sigma that the printed noise gives the mean over pairs."""
    duration = 60.0 * PAPER_MINUTES[run]
    sigma = allowed_sigmas(_DESIGN, duration, PAPER_MODEL)["sigma"]
    return PrintedRun(duration, PRINTED[run] * DEGREE, float(sigma))


def _off(run: PrintedRun) -> float:
    """Return the error of a printed estimate of the Earth's rate, rad/s."""
    return run.value - EARTH_RATE


def error_in_sigma(_: Evidence, run: str) -> Result:
    """Return the error of a printed estimate over the noise of the mean over pairs."""
    return Result(fields={"off": _off(printed_run(run)) / printed_run(run).sigma})


def allowed_rates(evidence: Evidence, run: str) -> Result:
    """Return the Earth's rate, and the 95 % range of estimates with the printed noise, rad/s."""
    half = _Z_95 * printed_run(run).sigma
    return Result(
        value=EARTH_RATE,
        lower=EARTH_RATE - half,
        upper=EARTH_RATE + half,
        fields=error_in_sigma(evidence, run).fields,
    )


@cache
def explain_errors(_: Evidence) -> Result:
    """Return the size of each cause that would explain runs 2, 3 and 4, and the limits of it."""
    runs = {run: printed_run(run) for run in "234"}
    last = printed_run("4, last 13 min")
    first = runs["4"].without(last)

    def drift(run: PrintedRun) -> float:
        return causes.drift_needed(_off(run), PAPER_PERIOD, ASSUMED_LATITUDE)

    fields: dict[str, object] = {}
    for name, run in runs.items():
        parts = [first, last] if name == "4" else [run]
        angle = causes.angle_needed(_off(run), PAPER_PERIOD - ASSUMED_TURNING, ASSUMED_LATITUDE)
        fields |= {
            f"drift_{name}": drift(run) * run.duration / DEGREE,  # deg/s over the run
            f"wrong_{name}": 100 * (causes.wrong_part(run.value, EARTH_RATE) or 0.0),  # %
            f"angle_{name}": abs(angle) / DEGREE,
            f"clock_{name}": 100 * causes.slip_needed(parts, PAPER_PERIOD, EARTH_RATE)[0],  # %
            f"heading_{name}": (causes.heading_needed(run.value, EARTH_RATE) or 0.0) / DEGREE,
            f"noise_{name}": abs(_off(run)) / run.sigma / _Z_95,
            f"factor_{name}": run.value / EARTH_RATE,
        }
    warmed = causes.warm_up(drift(first), drift(last), runs["4"].duration, last.duration)
    assert warmed is not None  # of the printed numbers
    return Result(
        fields=fields
        | {
            "minutes": warmed.time_constant / 60.0,
            "samples": warmed.total / PAPER_MODEL.N / math.sqrt(PAPER_RATE),
            "apart": causes.apart(last, first),
            "alone": causes.one_miscount(runs["4"], last, EARTH_RATE),
            "least": math.cos(ASSUMED_LATITUDE),
        }
    )


def error_of_mean(_: Evidence) -> Result:
    """Return errors of the Earth's rate, deg/h: of 1000 samples by the start, and of one pair."""
    hour = DEGREE / 3600.0
    along_axis = {
        name: float(mean_sigma(PAPER_MODEL, PAPER_RATE, 1000, start, 0.0)[-1])
        for name, start in STARTS.items()
    }
    pair = float(allowed_sigmas(_DESIGN, 2.0 * PAPER_PERIOD, PAPER_MODEL)["sigma"])
    errors = {name: one / math.cos(ASSUMED_LATITUDE) / hour for name, one in along_axis.items()}
    return Result(fields=errors | {"rate": EARTH_RATE / hour, "pair": pair / hour})


def compute_filter_gain(run: str) -> float:
    """Return the relative reduction of sigma by a filter with unknown rate, against pairs."""
    sigmas = allowed_sigmas(_DESIGN, 60.0 * PAPER_MINUTES[run], PAPER_MODEL)
    return float(1.0 - sigmas["sigma_filter"] / sigmas["sigma"])


def gain_of_filter(_: Evidence) -> Result:
    """Return the least and greatest reduction of sigma by a filter, %."""
    gains = [100.0 * compute_filter_gain(run) for run in PRINTED]
    return Result(fields={"least": min(gains), "most": max(gains)})


def aligned_heading(run: Evidence) -> Result | None:
    """Return the heading of the triad, with the half of its interval and the truth, degrees."""
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
