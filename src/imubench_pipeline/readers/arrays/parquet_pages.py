"""What the pages of a Parquet file unpack to, before they are unpacked.

A page is unpacked as a whole, to what its own header says; the metadata at the end of the file know
nothing of it. The header is a structure of Thrift's compact protocol: ``PageHeader`` of
``parquet.thrift``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import pyarrow.parquet as pq

from imubench_pipeline.readers.arrays.table import UnusableError
from imubench_pipeline.readers.bounds import MAX_PAGE_BYTES, MAX_UNCHECKED_PAGES, MIN_MEAN_PAGE

_UNPACKED, _PACKED = 2, 3
_HEADER, _LONGEST_HEADER = 1 << 10, 1 << 20
"""Bytes of a header that are read at first, and at most: it may hold the extremes of its page."""


def check_pages(path: Path, metadata: pq.FileMetaData, names: Sequence[str]) -> None:
    """Raise where the pages of columns, of each the largest, may not be in memory together.

    ``names``: of the columns that are read side by side.

    Raises
    ------
    UnusableError
        If they may not, or are too many for what they hold.
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
    """Yield to how many bytes each page of a column unpacks."""
    at = column.data_page_offset
    if column.has_dictionary_page and 0 < column.dictionary_page_offset < at:
        at = column.dictionary_page_offset
    end = at + column.total_compressed_size
    while at < end:
        for most in (_HEADER, _LONGEST_HEADER):
            file.seek(at)
            data = file.read(most)
            try:
                fields, length = _header(data)
                break
            except IndexError:
                continue
        else:
            raise UnusableError("corrupt data: a damaged page; copy the file again")
        unpacked, packed = fields.get(_UNPACKED, 0), fields.get(_PACKED, -1)
        if unpacked < 0 or packed < 0:
            raise UnusableError("corrupt data: a damaged page; copy the file again")
        yield unpacked
        at += length + packed


# ------------------------------------------------------------------- Thrift's compact protocol

_TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _STRUCT = 1, 2, 3, 7, 8, 12
_NUMBERS = frozenset((4, 5, 6))
_DEEPEST = 8


def _header(data: bytes) -> tuple[dict[int, int], int]:
    """Return the whole numbers of a structure by their fields, and its length.

    Raises
    ------
    IndexError
        If it does not end within the data.
    """
    numbers: dict[int, int] = {}
    at, field = 0, 0
    while kind := data[at]:
        field, at = _field(data, at, field)
        kind &= 15
        if kind in _NUMBERS:
            value, at = _varint(data, at)
            numbers[field] = (value >> 1) ^ -(value & 1)
        else:
            at = _behind(data, at, kind, 0)
    return numbers, at + 1


def _field(data: bytes, at: int, before: int) -> tuple[int, int]:
    """Return the number of the field whose type stands at a place, and the place behind that."""
    step = data[at] >> 4
    if step:
        return before + step, at + 1
    number, at = _varint(data, at + 1)
    return (number >> 1) ^ -(number & 1), at


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        value |= (data[at] & 127) << shift
        at, more = at + 1, data[at] > 127
        shift += 7
        if not more:
            return value, at
        if shift > 63:
            raise IndexError("a number without end")


def _behind(data: bytes, at: int, kind: int, depth: int) -> int:
    """Return the place behind a value of a type."""
    if kind in (_TRUE, _FALSE):
        return at
    if kind in _NUMBERS:
        return _varint(data, at)[1]
    if kind in (_BYTE, _DOUBLE):
        return at + (1 if kind == _BYTE else 8)
    if kind == _BINARY:
        size, at = _varint(data, at)
        return at + size
    if kind == _STRUCT and depth < _DEEPEST:
        field = 0
        while inner := data[at]:
            field, at = _field(data, at, field)
            at = _behind(data, at, inner & 15, depth + 1)
        return at + 1
    raise IndexError("no type of a page header")
