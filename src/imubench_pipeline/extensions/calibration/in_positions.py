"""What is declared beside a log of a triad that stands in several positions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Self

from pydantic import Field, model_validator

from imubench_pipeline.extensions.calibration.known_rates import (
    AccelerationFromZero,
    Angle,
    RateFromZero,
    TimeFromZero,
)
from imubench_pipeline.settings.requirements import Latitude, Time
from imubench_pipeline.settings.validation import Strict
from imubench_pipeline.units import quantity_to_si

TRIAD = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
"""The axes that it takes, in the order of `imubench_pipeline.extensions.calibration.alignment`."""


class InPositions(Strict):
    """A triad that is turned about its z axis, by the clock, and stands still between the turns.

    Raises
    ------
    ValueError
        If a figure has a unit of another dimension or is out of range, or a turn takes all of a
        dwell.
    """

    latitude: Latitude = Field(description="of the place, with its unit; south is negative")
    dwell: Time = Field(description="from the start of one turn to the start of the next")
    turning: TimeFromZero = Field("2 s", description="of it at the end that the turn takes")
    turned: tuple[Angle, ...] = Field(
        ("0 deg", "180 deg"),
        min_length=1,
        description="angle of each position from the first, about z; they follow each other again "
        "and again",
    )
    gyro_bias: RateFromZero = Field("0.5 deg/s", description="standard deviation of each")
    accelerometer_bias: AccelerationFromZero = Field("20 mg", description="likewise")

    @model_validator(mode="after")
    def _stands(self) -> Self:
        if self.seconds("turning") >= self.seconds("dwell"):
            raise ValueError(
                f"turning is {self.turning}; expected less than the dwell, {self.dwell}"
            )
        return self

    def seconds(self, name: str) -> float:
        """Return one of its times in s."""
        return quantity_to_si(getattr(self, name), "time")

    @property
    def latitude_si(self) -> float:
        """The latitude, rad."""
        return quantity_to_si(self.latitude, "angle")

    def angle(self, number: int) -> float:
        """Return the angle of a position, counted from 0, from the first one, rad.

        It grows where the next one is less far round, so that all turns go the same way.
        """
        angles = [quantity_to_si(text, "angle") for text in self.turned]
        return angles[number % len(angles)] + 2.0 * math.pi * (number // len(angles))

    def check(self, channels: Sequence[str]) -> None:
        """Raise ValueError if the log lacks an axis."""
        missing = [name for name in TRIAD if name not in channels]
        if missing:
            raise ValueError(
                f"the log has no {', '.join(missing)}; expected three gyros and accelerometers"
            )
