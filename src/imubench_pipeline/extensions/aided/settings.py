"""Settings of the filters that run on simulated drives."""

from typing import Annotated, Literal

from pydantic import Field

from imubench_pipeline.settings.requirements import Outage, Trajectory
from imubench_pipeline.settings.validation import (
    AccelerationFromZero,
    Duration,
    Frequency,
    RateFromZero,
    Strict,
    Text,
    make_validator,
)
from imubench_pipeline.units import parse_difference

_difference = make_validator("temperature", "a difference, such as 10 K", to_si=parse_difference)

_AccelerationDensity = Annotated[Text, make_validator("accel_density", "a density above 0")]
_Drive = Annotated[
    Duration, make_validator("time", "a drive of at most 10 h", within=(0.0, 36_000.0))
]
_FilterRate = Annotated[
    Frequency, make_validator("frequency", "10 Hz to 1 kHz", within=(10.0, 1000.0))
]


class NavigateSettings(Strict):
    """Filters with every available tuning of a sensor, on simulated drives with GNSS outages."""

    of: Literal["none", "simulated", "all"] = Field(
        "simulated", description="sensors: only those with simulated recordings, all, or none"
    )
    trajectories: tuple[Trajectory, ...] = Field(("field",), min_length=1)
    outages: tuple[Outage, ...] = Field(
        ("10 s", "30 s", "60 s"),
        min_length=1,
        description="durations without GNSS, one after the other",
    )
    duration: _Drive = Field(
        "310 s",
        description="duration of a run; the first 120 s have GNSS; long enough for its outages",
    )
    rate: _FilterRate = Field("50 Hz", description="sampling rate of the filter input")
    runs: int = Field(
        12,
        ge=4,
        le=10_000,
        description="number of runs of each trajectory; 100 runs of 10 min determine the errors to "
        "5 %",
    )
    gyro_bias: RateFromZero = Field(
        "0.1 deg/s", description="standard deviation of the turn-on bias"
    )
    accel_bias: AccelerationFromZero = Field("3 mg", description="the same for accelerometers")
    accel_noise: _AccelerationDensity = Field(
        "100 ug/sqrt(Hz)",
        description="two-sided density of the assumed accelerometers if a log has none",
    )
    gyro_scale: float = Field(
        0.0, ge=0, lt=0.1, description="standard deviation of the error of the scale factor"
    )
    accel_scale: float = Field(0.0, ge=0, lt=0.1, description="the same for accelerometers")
    temperature_change: Annotated[Text, _difference] | None = Field(
        None,
        examples=["10 K"],
        description="temperature change over a run, for sensors with a known temperature drift",
    )
    seed: int = Field(20260101, ge=0)
