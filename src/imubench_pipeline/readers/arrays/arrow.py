"""Parquet, and Feather or Arrow IPC files and streams: read by row group or record batch.

A column is a name or a position; ``variable`` is not used. A null is a missing sample. A column of
timestamps is time with ``format: iso8601``. A page of Parquet and a compressed record batch are
unpacked as a whole, within the memory that the process may use.
"""

import json
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.arrays.table import Column, Table, UnusableError

METADATA = b"imubench"  # metadata key of Parquet files that this package writes; the value is JSON
_PARQUET_MAGIC, _FEATHER_1_MAGIC = b"PAR1", b"FEA1"
_ARROW_FILE_MAGIC, _ARROW_STREAM_MAGIC = b"ARROW1", b"\xff\xff\xff\xff"


class ArrowFile(ArrayFile):
    """A Parquet, Feather or Arrow IPC file."""

    def tables(self, stack: ExitStack) -> Iterable[Table]:
        """Return the columns of the file as one table (see `ArrayFile.tables`)."""
        with self.path.open("rb") as file:
            begin = file.read(len(_ARROW_FILE_MAGIC))
        if begin.startswith(_PARQUET_MAGIC):
            # Memory-mapped, since otherwise a whole column of a row group is read at once.
            file = pq.ParquetFile(
                self.path, memory_map=True, pre_buffer=False, page_checksum_verification=True
            )
            return [_ParquetTable(stack.enter_context(file))]
        if begin.startswith((_ARROW_FILE_MAGIC, _ARROW_STREAM_MAGIC)):
            source = stack.enter_context(pa.memory_map(str(self.path)))
            opened = pa.ipc.open_file if begin == _ARROW_FILE_MAGIC else pa.ipc.open_stream
            return [_IpcTable(opened(source))]
        if begin.startswith(_FEATHER_1_MAGIC):
            raise UnusableError(
                "is Feather version 1; expected version 2: read it with an older pyarrow, and "
                "write it with pyarrow.feather.write_feather"
            )
        raise UnusableError(
            "not a Parquet, Feather or Arrow file, or its beginning is damaged; correct 'reader' "
            "in the sensor file, or copy the file again"
        )


class _ArrowTable(Table):
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
    def __init__(self, file: pq.ParquetFile) -> None:
        super().__init__(file.schema_arrow)
        self._file = file
        self.rows = file.metadata.num_rows
        with suppress(ValueError):
            about = json.loads((file.metadata.metadata or {}).get(METADATA, b"{}"))
            self.simulated = isinstance(about, dict) and about.get("simulated") is True

    def _batches(self, names: list[str], rows: int) -> Iterator[pa.RecordBatch]:
        read = 0
        for batch in self._file.iter_batches(rows, columns=names, use_threads=False):
            read += len(batch)
            yield batch
        if read != self.rows:  # rows of a damaged page can be left out without an error
            raise UnusableError(
                f"is damaged: found {read} rows, expected {self.rows}; copy the file again"
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
