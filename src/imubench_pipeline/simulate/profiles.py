"""Profiles of motion and temperature over time, in SI, from the settings in `profile_forms`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from imubench_pipeline.settings.profile_forms import (
    ConstantForm,
    DayCycleForm,
    FileForm,
    Form,
    Formula,
    StepsForm,
    Surroundings,
    WarmUpForm,
)
from imubench_pipeline.settings.sensor import QUANTITIES, quantity_of
from imubench_pipeline.simulate.profile_files import FileSeries
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_difference, parse_quantity


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
class SampledProfile(Profile):
    """A value at each sample of a log."""

    values: Array
    rate: float

    def at(self, times: Array) -> Array:
        """Return the values of the samples at these times."""
        return self.values[np.rint(times * self.rate).astype(np.int64)]


@dataclass(frozen=True)
class Steps(Profile):
    """Piecewise constant values from their times on; the first one also before."""

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
class Sum(Profile):
    """Several profiles together."""

    parts: tuple[Profile, ...]

    def at(self, times: Array) -> Array:
        """Return the sum at each time."""
        return np.asarray(sum(part.at(times) for part in self.parts))


@dataclass(frozen=True)
class FileColumn(Profile):
    """A column of a file, linear between its rows and constant beyond them."""

    series: FileSeries
    name: str

    def at(self, times: Array) -> Array:
        """Interpolate the column."""
        return self.series.at(self.name, times)


def profiles_of(around: Surroundings, folder: Path) -> tuple[dict[str, Profile], Profile | None]:
    """Return motion by channel, and temperature, in SI; file names are relative to a folder.

    Raises ConfigError if a file cannot be used. Raises UnitError if a unit has another dimension
    than its profile.
    """
    opened: dict[Path, FileSeries] = {}
    motion = {
        str(channel): make_profile(form, channel, folder, opened)
        for channel, form in around.motion.items()
    }
    warm = around.temperature
    return motion, None if warm is None else make_profile(warm, "temperature", folder, opened)


def make_profile(form: Form, name: str, folder: Path, opened: dict[Path, FileSeries]) -> Profile:
    """Return a profile, in SI, of a channel or of ``temperature``.

    File names are relative to the folder. A file is opened once: a newly opened file is added to
    ``opened``. Raises ConfigError if its file cannot be used. Raises UnitError if a unit has
    another dimension.
    """
    dimension = name if name == "temperature" else QUANTITIES[quantity_of(name)]
    if isinstance(form, FileForm):
        path = folder / form.file
        if path not in opened:
            opened[path] = FileSeries(path)
        column = form.column or name
        opened[path].take(column, dimension)
        return FileColumn(opened[path], column)
    return _make_formula_profile(form, dimension)


def _make_formula_profile(form: Formula, dimension: str, *, difference: bool = False) -> Profile:
    """Return a profile of a value, or of a difference, for which 5 degC and 5 K are the same."""
    convert: Callable[[str, str], float] = parse_difference if difference else parse_quantity

    def time(text: str) -> float:
        return parse_quantity(text, "time")

    def value(text: str) -> float:
        return convert(text, dimension)

    match form:
        case ConstantForm():
            return Constant(value(form.value))
        case StepsForm():
            return Steps(tuple(map(time, form.times)), tuple(map(value, form.values)))
        case DayCycleForm():
            swing = parse_difference(form.amplitude, dimension)
            return DayCycle(value(form.mean), swing, time(form.period), time(form.highest))
        case WarmUpForm():
            start, end = value(form.start), value(form.end)
            return WarmUp(start, end, time(form.time_constant), time(form.begin))
    first, *others = form.parts
    added = (_make_formula_profile(part, dimension, difference=True) for part in others)
    return Sum((_make_formula_profile(first, dimension), *added))
