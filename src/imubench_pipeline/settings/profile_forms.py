"""Motion and temperature over time in a YAML file: a formula, or columns of a file.

    temperature: {form: warm_up, start: 22 degC, end: 35 degC, time_constant: 10 min}
    motion:
      gyro_z: {form: steps, times: [0 s, 60 s, 90 s], values: [0 deg/s, 20 deg/s, 0 deg/s]}
      accel_z: 1 g

`profiles` converts figures to SI. Nothing is computed here: every configuration loads this module.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, field_validator, model_validator

from imubench_pipeline.settings.sensor import QUANTITIES, Channel, quantity_of
from imubench_pipeline.settings.validation import Duration, Strict, Text, make_validator
from imubench_pipeline.units import UnitError, parse_difference, parse_quantity

_Time = Annotated[Text, make_validator("time")]


class ConstantForm(Strict):
    """A constant value."""

    form: Literal["constant"]
    value: Text


class StepsForm(Strict):
    """Constant values, each from its time to the next."""

    form: Literal["steps"]
    times: tuple[Text, ...] = Field(min_length=1)
    values: tuple[Text, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _ordered(self) -> "StepsForm":
        if len(self.times) != len(self.values):
            raise ValueError(
                f"{len(self.times)} times and {len(self.values)} values; expected equal numbers"
            )
        times = [parse_quantity(time, "time") for time in self.times]
        if times != sorted(set(times)):
            raise ValueError("the times do not ascend; expected each later than the one before")
        return self


class DayCycleForm(Strict):
    """A cosine about a mean."""

    form: Literal["day_cycle"]
    mean: Text
    amplitude: Text = Field(description="a difference: 5 degC and 5 K are the same")
    period: Duration = "24 h"
    highest: _Time = Field("0 s", description="time of the highest value")


class WarmUpForm(Strict):
    """An exponential from one value to another."""

    form: Literal["warm_up"]
    start: Text
    end: Text
    time_constant: Duration
    begin: _Time = "0 s"


class FileForm(Strict):
    """A column of a CSV or Parquet file with a column ``time``."""

    form: Literal["file"]
    file: Path
    column: str | None = Field(None, description="null: the unit of its quantity")


Part = Annotated[ConstantForm | StepsForm | DayCycleForm | WarmUpForm, Field(discriminator="form")]


class SumForm(Strict):
    """A sum of formulas: a value, and differences that are added to it."""

    form: Literal["sum"]
    parts: tuple[Part, ...] = Field(min_length=2)


Formula = ConstantForm | StepsForm | DayCycleForm | WarmUpForm | SumForm
Form = Annotated[Formula | FileForm, Field(discriminator="form")]


def _form(value: Any) -> Any:
    return {"form": "constant", "value": value} if isinstance(value, (str, int, float)) else value


ProfileForm = Annotated[Form, BeforeValidator(_form)]
"""A profile as YAML has it: a form with its figures, or a quantity such as 25 degC."""


class Surroundings(Strict):
    """Common conditions of the sensors of a board."""

    temperature: ProfileForm | None = None
    motion: dict[Channel, ProfileForm] = Field(default_factory=dict)

    @field_validator("temperature")
    @classmethod
    def _of_temperature(cls, form: Form | None) -> Form | None:
        if form is not None:
            _check_units(form, "temperature")
        return form

    @field_validator("motion")
    @classmethod
    def _of_motion(cls, motion: dict[Channel, Form]) -> dict[Channel, Form]:
        for channel, form in motion.items():
            try:
                _check_units(form, QUANTITIES[quantity_of(channel)])
            except UnitError as error:
                raise ValueError(f"{channel}: {error}") from error
        return motion


def _check_units(form: Form, dimension: str) -> None:
    match form:
        case ConstantForm():
            parse_quantity(form.value, dimension)
        case StepsForm():
            for value in form.values:
                parse_quantity(value, dimension)
        case DayCycleForm():
            parse_quantity(form.mean, dimension)
            parse_difference(form.amplitude, dimension)
        case WarmUpForm():
            parse_quantity(form.start, dimension)
            parse_quantity(form.end, dimension)
        case SumForm():
            for part in form.parts:
                _check_units(part, dimension)
