"""Recordings as the ingest keeps them, for tests that begin after it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from imubench_pipeline.allan import AllanCurve, of_blocks
from imubench_pipeline.recordings.recording import ChannelLog, LogWriter, open_channel_logs

_ROWS = 7001  # of a block: no divisor of anything


def kept(
    folder: Path, columns: Mapping[str, np.ndarray], rate: float, *, holes: bool = False
) -> dict[str, ChannelLog]:
    """Write a recording of one segment, block by block, and return its channels."""
    folder.mkdir(parents=True, exist_ok=True)
    samples = len(next(iter(columns.values())))
    with LogWriter(folder / "log.parquet", dict.fromkeys(columns, pa.float64())) as writer:
        for start in range(0, samples, _ROWS):
            writer.write({name: values[start : start + _ROWS] for name, values in columns.items()})
        writer.finish(
            {
                "rate": rate,
                "grid": samples,
                "segments": [[0, samples]],
                "holes": dict.fromkeys(columns, holes),
                "unusable": [],
            }
        )
    return open_channel_logs(folder)


def curve_of(log: ChannelLog) -> AllanCurve:
    return of_blocks(log.blocks(), log.grid, log.rate, holes=log.holes, segments=log.segments)
