"""Declaration of a format of log files, and description of the contents of a file."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.settings.extras import Extra, ExtraError, require_extra
from imubench_pipeline.settings.sensor import LogFormat, Reader
from imubench_pipeline.settings.validation import cut
from imubench_pipeline.tables.findings import RecordingError

Kind = Literal["number", "date", "text", "other"]
MAX_EXAMINED_RECORDS = 1000  # largest number of records that are examined in an inspection
MAX_SHOWN_VALUES = 4  # largest number of values of a column that are shown

NOTHING_STATED = LogFormat.model_validate(
    {"rate": "1 Hz", "channels": {"gyro_x": {"column": 1, "unit": "rad/s"}}}
)
"""Log format for an unknown log; its required entries are arbitrary."""


@dataclass(frozen=True, kw_only=True)
class Signature:
    """Features that identify a format: contents only, never the name of a file."""

    begins: tuple[bytes, ...] = ()  # a file that begins with one of these has the format
    tells: Callable[[bytes], bool] | None = None
    """Returns whether the first 64 kB of a file have the format; used if they match no ``begins``.
    Random bytes must not be accepted, in any amount."""
    folder_has: str | None = None  # a folder with a file of this name is one log
    archive_has: str | None = None  # a zip archive with a file with this suffix is one log


class Code(NamedTuple):
    """The code that reads the files of a format."""

    log_file: type[LogFile]  # reads one file, or one topic of it
    tables: "Callable[[Path, FileFormat], list[LogTable]]"
    """Returns the tables of a file from its path and format; reads its beginning only. Raises
    `RecordingError` if there is no table."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FileFormat:
    """Properties of a format of log files, without the code that reads it."""

    name: Reader  # value of `reader` in a sensor file
    title: str  # common name of the format
    endings: tuple[str, ...]  # usual suffixes of its files, for messages
    signature: Signature
    code: Callable[[], Code]  # imports and returns the code, when a run needs the format
    streamed: bool = False  # read sequentially: may be compressed or in a zip archive
    clock_of: Literal["file", "variable", "length"] = "length"
    """Data that share a clock: a file, a topic, or arrays of equal length."""
    time_columns: tuple[str, ...] = ()  # names that the format fixes
    settings: tuple[str, ...] = ()  # entries of `log` that apply to this format, but not to all
    vendor: str | None = None  # vendor of all sensors with such logs
    measured_by_name: bool = False  # ``linear_acceleration`` includes gravity in this format
    extra: Extra | None = None  # extra of the package with a library for the code

    def load(self) -> Code:
        """Return the code; raise `RecordingError` if the library that it needs is not installed."""
        if self.extra is None:
            return self.code()
        try:
            with require_extra(self.extra, f"read a {self.title}"):
                return self.code()
        except ExtraError as error:
            raise RecordingError(str(error)) from None

    def tables(self, path: Path) -> "list[LogTable]":
        """Return the tables of a log, from its beginning; RecordingError if it cannot be read."""
        return self.load().tables(path, self)


@dataclass(frozen=True, eq=False)
class LogColumn:
    """One column, as described by the beginning of a file."""

    source: str | int  # value of `column` in a sensor file
    label: str  # name of the column; empty if it has none
    kind: Kind
    first: tuple[str, ...] = ()  # the first values as written
    values: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """First values, shape (n,); NaN where missing; dates in ns since 1970 or since midnight. Empty
    if they are no numbers."""
    unit: str | None = None  # unit that the file states or its format fixes
    forms: tuple[str, ...] = ()
    """For dates in text: ``iso8601`` or matching patterns, the most plausible first; a pattern may
    be for a date only or a time of day only."""
    address: str | int | None = None  # value of `column` under `time`, if it differs from `source`
    scale: float | None = None  # unit per count as written; ``values`` are scaled
    hint: str = ""  # what is known of unit and scale, for a comment

    @classmethod
    def of_numbers(
        cls, source: str, label: str, values: NDArray[Any], unit: str | None = None
    ) -> "LogColumn":
        """Return the description of a column of numbers, with its first values as text."""
        first = format_first_numbers(values)
        return cls(source, label, "number", first, values.astype(np.float64), unit)


@dataclass(frozen=True, eq=False)
class LogTable:
    """Columns with common records: a text log, an array, a topic or a message."""

    file_format: FileFormat
    name: str = ""  # of the array, topic or message; empty for a text log
    columns: tuple[LogColumn, ...] = ()
    variable: str | None = None  # value of `variable` in a sensor file
    file: str | None = None  # value of `file` in a sensor file; None: the recording is one file
    rows: int | None = None  # number of records, if it is known without reading them
    rate: float | None = None  # rate that the file states, Hz
    started: str | None = None  # start of the log that the file states, ISO 8601
    about: str = ""  # layout of the table, for messages
    notes: tuple[str, ...] = ()  # comments in the file
    fault: str | None = None  # reason why the table cannot be used, as the end of a sentence


def format_first_numbers(values: NDArray[Any]) -> tuple[str, ...]:
    """Return the first `MAX_SHOWN_VALUES` numbers as text."""
    whole = values.dtype.kind in "iu"
    return tuple(str(value) if whole else f"{value:.10g}" for value in values[:MAX_SHOWN_VALUES])


def join_first(names: Iterable[str], most: int = 20) -> str:
    """Join the first ``most`` names by commas; long names are cut, and further ones are "..."."""
    every = list(names)
    return ", ".join([*(cut(name, str) for name in every[:most]), *["..."] * (len(every) > most)])
