"""Settings of gyros that are turned between north and south."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from imubench_pipeline.extensions.calibration.settings import Turned, stated_gyro
from imubench_pipeline.settings.experiments import Gyro
from imubench_pipeline.settings.requirements import Latitude, Time
from imubench_pipeline.settings.validation import (
    AccelerationFromZero,
    Rate,
    RateFromZero,
    Strict,
    Text,
    TimeFromZero,
    make_validator,
)
from imubench_pipeline.units import parse_quantity

_DriftFromZero = Annotated[Text, make_validator("gyro_ramp", "0 or more", from_zero=True)]
_REQUIRED_KEYS = {
    "latitude": "the latitude of the place, such as latitude: 45.1 deg (south: negative)",
    "dwell": "the time from one turn to the next, such as dwell: 30 s",
}


class TwoPosition(Turned):
    """A log of a gyro that was repeatedly turned end for end, between north and south."""

    channel: Gyro | None = Field(None, description="the turned gyro; null: the only one of the log")
    turning: TimeFromZero = Field("2 s", description="duration of a turn that is not visible")
    start: TimeFromZero = Field("0 s", description="of the first dwell, from the first sample used")
    first: Literal["north", "south"] | None = Field(
        None, description="direction of the axis in the first dwell; null: not known"
    )
    trust_schedule: bool = Field(False, description="accept the schedule if no turn is detected")
    turn_on_bias: RateFromZero | None = Field(
        None, description="standard deviation of the fixed bias, such as 0.1 deg/s; null: not known"
    )
    drift: _DriftFromZero | None = Field(
        None, description="standard deviation of a steady drift, such as 20 deg/h/h; null: none"
    )
    last: tuple[Time, ...] = Field((), description="parts at the end, estimated too: 13 min")

    @model_validator(mode="before")
    @classmethod
    def _require_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            for key, needed in _REQUIRED_KEYS.items():
                if data.get(key) is None:
                    raise ValueError(f"{key} is missing; expected {needed}")
        return data

    @field_validator("latitude")
    @classmethod
    def _check_latitude(cls, latitude: str) -> str:
        if abs(parse_quantity(latitude, "angle")) > parse_quantity("89 deg", "angle"):
            raise ValueError(
                "expected at most 89 deg: at a pole a horizontal axis does not sense the Earth's "
                "rate"
            )
        return latitude

    @model_validator(mode="after")
    def _check_turning(self) -> Self:
        if 2.0 * self.seconds("turning") >= self.seconds("dwell"):
            raise ValueError(
                f"turning is {self.turning}; expected less than half of the dwell of {self.dwell}"
            )
        return self

    @property
    def first_sense(self) -> int | None:
        """Sense of the first dwell: 1 north, -1 south; None where it is not known."""
        return None if self.first is None else {"north": 1, "south": -1}[self.first]

    @property
    def turn_on_bias_si(self) -> float | None:
        """Standard deviation of the fixed bias, rad/s; None where it is not known."""
        return parse_quantity(self.turn_on_bias, "angular_rate") if self.turn_on_bias else None

    @property
    def drift_si(self) -> float:
        """Standard deviation of a steady drift, rad/s^2."""
        return parse_quantity(self.drift, "gyro_ramp") if self.drift else 0.0

    def moved_gyro(self, channels: Sequence[str], *, column: bool = False) -> str:
        """Return the channel of the turned gyro (see `stated_gyro`)."""
        return stated_gyro(self.channel, channels, "was turned")


class PublishedRate(Strict):
    """A published estimate of the Earth's rate."""

    where: Text = Field(description="such as section 6")
    printed: Rate = Field(description="printed value, with its unit")
    part: Text = Field("whole", description="part of the run: whole, or such as 'last 13 min'")


class SimulatedTurns(TwoPosition):
    """A gyro that is turned between north and south by a schedule."""

    transient: Rate = Field(
        "0 deg/s", description="approximate largest rate that is sensed during a turn"
    )
    assumed: tuple[Text, ...] = Field((), description="values that no source publishes")
    published: tuple[PublishedRate, ...] = ()

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        parts = {"whole", *(f"last {text}" for text in self.last)}
        for rate in self.published:
            if rate.part not in parts:
                raise ValueError(f"published: part is {rate.part!r}; expected one of {parts}")
        return self


class EarthRateSettings(Strict):
    """The Earth's rate from turned gyros, and the recordings required for it."""

    margin: TimeFromZero = Field(
        "0.5 s", description="time omitted on both sides of a visible turn"
    )
    goals: tuple[float, ...] = Field(
        (1.0, 0.1, 0.01),
        min_length=1,
        description="required standard deviations, as a fraction of the Earth's rate",
    )
    run_time: Time = Field(
        "1 h", description="duration of a run for which the best dwell is computed"
    )
    latitude: Latitude = Field(
        "45 deg", description="latitude for predictions of the Earth's rate and north"
    )
    gyro_bias: RateFromZero = Field(
        "0.5 deg/s",
        description="standard deviation of the fixed bias of gyros whose datasheet prints none",
    )
    accelerometer_bias: AccelerationFromZero = Field(
        "20 mg", description="the same for accelerometers"
    )
    draws: int = Field(60, ge=20, description="number of noise models for the range of a sigma")

    @field_validator("goals")
    @classmethod
    def _check_goals(cls, goals: tuple[float, ...]) -> tuple[float, ...]:
        if min(goals) <= 0:
            raise ValueError("expected fractions above 0, such as 0.01 for 1 %")
        return goals
