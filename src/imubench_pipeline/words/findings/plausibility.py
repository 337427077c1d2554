"""Findings on data that are implausible for a sensor at rest in the stated units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.words.findings import base
from imubench_pipeline.words.numbers import join_names, number_text

_OF_UNIT = frozenset(base.POWERS_OF_UNIT)
_CORRECT_UNIT = "If so, correct 'unit' in the sensor file"


class RateImplausible(
    base.FindingData,
    affects=frozenset(base.POWERS_OF_TIME),
    unfit=True,
    scales=base.POWERS_OF_TIME,
    doubt="the sampling rate looks wrong",
):
    """The sampling rate is implausible for an inertial sensor."""

    rate: float
    slowest: float
    fastest: float  # limits of a plausible rate, Hz
    factor: float  # corrects the times
    statable: bool  # whether the rate is plausible once the sensor file states it

    def text(self, channel: str) -> str:
        times, size = (self.factor, "long") if self.factor > 1.0 else (1.0 / self.factor, "short")
        text = (
            f"The sampling rate is {number_text(self.rate)} Hz; expected "
            f"{number_text(self.slowest, 3)} to {number_text(self.fastest, 5)} Hz. If the unit of "
            f"time is {number_text(times)} times as {size}, the rate is "
            f"{number_text(self.rate / self.factor)} Hz. "
            "If so, correct 'unit' of 'time' in the sensor file"
        )
        if self.statable:
            rate = f"{self.rate:.4g} Hz"
            text += f". If {rate} is right, state it there: 'rate: {rate}'"
        return text


class SlowSampling(base.FindingData, affects=base.NONE):
    """Samples so slow that noise of higher frequencies may be folded into N."""

    rate: float  # Hz

    def text(self, channel: str) -> str:
        return (
            f"The log is sampled at {number_text(self.rate)} Hz, and most sensors are faster. "
            "If samples were skipped and not averaged, noise of higher frequencies is folded into "
            "N. N is then larger than on a datasheet. Log faster, or average before"
        )


class ImpossibleNoise(
    base.FindingData,
    affects=base.ALL,
    unfit=True,
    doubt="the noise of {channels} is impossibly small",
):
    """Less noise than physics allows for any sensor of this kind."""

    noise: float  # SI
    least: float  # least noise of known sensors, SI
    sensors: int  # number of known sensors

    def text(self, channel: str) -> str:
        return (
            f"The noise of {base.channel_name(channel)} is "
            f"{base.value_text(self.noise, channel, 'density')}, "
            f"{number_text(self.least / self.noise, 2)} times below the least of {self.sensors} "
            "sensors. No sensor is so quiet: the axis is dead, or its values were filled in or "
            "computed. Check the column"
        )


class SuspiciousUnit(
    base.FindingData,
    affects=_OF_UNIT,
    unfit=True,
    scales=base.POWERS_OF_UNIT,
    doubt="the unit of measurement of {channels} looks wrong",
):
    """Gravity or noise is unusual in the stated unit, and would be usual in another unit."""

    stated: str
    likely: str  # both units as the sensor file writes them
    factor: float  # corrects the samples
    gravity: float | None = None  # norm of the mean acceleration, m/s², if it shows the mistake
    noise: float | None = None  # white noise, SI, if it shows the mistake
    usual: tuple[float, float] | None = None  # usual limits of the white noise, SI
    printed: bool = False  # whether these limits are from the datasheet of this sensor
    mean: float | None = None  # rate of all gyros, rad/s, if it is unusual too

    def text(self, channel: str) -> str:
        name = base.channel_name(channel)
        if self.gravity is not None:
            seen = f"the mean acceleration is {number_text(self.gravity)} m/s²"
            usual = f"expected {number_text(STANDARD_GRAVITY)}"
            mended = f"{number_text(self.gravity * self.factor)} m/s²"
        else:
            assert self.noise is not None
            assert self.usual is not None
            unit = base.unit_of(channel, "density")
            seen = f"the noise is {unit.text(self.noise)} {unit.sign}"
            if self.mean is not None:
                seen += f", and the mean rate {base.value_text(self.mean, channel)}"
            limits = " to ".join(unit.text(limit) for limit in self.usual)
            usual = f"expected {limits} {'by its datasheet' if self.printed else 'for a MEMS gyro'}"
            mended = f"{unit.text(self.noise * self.factor)} {unit.sign}"
        return (
            f"The unit of {name} is probably wrong: {seen}; {usual}. If the log is in "
            f"{self.likely}, and not {self.stated}, this is {mended}. {_CORRECT_UNIT}"
        )


class GravityNorm(base.FindingData, affects=base.ALL, doubt="the mean acceleration is not gravity"):
    """The mean acceleration is not gravity in any unit."""

    norm: float  # m/s²
    removed: bool  # whether gravity seems to be subtracted

    def text(self, channel: str) -> str:
        advice = (
            "Gravity seems to be subtracted already (linear acceleration): use the raw data"
            if self.removed
            else "Check unit, scale, offset and columns of the accelerometer"
        )
        return (
            f"The mean acceleration is {number_text(self.norm)} m/s²; expected "
            f"{number_text(STANDARD_GRAVITY)}. {advice}"
        )


class NoiseUnlikeDatasheet(
    base.FindingData, affects=base.ALL, doubt="the noise of {channels} differs from its datasheet"
):
    """The white noise is far from the printed one, and no unit explains it."""

    measured_on: str  # the channel, even if the finding is about all channels
    noise: float
    printed: float  # white noise, SI
    stated_rate: float | None  # Hz, if the log has no time stamps: it may be the cause

    def text(self, channel: str) -> str:
        name, unit = base.channel_name(self.measured_on), base.unit_of(self.measured_on, "density")
        rate = f"the sampling rate ({number_text(self.stated_rate)} Hz is stated), "
        return (
            f"The noise of {name} is {unit.text(self.noise)} {unit.sign}, "
            f"{number_text(self.noise / self.printed, 3)} times the "
            f"{unit.text(self.printed)} of its datasheet. "
            f"Check {rate * bool(self.stated_rate)}scale, range and column of the channel, and "
            "that the log is of this sensor"
        )


class AxisUnlike(
    base.FindingData, affects=base.ALL, doubt="the noise of {channels} differs from the other axes"
):
    """One axis has much more or much less noise than both others."""

    others: tuple[str, ...]
    ratio: float  # white noise divided by the white noise of the others
    noise: float  # white noise, SI
    stated: str
    likely: str | None  # units as the sensor file writes them; None: no unit explains it

    def text(self, channel: str) -> str:
        unit = (
            f"A unit of {self.likely} instead of {self.stated} would explain it. "
            if self.likely
            else ""
        )
        return (
            f"The noise of {base.channel_name(channel)} is {number_text(self.ratio, 3)} times that "
            f"of {join_names([base.channel_name(other) for other in self.others])}: "
            f"{base.value_text(self.noise, channel, 'density')}. Axes of one sensor rarely differ "
            f"so much. {unit}Check unit, scale and column of this axis"
        )


class Turning(base.FindingData, affects=base.ALL, unfit=True, doubt="the sensor was turning"):
    """The mean rate of a gyro, or a steady turn of gravity, shows a rotation."""

    rate: float  # of the gyro, or of gravity relative to the sensor, rad/s
    largest: float | None = None
    """Largest plausible offset of the gyro, rad/s; None: gravity shows the turn."""
    offset_of: str | None = None
    """``datasheet``, or the price class, that limits the offset; None: any gyro."""
    swept: float | None = None  # angle by which gravity turns, rad
    gyro_rate: float | None = None
    """Mean rate of the gyros about the axis of gravity's turn, if it agrees, rad/s."""

    def text(self, channel: str) -> str:
        rate = number_text(math.degrees(self.rate), 3)
        if self.largest is not None:
            limit = {None: "of any gyro", "datasheet": "by its datasheet"}.get(
                self.offset_of, f"of price class {self.offset_of}"
            )
            return (
                f"The mean rate of {base.channel_name(channel)}, {rate} °/s, is beyond the largest "
                f"plausible offset {limit} ({number_text(math.degrees(self.largest), 3)} °/s). "
                "The sensor is turning, or the unit is wrong. "
                "Record with the sensor at rest, or correct the unit"
            )
        gyros = (
            ""
            if self.gyro_rate is None
            else f"The gyros show {number_text(math.degrees(self.gyro_rate), 3)} °/s about the "
            "same axis. "
        )
        return (
            "Gravity turns relative to the sensor by "
            f"{number_text(math.degrees(self.swept or 0.0), 3)}°, steadily at {rate} °/s. {gyros}"
            "The sensor is turning or tilting: record with the sensor at rest"
        )


_PREFIX_MISTAKES: Sequence[tuple[float, str]] = (
    (1e-3, "thousandths of its unit"),
    (1e3, "thousands of its unit"),
    (1e-6, "millionths of its unit"),
    (1e6, "millions of its unit"),
)
UNIT_MISTAKES: Mapping[str, Sequence[tuple[float, str]]] = {
    "gyro": (
        (math.radians(1.0), "degrees, and not rad"),
        (math.degrees(1.0), "rad, and not degrees"),
        *_PREFIX_MISTAKES,
    ),
    "accel": (
        (STANDARD_GRAVITY, "g, and not m/s²"),
        (1.0 / STANDARD_GRAVITY, "m/s², and not g"),
        *_PREFIX_MISTAKES,
    ),
}
"""Common unit mistakes: the factor that corrects a figure, and the mistake in words."""


class UnusualFigure(
    base.FindingData,
    affects=_OF_UNIT | {"S"},
    doubt="N or B of {channels} differs from all known sensors",
):
    """N or B is far above the median, or far below the least, of other sensors."""

    quantity: str
    figure: str  # ``N`` or ``B``
    value: float
    usual: float  # median of other sensors, or the least if the value is below it, SI
    sensors: int  # number of other sensors
    factor: float | None
    """Factor of the unit mistake that explains it (`UNIT_MISTAKES`); None: no mistake does."""
    lower: float | None = None
    upper: float | None = None
    """Limits of an estimate; its B is the minimum of the Allan deviation, as vendors print it."""
    estimated: bool = False

    def text(self, channel: str) -> str:
        symbol = "σ_min" if self.figure == "B" and self.estimated else self.figure
        unit = base.unit_of(self.quantity, "density" if self.figure == "N" else "level")
        unit = replace(unit, parameter=self.figure)
        value, _ = unit.estimate_texts(self.value, self.lower, self.upper)
        if self.value > self.usual:
            how = f"{number_text(self.value / self.usual, 3)} times the median"
        else:
            how = f"{number_text(self.usual / self.value, 3)} times below the least"
        mistake = next(
            (words for factor, words in UNIT_MISTAKES[self.quantity] if factor == self.factor), None
        )
        return (
            f"{symbol} of {base.channel_name(channel) if channel else SENSORS[self.quantity]} is "
            f"{value} {unit.sign}, {how} of {self.sensors} sensors "
            f"({unit.text(self.usual)} {unit.sign}). "
            + (
                f"If it is in {mistake}, the value is "
                f"{unit.text(self.value * (self.factor or 1.0))} {unit.sign}: check its unit"
                if mistake
                else "Check whether its unit is right"
            )
        )
