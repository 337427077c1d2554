"""Settings of recordings with known rates or directions, measured and simulated."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.settings.experiments import Experiment, Gyro
from imubench_pipeline.settings.requirements import Latitude, Time
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.settings.validation import (
    AccelerationFromZero,
    Angle,
    AngleFromZero,
    Rate,
    RateFromZero,
    Strict,
    Text,
    TimeFromZero,
)
from imubench_pipeline.units import parse_quantity

_MAX_UNKNOWN_EARTH_RATE = 1e-9  # about an axis without a heading, rad/s


def stated_gyro(stated: Gyro | None, channels: Sequence[str], what: str) -> str:
    """Return the gyro of an experiment: the gyro stated in its notes, or the only one.

    `what` completes "the gyro whose axis ..." in the error. Raises ValueError if the stated gyro is
    not in the log, or if none is stated and the log does not have exactly one; the error begins
    with the key.
    """
    gyros = [name for name in channels if name.startswith("gyro_")]
    if stated in gyros:
        return stated
    in_log = ", ".join(gyros) or "no gyro"
    if stated is not None:
        raise ValueError(f"channel: found {stated!r}; expected a gyro of the log: {in_log}")
    if len(gyros) != 1:
        raise ValueError(
            f"channel: missing; expected the gyro whose axis {what}, the log has {in_log}"
        )
    return gyros[0]


class Direction(Strict):
    """The direction of an axis on the Earth."""

    latitude: Latitude = Field(description="of the place, with its unit; south is negative")
    heading: Angle | None = Field(None, description="of the axis, north to east; null: unknown")
    elevation: Angle = Field("0 deg", description="above the horizon: 90 deg up, -90 deg down")
    heading_sigma: AngleFromZero = Field("0 deg", description="standard deviation of the heading")
    elevation_sigma: AngleFromZero = Field("0 deg", description="the same for the elevation")

    @model_validator(mode="before")
    @classmethod
    def _require_latitude(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("latitude") is None:
            raise ValueError(
                "latitude is missing; expected the latitude of the place, such as latitude: 45.1 "
                "deg (south: negative)"
            )
        return data

    @property
    def pointing(self) -> Pointing:
        """The direction in rad."""
        angles = {
            name: parse_quantity(getattr(self, name), "angle")
            for name in ("latitude", "elevation", "heading_sigma", "elevation_sigma")
        }
        heading = None if self.heading is None else parse_quantity(self.heading, "angle")
        return Pointing(heading=heading, **angles)


class AtRest(Direction, Experiment):
    """A static log of a gyro whose axis direction is fully or partly known."""

    is_static: ClassVar[bool] = True

    channel: Gyro | None = Field(
        None, description="channel of this axis; null: the only gyro of the log"
    )

    def moved_gyro(self, channels: Sequence[str], *, column: bool = False) -> str:
        """Return the channel of the gyro with the stated direction (see `stated_gyro`)."""
        return stated_gyro(self.channel, channels, "points there")


class Step(Strict):
    """A steady rate of the table."""

    start: TimeFromZero = Field(description="time from the first sample of the recording")
    end: TimeFromZero = Field(description="the same")
    rate: Rate = Field(
        description="rate of the table, positive if a correct gyro reads a positive rate"
    )

    @model_validator(mode="after")
    def _check_end(self) -> Self:
        if self.seconds[1] <= self.seconds[0]:
            raise ValueError(f"end is {self.end}; expected a time after start, {self.start}")
        return self

    @property
    def seconds(self) -> tuple[float, float]:
        """Start and end, s."""
        return parse_quantity(self.start, "time"), parse_quantity(self.end, "time")


class OnRateTable(Experiment):
    """A log of a gyro on a rate table, its axis along the axis of the table."""

    steps: tuple[Step, ...] = Field((), description="steady rates; none: column log.table_rate")
    channel: Gyro | None = Field(None, description="along the axis; null: the only gyro of the log")
    settling: TimeFromZero = Field(
        "2 s", description="time omitted at the start of each steady rate"
    )
    tolerance: RateFromZero = Field(
        "0.05 deg/s", description="range of the column at a steady rate"
    )
    shortest: Time = Field("10 s", description="least duration of a steady rate in that column")
    setting_sigma: RateFromZero = Field("0 deg/s", description="standard deviation of a true rate")
    axis: Direction | None = Field(
        None, description="of the table, for the Earth's rate along it; null: a part of the bias"
    )

    @model_validator(mode="after")
    def _check_steps(self) -> Self:
        settling = parse_quantity(self.settling, "time")
        for number, step in enumerate(self.steps, 1):
            if step.seconds[1] - step.seconds[0] <= settling:
                raise ValueError(
                    f"steps: step {number} lasts from {step.start} to {step.end}; expected more "
                    f"than the settling of {self.settling}: lengthen it, or lower settling"
                )
        for number, (before, after) in enumerate(pairwise(self.steps), 2):
            if after.seconds[0] < before.seconds[1]:
                raise ValueError(
                    f"steps: step {number} starts at {after.start}, before step {number - 1} ends "
                    f"at {before.end}; expected steps in their order"
                )
        if not self.steps and parse_quantity(self.shortest, "time") <= settling:
            raise ValueError(
                f"shortest is {self.shortest}; expected more than the settling of {self.settling}"
            )
        return self

    @model_validator(mode="after")
    def _require_heading(self) -> Self:
        if self.axis is None or self.axis.heading is not None:
            return self
        if self.axis.pointing.half_width > _MAX_UNKNOWN_EARTH_RATE:
            raise ValueError(
                "axis.heading is missing; expected where the axis of the table points, such as "
                "heading: 0 deg (north), as it is not vertical (elevation: 90 deg or -90 deg); or "
                "leave 'axis' out: the Earth's rate is then a part of the bias"
            )
        return self

    def si(self, name: str, dimension: str) -> float:
        """Return a setting in SI; ``dimension``: such as "time" or "angular_rate"."""
        return parse_quantity(getattr(self, name), dimension)

    def moved_gyro(self, channels: Sequence[str], *, column: bool) -> str:
        """Return the channel along the table's axis; ``column``: whether the log has the rate."""
        if not self.steps and not column:
            raise ValueError(
                "steps: missing; expected the steady rates, such as - {start: 0 s, end: 60 s, "
                "rate: 10 deg/s}, or a column with the rate of the table, log: {table_rate: "
                "{column: ..., unit: deg/s}}"
            )
        if self.steps and column:
            raise ValueError(
                f"steps: found both steps ({len(self.steps)}) and the column log.table_rate; "
                "expected one of the two: remove steps or log.table_rate"
            )
        return stated_gyro(self.channel, channels, "is along the axis of the table")


class Turned(Experiment):
    """A log of a sensor that is turned by a schedule, and is at rest between the turns."""

    latitude: Latitude = Field(description="of the place, with its unit; south is negative")
    dwell: Time = Field(
        description="nominal time from the start of one turn to the start of the next"
    )

    def seconds(self, name: Literal["dwell", "turning", "start"]) -> float:
        """Return a setting that is a time, s."""
        return parse_quantity(getattr(self, name), "time")

    @property
    def latitude_si(self) -> float:
        """Latitude, rad."""
        return parse_quantity(self.latitude, "angle")


class InPositions(Turned):
    """A triad that is turned about its z axis by a schedule, and is at rest between the turns."""

    turning: TimeFromZero = Field(
        "2 s", description="part of this time, at its end, that the turn takes"
    )
    turned: tuple[Angle, ...] = Field(
        ("0 deg", "180 deg"),
        min_length=1,
        description="angle of each position from the first, about z; the sequence repeats",
    )
    gyro_bias: RateFromZero = Field(
        "0.5 deg/s", description="standard deviation of the fixed bias of each gyro"
    )
    accelerometer_bias: AccelerationFromZero = Field("20 mg", description="the same")

    @model_validator(mode="after")
    def _check_turning(self) -> Self:
        if self.seconds("turning") >= self.seconds("dwell"):
            raise ValueError(
                f"turning is {self.turning}; expected less than the dwell, {self.dwell}"
            )
        return self

    def angle(self, number: int) -> float:
        """Return the angle from the first position (number 0) to a position, rad, never wrapped."""
        angles = [parse_quantity(text, "angle") for text in self.turned]
        return angles[number % len(angles)] + 2.0 * math.pi * (number // len(angles))

    def moved_gyro(self, channels: Sequence[str], *, column: bool = False) -> None:
        """Raise ValueError if the log lacks one of the six axes."""
        missing = [name for name in CHANNELS if name not in channels]
        if missing:
            raise ValueError(
                f"the log has no {', '.join(missing)}; expected three gyros and three "
                "accelerometers"
            )


class SimulatedTable(OnRateTable):
    """A simulated gyro on a rate table that follows its steps, with ramps between them."""

    scale_factor: float = Field(1.0, gt=0, description="true one: indicated over true rate")
    assumed: tuple[Text, ...] = Field((), description="values that no source publishes")

    @model_validator(mode="after")
    def _require_steps(self) -> Self:
        if not self.steps:
            raise ValueError("steps is missing; expected the steady rates of the table")
        return self


class SimulatedPositions(InPositions):
    """A triad that is turned by a schedule, and senses gravity and the Earth's rate."""

    roll: Angle = Field("0 deg", description="true one, in the first position")
    pitch: Angle = Field("0 deg", description="the same")
    heading: Angle = Field("0 deg", description="the same, from north towards east")
    assumed: tuple[Text, ...] = Field((), description="values that no source publishes")

    @property
    def true_angles(self) -> dict[str, float]:
        """Roll, pitch and heading, rad, the heading from -pi to pi."""
        roll, pitch, heading = (
            parse_quantity(angle, "angle") for angle in (self.roll, self.pitch, self.heading)
        )
        heading = math.remainder(heading, 2.0 * math.pi)
        return {"roll": roll, "pitch": pitch, "heading": heading}


class SimulatedRest(AtRest):
    """A gyro at rest that senses its part of the Earth's rate."""

    true_heading: Angle = Field("0 deg", description="true heading of the axis, if heading is null")
    assumed: tuple[Text, ...] = Field((), description="values that no source publishes")

    @property
    def true(self) -> Pointing:
        """The true direction of the axis."""
        stated, heading = self.pointing, self.pointing.heading
        if heading is None:
            heading = parse_quantity(self.true_heading, "angle")
        return Pointing(latitude=stated.latitude, heading=heading, elevation=stated.elevation)
