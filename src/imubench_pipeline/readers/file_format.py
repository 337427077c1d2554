"""What is declared of a format of log files, and what a file of it is said to hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.settings.extras import Extra, ExtraError, extra
from imubench_pipeline.settings.sensor import LogFormat, Reader
from imubench_pipeline.tables.findings import RecordingError

Kind = Literal["number", "date", "text", "other"]

ROWS = 1000
"""Records that are looked at, at most."""

FIRST = 4
"""Values of a column that are shown."""

NOTHING_STATED = LogFormat.model_validate(
    {"rate": "1 Hz", "channels": {"gyro_x": {"column": 1, "unit": "rad/s"}}}
)
"""The format of a log of which nothing is known; what it has to have says nothing."""


@dataclass(frozen=True, kw_only=True)
class Signature:
    """How a log of a format is told from others: by what it holds, and never by its name."""

    begins: tuple[bytes, ...] = ()
    """A file that begins with one of these is of the format."""
    tells: Callable[[bytes], bool] | None = None
    """Tells from the first 64 kB of a file whether it is of the format, where these begin as that
    of no format. Bytes of chance have nothing of the kind, however many they are."""
    folder_has: str | None = None
    """A folder with a file of this name is one log."""
    archive_has: str | None = None
    """A zip archive with a file that ends so is one log."""


class Code(NamedTuple):
    """What reads the files of a format."""

    log_file: type[LogFile]
    """Reads one file, or one topic of it."""
    tables: Callable[[Path, FileFormat], list[LogTable]]
    """Of a path and the format: the tables of a file, told from its beginning. It raises
    `RecordingError` where there is none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FileFormat:
    """A format of log files: all that is known of it beside the code that reads it."""

    name: Reader
    """What ``reader`` of a sensor file says; its module in `imubench_pipeline.readers.formats` is
    called so."""
    title: str
    """What people call it."""
    endings: tuple[str, ...]
    """How the names of its files mostly end, for people."""
    signature: Signature
    streamed: bool
    """Its logs are read from front to back, so that they may be compressed, or in a zip archive."""
    clock_of: Literal["file", "variable", "length"]
    """What has a clock of its own: the whole file, each ``variable``, or all arrays of one length.
    """
    time_columns: tuple[str, ...]
    """What the format calls the columns of time; empty: they are called as their writer likes."""
    settings: tuple[str, ...]
    """Entries of ``log``, or of its channels, that are for logs of some formats, and this one."""
    code: Callable[[], Code]
    """Imports and returns the code, since only what a run needs is to be imported."""
    vendor: str | None = None
    """Who makes every sensor with such logs."""
    measured_by_name: bool = False
    """The format has names for what is measured alone: its linear acceleration has gravity in it.
    """
    extra: Extra | None = None
    """The extra of the package with the library that the code takes; None: it takes none."""

    def load(self) -> Code:
        """Return the code.

        Raises
        ------
        RecordingError
            If the library that it takes is not installed.
        """
        if self.extra is None:
            return self.code()
        try:
            with extra(self.extra, f"read a {self.title}"):
                return self.code()
        except ExtraError as error:
            raise RecordingError(str(error)) from None

    def tables(self, path: Path) -> list[LogTable]:
        """Return what a log holds, told from its beginning.

        ``path``: a file, or a member of a zip archive where the format is streamed.

        Raises
        ------
        RecordingError
            If it cannot be read, or holds nothing.
        """
        return self.load().tables(path, self)


@dataclass(frozen=True, eq=False)
class LogColumn:
    """One column, as far as the beginning of a file tells."""

    source: str | int
    """What ``column`` of a sensor file says for it."""
    label: str
    """Its name; empty where it has none."""
    kind: Kind
    first: tuple[str, ...] = ()
    """The first values as written."""
    values: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    """The first values, ns since 1970 (or since midnight) of dates, NaN where one is missing, shape
    (n,); empty where they are no figures."""
    unit: str | None = None
    """As the file states it, or its format fixes it."""
    forms: tuple[str, ...] = ()
    """Of dates in text: ``iso8601`` or patterns that fit, the likeliest first; a date alone or a
    time of day alone is a part of one."""
    address: str | int | None = None
    """What ``column`` of ``time`` says for it, where that is not ``source``."""


@dataclass(frozen=True, eq=False)
class LogTable:
    """Columns that have their records in common: of a text log, an array, a topic, a message."""

    file_format: FileFormat
    name: str = ""
    """Of the array, topic or message; empty in a text log."""
    columns: tuple[LogColumn, ...] = ()
    variable: str | None = None
    """What ``variable`` of a sensor file says for it."""
    file: str | None = None
    """What ``file`` of a sensor file says for it; None: the recording is one file."""
    rows: int | None = None
    """Records, where that is cheap to know."""
    rate: float | None = None
    """Hz, as the file states it."""
    started: str | None = None
    """ISO 8601, as the file states it."""
    about: str = ""
    """How it is written."""
    notes: tuple[str, ...] = ()
    """What the file says in words."""
    fault: str | None = None
    """Why it cannot be used, as the end of a sentence."""


def shown(values: NDArray[Any]) -> tuple[str, ...]:
    """Return the first figures as text."""
    whole = values.dtype.kind in "iu"
    return tuple(str(value) if whole else f"{value:.10g}" for value in values[:FIRST])
