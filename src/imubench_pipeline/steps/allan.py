"""Compute the Allan variance of every channel of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from numpy.typing import ArrayLike

from imubench_pipeline.allan import AllanCurve, cluster_sizes, of_blocks, of_phase
from imubench_pipeline.allan.phase import NO_GAPS, gaps_of, integrate
from imubench_pipeline.estimators.rows import allan_rows
from imubench_pipeline.model.estimates import AllanRow
from imubench_pipeline.recordings.kept import kept_static_logs
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.config import AllanSettings
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.words.findings.samples import TooShort


def too_sparse(channel: str, log: ChannelLog) -> Finding:
    """Return why a channel has no Allan variance, and so no estimates."""
    return find(TooShort(log.grid, rate=log.rate), "fatal", log.grid, channel)


def curves(
    folder: Path, sensor: str, recording: str, settings: AllanSettings
) -> Iterator[AllanRow]:
    """Yield the rows of the table ``allan``; none of a rejected recording."""
    for channel, log in kept_static_logs(folder).items():
        yield from allan_rows(Key(sensor, recording, channel), curve_of_channel(log, settings))


def curve_of_channel(log: ChannelLog, settings: AllanSettings) -> AllanCurve:
    """Return the Allan variance of a channel at the cluster sizes of the settings."""
    sizes = cluster_sizes(log.grid, per_decade=settings.per_decade, longest=settings.longest)
    return curve_of(log, sizes, settings.overlap)


def curve_of(
    log: ChannelLog,
    sizes: ArrayLike | None,
    overlap: Literal["full", "octave"],
    *,
    threads: int = 1,
) -> AllanCurve:
    """Return the Allan variance of a channel, with the same bits for any number of threads."""
    blocks, holes, segments = log.blocks(), log.holes, log.segments
    gaps = gaps_of(log.blocks()) if holes else NO_GAPS
    if overlap == "full":
        phase = integrate(blocks, log.grid, holes=holes, segments=segments)
        return of_phase(phase, log.rate, sizes, gaps=gaps, threads=threads)
    return of_blocks(
        blocks,
        log.grid,
        log.rate,
        sizes,
        holes=holes,
        gaps=gaps,
        segments=segments,
        threads=threads,
    )
