"""Profiles of motion and temperature over time, in SI, from the settings in `profile_forms`.

A file of columns is CSV or Parquet, and is read as a stream: only the rows near the requested times
are in memory. The name of a column is its quantity, with the unit in brackets: ``time [s]``,
``temperature [degC]``, ``gyro_z [deg/s]``. Without a unit it is in SI, and temperature in °C.
"""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
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
_ROWS_PER_BATCH = 1 << 16
_EXPECTED_CSV = "commas between columns, points before decimals, and one line of names"


class FileSeries:
    """Columns over time in a file: CSV with a line of names, or Parquet.

    Raises ConfigError if the file does not exist, cannot be read, or has no column ``time``.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._headings = self._read_headings()
        self._asked: dict[str, tuple[str, float, float]] = {}
        self.take(_TIME_COLUMN, "time")
        self._batches: Iterator[tuple[int, pa.RecordBatch]] | None = None
        self._window: dict[str, Array] = {}
        self._trimmed = False

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities of the columns, without time."""
        return tuple(name for name in self._headings if name != _TIME_COLUMN)

    def take(self, name: str, dimension: str) -> None:
        """Request a column by name, without its unit, and dimension.

        Raises ConfigError if there is no such column, or its unit has another dimension.
        """
        if name not in self._headings:
            raise ConfigError(
                f"{self.path}: no column {name!r}; it has {', '.join(self._headings) or 'none'}; "
                f"expected such as '{name} [{units.SI_UNITS[dimension]}]'"
            )
        heading, unit = self._headings[name]
        try:
            factor, offset = units.find_conversion(unit or units.SI_UNITS[dimension], dimension)
        except units.UnitError as error:
            raise ConfigError(f"{self.path}: column {heading!r}: {error}") from error
        self._asked[name] = (heading, factor, offset)
        self._batches = None

    def span(self) -> tuple[float, float]:
        """Return the first and the last time, s; this reads the whole file.

        Raises ConfigError if the file has no rows, a number is missing in it, or its times do not
        ascend.
        """
        first, last = np.nan, np.nan
        for row, batch in self._read():
            times = self._columns(batch, row, last)[_TIME_COLUMN]
            if len(times):
                first = times[0] if np.isnan(first) else first
                last = times[-1]
        if np.isnan(first):
            raise ConfigError(f"{self.path}: has no rows")
        return float(first), float(last)

    def at(self, name: str, times: Array) -> Array:
        """Return a requested column (`take`), in SI, temperature in °C, shape (k,).

        It is linear between rows and constant beyond them. The times, shape (k,), are in s,
        ascending. Raises ConfigError if a number is missing in the file, or its times do not
        ascend.
        """
        if not len(times):
            return np.empty(0)
        first, last = float(times[0]), float(times[-1])
        # Load the rows from the last one before `first` to the first one after `last`.
        if self._batches is None or (self._trimmed and first < self._window[_TIME_COLUMN][0]):
            self._batches = self._read()
            self._window = {name: np.empty(0) for name in self._asked}
            self._trimmed = False
        parts, loaded = [self._window], self._window[_TIME_COLUMN]
        reached = float(loaded[-1]) if len(loaded) else -np.inf
        while not reached >= last and (numbered := next(self._batches, None)) is not None:
            row, batch = numbered
            columns = self._columns(batch, row, reached)
            if len(columns[_TIME_COLUMN]):
                parts.append(self._from(columns, first))
                reached = float(columns[_TIME_COLUMN][-1])
        joined = {name: np.concatenate([part[name] for part in parts]) for name in self._asked}
        if not len(joined[_TIME_COLUMN]):
            raise ConfigError(f"{self.path}: has no rows")
        self._window = self._from(joined, first)
        return np.interp(times, self._window[_TIME_COLUMN], self._window[name])

    def _from(self, columns: dict[str, Array], first: float) -> dict[str, Array]:
        """Return the columns without the rows that are no longer needed."""
        begin = max(0, int(np.searchsorted(columns[_TIME_COLUMN], first, side="right")) - 1)
        self._trimmed = self._trimmed or begin > 0
        return {name: values[begin:] for name, values in columns.items()}

    def _columns(self, batch: pa.RecordBatch, row: int, before: float) -> dict[str, Array]:
        """Return the columns of a batch in SI; ``row`` is the number of its first row."""
        columns = {}
        for name, (heading, factor, offset) in self._asked.items():
            column = batch.column(heading)
            if pa.types.is_string(column.type) or pa.types.is_binary(column.type):
                raise ConfigError(f"{self.path}: column {heading!r} is text; expected numbers")
            raw = column.cast(pa.float64()).to_numpy(zero_copy_only=False)
            if not np.isfinite(raw).all():
                at = row + int(np.argmin(np.isfinite(raw)))
                raise ConfigError(
                    f"{self.path}: column {heading!r}: a number is missing in row {at}; expected "
                    "one a row: leave out the row, or fill it in"
                )
            columns[name] = raw * factor + offset
        earlier = before if np.isfinite(before) else -np.inf
        times = np.concatenate(([earlier], columns[_TIME_COLUMN]))
        rises = np.diff(times) > 0
        if not rises.all():
            at = int(np.argmin(rises))
            raise ConfigError(
                f"{self.path}: the times do not ascend in row {row + at}: {times[at + 1]:g} s "
                f"after {times[at]:g} s; expected each row later than the one before: put the rows "
                "in order, each time once"
            )
        return columns

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
                "'time [s]': mend its name"
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
                "such as 'time [s]'"
            )
        return headings

    def _unreadable(self, error: Exception) -> ConfigError:
        text = self.path.suffix != ".parquet" and isinstance(error, pa.ArrowException)
        expected = f"; expected {_EXPECTED_CSV}" if text else ""
        return ConfigError(f"{self.path}: cannot be read: {error}{expected}")

    def _read(self) -> Iterator[tuple[int, pa.RecordBatch]]:
        """Yield the number of the first row, from 1 below the line of names, and the batch."""
        headings = [heading for heading, _, _ in self._asked.values()]
        row = 1
        with ExitStack() as opened:
            try:
                batches: Iterable[pa.RecordBatch]
                if self.path.suffix == ".parquet":
                    file = opened.enter_context(pq.ParquetFile(self.path))
                    batches = file.iter_batches(_ROWS_PER_BATCH, None, headings, use_threads=False)
                else:
                    types = dict.fromkeys(headings, pa.float64())
                    chosen = pacsv.ConvertOptions(include_columns=headings, column_types=types)
                    reader = pacsv.open_csv(self.path, convert_options=chosen)
                    batches = opened.enter_context(reader)
                for batch in batches:
                    yield row, batch
                    row += len(batch)
            except (OSError, pa.ArrowException) as error:
                raise self._unreadable(error) from error


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


def profiles_of(
    around: profile_forms.Surroundings, folder: Path
) -> tuple[dict[str, Profile], Profile | None]:
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
        column = form.column or name
        opened[path].take(column, dimension)
        return FileColumn(opened[path], column)
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
            return Constant(value(form.value))
        case profile_forms.StepsForm():
            return Steps(tuple(map(time, form.times)), tuple(map(value, form.values)))
        case profile_forms.DayCycleForm():
            swing = units.parse_difference(form.amplitude, dimension)
            return DayCycle(value(form.mean), swing, time(form.period), time(form.highest))
        case profile_forms.WarmUpForm():
            start, end = value(form.start), value(form.end)
            return WarmUp(start, end, time(form.time_constant), time(form.begin))
    first, *others = form.parts
    added = (_make_formula_profile(part, dimension, difference=True) for part in others)
    return Sum((_make_formula_profile(first, dimension), *added))
