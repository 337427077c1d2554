"""Counterparts of the results of Engers (2021), and of his aim: the fusion of cheap gyros."""

import math

import numpy as np

from imubench_pipeline.extensions.fusion.tables import GradeRow, PublishedFigureRow
from imubench_pipeline.extensions.papers.printed import Evidence, Log, Result, Verdict, read_paper
from imubench_pipeline.model.estimates import (
    AllanRow,
    CompensatedAllanRow,
    ModelSampleRow,
    ReconstructionRow,
)
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.settings.validation import Strict

DEGREE = math.pi / 180.0
RECORDING = "sim_engers"
READ_AT = 3600.0  # s; cluster time of the figures under "PSD" (section 2.2.4)
_MIN_TAU_ABOVE_LOW_PASS = 0.1  # s, above which the low-passes of these sensors have no effect
_MIN_PERCENT_IN_BAND = 80.0  # of a curve in its 95 % band; by chance, one in twenty is below
_MAX_DEVIATION_DIFFERENCE = 0.05  # relative, of two deviations of samples that look alike

_SINGLE_SENSOR, _FUSED_SENSOR, _FUSED_COUNT = "scc2130", "scc2130_x25", 25


class Axis(Strict):
    """Printed figures of an axis (Tables 2 to 7) and of its sensor (Table 1), in degrees."""

    sensor: str
    axis: str
    name: str  # of sensor and axis, in words
    noise: str  # table of the noise
    drift: str  # table of the fixed drift
    psd: float  # ordinate of the -1/2 line at 1 h, deg/s
    bias: float  # deg/s
    floor: float  # lowest point of the curve, deg/s; printed per kelvin
    rate: float  # of the log, Hz
    sheet: float  # PSD of the datasheet, (deg/s)/sqrt(Hz)

    @property
    def density(self) -> float:
        """N, if the value in the column "PSD" is the ordinate at 1 h, (deg/s)/sqrt(Hz)."""
        return self.psd * math.sqrt(READ_AT)

    @property
    def log(self) -> Log:
        """The simulated channel."""
        return Log(self.sensor, RECORDING, f"gyro_{self.axis}")

    def meeting(self, scaled: bool) -> float:
        """Return tau, s, where the -1/2 line of N (``scaled``), or of ``psd``, meets the floor."""
        return ((self.density if scaled else self.psd) / self.floor) ** 2


_FIGURES = read_paper("engers").figures
_SENSORS = {row["sensor"]: row for row in _FIGURES["sensors"]}
AXES = {
    (row["sensor"], row["axis"]): Axis.model_validate({**_SENSORS[row["sensor"]], **row})
    for row in _FIGURES["axes"]
}


def compute_cutoff(_: Evidence, bandwidth: str) -> float:
    """Return the cut-off of a low-pass of first order with this noise bandwidth, Hz."""
    return 2.0 / math.pi * float(bandwidth)


def get_published_figure(run: Evidence, sensor: str, axis: str, parameter: str) -> Result | None:
    """Return the estimate, SI, of a printed bias, -1/2 line at 1 h (N), or floor (B)."""
    one = AXES[sensor, axis]
    place = one.drift if parameter == "bias" else one.noise
    times = {"bias": 1.0, "N": 1.0 / math.sqrt(READ_AT), "B": FLOOR}[parameter]
    of_axis = run.of_log(PublishedFigureRow, one.log, place=place, parameter=parameter)
    row = next((row for row in of_axis if row.of == "log"), None)
    if row is None or row.value is None:
        return None
    value, lower, upper = (
        None if end is None else times * end for end in (row.value, row.lower, row.upper)
    )
    if parameter == "bias" or row.curve is None:
        return Result(value=value, lower=lower, upper=upper, words="")
    curve = times * row.curve / DEGREE
    shown = np.format_float_positional(curve, precision=3, fractional=False, trim="-")
    return Result(value=value, lower=lower, upper=upper, fields={"curve": shown})


def derive_from_axis(_: Evidence, sensor: str, axis: str) -> Result:
    """Return numbers that follow from the printed figures of an axis: times in s, and ratios."""
    one = AXES[sensor, axis]
    ratio = one.density / one.sheet
    scaled, samples = one.meeting(True), one.meeting(False) * one.rate
    drift = one.floor / 0.662 / 18_000.0 * scaled / math.sqrt(2.0)  # his divisor; 1 K over the log
    return Result(
        fields={
            "scaled": scaled,
            "unscaled": one.meeting(False),
            "samples": f"{samples:.0f} samples" if samples >= 1.5 else "one sample",
            "against": "against it: " if one.density > 2.0 * one.sheet else "",
            "ratio": ratio,
            "one_sided": math.sqrt(2.0) * ratio,
            "as_power": math.sqrt(one.psd * one.rate) / (one.density * math.sqrt(one.rate)),
            "over_drift": one.floor / drift,
            "sheet_two_sided": (one.sheet / one.floor) ** 2,
            "sheet_one_sided": (one.sheet / one.floor) ** 2 / 2.0,
            "sheet_drift": (one.sheet / 0.015) ** 2,  # 0.015 (deg/s)/K as if it were the floor
        }
    )


def compare_axes(_: Evidence, sensor: str) -> Result:
    """Return the ratio of the noise of each axis of a sensor to the x axis and the datasheet."""
    axes = [axis for axis in AXES.values() if axis.sensor == sensor]
    over_x = {axis.axis: axis.psd / axes[0].psd for axis in axes}
    return Result(fields=over_x | {f"sheet_{one.axis}": one.density / one.sheet for one in axes})


def compute_share_in_band(run: Evidence, sensor: str, axis: str) -> Result | None:
    """Return the percentage of a curve inside the band of logs simulated by its estimate."""
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
    """Return the deviation of samples by channel, of the log and of the models, if known."""
    rows = run.rows(ModelSampleRow, sensor=sensor, recording=RECORDING, what="deviation")
    return {(row.channel, row.of): row.mean for row in rows if row.mean is not None}


def compare_sample_deviations(run: Evidence, sensor: str, if_alike: Verdict) -> Result | None:
    """Return the standard deviation of samples of the fitted model divided by the log's."""
    by = _get_sample_deviations(run, sensor)
    ratios = [value / by[channel, "log"] for (channel, of), value in by.items() if of == "after"]
    if not ratios:
        return None
    alike = all(abs(ratio - 1.0) < _MAX_DEVIATION_DIFFERENCE for ratio in ratios)
    return Result(
        verdict=if_alike if alike else "differs",
        fields={"ratios": ", ".join(f"{ratio:.3f}" for ratio in ratios)},
    )


def compare_deviations_with_x(run: Evidence, sensor: str) -> Result | None:
    """Return the standard deviations of y and z divided by the one of x, of log and model."""
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


def correlate_adjacent_samples(run: Evidence, sensor: str, of: str) -> Result | None:
    """Return the correlation of adjacent samples of the log, and of the model ``of``."""
    rows = run.rows(
        ModelSampleRow, sensor=sensor, recording=RECORDING, channel="gyro_x", what="stretch"
    )
    stretches = {
        one: [row.mean for row in rows if row.of == one and row.mean is not None]
        for one in ("log", of)
    }
    if not all(stretches.values()):
        return None
    log, model = (
        float(np.corrcoef(values[:-1], values[1:])[0, 1]) for values in stretches.values()
    )
    count = len(stretches["log"])
    error = math.sqrt(2.0 * (1.0 - log * log) / count)
    return Result(
        verdict="agrees" if abs(model - log) < 3.0 * error else "differs",
        fields={"model": model, "log": log, "count": count},
    )


def count_equal(run: Evidence, grade: str, option: str) -> Result | None:
    """Return how many sensors together equal a grade, by white noise and by lowest point."""
    words = []
    for sensor, name in ((_SINGLE_SENSOR, ""), (_FUSED_SENSOR, f"of {_FUSED_COUNT} fused ")):
        rows = run.rows(
            GradeRow, sensor=sensor, quantity="gyro", grade=grade, option=option or None
        )
        if not rows:
            return None
        if all(row.printed is None for row in rows):
            reason = f"noise of {rows[0].grade_name}: {rows[0].reason}"
            return Result(words="", verdict="not available", reason=reason)
        by = {row.statistic: row for row in reversed(rows)}
        shown = []
        for statistic, what in (("N", "white noise"), ("sigma_min", "lowest point")):
            row = by.get(statistic)
            if row is not None and row.n_upper is not None:
                most = "at most " if row.n is None else ""
                count = max(math.ceil(row.n_upper if row.n is None else row.n), 1)
                shown.append(f"{most}{count} by its {what}")
        words.append(name + ", ".join(shown))
    return Result(fields={"counts": "; ".join(words)})


def get_fused_noise(run: Evidence) -> Result | None:
    """Return N of the fused log, with the expectation from the log of one sensor, deg/sqrt(h)."""
    one, fused = (
        next(iter(run.rows(GradeRow, sensor=sensor, quantity="gyro", statistic="N")), None)
        for sensor in (_SINGLE_SENSOR, _FUSED_SENSOR)
    )
    if one is None or fused is None or not one.value:
        return None
    expected = one.value / math.sqrt(_FUSED_COUNT) / DEGREE * 60.0
    return Result(
        value=fused.value, lower=fused.lower, upper=fused.upper, fields={"expected": expected}
    )
