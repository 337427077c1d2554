"""Parquet files with checksums of their pages, and a digest of the metadata in the footer.

Parquet has checksums of pages only, not of the footer.
"""

import hashlib
import re
import struct
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

SEAL = b"imubench.digest"  # key of the metadata

_END = struct.Struct("<I4s")  # the end of a file: length of its metadata, mark of the format
_UNSEALED = b"0" * 64
# A text in compact Thrift: its field (1 after the last one, binary), its length, itself.
_PLACE = re.compile(re.escape(SEAL) + rb"\x18\x40([0-9a-f]{64})")


def open_parquet(path: Path) -> pq.ParquetFile:
    """Open a Parquet file so that the checksums of its pages are verified when they are read."""
    return pq.ParquetFile(path, page_checksum_verification=True)


def read_row_group(file: pq.ParquetFile, number: int, columns: list[str] | None = None) -> pa.Table:
    """Read a row group of an open Parquet file; raise `pyarrow.ArrowInvalid` if rows are missing.

    PyArrow before version 22 omits rows where the header of a page is damaged, as no checksum
    covers it.
    """
    table = file.read_row_group(number, columns=columns, use_threads=False)
    expected = file.metadata.row_group(number).num_rows
    if table.num_rows != expected:
        found = f"row group {number} has {table.num_rows} rows"
        raise pa.ArrowInvalid(f"{found}, expected {expected}; the file is damaged")
    return table


def write_sealed(table: pa.Table, path: Path, compression: str) -> None:
    """Write a table with checksums of its pages and a digest of its metadata."""
    with pq.ParquetWriter(
        path, table.schema, compression=compression, write_page_checksum=True
    ) as writer:
        writer.write_table(table)
        writer.add_key_value_metadata({SEAL: _UNSEALED})
    footer = read_footer(path)
    place = _PLACE.search(footer)
    if place is None:
        raise RuntimeError(
            f"{path}: no digest in the metadata; use a tested version of pyarrow, such as the one "
            "in constraints.txt"
        )
    with path.open("r+b") as file:
        file.seek(place.start(1) - len(footer), 2)
        file.write(hashlib.sha256(footer).hexdigest().encode())


def is_seal_broken(path: Path) -> bool:
    """Return whether metadata were changed after `write_sealed`; False without a digest."""
    footer = read_footer(path)
    place = _PLACE.search(footer)
    if place is None:
        return False
    unsealed = footer[: place.start(1)] + _UNSEALED + footer[place.end(1) :]
    return hashlib.sha256(unsealed).hexdigest().encode() != place[1]


def read_footer(path: Path) -> bytes:
    """Return the metadata at the end of a Parquet file; empty if the end is invalid."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(size - _END.size, 0))
        end = file.read()
        if len(end) < _END.size:
            return b""
        length = _END.unpack(end)[0] + _END.size
        if length > size:
            return b""
        file.seek(size - length)
        return file.read()
