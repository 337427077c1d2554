"""Check the unpacked size of the pages of a Parquet file before they are unpacked.

A page is unpacked as a whole, to the size in its own header; the metadata at the end of the file do
not have this size. The header is a structure of Thrift's compact protocol: ``PageHeader`` of
``parquet.thrift``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import pyarrow.parquet as pq

from imubench_pipeline.readers.arrays.table import UnusableError
from imubench_pipeline.readers.bounds import MAX_PAGE_BYTES, MAX_UNCHECKED_PAGES, MIN_MEAN_PAGE

_FIELD_UNPACKED_SIZE, _FIELD_PACKED_SIZE = 2, 3
_HEADER_PROBE, _MAX_HEADER = 1 << 10, 1 << 20
"""Bytes of a header that are read first, and at most: it may contain the extremes of its page."""


def check_pages(path: Path, metadata: pq.FileMetaData, names: Sequence[str]) -> None:
    """Raise if the largest pages of all columns together exceed the memory limit.

    ``names``: names of the columns that are read together.
    Raise `UnusableError` if they exceed the limit, or if there are too many small pages.
    """
    most = max(MAX_UNCHECKED_PAGES, path.stat().st_size // MIN_MEAN_PAGE)
    paths = [metadata.schema.column(place).path for place in range(metadata.num_columns)]
    places = [place for place, name in enumerate(paths) if name in names]
    number = 0
    with path.open("rb") as file:
        for group in range(metadata.num_row_groups):
            together = 0
            for place in places:
                largest = 0
                for unpacked in pages(file, metadata.row_group(group).column(place)):
                    number += 1
                    largest = max(largest, unpacked)
                    if number > most:
                        raise UnusableError(
                            f"more than {most} pages; expected larger ones: write it with "
                            "pyarrow.parquet.write_table"
                        )
                together += largest
            if together > MAX_PAGE_BYTES:
                raise UnusableError(
                    f"pages unpack to {together} bytes together; expected at most "
                    f"{MAX_PAGE_BYTES}: write it with pyarrow.parquet.write_table, which makes "
                    "smaller ones"
                )


def pages(file: BinaryIO, column: pq.ColumnChunkMetaData) -> Iterator[int]:
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


# ------------------------------------------------------------------- Thrift's compact protocol

_TYPE_TRUE, _TYPE_FALSE, _TYPE_BYTE, _TYPE_DOUBLE, _TYPE_BINARY, _TYPE_STRUCT = 1, 2, 3, 7, 8, 12
_INTEGER_TYPES = frozenset((4, 5, 6))
_MAX_DEPTH = 8


def _parse_header(data: bytes) -> tuple[dict[int, int], int]:
    """Return the integers of a structure by field number, and its length.

    Raise `IndexError` if the structure does not end within the data.
    """
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
