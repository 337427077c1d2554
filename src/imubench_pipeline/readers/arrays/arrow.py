"""Parquet, and Feather or Arrow IPC files and streams: read by row group or record batch.

A column is a name or a position; ``variable`` is not used. A null is a missing sample. A column of
timestamps is time with ``format: iso8601``. Large compressed record batches are rejected, since
they are unpacked as a whole.
"""

import json
import struct
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imubench_pipeline.readers import bounds
from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.arrays.table import Column, Table, UnusableError

METADATA = b"imubench"  # metadata key of Parquet files that this package writes; the value is JSON
_PARQUET_MAGIC, _FEATHER_1_MAGIC = b"PAR1", b"FEA1"
_ARROW_FILE_MAGIC, _ARROW_STREAM_MAGIC = b"ARROW1", b"\xff\xff\xff\xff"


class ArrowFile(ArrayFile):
    """A Parquet, Feather or Arrow IPC file."""

    def tables(self, stack: ExitStack) -> Iterable[Table]:
        """Read the schema."""
        with self.path.open("rb") as file:
            begin = file.read(len(_ARROW_FILE_MAGIC))
        if begin.startswith(_PARQUET_MAGIC):
            # Memory-mapped, since otherwise a whole column of a row group is read at once.
            file = pq.ParquetFile(
                self.path, memory_map=True, pre_buffer=False, page_checksum_verification=True
            )
            return [_ParquetTable(self.path, stack.enter_context(file))]
        if begin.startswith((_ARROW_FILE_MAGIC, _ARROW_STREAM_MAGIC)):
            check_batches(self.path, begin == _ARROW_FILE_MAGIC)
            source = stack.enter_context(pa.memory_map(str(self.path)))
            opened = pa.ipc.open_file if begin == _ARROW_FILE_MAGIC else pa.ipc.open_stream
            return [_IpcTable(opened(source))]
        if begin.startswith(_FEATHER_1_MAGIC):
            raise UnusableError(
                "is Feather version 1; expected version 2: read it with an older pyarrow, and "
                "write it with pyarrow.feather.write_feather"
            )
        raise UnusableError(
            "not a Parquet, Feather or Arrow file, or its beginning is damaged; mend 'reader' in "
            "the sensor file, or copy the file again"
        )


class _ArrowTable(Table):
    """The columns of a schema."""

    def __init__(self, schema: pa.Schema) -> None:
        self.schema = schema
        self.labels = schema.names
        self.width = len(schema.names)
        if not self.width:
            self.fault = "has no column"

    def column(self, position: int) -> Column:
        kind = stored = self.schema.field(position).type
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        numpy_kind = "M" if pa.types.is_timestamp(kind) else "O"
        if pa.types.is_floating(kind) or pa.types.is_decimal(kind) or pa.types.is_null(kind):
            numpy_kind = "f"
        elif pa.types.is_integer(kind):
            numpy_kind = "i" if pa.types.is_signed_integer(kind) else "u"
        return Column(self.labels[position], numpy_kind, str(stored))

    def unit(self, position: int) -> str | None:
        stated = self.schema.field(position).metadata or {}
        unit = next((stated[key] for key in (b"unit", b"units") if key in stated), b"")
        return unit.decode("utf-8", "replace") or None

    def row_bytes(self, positions: Sequence[int]) -> int:
        return 8 * len(positions)

    def blocks(self, positions: Sequence[int], rows: int) -> Iterator[list[NDArray[Any]]]:
        # Columns with the same name are all read.
        same = [self.labels[:position].count(self.labels[position]) for position in positions]
        names = [self.labels[position] for position in positions]
        for batch in self._batches(list(dict.fromkeys(names)), rows):
            chosen = [
                batch.column(batch.schema.get_all_field_indices(name)[number])
                for name, number in zip(names, same, strict=True)
            ]
            for column in chosen:
                # Offsets in a damaged file may lie outside of its memory.
                column.validate(full=True)
            for start in range(0, len(batch), rows):
                yield [_convert_to_numpy(column.slice(start, rows)) for column in chosen]

    @abstractmethod
    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        """Yield batches with at least the columns of these names, by row group or record batch."""


class _ParquetTable(_ArrowTable):
    def __init__(self, path: Path, file: pq.ParquetFile) -> None:
        super().__init__(file.schema_arrow)
        self._path, self._file = path, file
        self.rows = file.metadata.num_rows
        with suppress(ValueError):
            about = json.loads((file.metadata.metadata or {}).get(METADATA, b"{}"))
            self.simulated = isinstance(about, dict) and about.get("simulated") is True

    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        check_pages(self._path, self._file.metadata, names)
        read = 0
        for batch in self._file.iter_batches(rows, columns=names, use_threads=False):
            read += len(batch)
            yield batch
        if read != self.rows:  # rows of a damaged page can be left out without an error
            raise UnusableError(
                f"is damaged: {read} rows are found, expected {self.rows}; copy the file again"
            )


class _IpcTable(_ArrowTable):
    def __init__(self, reader: pa.RecordBatchFileReader | pa.RecordBatchStreamReader) -> None:
        super().__init__(reader.schema)
        self._reader = reader

    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        if isinstance(self._reader, pa.RecordBatchStreamReader):
            yield from self._reader
            return
        for number in range(self._reader.num_record_batches):
            yield self._reader.get_batch(number)


def _convert_to_numpy(column: pa.Array) -> NDArray[Any]:
    if pa.types.is_dictionary(column.type):
        column = column.dictionary_decode()
    if pa.types.is_decimal(column.type) or pa.types.is_null(column.type):
        column = column.cast(pa.float64())
    if pa.types.is_integer(column.type) and column.null_count:
        present = column.is_valid().to_numpy(zero_copy_only=False)
        return np.ma.masked_array(column.fill_null(0).to_numpy(), ~present)
    return np.asarray(column.to_numpy(zero_copy_only=False))


# --------------------------------------- unpacked size of record batches, before they are unpacked
#
# A message is a FlatBuffers table: "Encapsulated message format" and ``Message.fbs`` of Arrow.

_FILE_PREFIX_BYTES = 8  # bytes of a file before its stream
_FIELD_HEADER_TYPE, _FIELD_HEADER = 1, 2
_TYPE_DICTIONARY_BATCH, _TYPE_RECORD_BATCH = 2, 3
_FIELD_DICTIONARY_DATA = 1
_FIELD_BUFFERS, _FIELD_COMPRESSION = 2, 3


def check_batches(path: Path, in_file: bool) -> None:
    """Raise `UnusableError` if a compressed batch is too large; ``in_file``: no stream format."""
    with pa.memory_map(str(path)) as source:
        source.seek(_FILE_PREFIX_BYTES if in_file else 0)
        for message in pa.ipc.MessageReader.open_stream(source):
            unpacked = sum(_read_unpacked_sizes(bytes(message.metadata), message.body))
            if unpacked > bounds.MAX_ARROW_BATCH:
                raise UnusableError(
                    f"a compressed record batch unpacks to {unpacked} bytes; expected at most "
                    f"{bounds.MAX_ARROW_BATCH}: write it with pyarrow.feather.write_feather, which "
                    "makes smaller ones"
                )


def _read_unpacked_sizes(metadata: bytes, body: pa.Buffer | None) -> Iterator[int]:
    """Yield the stated unpacked size of each compressed buffer of a message, bytes."""
    try:
        table = _FlatTable(metadata, struct.unpack_from("<I", metadata)[0])
        kind = table.byte(_FIELD_HEADER_TYPE)
        header = table.table(_FIELD_HEADER)
        if header is not None and kind == _TYPE_DICTIONARY_BATCH:
            header = header.table(_FIELD_DICTIONARY_DATA)
        elif kind != _TYPE_RECORD_BATCH:
            return
        if body is None or header is None or header.table(_FIELD_COMPRESSION) is None:
            return
        start, count = header.vector(_FIELD_BUFFERS)
        for number in range(count):
            offset, length = struct.unpack_from("<qq", metadata, start + 16 * number)
            if length >= 8:
                yield max(0, *struct.unpack("<q", bytes(body[offset : offset + 8])))
    except struct.error:
        raise UnusableError("corrupt data: a damaged message; copy the file again") from None


class _FlatTable:
    """A table of FlatBuffers, with fields at the positions in its list of offsets (vtable)."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data = data
        self._at = at
        self._offsets = at - struct.unpack_from("<i", data, at)[0]

    def _place(self, field: int) -> int | None:
        (size,) = struct.unpack_from("<H", self._data, self._offsets)
        at = 4 + 2 * field
        offset = struct.unpack_from("<H", self._data, self._offsets + at)[0] if at < size else 0
        return self._at + offset if offset else None

    def byte(self, field: int) -> int:
        place = self._place(field)
        return 0 if place is None else int(struct.unpack_from("<B", self._data, place)[0])

    def table(self, field: int) -> "_FlatTable | None":
        place = self._place(field)
        if place is None:
            return None
        return _FlatTable(self._data, place + struct.unpack_from("<I", self._data, place)[0])

    def vector(self, field: int) -> tuple[int, int]:
        """Return the position and the number of the elements of a vector."""
        place = self._place(field)
        if place is None:
            return 0, 0
        at = place + struct.unpack_from("<I", self._data, place)[0]
        return at + 4, int(struct.unpack_from("<I", self._data, at)[0])


# ------------------------------------------- unpacked size of the pages of Parquet
#
# A page is unpacked as a whole, to the size in its own header; the metadata at the end of the file
# do not have this size. The header is a structure of Thrift's compact protocol: ``PageHeader`` of
# ``parquet.thrift``.

_FIELD_UNPACKED_SIZE, _FIELD_PACKED_SIZE = 2, 3
_HEADER_PROBE, _MAX_HEADER = 1 << 10, 1 << 20  # bytes of a header that are read first, and at most


def check_pages(path: Path, metadata: pq.FileMetaData, names: Sequence[str]) -> None:
    """Raise `UnusableError` if pages are too many, or the largest of all columns are too large."""
    most = max(bounds.MAX_UNCHECKED_PAGES, path.stat().st_size // bounds.MIN_MEAN_PAGE)
    paths = [metadata.schema.column(place).path for place in range(metadata.num_columns)]
    places = [place for place, name in enumerate(paths) if name in names]
    number = 0
    with path.open("rb") as file:
        for group in range(metadata.num_row_groups):
            together = 0
            for place in places:
                largest = 0
                for unpacked in list_page_sizes(file, metadata.row_group(group).column(place)):
                    number += 1
                    largest = max(largest, unpacked)
                    if number > most:
                        raise UnusableError(
                            f"more than {most} pages; expected larger ones: write it with "
                            "pyarrow.parquet.write_table"
                        )
                together += largest
            if together > bounds.MAX_PAGE_BYTES:
                raise UnusableError(
                    f"pages unpack to {together} bytes together; expected at most "
                    f"{bounds.MAX_PAGE_BYTES}: write it with pyarrow.parquet.write_table, which "
                    "makes smaller ones"
                )


def list_page_sizes(file: BinaryIO, column: pq.ColumnChunkMetaData) -> Iterator[int]:
    """Yield the unpacked size of each page of a column, bytes."""
    at = column.data_page_offset
    if column.has_dictionary_page and 0 < column.dictionary_page_offset < at:
        at = column.dictionary_page_offset
    end = at + column.total_compressed_size
    while at < end:
        for most in (_HEADER_PROBE, _MAX_HEADER):
            file.seek(at)
            data = file.read(most)
            try:
                fields, length = _parse_header(data)
                break
            except IndexError:
                continue
        else:
            raise UnusableError("corrupt data: a damaged page; copy the file again")
        unpacked, packed = fields.get(_FIELD_UNPACKED_SIZE, 0), fields.get(_FIELD_PACKED_SIZE, -1)
        if unpacked < 0 or packed < 0:
            raise UnusableError("corrupt data: a damaged page; copy the file again")
        yield unpacked
        at += length + packed


_TYPE_TRUE, _TYPE_FALSE, _TYPE_BYTE, _TYPE_DOUBLE, _TYPE_BINARY, _TYPE_STRUCT = 1, 2, 3, 7, 8, 12
_INTEGER_TYPES = frozenset((4, 5, 6))
_MAX_DEPTH = 8


def _parse_header(data: bytes) -> tuple[dict[int, int], int]:
    """Return the integers of a structure by field number, and its length; `IndexError` if cut."""
    numbers: dict[int, int] = {}
    at, field = 0, 0
    while kind := data[at]:
        field, at = _parse_field(data, at, field)
        kind &= 15
        if kind in _INTEGER_TYPES:
            value, at = _parse_varint(data, at)
            numbers[field] = (value >> 1) ^ -(value & 1)
        else:
            at = _skip_value(data, at, kind, 0)
    return numbers, at + 1


def _parse_field(data: bytes, at: int, before: int) -> tuple[int, int]:
    """Return the number of the field with its type at a position, and the next position."""
    step = data[at] >> 4
    if step:
        return before + step, at + 1
    number, at = _parse_varint(data, at + 1)
    return (number >> 1) ^ -(number & 1), at


def _parse_varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 127) << shift
        at, more = at + 1, data[at] > 127
        shift += 7
        if not more:
            return value, at
        if shift > 63:
            raise IndexError("a number without end")


def _skip_value(data: bytes, at: int, kind: int, depth: int) -> int:
    """Return the position after a value of a type."""
    if kind in (_TYPE_TRUE, _TYPE_FALSE):
        return at
    if kind in _INTEGER_TYPES:
        return _parse_varint(data, at)[1]
    if kind in (_TYPE_BYTE, _TYPE_DOUBLE):
        return at + (1 if kind == _TYPE_BYTE else 8)
    if kind == _TYPE_BINARY:
        size, at = _parse_varint(data, at)
        return at + size
    if kind == _TYPE_STRUCT and depth < _MAX_DEPTH:
        field = 0
        while inner := data[at]:
            field, at = _parse_field(data, at, field)
            at = _skip_value(data, at, inner & 15, depth + 1)
        return at + 1
    raise IndexError("no type of a page header")
