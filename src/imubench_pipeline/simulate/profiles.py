"""Profiles of motion and temperature over time, in SI, from the settings in `profile_forms`.

A file of columns is CSV or Parquet. The name of a column is its quantity, with the unit in
brackets: ``time [s]``, ``temperature [degC]``, ``gyro_z [deg/s]``. Without a unit it is in SI, and
temperature in °C.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from imubench_pipeline import units
from imubench_pipeline.settings import profile_forms
from imubench_pipeline.settings.sensor import QUANTITIES, quantity_of
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.typing import Array

_HEADING_PATTERN = re.compile(r"^\s*(\w+)\s*(?:[\[(]\s*(.+?)\s*[\])])?\s*$")
_TIME_COLUMN = "time"
_EXPECTED_CSV = "commas between columns, points before decimals, and one line of names"


class FileSeries:
    """Columns over time in a file: CSV with a line of names, or Parquet.

    Raises ConfigError if the file does not exist, cannot be read, or has no column ``time``.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._headings = self._read_headings()

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities of the columns, without time."""
        return tuple(name for name in self._headings if name != _TIME_COLUMN)

    def column(self, name: str, dimension: str) -> "FileColumn":
        """Return a column by name, without its unit, in SI, temperature in °C.

        Raises ConfigError if there is no such column, its unit has another dimension, a number is
        missing in it, or the times of the file do not ascend.
        """
        return FileColumn(self.path, self._times, self._read(name, dimension))

    @cached_property
    def _times(self) -> Array:
        times = self._read(_TIME_COLUMN, "time")
        if not len(times):
            raise ConfigError(f"{self.path}: has no rows; expected at least one")
        rises = np.diff(times) > 0
        if not rises.all():
            at = int(np.argmin(rises))
            raise ConfigError(
                f"{self.path}: the times do not ascend in row {at + 2}: {times[at + 1]:g} s "
                f"after {times[at]:g} s; expected each row later than the one before; put the rows "
                "in order, each time once"
            )
        return times

    def _read(self, name: str, dimension: str) -> Array:
        if name not in self._headings:
            raise ConfigError(
                f"{self.path}: no column {name!r}; it has {', '.join(self._headings) or 'none'}; "
                f"expected a column such as '{name} [{units.SI_UNITS[dimension]}]'"
            )
        heading, unit = self._headings[name]
        try:
            factor, offset = units.find_conversion(unit or units.SI_UNITS[dimension], dimension)
        except units.UnitError as error:
            raise ConfigError(f"{self.path}: column {heading!r}: {error}") from error
        try:
            if self.path.suffix == ".parquet":
                column = pq.read_table(self.path, columns=[heading]).column(0)
            else:
                options = pacsv.ConvertOptions(
                    include_columns=[heading], column_types={heading: pa.float64()}
                )
                column = pacsv.read_csv(self.path, convert_options=options).column(0)
        except (OSError, pa.ArrowException) as error:
            raise self._unreadable(error) from error
        if pa.types.is_string(column.type) or pa.types.is_binary(column.type):
            raise ConfigError(f"{self.path}: column {heading!r} is text; expected numbers")
        values = column.cast(pa.float64()).to_numpy()
        present = np.isfinite(values)
        if not present.all():
            raise ConfigError(
                f"{self.path}: column {heading!r}: a number is missing in row "
                f"{1 + int(np.argmin(present))}; expected one in each row; remove the row, or add "
                "the number"
            )
        return np.asarray(values * factor + offset)

    def _read_headings(self) -> dict[str, tuple[str, str | None]]:
        """Return heading and unit of the columns by name; Parquet may state a unit in metadata."""
        try:
            if self.path.suffix == ".parquet":
                schema = pq.read_schema(self.path)
            else:
                with pacsv.open_csv(self.path) as reader:
                    schema = reader.schema
        except FileNotFoundError:
            raise ConfigError(
                f"{self.path}: no such file; expected a CSV or Parquet file with columns such as "
                "'time [s]'; correct its name"
            ) from None
        except (OSError, pa.ArrowException) as error:
            raise self._unreadable(error) from error
        headings = {}
        for field in schema:
            heading, stated = field.name, (field.metadata or {}).get(b"unit")
            unit = None if stated is None else stated.decode("utf-8", "replace")
            if self.path.suffix != ".parquet" and (";" in heading or "\t" in heading):
                raise ConfigError(
                    f"{self.path}: found the line of names {heading!r}; expected {_EXPECTED_CSV}"
                )
            match = _HEADING_PATTERN.match(heading)
            if match:
                headings[match[1]] = (heading, match[2] or unit)
        if _TIME_COLUMN not in headings:
            raise ConfigError(
                f"{self.path}: no column 'time'; it has {', '.join(headings) or 'none'}; expected "
                "a column such as 'time [s]'"
            )
        return headings

    def _unreadable(self, error: Exception) -> ConfigError:
        text = self.path.suffix != ".parquet" and isinstance(error, pa.ArrowException)
        expected = f"; expected {_EXPECTED_CSV}" if text else ""
        return ConfigError(f"{self.path}: cannot be read: {error}{expected}")


Profile = Callable[[Array], Array]
"""A quantity over time: returns its values at ascending times in s, in SI (temperature: °C)."""


def make_constant(value: float) -> Profile:
    """Return a profile of one value."""
    return lambda times: np.full(len(times), value)


def make_sampled(values: Array, rate: float) -> Profile:
    """Return a profile of the samples, shape (n,), of a log at a rate, Hz."""
    return lambda times: values[np.rint(times * rate).astype(np.int64)]


def make_steps(starts: Sequence[float], values: Sequence[float]) -> Profile:
    """Return a profile with each value from its start, s, on; the first value also before it."""
    at, levels = np.array(starts), np.array(values)
    return lambda times: levels[np.maximum(np.searchsorted(at, times, side="right") - 1, 0)]


def make_day_cycle(mean: float, amplitude: float, period: float, highest: float) -> Profile:
    """Return the profile mean + amplitude cos(2 pi (t - highest) / period); times in s."""
    return lambda times: mean + amplitude * np.cos(2.0 * math.pi * ((times - highest) / period))


def make_warm_up(start: float, end: float, time_constant: float, begin: float) -> Profile:
    """Return the profile start + (end - start) (1 - e^-x), x = (t - begin) / time_constant > 0."""
    return lambda times: (
        start + (end - start) * -np.expm1(-np.maximum(times - begin, 0.0) / time_constant)
    )


@dataclass(frozen=True, eq=False)
class FileColumn:
    """Profile of a column of a file, linear between its rows and constant beyond them."""

    path: Path
    times: Array
    values: Array

    def __call__(self, times: Array) -> Array:
        """Return the values at times, s, interpolated linearly."""
        return np.interp(times, self.times, self.values)


def profiles_of(
    around: profile_forms.Surroundings, folder: Path
) -> tuple[dict[str, Profile], Profile | None]:
    """Return motion by channel, and temperature, in SI; raises ConfigError and UnitError."""
    opened: dict[Path, FileSeries] = {}
    motion = {
        str(channel): make_profile(form, channel, folder, opened)
        for channel, form in around.motion.items()
    }
    warm = around.temperature
    return motion, None if warm is None else make_profile(warm, "temperature", folder, opened)


def make_profile(
    form: profile_forms.Form, name: str, folder: Path, opened: dict[Path, FileSeries]
) -> Profile:
    """Return a profile, in SI, of a channel or of ``temperature``.

    File names are relative to the folder. A file is opened once: a newly opened file is added to
    ``opened``. Raises ConfigError if its file cannot be used. Raises UnitError if a unit has
    another dimension.
    """
    dimension = name if name == "temperature" else QUANTITIES[quantity_of(name)]
    if isinstance(form, profile_forms.FileForm):
        path = folder / form.file
        if path not in opened:
            opened[path] = FileSeries(path)
        return opened[path].column(form.column or name, dimension)
    return _make_formula_profile(form, dimension)


def _make_formula_profile(
    form: profile_forms.Formula, dimension: str, *, difference: bool = False
) -> Profile:
    """Return a profile of a value, or of a difference, for which 5 degC and 5 K are the same."""
    time = partial(units.parse_quantity, dimension="time")
    value = partial(
        units.parse_difference if difference else units.parse_quantity, dimension=dimension
    )
    match form:
        case profile_forms.ConstantForm():
            return make_constant(value(form.value))
        case profile_forms.StepsForm():
            return make_steps([*map(time, form.times)], [*map(value, form.values)])
        case profile_forms.DayCycleForm():
            swing = units.parse_difference(form.amplitude, dimension)
            return make_day_cycle(value(form.mean), swing, time(form.period), time(form.highest))
        case profile_forms.WarmUpForm():
            start, end = value(form.start), value(form.end)
            return make_warm_up(start, end, time(form.time_constant), time(form.begin))
    first, *others = form.parts
    parts = [_make_formula_profile(part, dimension, difference=True) for part in others]
    parts.insert(0, _make_formula_profile(first, dimension))
    return lambda times: sum((part(times) for part in parts), np.zeros(len(times)))
