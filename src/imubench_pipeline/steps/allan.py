"""Compute the Allan variance of every channel of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.allan import cluster_sizes, of_blocks, of_phase
from imubench_pipeline.allan.phase import integrate
from imubench_pipeline.estimators.rows import allan_rows
from imubench_pipeline.recordings.kept import kept_static_logs
from imubench_pipeline.settings.config import AllanSettings
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Row


def curves(folder: Path, sensor: str, recording: str, settings: AllanSettings) -> Iterator[Row]:
    """Yield the rows of the table ``allan``; none of a rejected recording."""
    for channel, log in kept_static_logs(folder).items():
        sizes = cluster_sizes(log.grid, per_decade=settings.per_decade, longest=settings.longest)
        blocks, holes, segments = log.blocks(), log.holes, log.segments
        if settings.overlap == "octave":
            curve = of_blocks(blocks, log.grid, log.rate, sizes, holes=holes, segments=segments)
        else:
            phase = integrate(blocks, log.grid, holes=holes, segments=segments)
            curve = of_phase(phase, log.rate, sizes)
        yield from allan_rows(Key(sensor, recording, channel), curve)
