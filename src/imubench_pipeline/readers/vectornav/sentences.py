"""VectorNav's ASCII sentences: their fields, their checksums, and what stands between them."""

from __future__ import annotations

import re
from binascii import crc_hqx
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from imubench_pipeline.readers.compressed import BLOCK_BYTES, blocks
from imubench_pipeline.tables.findings import Finding, RecordingError

_APPENDED = re.compile(rb"(?:,S[0-9A-Fa-f]{4})?(?:,T(\d{1,18}))?$")
"""What the device appends on request: a status, and a counter or time."""

_BYTE = {form % value: value for value in range(256) for form in (b"%02X", b"%02x")}


def _axes(*names: str) -> tuple[str, ...]:
    return tuple(f"{name}_{axis}" for name in names for axis in "xyz")


_ATTITUDE = ("yaw", "pitch", "roll")
_MEASURED = _axes("mag", "accel", "gyro")
FIELDS: dict[str, tuple[str, ...]] = {
    "VNYMR": (*_ATTITUDE, *_MEASURED),
    "VNQMR": ("quat_x", "quat_y", "quat_z", "quat_w", *_MEASURED),
    "VNMAR": _MEASURED,
    "VNIMU": (*_MEASURED, "temperature", "pressure"),
    "VNCMV": (*_MEASURED, "temperature"),
    "VNACC": _axes("accel"),
    "VNGYR": _axes("gyro"),
    "VNYBA": (*_ATTITUDE, *_axes("linear_accel", "gyro")),
    "VNYIA": (*_ATTITUDE, *_axes("inertial_accel", "gyro")),
}
"""The fields of each sentence that holds angular rate or acceleration."""

UNITS = {
    **dict.fromkeys(_axes("gyro"), "rad/s"),
    **dict.fromkeys(_axes("accel", "linear_accel", "inertial_accel"), "m/s^2"),
    **dict.fromkeys(_ATTITUDE, "deg"),
    **dict.fromkeys(_axes("mag"), "gauss"),
    "temperature": "degC",
    "pressure": "kPa",
}
"""The unit that the format fixes for each field that has one."""


@dataclass(slots=True)
class Row:
    """One record: what stands before its sentence, its fields, and the counter it ends with."""

    before: bytes
    body: bytes
    counter: bytes = b""


class Sentences:
    """Sorts the sentences of one kind from all else, and counts."""

    def __init__(self, kind: str, stamped: bool) -> None:
        self._head = kind.encode() + b","
        self._commas = len(FIELDS[kind])
        self._stamped = stamped
        self.right = 0
        self.wrong = 0
        self.unread = 0
        self.garbage = 0
        self.others: Counter[str] = Counter()

    def add(self, text: bytes) -> list[Row]:
        """Return the records of some lines; one with an empty body is a missing sample."""
        befores: list[bytes] = []
        bodies: list[bytes] = []
        checks: list[bytes] = []
        for line in text.split(b"\n"):
            before, _, rest = line.partition(b"$")
            if not rest:
                self.garbage += bool(line.strip(b"\r\0 \t"))
                continue
            # A sentence whose line break was lost runs into the next one.
            for piece in rest.split(b"$"):
                body, _, check = piece.rpartition(b"*")
                befores.append(before)
                bodies.append(body or piece)
                checks.append(check.rstrip() if body else b"")
                before = b""
        rows: list[Row] = []
        for good, before, body in zip(
            right_checksums(bodies, checks), befores, bodies, strict=True
        ):
            if good and body.startswith(self._head):
                self.right += 1
                rows.append(self._row(before, body))
            elif good:
                self.others[body.partition(b",")[0].decode("ascii", "replace")] += 1
            elif body.startswith(self._head) or self._damaged_name(body):
                self.wrong += 1
                if not self._stamped:
                    rows.append(Row(b"", b""))
            else:
                self.garbage += 1
        return rows

    def _damaged_name(self, body: bytes) -> bool:
        """Tell whether this was a sentence of our kind: as many fields, and no known name."""
        name = body.partition(b",")[0].decode("ascii", "replace")
        other = name in self.others or name in FIELDS
        return not other and body.count(b",") == self._commas

    def _row(self, before: bytes, body: bytes) -> Row:
        row = Row(before, body[len(self._head) :])
        if body.count(b",") != self._commas:
            appended = _APPENDED.search(row.body)
            if appended is not None:
                row.counter = appended[1] or b""
                row.body = row.body[: appended.start()]
        return row


def position_of(kind: str, column: str | int) -> int:
    """Return the place of a column in a kind of sentence, from 0; -1: it has no such column."""
    fields = FIELDS[kind]
    if isinstance(column, int):
        return column - 1 if column <= len(fields) else -1
    sentence, _, name = column.rpartition(".")
    return fields.index(name) if name in fields and sentence in ("", kind) else -1


def lines_of(path: Path, findings: list[Finding]) -> Iterator[bytes]:
    """Yield the text of a log in blocks of whole lines.

    A last line without its line break is kept if its checksum is right; else it was cut short
    by the end of the recording, which is noted in ``findings``.
    """
    rest = b""
    for block in blocks(path, findings):
        text = rest + block
        cut = text.rfind(b"\n") + 1
        rest = text[cut:]
        if len(rest) > BLOCK_BYTES:
            raise RecordingError(
                f"{path.name}: no line break in {BLOCK_BYTES} bytes; expected the text of a "
                "VectorNav sensor; is this the right file?"
            )
        yield text[:cut]
    body, _, check = rest.rpartition(b"$")[2].rpartition(b"*")
    if right_checksums([body], [check.rstrip()])[0] and b"$" in rest:
        yield rest
    elif rest.strip(b"\0\r\t "):
        shown = rest[:60].decode("ascii", "replace")
        findings.append(
            Finding(
                "incomplete_last_record",
                "note",
                f"{path.name}: the last line has no line break and no right checksum; left out: "
                f"{shown!r}",
                1,
            )
        )


def right_checksums(bodies: list[bytes], checks: list[bytes]) -> list[bool]:
    """Tell which sentences have a right checksum: XOR of 8 bits, or CRC of 16."""
    if not bodies:
        return []
    # A zero byte before each changes no XOR, and makes each begin somewhere.
    joined = np.frombuffer(b"\0" + b"\0".join(bodies), np.uint8)
    lengths = np.fromiter(map(len, bodies), np.int64, len(bodies)) + 1
    sums = np.bitwise_xor.reduceat(joined, np.cumsum(lengths) - lengths).tolist()
    return [
        _BYTE.get(check, -1) == xor
        if len(check) != 4
        else b"%04X" % crc_hqx(body, 0) == check.upper()
        for xor, body, check in zip(sums, bodies, checks, strict=True)
    ]


def fields_of(
    kind: str, rows: list[Row], positions: set[int]
) -> tuple[dict[int, NDArray[np.float64]], int]:
    """Return some fields of some records by place, and how many sentences could not be read."""
    commas = len(FIELDS[kind]) - 1
    whole = [number for number, row in enumerate(rows) if row.body.count(b",") == commas]
    present = sum(1 for row in rows if row.body)
    fields = {position: np.full(len(rows), np.nan) for position in positions}
    read, unread = _numbers([rows[number].body for number in whole], commas + 1, positions)
    for position, values in read.items():
        fields[position][whole] = values
    return fields, unread + present - len(whole)


def _numbers(
    texts: list[bytes], width: int, positions: set[int]
) -> tuple[dict[int, NDArray[np.float64]], int]:
    """Return some cells of lines of text, by place, and how many lines could not be read."""
    names = [str(position) for position in range(width)]
    wanted = [str(position) for position in sorted(positions)]
    # Arrow takes no plus sign.
    joined = b"\n".join(texts).replace(b"+", b"")
    if texts and joined:
        try:
            table = pacsv.read_csv(
                pa.py_buffer(joined),
                read_options=pacsv.ReadOptions(use_threads=False, column_names=names),
                parse_options=pacsv.ParseOptions(quote_char=False),
                convert_options=pacsv.ConvertOptions(
                    column_types=dict.fromkeys(wanted, pa.float64()), include_columns=wanted
                ),
            )
        except pa.ArrowInvalid:
            table = None
        if table is not None and len(table) == len(texts):
            columns = {int(name): table.column(name).to_numpy() for name in wanted}
            return columns, 0
    return _numbers_one_by_one(texts, positions)


def _numbers_one_by_one(
    texts: list[bytes], positions: set[int]
) -> tuple[dict[int, NDArray[np.float64]], int]:
    fields = {position: np.full(len(texts), np.nan) for position in positions}
    unread = 0
    for number, text in enumerate(texts):
        cells = text.split(b",")
        for position in positions:
            try:
                fields[position][number] = float(cells[position])
            except ValueError:
                unread += 1
                break
    return fields, unread
