"""Read u-blox UBX logs: the inertial sensors of a receiver, in ESF-MEAS or ESF-RAW.

Columns are ``gyro_x`` ``gyro_y`` ``gyro_z`` in deg/s, ``accel_x`` ``accel_y`` ``accel_z`` in
m/s^2 and ``temperature`` in degC: state these units in the sensor file. A log with both messages
needs ``variable: ESF-RAW`` or ``variable: ESF-MEAS`` with each column.

The time column is ``time_tag``, with ``unit: ms``. ESF-MEAS writes ms, unless the receiver is
configured for another unit. ESF-RAW writes ticks of a unit that u-blox does not state. They are
assumed to be 1/25.6 ms, the tick of the sensor inside (Bosch), and converted to ms. If that is
wrong, ``sTtag`` is the count as written. Tags wrap at 32 bits, or at 24 bits if ESF-RAW forwards
the tag of the sensor: both are detected, unless ``wraps`` is stated.

ESF-MEAS writes gyro and accelerometer in separate messages, some ms apart. One of each makes a
record, with the stamp of the first.
"""

import math
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.extensions.formats.ubx_frames import Frames
from imubench_pipeline.readers import file_format as formats
from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.readers.compressed import blocks
from imubench_pipeline.readers.stamps import WrapState, unwrap
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.words.findings.files import IncompleteLastRecord, WrongChecksum

_ESF_MEAS, ESF_RAW, _NAV_PVT = b"\x10\x02", b"\x10\x03", b"\x01\x07"
KINDS = {_ESF_MEAS: "ESF-MEAS", ESF_RAW: "ESF-RAW"}  # the messages that are read, by class and id

COLUMNS: dict[str, tuple[int, float]] = {
    "gyro_x": (14, 2.0**-12),
    "gyro_y": (13, 2.0**-12),
    "gyro_z": (5, 2.0**-12),
    "accel_x": (16, 2.0**-10),
    "accel_y": (17, 2.0**-10),
    "accel_z": (18, 2.0**-10),
    "temperature": (12, 1e-2),
}
"""Data type of each column, and scale of one count in its unit."""

UNITS = {"gyro": "deg/s", "accel": "m/s^2", "temperature": "degC"}  # unit of each quantity
TICK_MS = 5 / 128  # length of a tick, ms: 1/25.6, which is exact in float64
_MIN_ZEROS = 512  # least run of zero bytes that is reported: a sector
_BATCH_WORDS = 1 << 17
_MIN_PROBED_BYTES = 1 << 20
_MAX_HOLE_TICKS = 256_000
_NO_WRAP = 2.0**62
_MAX_LOG_LENGTH = 1e9


class UbxFile(LogFile):
    """A log of a u-blox receiver."""

    fixed_units, fixed_by = UNITS, "the format of u-blox"

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        for name, source in self.sources.items():
            if source.column not in COLUMNS:
                raise RecordingError(
                    f"{self.path.name}: no column {source.column!r} for {name}; a UBX log has "
                    f"{', '.join(COLUMNS)}; correct 'column' of {name} in the sensor file"
                )
        kind = self._kind()
        self._check_time(kind)
        frames = Frames(blocks(self.path, self.findings, _MIN_ZEROS))
        words = Words(kind, self._columns())
        clock = _Clock(self, kind)
        records = _RecordGrouper(len(self._columns()))
        rows = 0
        for key, payload in frames:
            if key == kind:
                words.add(payload)
            elif key == _NAV_PVT:
                clock.note_date(payload, len(words))
            if len(words) >= _BATCH_WORDS:
                for batch in self._batch(words, clock, records, ended=False):
                    rows += len(batch)
                    yield batch
        for batch in self._batch(words, clock, records, ended=True):
            rows += len(batch)
            yield batch
        self._report(kind, words, frames, rows)

    def _batch(
        self, words: "Words", clock: "_Clock", records: "_RecordGrouper", ended: bool
    ) -> Iterator[Batch]:
        columns, values, tags, places = words.drained()
        table, stamps = records.grouped(columns, values, clock.stamps(tags, places), ended)
        if len(table):
            figures = dict(zip(self._columns(), np.ascontiguousarray(table.T), strict=True))
            time = None if self.log.time is None else self.seconds(stamps, clock.first)
            wanted = {name: figures[str(source.column)] for name, source in self.sources.items()}
            yield Batch(time, {name: self.to_si(name, raw) for name, raw in wanted.items()})

    def _columns(self) -> list[str]:
        return list(dict.fromkeys(str(source.column) for source in self.sources.values()))

    def _check_time(self, kind: bytes) -> None:
        time = self.log.time
        if time is None:
            return
        columns = ("time_tag", "sTtag") if kind == ESF_RAW else ("time_tag",)
        if time.column not in columns:
            raise RecordingError(
                f"{self.path.name}: no time column {time.column!r}; {KINDS[kind]} has "
                f"{' and '.join(columns)}; correct 'column' of 'time' in the sensor file"
            )
        in_ms = kind == ESF_RAW and time.column == "time_tag"
        if time.format is not None or (in_ms and time.unit != "ms"):
            raise RecordingError(
                f"{self.path.name}: {time.column} of {KINDS[kind]} is "
                f"{time.format or time.unit} in the sensor file; expected 'unit: ms' of 'time'"
            )

    def _kind(self) -> bytes:
        stated = {source.variable for source in self.sources.values()} - {None}
        kinds = [key for key, name in KINDS.items() if name in stated]
        if len(stated) > 1 or len(kinds) != len(stated):
            raise RecordingError(
                f"{self.path.name}: 'variable' is {', '.join(sorted(map(str, stated)))}; expected "
                "ESF-RAW or ESF-MEAS, the same for every column"
            )
        if kinds:
            return kinds[0]
        words = {key: Words(key, self._columns()) for key in KINDS}
        frames = Frames(blocks(self.path, [], _MIN_ZEROS))
        for number, (key, payload) in enumerate(frames):
            if key in words:
                words[key].add(payload)
            if number % 1000 == 0 and self._is_clear(frames, words):
                break
        self._is_clear(frames, words)
        present = [key for key in KINDS if words[key].present]
        if len(present) == 1:
            return present[0]
        if present:
            raise RecordingError(
                f"{self.path.name}: both ESF-MEAS and ESF-RAW have the columns; select one with "
                "'variable: ESF-RAW' (every sample) or 'variable: ESF-MEAS' at each column"
            )
        types = ", ".join(
            f"{KINDS[key]} with data types {of_kind.types()}"
            for key, of_kind in words.items()
            if of_kind.types()
        )
        raise RecordingError(
            f"{self.path.name}: found {types or 'no ESF-MEAS and no ESF-RAW'} among "
            f"{frames.right.total()} UBX messages (class and id {frames.kinds()}), "
            f"{frames.wrong.total()} with a wrong checksum; expected the data types of "
            f"{_describe_types(self._columns())}; switch ESF-RAW or ESF-MEAS on in the "
            "receiver, or correct 'column' in the sensor file"
        )

    def _is_clear(self, frames: Frames, words: "dict[bytes, Words]") -> bool:
        for of_kind in words.values():
            of_kind.drained()
        present = any(of_kind.present for of_kind in words.values())
        return frames.read > _MIN_PROBED_BYTES and present

    def _report(self, kind: bytes, words: "Words", frames: Frames, rows: int) -> None:
        name = KINDS[kind]
        absent = [column for column in self._columns() if not words.seen[COLUMNS[column][0]]]
        if rows == 0 or absent:
            raise RecordingError(
                f"{self.path.name}: found {frames.right[kind]} {name} messages with data types "
                f"{words.types() or 'none'}, {frames.wrong[kind]} with a wrong checksum; expected "
                f"{_describe_types(absent)}; correct 'column' or 'variable' in the sensor file"
            )
        if wrong := frames.wrong[kind]:
            data = WrongChecksum(
                self.path.name,
                wrong,
                name,
                is_sentence=False,
                is_left_out=True,
                is_shifted=self.log.time is None,
            )
            self.note(data, wrong)
        if cut := frames.cut[kind]:
            self.note(IncompleteLastRecord(self.path.name, messages=cut, message=name), cut, "note")


def _describe_types(columns: list[str]) -> str:
    return ", ".join(f"{COLUMNS[column][0]} ({column})" for column in columns)


class Words:
    """Buffer of measurements for the next batch; ``seen``: their number so far, by data type."""

    def __init__(self, kind: bytes, columns: list[str]) -> None:
        self._raw = kind == ESF_RAW
        self._place = np.full(256, -1, np.int64)
        self._scale = np.array([COLUMNS[column][1] for column in columns])
        for place, column in enumerate(columns):
            self._place[COLUMNS[column][0]] = place
        self._parts: list[bytes] = []
        self._counts: list[int] = []
        self._tags: list[int] = []
        self._waiting = 0
        self.seen = np.zeros(256, np.int64)

    def __len__(self) -> int:
        return self._waiting

    @property
    def present(self) -> bool:
        """Whether a required data type has occurred."""
        return bool(self.seen[self._place >= 0].any())

    def types(self) -> str:
        """Return the data types that have occurred, as text."""
        return ", ".join(map(str, np.flatnonzero(self.seen)))

    def add(self, payload: bytes) -> None:
        """Add the measurements of a message."""
        if self._raw:
            count = max(len(payload) - 4, 0) // 8
            self._parts.append(payload[4 : 4 + 8 * count])
        else:
            flags = int.from_bytes(payload[4:6], "little")
            available = max(len(payload) - 8, 0) // 4
            # The measurements may be followed by one more word, a time of the receiver.
            count = min(flags >> 11 or available - (flags >> 3 & 1), available)
            self._parts.append(payload[8 : 8 + 4 * max(count, 0)])
            self._counts.append(max(count, 0))
            self._tags.append(int.from_bytes(payload[:4], "little"))
        self._waiting += max(count, 0)

    def drained(
        self,
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """Remove and return column, value, tag and index of the required measurements, (n,)."""
        written = np.frombuffer(b"".join(self._parts), "<u4")
        if self._raw:
            words, tags = written[::2], written[1::2]
            types = words >> 24
        else:
            words, tags = written, np.repeat(np.array(self._tags, np.int64), self._counts)
            types = words >> 24 & 0x3F
        self._parts, self._counts, self._tags, self._waiting = [], [], [], 0
        self.seen += np.bincount(types, minlength=256)
        columns = self._place[types]
        wanted = np.flatnonzero(columns >= 0)
        columns = columns[wanted]
        signed = (words[wanted] << 8).view(np.int32) >> 8
        return columns, signed * self._scale[columns], tags[wanted].astype(np.int64), wanted


class _Clock:
    """Unwraps the time tags and finds the date."""

    def __init__(self, file: UbxFile, kind: bytes) -> None:
        self._file = file
        self._time = file.log.time
        column = None if self._time is None else self._time.column
        self._tick = TICK_MS if kind == ESF_RAW and column == "time_tag" else 1
        self._wraps: float | None = 2.0**32 if kind == _ESF_MEAS else None
        if self._time is not None and self._time.wraps is not None:
            self._wraps = self._time.wraps / self._tick
        self._state = WrapState()
        self._date: tuple[datetime, int] | None = None
        self.first: Any = None

    def note_date(self, payload: bytes, place: int) -> None:
        """Store the date of a NAV-PVT message that precedes the word with this index."""
        if self._time is None or self._file.started or self._date or len(payload) < 12:
            return
        year, (month, day, hour, minute, second, valid) = payload[4:6], payload[6:12]
        if valid & 3 == 3:
            try:
                date = datetime(int.from_bytes(year, "little"), month, day, hour, minute, second)
            except ValueError:
                return
            self._date = date, place

    def stamps(self, tags: NDArray[np.int64], places: NDArray[np.int64]) -> NDArray[Any]:
        """Return unwrapped stamps from tags, in the unit of the sensor file."""
        if not len(tags) or self._time is None:
            return tags
        if self._wraps is None:
            self._wraps = _guess_wrap(tags, self._state.last)
        stamps = unwrap(tags, self._wraps or _NO_WRAP, self._state) * self._tick
        if self.first is None:
            self.first = stamps[0]
        if self._date is not None:
            date, place = self._date
            index = min(int(np.searchsorted(places, place)), len(stamps) - 1)
            passed = float(self._file.seconds(stamps[index : index + 1], self.first)[0])
            self._date = None
            if abs(passed) < _MAX_LOG_LENGTH:
                started = date - timedelta(seconds=passed)
                self._file.started = started.isoformat(timespec="milliseconds")
        return stamps


def _guess_wrap(tags: NDArray[np.int64], last: int | None) -> float | None:
    """Return the value at which tags wrap to 0; None if they do not, or if it is unknown."""
    if tags.max() >= 1 << 24:
        return 2.0**32
    before = np.concatenate(([tags[0] if last is None else last], tags[:-1]))
    falls = np.flatnonzero(tags - before < -(1 << 23))
    # After a restart of the receiver, the last tag would not be just below 24 bits.
    passed = tags[falls] + (1 << 24) - before[falls]
    return 2.0**24 if len(falls) and passed[0] <= _MAX_HOLE_TICKS else None


class _RecordGrouper:
    """Groups the measurements of one time to a record."""

    def __init__(self, width: int) -> None:
        self._open = np.full(width, np.nan)
        self._stamp: Any = None
        self._state = np.array([-1, 0], np.int64)

    def grouped(
        self,
        columns: NDArray[np.int64],
        values: NDArray[np.float64],
        stamps: NDArray[Any],
        ended: bool,
    ) -> tuple[NDArray[np.float64], NDArray[Any]]:
        """Return the records that are complete, and their stamps."""
        if self._stamp is None:
            self._stamp = np.zeros(1, stamps.dtype)
        table = np.empty((len(columns) + 1, len(self._open)))
        times = np.empty(len(columns) + 1, stamps.dtype)
        # Stamps are only copied, so that one kernel on their bits serves integers and floats.
        bits = (each.view(np.int64) for each in (stamps, self._stamp, times))
        count = _group_records(columns, values, self._open, self._state, table, *bits)
        if ended and self._state[1]:
            table[count], times[count] = self._open, self._stamp[0]
            count += 1
        return table[:count], times[:count]


@njit(cache=True, nogil=True)
def _group_records(
    columns: NDArray[np.int64],
    values: NDArray[np.float64],
    row: NDArray[np.float64],
    state: NDArray[np.int64],
    table: NDArray[np.float64],
    stamps: NDArray[np.int64],
    row_stamp: NDArray[np.int64],
    times: NDArray[np.int64],
) -> int:
    """Fill records; return the number of complete ones."""
    count = 0
    # `state`: the first column of the log, which begins a record, and whether a record is open
    for i in range(columns.size):
        column = columns[i]
        if state[0] < 0:
            state[0] = column
        if state[1] and (column == state[0] or not math.isnan(row[column])):
            for j in range(row.size):  # a slice assignment takes longer to compile than the rest
                table[count, j] = row[j]
                row[j] = math.nan
            times[count] = row_stamp[0]
            count += 1
            state[1] = 0
        if not state[1]:
            row_stamp[0] = stamps[i]
            state[1] = 1
        row[column] = values[i]
    return count


_MAX_DESCRIBED_BYTES, _MAX_SEARCHED_BYTES = 1 << 22, 1 << 26  # behind a message, and for one


def list_messages(path: Path, file_format: formats.FileFormat) -> list[formats.LogTable]:
    """Return a table for each message with inertial data; raise `RecordingError` if none."""
    names = list(COLUMNS)
    words = {kind: Words(kind, names) for kind in KINDS}
    frames = Frames(blocks(path, [], _MIN_ZEROS))
    for key, payload in frames:
        if key in words and len(words[key]) < formats.MAX_EXAMINED_RECORDS * len(names):
            words[key].add(payload)
        found = any(map(len, words.values()))
        if frames.read > (_MAX_DESCRIBED_BYTES if found else _MAX_SEARCHED_BYTES):
            break
    described = []
    for kind, name in KINDS.items():
        if not len(words[kind]):
            continue
        places, figures, tags, _ = words[kind].drained()
        columns = []
        for place, column in enumerate(COLUMNS):
            values = figures[places == place]
            if len(values):
                unit = UNITS[column.split("_")[0]]
                columns.append(formats.LogColumn.of_numbers(column, column, values, unit))
        if columns:
            first = tags[places == places[0]].astype(np.float64)
            ticks = first * TICK_MS if kind == ESF_RAW else first
            columns.append(formats.LogColumn.of_numbers("time_tag", "time_tag", ticks, "ms"))
            if kind == ESF_RAW:
                columns.append(formats.LogColumn.of_numbers("sTtag", "sTtag", first))
        about = f"{frames.right[kind]} messages at the beginning"
        described.append(
            formats.LogTable(file_format, name, tuple(columns), variable=name, about=about)
        )
    if not any(table.columns for table in described):
        raise RecordingError(
            f"{path.name}: no inertial figures in ESF-MEAS or ESF-RAW among "
            f"{frames.right.total()} UBX messages (class and id {frames.kinds()}); "
            "switch ESF-RAW on in the receiver"
        )
    return sorted(described, key=lambda table: table.name != KINDS[ESF_RAW])
