"""Counterparts of the figures of Engers (2021); the text does not contain their curves."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from imubench_pipeline.extensions.papers.engers import AXES, RECORDING
from imubench_pipeline.extensions.papers.evidence import Evidence, Result
from imubench_pipeline.extensions.papers.printed import Verdict
from imubench_pipeline.model.estimates import (
    AllanRow,
    CompensatedAllanRow,
    ModelSampleRow,
    ReconstructionRow,
)

_MIN_TAU_ABOVE_LOW_PASS = 0.1
"""Cluster time above which the low-passes of these sensors have no effect, s."""

_MIN_PERCENT_IN_BAND = 80.0
"""Least share of a curve, in per cent, within a pointwise band of 95 %. By chance, one curve in
twenty is below."""

_MAX_DEVIATION_DIFFERENCE = 0.05
"""Largest relative difference of two deviations of samples that look alike."""


def share_in_band(run: Evidence, sensor: str, axis: str) -> Result | None:
    """Return the share of the curve within the band of logs of its estimate, %."""
    log = AXES[sensor, axis].log
    for method in ("compensated", "likelihood"):
        bands = run.of_log(ReconstructionRow, log, method=method)
        if bands:
            break
    else:
        return None
    curve: type[AllanRow] | type[CompensatedAllanRow] = (
        CompensatedAllanRow if method == "compensated" else AllanRow
    )
    measured = {row.tau: row.adev for row in run.of_log(curve, log)}
    seen = [row for row in bands if row.tau >= _MIN_TAU_ABOVE_LOW_PASS and row.tau in measured]
    inside = sum(row.lower <= measured[row.tau] <= row.upper for row in seen)
    share = 100.0 * inside / len(seen)
    return Result(
        verdict="agrees" if share >= _MIN_PERCENT_IN_BAND else "differs",
        fields={
            "share": share,
            "tau": _MIN_TAU_ABOVE_LOW_PASS,
            "method": method,
            "least": _MIN_PERCENT_IN_BAND,
        },
    )


def _get_sample_deviations(run: Evidence, sensor: str) -> dict[tuple[str, str], float]:
    """Return the deviation of samples by channel, of the log and of the models; maybe none."""
    rows = run.rows(ModelSampleRow, sensor=sensor, recording=RECORDING, what="deviation")
    return {(row.channel, row.of): row.mean for row in rows if row.mean is not None}


def sample_deviations(run: Evidence, sensor: str, if_alike: Verdict) -> Result | None:
    """Return the deviations of samples of the fitted model over those of the log."""
    by = _get_sample_deviations(run, sensor)
    ratios = [value / by[channel, "log"] for (channel, of), value in by.items() if of == "after"]
    if not ratios:
        return None
    alike = all(abs(ratio - 1.0) < _MAX_DEVIATION_DIFFERENCE for ratio in ratios)
    return Result(
        verdict=if_alike if alike else "differs",
        fields={"ratios": ", ".join(f"{ratio:.3f}" for ratio in ratios)},
    )


def deviations_over_x(run: Evidence, sensor: str) -> Result | None:
    """Return the deviations of samples of y and z over that of x, of log and fitted model."""
    by = _get_sample_deviations(run, sensor)
    if not by:
        return None
    ratios = {
        f"{of}_{axis}": by[f"gyro_{axis}", of] / by["gyro_x", of]
        for of in ("log", "after")
        for axis in "yz"
    }
    alike = all(
        abs(ratios[f"after_{axis}"] / ratios[f"log_{axis}"] - 1.0) < _MAX_DEVIATION_DIFFERENCE
        for axis in "yz"
    )
    return Result(verdict="agrees" if alike else "differs", fields=ratios)


def adjacent_samples(run: Evidence, sensor: str, of: str) -> Result | None:
    """Return the correlation of adjacent samples, of log and model."""
    rows = run.rows(
        ModelSampleRow, sensor=sensor, recording=RECORDING, channel="gyro_x", what="stretch"
    )
    stretches = {
        one: [row.mean for row in rows if row.of == one and row.mean is not None]
        for one in ("log", of)
    }
    if not all(stretches.values()):
        return None
    log, model = (_compute_correlation(values) for values in stretches.values())
    count = len(stretches["log"])
    error = math.sqrt(2.0 * (1.0 - log * log) / count)
    return Result(
        verdict="agrees" if abs(model - log) < 3.0 * error else "differs",
        fields={"model": model, "log": log, "count": count},
    )


def _compute_correlation(values: Sequence[float]) -> float:
    """Return the correlation of each value with the next."""
    samples = np.array(values)
    return float(np.corrcoef(samples[:-1], samples[1:])[0, 1])
