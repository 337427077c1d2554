"""Read logs of messages whose fields the log declares: the common part of ULog and DataFlash.

``variable`` names a kind of message with its instance, ``sensor_gyro_0`` or ``IMU_1``, and
``column`` a field of it, as in the CSV files of pyulog and pymavlink. Each kind has its own clock.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers import file_format as formats
from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.readers.bounds import MAX_TOPICS
from imubench_pipeline.readers.compressed import blocks
from imubench_pipeline.readers.stamps import Clock, format_date_of_stamp
from imubench_pipeline.readers.stated_units import find_stated_unit
from imubench_pipeline.tables.findings import Finding, RecordingError
from imubench_pipeline.words.findings.files import DamagedBytes, IncompleteLastRecord

_BATCH_MESSAGES, _MIN_ZEROS = 1 << 15, 512
_MAX_DESCRIBED_BYTES, _MAX_SEARCHED_BYTES = 1 << 23, 1 << 26  # examined for kinds of messages
_INERTIAL = re.compile(r"imu|gyr|acc", re.IGNORECASE)
_NOT_INERTIAL = re.compile(r"status|bias|estimator|vibe|calib|fifo", re.IGNORECASE)
_FAULT = "has no samples of a gyro or an accelerometer, or several in each message"


@dataclass(eq=False)
class Kind:
    """A kind of message; its fields have a label and a NumPy type, in the order of the log."""

    name: str  # with the instance
    fields: list[tuple[str, str]]
    units: Mapping[str, str] = field(default_factory=dict)  # of columns, as far as known
    factors: Mapping[str, float] = field(default_factory=dict)  # of fixed-point numbers

    def __post_init__(self) -> None:
        self.columns = [name for name, kind in self.fields if kind.lstrip("<")[0] in "fiu"]
        own = _INERTIAL.search(self.name) and not _NOT_INERTIAL.search(self.name)
        self.is_inertial = bool(self.units or own)

    def read(self, messages: Iterable[bytes]) -> NDArray[Any]:
        """Return messages as a structured array, shape (n,); too short messages are omitted."""
        layout = np.dtype(self.fields)
        size = layout.itemsize
        return np.frombuffer(b"".join(m[:size] for m in messages if len(m) >= size), layout)

    def figures(self, records: NDArray[Any], column: str) -> NDArray[np.float64]:
        """Return a column of records in its unit, shape (n,)."""
        return records[column].astype(np.float64) * self.factors.get(column, 1.0)


class Messages(ABC):
    """Iterator over the messages of a log: names of their kinds, and their bytes.

    ``wanted``: the only kind that is yielded; empty: all. ``most``: bytes after which reading
    stops. ``kinds``: kinds seen so far. ``damaged``: number of bytes that are no messages.
    ``cut``: number of messages cut short by the end.
    """

    time_columns: ClassVar[Mapping[str, str]]  # columns with stamps, and their units

    def __init__(
        self, path: Path, findings: list[Finding], wanted: str = "", most: int | None = None
    ) -> None:
        self._source = blocks(path, findings, _MIN_ZEROS)
        self._most = most
        self.file, self.wanted = path.name, wanted
        self.kinds: dict[str, Kind] = {}
        self.damaged = self.cut = self.read = 0
        self._data, self._at = b"", 0

    @abstractmethod
    def __iter__(self) -> Iterator[tuple[str, bytes]]: ...

    def _read_more(self) -> bool:
        """Read more bytes after the remaining ones; return whether there are any."""
        ended = self._most is not None and self.read >= self._most
        block = b"" if ended else next(self._source, b"")
        self.read += len(block)
        self._data, self._at = self._data[self._at :] + block, 0
        return bool(block)

    def _skip_to(self, mark: re.Pattern[bytes], length: int) -> bool:
        """Go to the next mark, and count the bytes before it; return whether there is more."""
        found = mark.search(self._data, self._at + 1)
        end = max(len(self._data) - length + 1, self._at) if found is None else found.start()
        self.damaged += len(self._data[self._at : end].strip(b"\0"))
        self._at = end
        return found is not None or self._read_more()

    def _is_wanted(self, kind: Kind | None) -> bool:
        """Return whether messages of a kind are yielded, and store the kind."""
        if kind is None or self.wanted not in ("", kind.name) or not kind.columns:
            return False
        if len(self.kinds) < MAX_TOPICS:
            self.kinds.setdefault(kind.name, kind)
        return kind.name in self.kinds


class MessageFile(LogFile):
    """The messages of one kind in a log."""

    messages: ClassVar[type[Messages]]

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        time, wanted = self.log.time, self._find_kind()
        messages = self.messages(self.path, self.findings, wanted.name)
        for name, source in self.sources.items():
            unit, where = wanted.units.get(str(source.column)), f"the message {wanted.name}"
            if stated := find_stated_unit(name, unit, where, ""):
                self.units[name] = stated
        wraps = None if time is None else time.wraps
        clock = Clock(
            self, wraps, lambda first: None if time is None else format_date_of_stamp(first, time)
        )
        rows, incoming = 0, iter(messages)
        while taken := [message for _, message in islice(incoming, _BATCH_MESSAGES)]:
            if not len(records := wanted.read(taken)):
                continue
            rows += len(records)
            seconds = None
            if time is not None:
                stamps = records[str(time.column)]
                present, whole = np.isfinite(stamps), stamps.dtype.kind != "f"
                stamps = np.where(present, stamps, 0).astype(np.int64 if whole else np.float64)
                seconds = clock.seconds(stamps, present)
            columns = {
                name: self.to_si(name, wanted.figures(records, str(source.column)))
                for name, source in self.sources.items()
            }
            yield Batch(seconds, columns)
        if not rows:
            raise RecordingError(
                f"{self.path.name}: no complete message {wanted.name}; expected some: record again"
            )
        if messages.damaged:
            self.note(DamagedBytes(self.path.name, messages.damaged), messages.damaged)
        if messages.cut:
            self.note(IncompleteLastRecord(self.path.name, messages=1, message="last"), 1, "note")

    def _find_kind(self) -> Kind:
        stated = {source.variable for source in self.sources.values()} - {None}
        wanted = {str(source.column) for source in self.sources.values()}
        wanted |= set() if self.log.time is None else {str(self.log.time.column)}
        messages = self.messages(self.path, [], most=_MAX_SEARCHED_BYTES)
        for name, _ in messages:
            if name in stated or (not stated and messages.read > _MAX_DESCRIBED_BYTES):
                break
        able = [
            kind
            for kind in messages.kinds.values()
            if wanted <= set(kind.columns) and (not stated or stated == {kind.name})
        ]
        if len(able) == 1:
            return able[0]
        named = [messages.kinds[str(name)].columns for name in stated if name in messages.kinds]
        has = formats.join_first([kind.name for kind in able] or [*named, list(messages.kinds)][0])
        raise RecordingError(
            f"{self.path.name}: expected one kind of message with {', '.join(sorted(wanted))}"
            f"{' called ' * bool(stated)}{' and '.join(sorted(map(str, stated)))}; found "
            f"{has or 'none'}; correct 'variable' or 'column' in the sensor file"
        )


def list_kinds(path: Path, file_format: formats.FileFormat) -> list[formats.LogTable]:
    """Return a table for each kind of message; `RecordingError` if none has numbers."""
    file = file_format.load().log_file(path, formats.NOTHING_STATED, {})
    assert isinstance(file, MessageFile)  # the reader of these files
    messages = file.messages(path, [], most=_MAX_DESCRIBED_BYTES)
    first: dict[str, list[bytes]] = {}
    for name, message in messages:
        of_kind = first.setdefault(name, [])
        if len(of_kind) < formats.MAX_EXAMINED_RECORDS:
            of_kind.append(message)
    if not first:
        raise RecordingError(
            f"{path.name}: the {file_format.title} has no message of numbers in its first "
            f"{messages.read} bytes; expected the log of an inertial sensor: copy it again, or "
            "switch the logging of raw IMU data on"
        )
    tables = []
    for name, own in first.items():
        kind, about = messages.kinds[name], f"{len(own)} messages at the beginning"
        table = formats.LogTable(file_format, name, (), name, about=about, fault=_FAULT)
        if kind.is_inertial:
            records, units = kind.read(own), {**kind.units, **messages.time_columns}
            columns = (
                formats.LogColumn.of_numbers(c, c, kind.figures(records, c), units.get(c))
                for c in kind.columns
            )
            table = formats.LogTable(file_format, name, tuple(columns), name, about=about)
        tables.append(table)
    # A message with both quantities first, since they share its clock.
    return sorted(tables, key=lambda t: (-len({column.unit for column in t.columns}), t.name))
