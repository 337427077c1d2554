"""Combine the files of a recording into one Parquet file per clock, and count all samples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imubench_pipeline.recordings import timebase
from imubench_pipeline.recordings.parts import Part
from imubench_pipeline.recordings.recording import BESIDE, LogMetadata, LogWriter, SampleCounts
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables import open_parquet, read_row_group


def name_parquet_files(parts: list[Part], groups: list[list[int]]) -> list[str]:
    """Return the name of the Parquet file of each clock, from its quantity or its channels."""
    if len(groups) == 1:
        return ["log.parquet"]
    contents = []
    for group in groups:
        columns = [name for index in group for name in parts[index].columns]
        contents.append([name for name in columns if name not in BESIDE] or columns)
    quantities = [sorted({quantity_of(name) for name in names}) for names in contents]
    names = []
    for channels, kinds in zip(contents, quantities, strict=True):
        alone = len(kinds) == 1 and quantities.count(kinds) == 1
        names.append(f"log.{kinds[0] if alone else '+'.join(channels)}.parquet")
    return names


def assemble(
    parts: list[Part],
    base: timebase.TimeBase,
    settings: QualitySettings,
    metadata: LogMetadata,
    path: Path,
) -> tuple[Path, dict[str, int]]:
    """Write the columns of files that share a clock to ``path``, unless one can be used unchanged.

    Return the path, and the samples of each column that are left out because they repeat a stamp.
    """
    for part in parts:
        part.writer.finish(asdict(metadata))
    if len(parts) == 1 and base.uniform:
        return parts[0].data, {}
    repeated: dict[str, int] = {}
    names = [name for part in parts for name in part.columns]
    columns = dict.fromkeys(names, pa.float64())
    if not base.uniform:
        sample = {"sample": pa.int64()} if base.stamped else {}
        columns = {"time": pa.float64()} | sample | columns
    blocks = _read_columns(parts)
    with LogWriter(path, columns) as writer:
        if base.uniform:
            for block in blocks:
                writer.write(block)
        else:
            first = None
            places = timebase.locate_samples(base, parts[0].stamps, settings)
            for block, stamps, points in zip(blocks, parts[0].stamps(), places, strict=True):
                first = stamps[0] if first is None else first
                block["time"] = stamps - first
                if base.stamped:
                    block["sample"] = points
                keep = points >= 0
                for name in names:
                    left = int(np.isfinite(block[name][~keep]).sum())
                    repeated[name] = repeated.get(name, 0) + left
                writer.write({name: values[keep] for name, values in block.items()})
        writer.finish(asdict(metadata))
    return path, repeated


def _read_columns(parts: list[Part]) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the columns of several files side by side, a row group at a time."""
    files = [open_parquet(part.data) for part in parts]
    try:
        for group in range(files[0].num_row_groups):
            block: dict[str, NDArray[Any]] = {}
            for file in files:
                table = read_row_group(file, group)
                block |= {name: table.column(name).to_numpy() for name in table.column_names}
            yield block
    finally:
        for file in files:
            file.close()


def count_samples(
    path: Path, parts: list[Part], repeated: Mapping[str, int]
) -> dict[str, SampleCounts]:
    """Return how many samples of each column are used and left out, by reason (see `assemble`)."""
    file = pq.read_metadata(path)
    used = dict.fromkeys(file.schema.names, 0)
    for group in range(file.num_row_groups):
        for index, name in enumerate(file.schema.names):
            column = file.row_group(group).column(index)
            used[name] += column.num_values - column.statistics.null_count
    counts = {}
    for part in parts:
        for name, column in part.columns.items():
            count = SampleCounts(
                present=column.present,
                used=used[name],
                knocks=part.knocks.get(name, 0),
                interpolated=part.interpolated.get(name, 0),
                repeated=repeated.get(name, 0),
            )
            left_out = count.knocks + count.interpolated + count.repeated
            if count.present != count.used + left_out:
                raise RuntimeError(f"samples were lost or invented: {name} {count}")
            counts[name] = count
    return counts
