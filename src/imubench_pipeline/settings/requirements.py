"""Requirements of an application: limits of the errors of dead reckoning after a time."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from imubench_pipeline.model.states import Measured
from imubench_pipeline.settings.validation import (
    Between,
    Frequency,
    Strict,
    Text,
    make_size_validator,
    make_validator,
)
from imubench_pipeline.settings.yaml_files import read_folder, require_valid
from imubench_pipeline.units import parse_difference, parse_quantity

Error = Literal["attitude", "heading", "velocity", "position", "cross_track", "north"]
"""What is limited: velocity and position in the horizontal plane, attitude about one axis.

``cross_track`` is the error across the way of a vehicle with an odometer; ``north`` is the heading
that a gyro at rest finds from the Earth's rate.
"""

DIMENSIONS: Mapping[str, str] = {
    "attitude": "angle",
    "heading": "angle",
    "velocity": "velocity",
    "position": "length",
    "cross_track": "length",
    "north": "angle",
}

Axis = Literal["worst", "median"]  # the axis of a sensor that a requirement is held against


def _latitude(text: str) -> str:
    if not abs(parse_quantity(text, "angle")) < 1.5707:
        raise ValueError(
            "expected a latitude between the poles: at a pole, a gyro with a horizontal axis "
            "senses nothing of the Earth's rate"
        )
    return text


Time = Annotated[Text, make_validator("time", "a time above zero"), Field(examples=["60 s"])]
Outage = Annotated[Time, make_validator("time", "an outage of 2 s to 1 h", within=(2.0, 3600.0))]
"""How long there is no GNSS: a few fixes at least."""
Latitude = Annotated[Text, AfterValidator(_latitude), Field(examples=["45 deg"])]

Trajectory = Literal["field", "car", "drone", "rest"]
"""The simulated drives on which filters are run."""

IN_OUTAGES = ("position", "velocity", "heading")
"""The errors that are measured at the end of outages of GNSS."""


class Limit(Strict):
    """The largest permitted error after a time, or at the end of a GNSS outage."""

    error: Error
    after: Time | None = Field(None, description="of dead reckoning; of rest, for north")
    outage: Outage | None = Field(
        None, description="instead of a time: GNSS outage of a tuned filter on a simulated drive"
    )
    trajectory: Trajectory | None = Field(None, description="of that drive")
    at_most: Text = Field(description="with its unit, such as 1 deg or 5 m")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.size <= 0:
            raise ValueError(f"at_most is {self.at_most}; expected more than zero")
        if (self.after is None) == (self.outage is None):
            raise ValueError("expected either 'after' or 'outage', such as 30 s")
        if (self.outage is None) != (self.trajectory is None):
            raise ValueError("expected 'outage' and 'trajectory' together, such as 30 s and field")
        if self.outage is not None and self.error not in IN_OUTAGES:
            raise ValueError(
                f"error is {self.error}; expected one of {', '.join(IN_OUTAGES)} for an outage"
            )
        return self

    @property
    def seconds(self) -> float:
        """Time after which the error is limited, or length of the outage, s."""
        return parse_quantity(self.outage or self.after or "", "time")

    @property
    def size(self) -> float:
        """Largest permitted error, SI."""
        return parse_quantity(self.at_most, DIMENSIONS[self.error])

    @property
    def text(self) -> str:
        """The limit in words."""
        name = self.error.replace("_", "-")
        if self.outage is not None:
            return (
                f"{name} within {self.at_most} at the end of {self.outage} without GNSS "
                f"({self.trajectory})"
            )
        return f"{name} within {self.at_most} after {self.after}"


def _axes(text: str) -> str:
    _, _, axes = text.partition("_")
    if not re.fullmatch("(gyro|accel)_[xyz]+", text) or len(set(axes)) < len(axes):
        raise ValueError("expected a quantity with its axes, such as gyro_xyz or accel_z")
    return text


Rate = Annotated[Text, make_size_validator("angular_rate"), Field(examples=["300 deg/s"])]
Acceleration = Annotated[Text, make_size_validator("acceleration"), Field(examples=["8 g"])]

_change = make_validator(
    "temperature", "a difference above zero, such as 20 K", to_si=parse_difference
)

_BIAS = "a standard deviation, 0 or more, with its unit"


class TurnOn(Strict):
    """Standard deviations of the biases with which dead reckoning begins."""

    gyro: Annotated[Text, make_validator("angular_rate", _BIAS, from_zero=True)] | None = Field(
        None, description="with its unit, such as 0.2 deg/s; null: from the datasheet"
    )
    accel: Annotated[Text, make_validator("acceleration", _BIAS, from_zero=True)] | None = Field(
        None, description="with its unit, such as 20 mg; null: from the datasheet"
    )
    on_time: Time = Field("60 s", description="since the sensor was switched on")


class Environment(Strict):
    """Conditions of use that a static log does not show; none by default."""

    temperature_change: Annotated[Text, _change] | None = Field(
        None,
        examples=["20 K"],
        description="±, from the static window to the end; with turn_on, from where its bias holds",
    )
    turns: Annotated[Text, make_size_validator("angle")] | None = Field(
        None, examples=["360 deg"], description="± about the axis of the gyro, by the end"
    )
    speed_change: Annotated[Text, make_size_validator("velocity")] | None = Field(
        None, examples=["10 m/s"], description="± along the axis of the accelerometer, by the end"
    )
    speed: Annotated[Text, make_size_validator("velocity")] | None = Field(
        None, examples=["2 m/s"], description="in turns, and on the way; null: speed_change"
    )
    vibration: Acceleration | None = Field(None, description="rms of one axis")
    vibration_frequency: Frequency | None = Field(None, description="its lowest; null: 10 Hz")


class FullScale(Strict):
    """Largest rate and acceleration of the application, which a sensor must measure."""

    gyro: Rate | None = Field(None, description="±")
    accel: Acceleration | None = Field(None, description="±, gravity included")


class Must(Strict):
    """Hard requirements, checked against the figures of the sensor file; none by default."""

    full_scale: FullScale = FullScale()
    bandwidth: Frequency | None = Field(None, description="-3 dB, of each quantity, at least")
    rate: Frequency | None = Field(None, description="of samples, at least")
    temperature: Between | None = Field(None, description="of operation, at least")
    axes: tuple[Annotated[str, AfterValidator(_axes)], ...] = Field(
        (), description="such as [gyro_xyz, accel_xyz]"
    )
    mass: Annotated[Text, make_size_validator("mass")] | None = Field(
        None, examples=["30 g"], description="at most"
    )
    power: Annotated[Text, make_size_validator("power")] | None = Field(
        None, examples=["1 W"], description="at most"
    )


class Requirement(Strict):
    """Requirements of one application."""

    title: Text
    example: bool = Field(False, description="invented as an example")
    note: Text | None = None
    limits: tuple[Limit, ...] = Field(min_length=1)
    static_window: Time | None = Field(
        None, description="window at rest before it, for the estimation of biases and tilt"
    )
    turn_on: TurnOn | None = Field(None, description="instead: turn-on biases without calibration")
    latitude: Latitude | None = Field(None, description="for limits of north")
    positions: int = Field(
        1, ge=1, description="for north: 1, or an even number of positions with half turns between"
    )
    environment: Environment = Field(
        Environment(), description="conditions of use; datasheets give the resulting errors"
    )
    must: Must = Field(Must(), description="without it a sensor is excluded")
    confidence: float = Field(
        0.95, gt=0, lt=1, description="probability of an error within its limit"
    )
    axis: Axis = Field("worst", description="the axis of a sensor that must fulfil it")
    price_class: tuple[Text, ...] | None = Field(
        None, description="permitted words in the price class of a sensor; null: any"
    )

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.static_window is not None and self.turn_on is not None:
            raise ValueError("found both; expected either 'static_window' or 'turn_on'")
        if self.by_dead_reckoning and self.static_window is None and self.turn_on is None:
            raise ValueError("found neither; expected either 'static_window' or 'turn_on'")
        if self.latitude is None and any(limit.error == "north" for limit in self.limits):
            raise ValueError("a limit of north needs 'latitude', such as 45 deg")
        if self.positions > 1 and self.positions % 2:
            raise ValueError(f"positions is {self.positions}; expected 1 or an even number")
        moving = self.environment.speed or self.environment.speed_change
        if not moving and any(limit.error == "cross_track" for limit in self.limits):
            raise ValueError("a limit of cross_track needs 'speed' in 'environment', such as 1 m/s")
        return self

    @property
    def by_dead_reckoning(self) -> tuple[Limit, ...]:
        """Limits that are compared with an error budget."""
        return tuple(limit for limit in self.limits if limit.outage is None)

    @property
    def in_outages(self) -> tuple[Limit, ...]:
        """Limits that are compared with a filter on a simulated drive."""
        return tuple(limit for limit in self.limits if limit.outage is not None)

    @property
    def quantities(self) -> tuple[Measured, ...]:
        """Quantities, gyro and accel, that contribute to the limited errors."""
        turned = ("heading", "cross_track", "north")
        gyro_alone = all(limit.outage is None and limit.error in turned for limit in self.limits)
        return ("gyro",) if gyro_alone else ("gyro", "accel")

    @property
    def sigmas(self) -> float:
        """Least ratio of a limit to the standard deviation of the error, from the confidence."""
        return NormalDist().inv_cdf((1.0 + self.confidence) / 2.0)

    def admits(self, price_class: str | None) -> bool:
        """Return whether sensors of a price class may be chosen."""
        if self.price_class is None:
            return True
        return any(word.lower() in (price_class or "").lower() for word in self.price_class)


def read_requirements(folders: Path | Iterable[Path] | None) -> dict[str, Requirement]:
    """Return the requirements in folders by file name; empty if None. Raises `ConfigError`."""
    return (
        {} if folders is None else require_valid(read_folder(Requirement, folders, "requirement"))
    )


def validate_requirements(sections: Mapping[str, object]) -> dict[str, Requirement]:
    """Return the requirements, by name, from their sections in a plan."""
    return {name: Requirement.model_validate(section) for name, section in sections.items()}
