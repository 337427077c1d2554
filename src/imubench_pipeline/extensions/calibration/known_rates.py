"""What is declared beside a log of a gyro on a rate table, or at rest with a known direction."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.settings.requirements import Latitude, Time
from imubench_pipeline.settings.validation import Strict, Text, checked
from imubench_pipeline.units import quantity_to_si

Gyro = Literal["gyro_x", "gyro_y", "gyro_z"]

_MAX_UNKNOWN_EARTH_RATE = 1e-9
"""Largest uncertainty of the Earth's rate about an axis without a heading, rad/s."""


def _from_zero(dimension: str) -> AfterValidator:
    return checked(dimension, "a figure from 0", from_zero=True)


TimeFromZero = Annotated[Text, _from_zero("time"), Field(examples=["2 s"])]
Angle = Annotated[Text, checked("angle"), Field(examples=["30 deg"])]
AngleFromZero = Annotated[Text, _from_zero("angle"), Field(examples=["0.5 deg"])]
Rate = Annotated[Text, checked("angular_rate"), Field(examples=["-10 deg/s"])]
RateFromZero = Annotated[Text, _from_zero("angular_rate"), Field(examples=["0.05 deg/s"])]
AccelerationFromZero = Annotated[Text, _from_zero("acceleration"), Field(examples=["20 mg"])]


def stated_gyro(stated: Gyro | None, channels: Sequence[str], what: str) -> str:
    """Return the gyro that an experiment is about: the one that its notes state, or the only one.

    `what` completes "the gyro whose axis ..." of the error.

    Raises
    ------
    ValueError
        If it is not among the channels of the log, or is not stated and the log has another number
        of gyros than one; the text begins with the key.
    """
    gyros = [name for name in channels if name.startswith("gyro_")]
    if stated in gyros:
        return stated
    in_log = ", ".join(gyros) or "no gyro"
    if stated is not None:
        raise ValueError(f"channel: found {stated!r}; the log has {in_log}")
    if len(gyros) != 1:
        raise ValueError(
            f"channel: missing; expected the gyro whose axis {what}, the log has {in_log}"
        )
    return gyros[0]


class Direction(Strict):
    """Where an axis points on the Earth.

    Raises
    ------
    ValueError
        If the latitude is missing, or a figure has a unit of another dimension or is out of range.
    """

    latitude: Latitude = Field(description="of the place, with its unit; south is negative")
    heading: Angle | None = Field(
        None, description="of the axis, from north towards east; null: not known"
    )
    elevation: Angle = Field(
        "0 deg", description="of the axis above the horizon: 90 deg up, -90 deg down"
    )
    heading_sigma: AngleFromZero = Field("0 deg", description="standard deviation of the heading")
    elevation_sigma: AngleFromZero = Field(
        "0 deg", description="standard deviation of the elevation"
    )

    @model_validator(mode="before")
    @classmethod
    def _placed(cls, data: Any) -> Any:
        if isinstance(data, dict) and data.get("latitude") is None:
            raise ValueError(
                "latitude is missing; expected where the log was recorded, such as "
                "latitude: 45.1 deg (south: negative)"
            )
        return data

    @property
    def pointing(self) -> Pointing:
        """The same in rad."""
        angles = {
            name: quantity_to_si(getattr(self, name), "angle")
            for name in ("latitude", "elevation", "heading_sigma", "elevation_sigma")
        }
        heading = None if self.heading is None else quantity_to_si(self.heading, "angle")
        return Pointing(heading=heading, **angles)


class AtRest(Direction):
    """A static log of a gyro whose axis points where it is known, or known in part."""

    channel: Gyro | None = Field(
        None, description="whose axis that is; null: the only gyro of the log"
    )

    def gyro(self, channels: Sequence[str]) -> str:
        """Return the one of the log's channels whose axis is stated, as of `stated_gyro`."""
        return stated_gyro(self.channel, channels, "points there")


class Step(Strict):
    """A steady rate of the table."""

    start: TimeFromZero = Field(description="from the first sample of the recording")
    end: TimeFromZero = Field(description="likewise")
    rate: Rate = Field(description="of the table, positive where a good gyro reads more")

    @model_validator(mode="after")
    def _lasts(self) -> Self:
        if self.seconds[1] <= self.seconds[0]:
            raise ValueError(f"end is {self.end}; expected a time after start, {self.start}")
        return self

    @property
    def seconds(self) -> tuple[float, float]:
        """Start and end, s."""
        return quantity_to_si(self.start, "time"), quantity_to_si(self.end, "time")


class OnRateTable(Strict):
    """A log of a gyro on a rate table, its axis along that of the table.

    Raises
    ------
    ValueError
        If a figure has a unit of another dimension or is out of range, steps are not in order,
        settling takes all of a step, or the heading of an axis that is not vertical is missing.
    """

    steps: tuple[Step, ...] = Field(
        (), description="steady rates in their order; none: they are in the column log.table_rate"
    )
    channel: Gyro | None = Field(
        None, description="along the axis of the table; null: the only gyro of the log"
    )
    settling: TimeFromZero = Field("2 s", description="left out at the start of each steady rate")
    tolerance: RateFromZero = Field(
        "0.05 deg/s", description="range of the column log.table_rate at a steady rate"
    )
    shortest: Time = Field(
        "10 s", description="steady rate that is looked for in that column, settling included"
    )
    setting_sigma: RateFromZero = Field(
        "0 deg/s", description="standard deviation of each true rate about the stated one"
    )
    axis: Direction | None = Field(
        None,
        description="where the axis of the table points, for the part of the Earth's rate; null: "
        "that is a part of the bias",
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        settling = quantity_to_si(self.settling, "time")
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
        if not self.steps and quantity_to_si(self.shortest, "time") <= settling:
            raise ValueError(
                f"shortest is {self.shortest}; expected more than the settling of {self.settling}"
            )
        return self

    @model_validator(mode="after")
    def _heading_where_it_counts(self) -> Self:
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
        """Return one of its figures in SI."""
        return quantity_to_si(getattr(self, name), dimension)

    def gyro(self, channels: Sequence[str], *, column: bool) -> str:
        """Return the one of the log's channels that is along the axis of the table.

        `column`: the log has a column with the rate of the table.

        Raises
        ------
        ValueError
            As `stated_gyro`; and if the rates of the table are stated nowhere, or twice.
        """
        if not self.steps and not column:
            raise ValueError(
                "steps: missing; expected the steady rates, such as - {start: 0 s, end: 60 s, "
                "rate: 10 deg/s}, or a column with the rate of the table, log: {table_rate: "
                "{column: ..., unit: deg/s}}"
            )
        if self.steps and column:
            raise ValueError(
                f"steps: found {len(self.steps)} of them, and the column log.table_rate; expected "
                "one of the two: leave one out"
            )
        return stated_gyro(self.channel, channels, "is along that of the table")
