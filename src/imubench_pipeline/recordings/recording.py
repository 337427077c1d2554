"""An ingested recording: Parquet files in SI, one for each time base, with its provenance.

The columns are the channels, ``temperature`` in °C, if needed ``time`` (s from the first sample),
and if samples are missing ``sample``, the position on the uniform grid. A null is a missing sample.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pydantic import TypeAdapter

from imubench_pipeline.readers.arrays.arrow import METADATA
from imubench_pipeline.settings.experiments import AT_REST
from imubench_pipeline.settings.sensor import POSITION, TABLE_RATE, TEMPERATURE
from imubench_pipeline.tables.files import replace_file
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.parquet import open_parquet, read_row_group, write_sealed
from imubench_pipeline.typing import Array

ROW_GROUP = 1 << 20  # rows of a row group
SAMPLES_FOLDER = "samples"  # in an object store
METADATA_FILE = "samples.json"  # there, the metadata of the first file of samples, or null
MEND = "remove it, and the next run reads the log again"
BESIDE = frozenset({TEMPERATURE, POSITION, TABLE_RATE})  # columns that are no channels
_NOT_CHANNELS = BESIDE | {"time", "sample"}


@dataclass(frozen=True, kw_only=True)
class LogNames:
    """Names and kind of the recording that a file of samples belongs to."""

    sensor: str = ""
    device: str = ""
    recording: str = ""
    kind: str = AT_REST
    simulated: bool = False


@dataclass(frozen=True)
class SourceFile:
    """Name, size in bytes, and digest of a file of a log."""

    name: str
    size: int | None
    sha256: str | None


@dataclass(frozen=True, kw_only=True)
class LogMetadata(LogNames):
    """Metadata of a file of samples, on one clock."""

    sources: tuple[SourceFile, ...] = ()
    reader: str | None = None
    begins: float = 0.0  # of the part used, s from the first sample
    started: str | None = None
    rate: float  # Hz
    rate_from: str = ""
    rows: int = 0
    grid: int
    segments: tuple[tuple[int, int], ...]
    uniform: bool = True
    holes: Mapping[str, bool]
    empty: tuple[str, ...] = ()
    unusable: tuple[str, ...] = ()
    removed: str = ""  # digest of the file that had the samples, if they were removed


_METADATA_ADAPTER = TypeAdapter(LogMetadata)  # once: it takes milliseconds


@dataclass(frozen=True, kw_only=True)
class SampleCounts:
    """Numbers of samples of a column: present in the log, used, and left out by reason."""

    present: int
    used: int
    knocks: int
    interpolated: int = 0
    repeated: int


class LogWriter(AbstractContextManager["LogWriter"]):
    """Writes columns to one Parquet file, in row groups of `ROW_GROUP` rows."""

    def __init__(self, path: Path, columns: Mapping[str, pa.DataType]) -> None:
        self._schema = pa.schema([pa.field(name, kind) for name, kind in columns.items()])
        floats = [name for name, kind in columns.items() if pa.types.is_floating(kind)]
        integers = [name for name in columns if name not in floats]
        self._writer = pq.ParquetWriter(
            path,
            self._schema,
            compression="zstd",
            compression_level=1,
            use_dictionary=False,
            use_byte_stream_split=floats,
            column_encoding={name: "DELTA_BINARY_PACKED" for name in integers} or None,
            write_page_checksum=True,
        )
        self._waiting: list[pa.RecordBatch] = []
        self._rows = 0

    def __exit__(self, *_: object) -> None:
        self._writer.close()

    def write(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Add consecutive rows; NaN is stored as null."""
        rows = len(next(iter(columns.values())))
        if rows == 0:
            return
        arrays = []
        for field in self._schema:
            values = columns[field.name]
            # NaN becomes null; a column without NaN is not copied.
            holes = values.dtype.kind == "f" and bool(np.isnan(values.sum()))
            arrays.append(pa.array(values, type=field.type, from_pandas=holes))
        self._waiting.append(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
        self._rows += rows
        while self._rows >= ROW_GROUP:
            self._flush(ROW_GROUP)

    def finish(self, metadata: Mapping[str, Any]) -> None:
        """Write the remaining rows and the metadata of the file; close it."""
        if self._rows:
            self._flush(self._rows)
        self._writer.add_key_value_metadata({METADATA: json.dumps(metadata)})
        self._writer.close()

    def _flush(self, rows: int) -> None:
        waiting = pa.Table.from_batches(self._waiting, schema=self._schema)
        self._writer.write_table(waiting.slice(0, rows), row_group_size=ROW_GROUP)
        self._waiting = waiting.slice(rows).to_batches()
        self._rows -= rows


def _to_numpy(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return a column of numbers, NaN where null; its own ``to_numpy`` imports pandas (40 MB)."""
    array = column.chunk(0) if column.num_chunks == 1 else pa.concat_arrays(column.chunks)
    validity, data = array.buffers()
    part = slice(array.offset, array.offset + len(array))
    values = np.frombuffer(data, array.type.to_pandas_dtype())[part]
    if array.null_count:
        bits = np.unpackbits(np.frombuffer(validity, np.uint8), bitorder="little")[part]
        values = np.where(bits, values, np.nan)
    return values


@dataclass(frozen=True)
class ChannelLog:
    """One channel of an ingested recording."""

    path: Path  # its Parquet file
    channel: str
    rate: float  # Hz
    grid: int  # points of the uniform grid
    segments: tuple[tuple[int, int], ...]  # grid points that begin and end each segment
    holes: bool  # samples are missing: blocks have NaN in their place
    temperature: bool = False  # there are readings of the temperature on the same grid
    position: bool = False  # a column on the same grid has the position of the sensor
    table_rate: bool = False  # a column on the same grid has the rate of the rate table

    def blocks(self) -> Iterator[Array]:
        """Yield the samples on the grid, SI; NaN if missing. RecordingError for a damaged file."""
        try:
            with open_parquet(self.path) as file:
                placed = "sample" in file.schema_arrow.names
                columns = [self.channel, *(["sample"] if placed else [])]
                reached = 0
                for number in range(file.num_row_groups):
                    table = read_row_group(file, number, columns)
                    values = _to_numpy(table.column(self.channel))
                    if not placed:
                        yield values
                        continue
                    points = _to_numpy(table.column("sample"))
                    start = 0
                    while start < len(points):
                        # Long holes: a row group can represent many times its rows on the grid.
                        stop = int(np.searchsorted(points, max(reached, points[start]) + ROW_GROUP))
                        block = np.full(int(points[stop - 1]) + 1 - reached, np.nan)
                        block[points[start:stop] - reached] = values[start:stop]
                        reached = int(points[stop - 1]) + 1
                        start = stop
                        yield block
        except (OSError, pa.ArrowException) as error:
            raise RecordingError(f"{self.path}: is damaged ({error}): {MEND}") from error

    def temperatures(self) -> Iterator[Array]:
        """Yield the readings of the temperature, °C, in the blocks of the samples."""
        return replace(self, channel=TEMPERATURE).blocks()

    def positions(self) -> Iterator[Array]:
        """Yield the position of the sensor, as written, in the blocks of the samples."""
        return replace(self, channel=POSITION).blocks()

    def table_rates(self) -> Iterator[Array]:
        """Yield the rate of the table, rad/s, in the blocks of the samples."""
        return replace(self, channel=TABLE_RATE).blocks()

    @property
    def position_elsewhere(self) -> bool:
        """Whether the position of the sensor is on another clock than this channel."""
        others = (path for path in list_log_files(self.path.parent) if path != self.path)
        return any(POSITION in pq.read_schema(path).names for path in others)

    def mean(self) -> float:
        """Return the mean of the samples present, SI."""
        return average_blocks(self.blocks())


def average_blocks(blocks: Iterable[Array]) -> float:
    """Return the mean of the samples present in consecutive blocks; NaN if there are none."""
    total, number = 0.0, 0
    for values in blocks:
        present = values[np.isfinite(values)]
        total += float(present.sum(dtype=np.float64))
        number += len(present)
    return total / number if number else math.nan


def read_metadata(path: Path) -> LogMetadata:
    """Return the metadata that `LogWriter.finish` wrote, or of a `METADATA_FILE`."""
    if path.name == METADATA_FILE:
        return _METADATA_ADAPTER.validate_json(path.read_bytes())
    metadata = pq.read_metadata(path).metadata or {}
    return _METADATA_ADAPTER.validate_json(metadata[METADATA])


def remove_samples(path: Path, sha256: str) -> None:
    """Replace a file of samples, with digest ``sha256``, by a file without rows."""
    metadata = json.loads(pq.read_metadata(path).metadata[METADATA]) | {"removed": sha256}
    schema = pq.read_schema(path).with_metadata({METADATA: json.dumps(metadata)})
    with replace_file(path) as temporary:
        write_sealed(schema.empty_table(), temporary, "snappy")


def list_log_files(folder: Path) -> list[Path]:
    """Return the Parquet files of an ingested recording, one per time base."""
    return sorted(locate_samples(folder).glob("log*.parquet"))


def locate_samples(folder: Path) -> Path:
    """Return the folder of the Parquet files: a subfolder if they were in an object store."""
    own = folder / SAMPLES_FOLDER
    return own if own.is_dir() else folder


def open_static_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return the channels that were at rest all the time; none of a turned sensor."""
    return open_channel_logs(folder) if was_at_rest(folder) else {}


def was_at_rest(folder: Path) -> bool:
    """Return whether the sensor of an ingested recording is stated to be at rest all the time."""
    return all(read_metadata(path).kind == AT_REST for path in list_log_files(folder))


def open_channel_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return the channels of an ingested recording that can be analysed, by name, in order."""
    logs: dict[str, ChannelLog] = {}
    for path in list_log_files(folder):
        metadata = read_metadata(path)
        columns = pq.read_schema(path).names
        beside = set(columns) - set(metadata.empty)  # without one reading
        for channel in columns:
            if channel in _NOT_CHANNELS or channel in metadata.unusable:
                continue
            logs[channel] = ChannelLog(
                path,
                channel,
                metadata.rate,
                metadata.grid,
                metadata.segments,
                metadata.holes.get(channel, True),
                TEMPERATURE in beside,
                POSITION in beside,
                TABLE_RATE in beside,
            )
    order = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    return {name: logs[name] for name in order if name in logs}


def place_on_grid(blocks: Iterable[Array], grid: int) -> Array:
    """Join consecutive blocks of a column on a grid of L points, shape (L,), padded with NaN."""
    values = np.full(grid, np.nan)
    reached = 0
    for block in blocks:
        values[reached : reached + len(block)] = block
        reached += len(block)
    return values
