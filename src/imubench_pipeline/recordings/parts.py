"""Convert one file of a recording to Parquet: read it, collect statistics, remove knocks."""

import contextlib
import hashlib
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from imubench_pipeline.readers import LogFile
from imubench_pipeline.readers.late import sort_late_records
from imubench_pipeline.recordings.quality import knocks, levels
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.recordings.recording import BESIDE, ROW_GROUP, LogWriter
from imubench_pipeline.recordings.timebase import TimeBase
from imubench_pipeline.settings.sensor import UsedPart
from imubench_pipeline.tables.findings import Finding, RecordingError
from imubench_pipeline.tables.parquet import open_parquet, read_row_group
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings.files import NotUsed

STAMP_BLOCK = ROW_GROUP  # records of a block of stamps, equal to the records of a row group


@dataclass
class Part:
    """The columns of one file of a recording that share a clock, and their stamps in a file."""

    source: LogFile
    data: Path
    stamps_path: Path
    absent_path: Path
    """Scratch files: the columns as Parquet, the stamps, and a bit mask per record of the columns
    without a number. It is sparse: records with all numbers are a hole in it."""
    writer: LogWriter  # writer of ``data``; open until the metadata are known
    rows: int = 0  # number of records that are used
    columns: dict[str, ColumnSummary] = field(default_factory=dict)  # statistics of each column
    patterns: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Number of records for each bit mask of columns with a number: entry 5 counts the records with
    the first and the third column."""
    knocks: dict[str, int] = field(default_factory=dict)  # samples of columns left out as knocks
    calm: dict[str, ColumnSummary] = field(default_factory=dict)  # of columns without their knocks
    interpolated: dict[str, int] = field(default_factory=dict)  # samples left out as interpolated
    stamped: bool = False  # records have stamps
    base: TimeBase | None = None  # set when the columns of a file were separated
    findings: list[Finding] = field(default_factory=list)  # of columns whose rate changes
    left_out: dict[str, ColumnSummary] = field(default_factory=dict)  # that have too few samples

    def stamps(self) -> Iterator[Array]:
        """Yield the stamps in s, read from the scratch file."""
        for start in range(0, self.rows, STAMP_BLOCK):
            yield np.fromfile(self.stamps_path, np.float64, STAMP_BLOCK, offset=8 * start)

    def present(self) -> Iterator[NDArray[np.uint16]]:
        """Yield bit masks of the columns with a number, in the same blocks as the stamps."""
        for start in range(0, self.rows, STAMP_BLOCK):
            absent = np.fromfile(self.absent_path, np.uint16, STAMP_BLOCK, offset=2 * start)
            yield absent ^ np.uint16(len(self.patterns) - 1)

    def digest(self) -> str:
        """Return a digest of the stamps; files with the same digest share a clock."""
        digest = hashlib.blake2b()
        for block in self.stamps():
            digest.update(block.data)
        return digest.hexdigest()


@contextlib.contextmanager
def open_part(
    source: LogFile, columns: Iterable[str], scratch: Path, name: str
) -> Iterator[tuple[Part, Callable[[Array | None, Mapping[str, Array]], None]]]:
    """Begin a part with scratch files of this ``name``; yield it with a function that writes it.

    The function takes the stamps, s, or None, and the columns of consecutive records. It writes
    them and adds them to the statistics.
    """
    data, stamps, absent = (
        scratch / f"{name}.{ending}" for ending in ("parquet", "stamps", "absent")
    )
    summaries = {column: ColumnSummary() for column in columns}
    writer = LogWriter(data, dict.fromkeys(summaries, pa.float64()))
    part = Part(source, data, stamps, absent, writer, columns=summaries)
    part.patterns = np.zeros(1 << len(summaries), np.int64)
    with stamps.open("wb") as stamps_file, absent.open("wb") as absent_file:

        def write(time: Array | None, columns: Mapping[str, Array]) -> None:
            # Not `tofile`: it does not report a failed write when the C library closes the file.
            if time is not None:
                part.stamped = True
                stamps_file.write(np.ascontiguousarray(time).data)
            counted = {name: part.columns[name].add(values) for name, values in columns.items()}
            rows = len(next(iter(counted.values())))
            if any(np.isnan(values.sum()) for values in counted.values()):
                bits = np.zeros(rows, np.uint16)
                for place, name in enumerate(part.columns):
                    bits |= np.isnan(counted[name]).astype(np.uint16) << np.uint16(place)
                part.patterns += np.bincount(bits, minlength=len(part.patterns))[::-1]
                absent_file.write(bits.data)
            else:
                part.patterns[-1] += rows
                absent_file.seek(2 * rows, os.SEEK_CUR)
            part.rows += rows
            part.writer.write(counted)

        yield part, write
        absent_file.truncate()  # to its position, after a hole


def read_part(file: LogFile, use: UsedPart, scratch: Path, number: int) -> Part:
    """Read one file of a recording, in bounded memory; ``number`` names its files in ``scratch``.

    Raises RecordingError if the file cannot be read, or no sample lies in the part ``use``.
    """
    rate = file.log.rate_hz
    read_rows = 0
    with open_part(file, file.sources, scratch, f"part{number}") as (part, write):
        for batch in sort_late_records(file):
            clock, columns = batch.time, batch.columns
            if use.start > 0.0 or use.end is not None:
                if clock is None:
                    assert rate is not None  # checked with the sensor file
                    clock = np.arange(read_rows, read_rows + len(batch)) / rate
                # Records without a stamp are used: they are not known to lie outside.
                keep = ~((clock < use.start) | (clock > (math.inf if use.end is None else use.end)))
                clock = clock[keep]
                columns = {name: values[keep] for name, values in columns.items()}
            read_rows += len(batch)
            write(None if batch.time is None else clock, columns)
    not_used = read_rows - part.rows
    if part.rows == 0:
        raise RecordingError(
            f"{file.path.name}: none of its {read_rows} samples lies in the part to use "
            f"(use: start {use.start} s, end {use.end or 'open'}); correct 'use' in the notes"
        )
    if not_used:
        file.note(NotUsed(file.path.name, not_used), not_used, "note")
    return part


def leave_out_disturbed(
    part: Part, sigmas: float, longest: int, scratch: Path
) -> dict[str, list[knocks.Knock]]:
    """Replace knocks and interpolated samples by NaN in the file of a part.

    Returns the knocks by column. ``sigmas``: least distance of a knock from the level, in standard
    deviations. ``longest``: longest knock, in records.
    """
    blocks = {name: column.blocks() for name, column in part.columns.items()}
    doubtful = [name for name, b in blocks.items() if len(knocks.find_outlier_blocks(b, sigmas)[0])]
    steps = {name: levels.detect_quantisation(part.columns[name]) for name in doubtful}
    step = {name: steps_of.step if steps_of else None for name, steps_of in steps.items()}
    doubtful = [
        name
        for name in doubtful
        if len(knocks.find_outlier_blocks(blocks[name], sigmas, step[name])[0])
    ]
    rules = {
        name: knocks.detect_interpolation(column.excerpts(), part.rows)
        for name, column in part.columns.items()
        if name not in BESIDE
    }
    if not doubtful and not any(rules.values()):
        return {}
    part.writer.finish({})
    knocks_of = {}
    for name in doubtful:
        values = _read_row_groups(part.data, name)
        if here := list(knocks.find_knocks(values, blocks[name], sigmas, longest, step[name])):
            knocks_of[name] = here
    # Write the columns again without those samples; the new writer stays open.
    old = part.data
    part.data = scratch / f"{old.stem}.calm.parquet"
    part.writer = LogWriter(part.data, dict.fromkeys(part.columns, pa.float64()))
    part.knocks = dict.fromkeys(part.columns, 0)
    part.interpolated = dict.fromkeys(part.columns, 0)
    part.calm = {name: ColumnSummary() for name in knocks_of}
    reached = 0
    with open_parquet(old) as file:
        for number in range(file.num_row_groups):
            table = read_row_group(file, number)
            columns = {}
            for name in part.columns:
                samples = np.array(table.column(name).to_numpy(), dtype=np.float64)
                before = int(np.isfinite(samples).sum())
                for knock in knocks_of.get(name, []):
                    start = max(knock.first - reached, 0)
                    samples[start : max(knock.last - reached, 0)] = np.nan
                after = int(np.isfinite(samples).sum())
                part.knocks[name] += before - after
                if name in part.calm:
                    part.calm[name].add(samples)
                if rules.get(name):
                    samples[knocks.mark_straight_lines(samples, rules[name])] = np.nan
                    part.interpolated[name] += after - int(np.isfinite(samples).sum())
                columns[name] = samples
            reached += table.num_rows
            part.writer.write(columns)
    old.unlink()
    return knocks_of


def _read_row_groups(path: Path, name: str) -> Iterator[Array]:
    with open_parquet(path) as file:
        for number in range(file.num_row_groups):
            table = read_row_group(file, number, [name])
            yield np.asarray(table.column(name).to_numpy(), dtype=np.float64)
