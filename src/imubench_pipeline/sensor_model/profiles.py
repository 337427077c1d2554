"""Motion and temperature over time: as a formula, or as the columns of a file.

A profile in a YAML file has its units with it, and is converted to SI when the simulation says
what it is a profile of:

    temperature: {form: warm_up, start: 22 degC, end: 35 degC, time_constant: 10 min}
    motion:
      gyro_z: {form: steps, times: [0 s, 60 s, 90 s], values: [0 deg/s, 20 deg/s, 0 deg/s]}
      accel_z: 1 g
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from imubench_pipeline.sensor import Channel
from imubench_pipeline.sensor_model.low_pass import Array
from imubench_pipeline.sensor_model.profile_files import FileSeries
from imubench_pipeline.units import difference_to_si, quantity_to_si
from imubench_pipeline.validation import Strict, Text


class Profile(ABC):
    """A quantity over time, in SI (temperature: °C)."""

    @abstractmethod
    def at(self, times: Array) -> Array:
        """Return the values at ascending times in s, in their shape."""


@dataclass(frozen=True)
class Constant(Profile):
    """One value."""

    value: float

    def at(self, times: Array) -> Array:
        """Return the value at every time."""
        return np.full(len(times), self.value)


@dataclass(frozen=True)
class Steps(Profile):
    """Values that hold from their times on; the first one also before."""

    times: tuple[float, ...]
    values: tuple[float, ...]

    def at(self, times: Array) -> Array:
        """Return the value of the last step at or before each time."""
        place = np.searchsorted(np.array(self.times), times, side="right") - 1
        return np.asarray(np.array(self.values)[np.maximum(place, 0)])


@dataclass(frozen=True)
class DayCycle(Profile):
    """mean + amplitude cos(2 pi (t - highest) / period)."""

    mean: float
    amplitude: float
    period: float
    highest: float

    def at(self, times: Array) -> Array:
        """Return the cosine at each time."""
        turns = (times - self.highest) / self.period
        return np.asarray(self.mean + self.amplitude * np.cos(2.0 * math.pi * turns))


@dataclass(frozen=True)
class WarmUp(Profile):
    """From start to end as 1 - e^(-(t - begin) / time_constant); start before ``begin``."""

    start: float
    end: float
    time_constant: float
    begin: float

    def at(self, times: Array) -> Array:
        """Return the exponential at each time."""
        since = np.maximum(times - self.begin, 0.0)
        risen = -np.expm1(-since / self.time_constant)
        return np.asarray(self.start + (self.end - self.start) * risen)


@dataclass(frozen=True)
class FileColumn(Profile):
    """A column of a file, linear between its rows, and its ends held beyond them."""

    series: FileSeries
    name: str

    def at(self, times: Array) -> Array:
        """Interpolate the column."""
        return self.series.at(self.name, times)


def _time(text: str) -> str:
    quantity_to_si(text, "time")
    return text


def _positive(text: str, what: str) -> float:
    seconds = quantity_to_si(text, "time")
    if seconds <= 0:
        raise ValueError(f"{what} is {text}, expected a time above 0")
    return seconds


class ConstantForm(Strict):
    """One value."""

    form: Literal["constant"]
    value: Text

    def profile(self, dimension: str) -> Profile:
        """Return it in SI."""
        return Constant(quantity_to_si(self.value, dimension))


class StepsForm(Strict):
    """Values that hold from their times on."""

    form: Literal["steps"]
    times: tuple[Text, ...] = Field(min_length=1)
    values: tuple[Text, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _ordered(self) -> StepsForm:
        if len(self.times) != len(self.values):
            raise ValueError(
                f"{len(self.times)} times and {len(self.values)} values; expected as many"
            )
        times = [quantity_to_si(time, "time") for time in self.times]
        if times != sorted(set(times)):
            raise ValueError("the times do not ascend")
        return self

    def profile(self, dimension: str) -> Profile:
        """Return it in SI."""
        return Steps(
            tuple(quantity_to_si(time, "time") for time in self.times),
            tuple(quantity_to_si(value, dimension) for value in self.values),
        )


class DayCycleForm(Strict):
    """A cosine about a mean."""

    form: Literal["day_cycle"]
    mean: Text
    amplitude: Text = Field(description="a difference: 5 degC and 5 K are the same")
    period: Text = "24 h"
    highest: Text = Field("0 s", description="time of the highest value")

    @model_validator(mode="after")
    def _times(self) -> DayCycleForm:
        _positive(self.period, "period")
        _time(self.highest)
        return self

    def profile(self, dimension: str) -> Profile:
        """Return it in SI."""
        return DayCycle(
            quantity_to_si(self.mean, dimension),
            difference_to_si(self.amplitude, dimension),
            quantity_to_si(self.period, "time"),
            quantity_to_si(self.highest, "time"),
        )


class WarmUpForm(Strict):
    """An exponential from one value to another."""

    form: Literal["warm_up"]
    start: Text
    end: Text
    time_constant: Text
    begin: Text = "0 s"

    @model_validator(mode="after")
    def _times(self) -> WarmUpForm:
        _positive(self.time_constant, "time_constant")
        _time(self.begin)
        return self

    def profile(self, dimension: str) -> Profile:
        """Return it in SI."""
        return WarmUp(
            quantity_to_si(self.start, dimension),
            quantity_to_si(self.end, dimension),
            quantity_to_si(self.time_constant, "time"),
            quantity_to_si(self.begin, "time"),
        )


class FileForm(Strict):
    """A column of a CSV or Parquet file with a column ``time``."""

    form: Literal["file"]
    file: Path
    column: str | None = Field(None, description="null: what it is a profile of")


Form = Annotated[
    ConstantForm | StepsForm | DayCycleForm | WarmUpForm | FileForm, Field(discriminator="form")
]


def _form(value: Any) -> Any:
    """Return a quantity that stands alone as a constant."""
    return {"form": "constant", "value": value} if isinstance(value, (str, int, float)) else value


ProfileForm = Annotated[Form, BeforeValidator(_form)]
"""A profile as YAML has it: a form with its figures, or a quantity such as 25 degC."""


class Surroundings(Strict):
    """What the sensors of a board have in common, as a YAML file has it."""

    temperature: ProfileForm | None = None
    motion: dict[Channel, ProfileForm] = Field(default_factory=dict)

    def profiles(self, folder: Path) -> tuple[dict[str, Profile], Profile | None]:
        """Return motion by channel, and temperature, in SI.

        Parameters
        ----------
        folder : Path
            That files are named from.

        Raises
        ------
        ConfigError
            If a file cannot be used.
        UnitError
            If a unit has another dimension than its profile.
        """
        opened: dict[Path, FileSeries] = {}
        motion = {
            str(channel): made(form, channel, folder, opened)
            for channel, form in self.motion.items()
        }
        warm = self.temperature
        return motion, None if warm is None else made(warm, "temperature", folder, opened)


def made(form: Form, name: str, folder: Path, opened: dict[Path, FileSeries]) -> Profile:
    """Return a profile in SI.

    Parameters
    ----------
    form : Form
    name : str
        What it is a profile of: a channel, or ``temperature``.
    folder : Path
        That its file is named from.
    opened : dict of Path to FileSeries
        Files that are read already; one that is read for this profile is added.

    Raises
    ------
    ConfigError
        If its file cannot be used.
    UnitError
        If a unit has another dimension.
    """
    if isinstance(form, FileForm):
        path = folder / form.file
        if path not in opened:
            opened[path] = FileSeries(path)
        column = form.column or name
        opened[path].take(column, dimension_of_profile(name))
        return FileColumn(opened[path], column)
    return form.profile(dimension_of_profile(name))


def dimension_of_profile(name: str) -> str:
    """Return the dimension of a channel, or of ``temperature``."""
    dimensions: Mapping[str, str] = {"gyro": "angular_rate", "accel": "acceleration"}
    return dimensions.get(name.split("_", maxsplit=1)[0], "temperature")
