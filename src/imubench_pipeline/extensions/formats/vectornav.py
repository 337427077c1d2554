"""Read VectorNav ASCII output: asynchronous sentences such as ``$VNYMR,...*68``.

Columns are named as in `FIELDS`, with or without the name of the sentence: ``gyro_x`` or
``VNYMR.gyro_x``. The name is needed only in a log with several sentences with that column.

gyro is in rad/s, accel in m/s^2, temperature in degC as the device writes it. Time columns:
``host_time``, a stamp of the logging host before the ``$``; ``counter``, the number after ``T``
that the device appends on request (SerialCount).

VNISL and VNISE are estimates of a filter, not measurements, and VNDTV has increments: they are
skipped.
"""

import re
from binascii import crc_hqx
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from imubench_pipeline.readers import file_format as formats
from imubench_pipeline.readers.batch import SECONDS, Batch, LogFile
from imubench_pipeline.readers.compressed import BLOCK_BYTES, blocks
from imubench_pipeline.readers.stamps import Clock, format_date
from imubench_pipeline.readers.text.cells import is_number
from imubench_pipeline.readers.text.stamps import StampError, parse_stamps
from imubench_pipeline.tables.findings import Finding, RecordingError, find
from imubench_pipeline.words.findings import files

_APPENDED_FIELDS = re.compile(rb"(?:,S[0-9A-Fa-f]{4})?(?:,T(\d{1,18}))?$")
"""Fields that the device appends on request: a status, and a counter or time."""

_HEX_VALUES = {form % value: value for value in range(256) for form in (b"%02X", b"%02x")}


def _make_axis_names(*names: str) -> tuple[str, ...]:
    return tuple(f"{name}_{axis}" for name in names for axis in "xyz")


_ATTITUDE_FIELDS = ("yaw", "pitch", "roll")
_MEASURED_FIELDS = _make_axis_names("mag", "accel", "gyro")
FIELDS: dict[str, tuple[str, ...]] = {
    "VNYMR": (*_ATTITUDE_FIELDS, *_MEASURED_FIELDS),
    "VNQMR": ("quat_x", "quat_y", "quat_z", "quat_w", *_MEASURED_FIELDS),
    "VNMAR": _MEASURED_FIELDS,
    "VNIMU": (*_MEASURED_FIELDS, "temperature", "pressure"),
    "VNCMV": (*_MEASURED_FIELDS, "temperature"),
    "VNACC": _make_axis_names("accel"),
    "VNGYR": _make_axis_names("gyro"),
    "VNYBA": (*_ATTITUDE_FIELDS, *_make_axis_names("linear_accel", "gyro")),  # without gravity
    # In the frame of the Earth.
    "VNYIA": (*_ATTITUDE_FIELDS, *_make_axis_names("inertial_accel", "gyro")),
}
"""The fields of each sentence with angular rate or acceleration."""

UNITS = {  # the unit of each field, which the format fixes
    **dict.fromkeys(_make_axis_names("gyro"), "rad/s"),
    **dict.fromkeys(_make_axis_names("accel", "linear_accel", "inertial_accel"), "m/s^2"),
    **dict.fromkeys(_ATTITUDE_FIELDS, "deg"),
    **dict.fromkeys(_make_axis_names("mag"), "gauss"),
    "temperature": "degC",
    "pressure": "kPa",
}


@dataclass(slots=True)
class Row:
    """One record: the text before its sentence, its fields, and the counter at its end."""

    before: bytes
    body: bytes
    counter: bytes = b""


_MIN_ZEROS = 16  # least run of zero bytes that is reported; shorter ones damage sentences
_SENTENCE_CANDIDATES = re.compile(rb"[^$]{6,}")  # after a `$`; shorter text has not even a name
_MAX_OTHER_NAMES, _MAX_SENTENCE_NAME = 1000, 32  # of other sentences; letters of one


class Counts:
    """Numbers of sentences by their state, and of other text."""

    def __init__(self) -> None:
        self.right = self.wrong = self.unread = self.garbage = 0
        self.others: Counter[str] = Counter()

    def report(self, file: LogFile, kind: str, width: int) -> None:
        """Add findings about text that is no valid sentence of ``kind`` with ``width`` fields."""
        name, timed = file.path.name, file.log.time is not None
        if count := self.wrong:
            wrong = files.WrongChecksum(name, count, kind, is_sentence=True, is_left_out=timed)
            file.note(wrong, count)
        if count := self.unread:
            file.note(files.UnreadableSentence(name, count, kind, width), count)
        if count := self.others.total():
            file.note(files.OtherSentences(name, count, _shorten_names(self.others)), count, "note")
        if count := self.garbage:
            file.note(files.NotSentences(name, count), count, "note")


class Sentences(Counts):
    """Extracts the sentences of one kind, and counts the other text."""

    def __init__(self, kind: str, stamped: bool) -> None:
        super().__init__()
        self._head = kind.encode() + b","
        self._commas = len(FIELDS[kind])
        self._stamped = stamped

    def add(self, text: bytes) -> list[Row]:
        """Return the records in some lines; a record with an empty body is a missing sample."""
        befores: list[bytes] = []
        bodies: list[bytes] = []
        checks: list[bytes] = []
        for line in text.split(b"\n"):
            before, _, rest = line.partition(b"$")
            if not rest:
                self.garbage += bool(line.strip(b"\r\0 \t"))
                continue
            # Without its line break, a sentence is followed by the next one on the same line.
            pieces = _SENTENCE_CANDIDATES.findall(rest)
            self.garbage += rest.count(b"$") + 1 - len(pieces)
            for piece in pieces:
                body, _, check = piece.rpartition(b"*")
                befores.append(before)
                bodies.append(body or piece)
                checks.append(check.rstrip() if body else b"")
                before = b""
        rows: list[Row] = []
        right = verify_checksums(bodies, checks)
        for good, before, body in zip(right, befores, bodies, strict=True):
            if good and body.startswith(self._head):
                self.right += 1
                row = Row(before, body[len(self._head) :])
                more = body.count(b",") != self._commas
                if more and (appended := _APPENDED_FIELDS.search(row.body)) is not None:
                    row.counter = appended[1] or b""
                    row.body = row.body[: appended.start()]
                rows.append(row)
                continue
            name = body[:_MAX_SENTENCE_NAME].partition(b",")[0].decode("ascii", "replace")
            # A damaged name: the sentence has the right width, and the name is unknown.
            unknown = name not in self.others and name not in FIELDS
            if good:
                many = len(self.others) >= _MAX_OTHER_NAMES and name not in self.others
                self.others["..." if many else name] += 1
            elif body.startswith(self._head) or (unknown and body.count(b",") == self._commas):
                self.wrong += 1
                if not self._stamped:
                    rows.append(Row(b"", b""))
            else:
                self.garbage += 1
        return rows


def find_position(kind: str, column: str | int) -> int:
    """Return the position of a column in a kind of sentence, from 0; -1 if there is none."""
    fields = FIELDS[kind]
    if isinstance(column, int):
        return column - 1 if column <= len(fields) else -1
    sentence, _, name = column.rpartition(".")
    return fields.index(name) if name in fields and sentence in ("", kind) else -1


def read_lines(path: Path, findings: list[Finding]) -> Iterator[bytes]:
    """Yield the text of a log in blocks of complete lines; an incomplete last line is reported."""
    rest = b""
    for block in blocks(path, findings, _MIN_ZEROS):
        text = rest + block
        cut = text.rfind(b"\n") + 1
        rest = text[cut:]
        if len(rest) > BLOCK_BYTES:
            raise RecordingError(
                f"{path.name}: no line break in {BLOCK_BYTES} bytes; expected the text of a "
                "VectorNav sensor: correct 'reader' in the sensor file, or copy the file again"
            )
        yield text[:cut]
    body, _, check = rest.rpartition(b"$")[2].rpartition(b"*")
    if verify_checksums([body], [check.rstrip()])[0] and b"$" in rest:
        yield rest
    elif rest.strip(b"\0\r\t "):
        shown = rest[:60].decode("ascii", "replace")
        data = files.IncompleteLastRecord(path.name, shown, has_checksum=True)
        findings.append(find(data, "note", 1))


def verify_checksums(bodies: list[bytes], checks: list[bytes]) -> list[bool]:
    """Return which sentences have a right checksum: XOR of 8 bits, or CRC of 16 bits."""
    if not bodies:
        return []
    # A zero byte before each one does not change its XOR, and makes empty ones valid.
    joined = np.frombuffer(b"\0" + b"\0".join(bodies), np.uint8)
    lengths = np.fromiter(map(len, bodies), np.int64, len(bodies)) + 1
    sums = np.bitwise_xor.reduceat(joined, np.cumsum(lengths) - lengths).tolist()
    return [
        _HEX_VALUES.get(check, -1) == xor
        if len(check) != 4
        else b"%04X" % crc_hqx(body, 0) == check.upper()
        for xor, body, check in zip(sums, bodies, checks, strict=True)
    ]


def parse_fields(
    bodies: list[bytes], width: int, positions: set[int]
) -> tuple[dict[int, NDArray[np.float64]], int]:
    """Return fields of records by position, and the number of unreadable sentences.

    ``width``: number of fields of a sentence. An empty body is a missing sample.
    """
    whole = [number for number, body in enumerate(bodies) if body.count(b",") == width - 1]
    unread = sum(map(bool, bodies)) - len(whole)
    fields = {position: np.full(len(bodies), np.nan) for position in positions}
    texts = [bodies[number] for number in whole]
    names = [str(position) for position in range(width)]
    wanted = [str(position) for position in sorted(positions)]
    table = None
    # Arrow does not accept a plus sign.
    if joined := b"\n".join(texts).replace(b"+", b""):
        with suppress(pa.ArrowInvalid):
            table = pacsv.read_csv(
                pa.py_buffer(joined),
                read_options=pacsv.ReadOptions(use_threads=False, column_names=names),
                parse_options=pacsv.ParseOptions(quote_char=False),
                convert_options=pacsv.ConvertOptions(
                    column_types=dict.fromkeys(wanted, pa.float64()), include_columns=wanted
                ),
            )
    if table is not None and len(table) == len(texts):
        for name in wanted:
            fields[int(name)][whole] = table.column(name).to_numpy()
        return fields, unread
    for number, text in zip(whole, texts, strict=True):
        cells = text.split(b",")
        for position in positions:
            try:
                fields[position][number] = float(cells[position])
            except ValueError:
                unread += 1
                break
    return fields, unread


_MAX_PROBED_SENTENCES = 1000
_MAX_LISTED_NAMES, _MAX_SHOWN_NAME = 10, 12
_ZONE_SUFFIX = re.compile(rb"(Z|[+-]\d\d:?\d\d)$")
STAMP_PADDING = b" \t,;:|[]()\"'\r\0"
HOST_TIME, COUNTER = "host_time", "counter"  # the columns of time


class VectorNavFile(LogFile):
    """A log of VectorNav's ASCII sentences."""

    fixed_units: ClassVar = {"gyro": "rad/s", "accel": "m/s^2"}
    fixed_by: ClassVar = "the format of VectorNav"

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        stated = self.log.time
        if stated is not None and stated.column not in (HOST_TIME, COUNTER):
            raise RecordingError(
                f"{self.path.name}: no time column {stated.column!r}; a VectorNav log has "
                f"{HOST_TIME!r}, a stamp before the '$', and {COUNTER!r}, the figure after 'T' at "
                "the end; correct 'column' of 'time', or drop 'time' and state 'rate'"
            )
        kind = self._kind()
        records = Sentences(kind, self.log.time is not None)
        positions = {
            name: find_position(kind, source.column) for name, source in self.sources.items()
        }
        wraps = None if self.log.time is None else self.log.time.wraps
        clock = Clock(self, wraps, self._started)
        for text in read_lines(self.path, self.findings):
            rows = records.add(text)
            if not rows:
                continue
            time = None
            if self.log.time is not None:
                stamps, missing = self._stamps(rows)
                if clock.first is None and missing.all():
                    at_host = self.log.time.column == HOST_TIME
                    where = "before the '$'" if at_host else "at the end: 'T' and a count"
                    before, body = rows[0].before[:40], rows[0].body[-40:]
                    raise RecordingError(
                        f"{self.path.name}: none of the first {len(rows)} sentences has a stamp "
                        f"that can be read; expected one {where}; the first has "
                        f"{before.decode('ascii', 'replace')!r} before the '$', and its fields end "
                        f"in {body.decode('ascii', 'replace')!r}; correct 'time' in the sensor "
                        "file, or drop it and state 'rate'"
                    )
                time = clock.seconds(stamps, ~missing)
            bodies = [row.body for row in rows]
            fields, unread = parse_fields(bodies, len(FIELDS[kind]), set(positions.values()))
            records.unread += unread
            columns = {
                name: self.to_si(name, fields[position]) for name, position in positions.items()
            }
            yield Batch(time, columns)
        if not records.right:
            raise RecordingError(
                f"{self.path.name}: no ${kind} sentence with a right checksum, {records.wrong} "
                f"with a wrong one; expected ${kind},...* and 2 or 4 digits; correct 'column' in "
                "the sensor file, or switch the checksum on (register 30)"
            )
        records.report(self, f"${kind}", len(FIELDS[kind]))

    def _kind(self) -> str:
        wanted = [source.column for source in self.sources.values()]
        able = [kind for kind in FIELDS if all(find_position(kind, c) >= 0 for c in wanted)]
        if not able:
            named = ", ".join(map(str, wanted))
            expected = "; ".join(f"{kind}: {' '.join(FIELDS[kind])}" for kind in FIELDS)
            raise RecordingError(
                f"{self.path.name}: no VectorNav sentence has all of the columns {named}; expected "
                f"columns of one sentence, {expected}; correct 'column' in the sensor file"
            )
        if len(able) == 1:
            return able[0]
        # The names of the sentences at the beginning of the file
        probe = Sentences(able[0], stamped=True)
        for text in read_lines(self.path, []):
            probe.add(text)
            if probe.right + probe.others.total() >= _MAX_PROBED_SENTENCES:
                break
        present = {*probe.others, *[able[0]] * bool(probe.right)}
        both = [kind for kind in able if kind in present]
        if len(both) == 1:
            return both[0]
        seen = ", ".join(_shorten_names(present)) or "no sentence with a right checksum"
        if not both:
            raise RecordingError(
                f"{self.path.name}: found {seen}; expected one of {', '.join(able)}, each with "
                "a checksum of 2 or 4 digits; correct 'column' in the sensor file, or set the "
                "output of the device (registers 6 and 30)"
            )
        raise RecordingError(
            f"{self.path.name}: {' and '.join(both)} both have the columns; name one in the "
            f"sensor file, as in 'column: {both[0]}.{FIELDS[both[0]][-1]}'"
        )

    def _stamps(self, rows: list[Row]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        assert self.log.time is not None
        if self.log.time.column == COUNTER:
            texts = [row.counter for row in rows]
        else:
            texts = [row.before.strip(STAMP_PADDING) for row in rows]
        is_date = self.log.time.format == "iso8601"
        whole = is_date or self.log.time.unit == "ns" or self.log.time.column == COUNTER
        # Nanoseconds since 1970 do not fit into the 53 bits of a float64.
        stamps = np.zeros(len(texts), np.int64 if whole else np.float64)
        missing = np.zeros(len(texts), bool)
        for number, text in enumerate(texts):
            try:
                if is_date:  # ns since 1970 (UTC)
                    kind = pa.timestamp("ns", "UTC" if _ZONE_SUFFIX.search(text) else None)
                    stamps[number] = pa.scalar(text.decode("ascii")).cast(kind).value
                else:
                    stamps[number] = int(text) if whole else float(text)
            except (ValueError, OverflowError):
                missing[number] = True
        if not whole:
            missing |= ~np.isfinite(stamps)
        return stamps, missing

    def _started(self, first: Any) -> str | None:
        time = self.log.time
        if time is None or time.column != HOST_TIME or time.unit == "samples":
            return None
        stamp = first.item()
        scale = SECONDS[time.unit or "ns"] * 1e9
        return format_date(stamp if isinstance(stamp, int) else round(stamp * scale))


def _shorten_names(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(name[:_MAX_SHOWN_NAME] for name in sorted(names)[:_MAX_LISTED_NAMES])


_MAX_DESCRIBED_BYTES = 1 << 21  # bytes


def list_sentences(path: Path, file_format: formats.FileFormat) -> list[formats.LogTable]:
    """Return a table for each sentence with inertial data; raise `RecordingError` if none."""
    sentences = {kind: Sentences(kind, stamped=True) for kind in FIELDS}
    rows: dict[str, list[Row]] = {kind: [] for kind in FIELDS}
    read = 0
    for text in read_lines(path, []):
        for kind, of_kind in sentences.items():
            if b"$" + kind.encode() in text:
                rows[kind] += of_kind.add(text)
        read += len(text)
        if read > _MAX_DESCRIBED_BYTES:
            break
    present = [kind for kind, of_kind in rows.items() if of_kind]
    if not present:
        raise RecordingError(
            f"{path.name}: no sentence of {', '.join(FIELDS)} with a right checksum at its "
            "beginning; set the output of the device (registers 6 and 30)"
        )
    described = []
    for kind in present:
        first = rows[kind][: formats.MAX_EXAMINED_RECORDS]
        width = len(FIELDS[kind])
        fields, _ = parse_fields([row.body for row in first], width, set(range(width)))
        columns = []
        for place, name in enumerate(FIELDS[kind]):
            source = name if len(present) == 1 else f"{kind}.{name}"
            values = fields[place]
            columns.append(formats.LogColumn.of_numbers(source, name, values, UNITS.get(name)))
        columns += _describe_time(HOST_TIME, [row.before.strip(STAMP_PADDING) for row in first])
        columns += _describe_time(COUNTER, [row.counter for row in first])
        about = f"{len(rows[kind])} sentences at the beginning"
        described.append(formats.LogTable(file_format, kind, tuple(columns), about=about))
    return described


def _describe_time(name: str, cells: list[bytes]) -> list[formats.LogColumn]:
    texts = [cell.decode("ascii", "replace") for cell in cells]
    first = tuple(texts[: formats.MAX_SHOWN_VALUES])
    if not any(texts):
        return []
    if all(is_number(text, ".") for text in texts if text):
        values = np.array([float(text) if text else np.nan for text in texts])
        return [formats.LogColumn(name, name, "number", first, values)]
    try:
        dates = parse_stamps("iso8601", texts)
        return [formats.LogColumn(name, name, "date", first, dates, None, ("iso8601",))]
    except StampError:
        return [formats.LogColumn(name, name, "text", first)]
