"""Counterparts of the tables and sections of Engers (2021), and of his aim."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.extensions.fusion.tables import GradeRow, PublishedFigureRow
from imubench_pipeline.extensions.papers.evidence import Evidence, Log, Result
from imubench_pipeline.extensions.papers.printed import read_paper
from imubench_pipeline.noise import FLOOR

DEGREE = math.pi / 180.0
RECORDING = "sim_engers"
READ_AT = 3600.0
"""Cluster time at which the figures under "PSD" were read, s (section 2.2.4)."""

_SINGLE_SENSOR, _FUSED_SENSOR, _FUSED_COUNT = "scc2130", "scc2130_x25", 25


@dataclass(frozen=True)
class Axis:
    """An axis of Tables 2 to 7, and Table 1 of its sensor; in degrees."""

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
        """N, if the figure under "PSD" is the ordinate at 1 h, (deg/s)/sqrt(Hz)."""
        return self.psd * math.sqrt(READ_AT)

    @property
    def log(self) -> Log:
        """The channel that is simulated of it."""
        return Log(self.sensor, RECORDING, f"gyro_{self.axis}")

    def meeting(self, scaled: bool) -> float:
        """Return the cluster time at which the -1/2 line meets the floor, s.

        Scaled: of N as read at 1 h; else of the figure as if it were N.
        """
        return ((self.density if scaled else self.psd) / self.floor) ** 2


_FIGURES = read_paper("engers").figures
_SENSORS = {row["sensor"]: row for row in _FIGURES["sensors"]}
AXES = {
    (row["sensor"], row["axis"]): Axis(
        sensor=row["sensor"],
        axis=row["axis"],
        name=row["name"],
        noise=row["noise"],
        drift=row["drift"],
        psd=float(row["psd"]),
        bias=float(row["bias"]),
        floor=float(row["floor"]),
        rate=float(_SENSORS[row["sensor"]]["rate"]),
        sheet=float(_SENSORS[row["sensor"]]["sheet"]),
    )
    for row in _FIGURES["axes"]
}
"""The axes by sensor and axis."""


def cutoff_of_bandwidth(_: Evidence, bandwidth: str) -> float:
    """Return the cut-off of a low-pass of first order with this noise bandwidth, Hz.

    White noise passes it as it passes a filter of this width with steep edges: pi/2 times the
    cut-off is its noise bandwidth.
    """
    return 2.0 / math.pi * float(bandwidth)


def published_figure(run: Evidence, sensor: str, axis: str, parameter: str) -> Result | None:
    """Return the estimate of a printed figure: bias, the -1/2 line at 1 h (N), or the floor (B)."""
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
    """Return the noise of each axis of a sensor over that of x, and over the datasheet's."""
    axes = [axis for axis in AXES.values() if axis.sensor == sensor]
    over_x = {axis.axis: axis.psd / axes[0].psd for axis in axes}
    return Result(fields=over_x | {f"sheet_{one.axis}": one.density / one.sheet for one in axes})


def count_equal(run: Evidence, grade: str, option: str) -> Result | None:
    """Return how many sensors equal one of a grade, by white noise and by lowest point."""
    words = []
    for sensor, name in ((_SINGLE_SENSOR, ""), (_FUSED_SENSOR, f"of {_FUSED_COUNT} fused ")):
        rows = run.rows(
            GradeRow, sensor=sensor, quantity="gyro", grade=grade, option=option or None
        )
        if not rows:
            return None
        if all(row.printed is None for row in rows):
            reason = f"noise of {rows[0].grade_name}: {rows[0].reason}"
            return Result(words="", verdict="not to be had", reason=reason)
        by = {row.statistic: row for row in reversed(rows)}
        shown = [
            f"{count} by its {what}"
            for statistic, what in (("N", "white noise"), ("sigma_min", "lowest point"))
            if (count := _format_count(by.get(statistic)))
        ]
        words.append(name + ", ".join(shown))
    return Result(fields={"counts": "; ".join(words)})


def _format_count(row: GradeRow | None) -> str:
    """Return the least sufficient whole number as text; empty if it is unknown."""
    if row is None or row.n_upper is None:
        return ""
    most = "at most " if row.n is None else ""
    return f"{most}{max(math.ceil(row.n_upper if row.n is None else row.n), 1)}"


def fused_noise(run: Evidence) -> Result | None:
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
