"""Compute the Allan variance of every channel of a recording, and read it back."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import pyarrow as pa
from numpy.typing import ArrayLike

from imubench_pipeline.allan import AllanCurve, cluster_sizes, of_blocks, of_phase
from imubench_pipeline.allan.phase import NO_GAPS, count_gaps, integrate
from imubench_pipeline.estimators.rows import make_allan_rows
from imubench_pipeline.model.estimates import AllanRow
from imubench_pipeline.recordings.kept import load_static_logs
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.config import AllanSettings
from imubench_pipeline.tables.files import read
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.tables.keys import Key, split_table
from imubench_pipeline.words.findings.samples import TooShort


def report_too_sparse(channel: str, log: ChannelLog) -> Finding:
    """Return the finding that a channel is too short, or has too many gaps, for estimates."""
    return find(TooShort(log.grid, rate=log.rate), "fatal", log.grid, channel)


def yield_allan_rows(
    folder: Path, sensor: str, recording: str, settings: AllanSettings
) -> Iterator[AllanRow]:
    """Yield the rows of the table ``allan``; none for a rejected recording."""
    for channel, log in load_static_logs(folder).items():
        yield from make_allan_rows(
            Key(sensor, recording, channel), compute_channel_curve(log, settings)
        )


def compute_channel_curve(log: ChannelLog, settings: AllanSettings) -> AllanCurve:
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
    """Return the Allan variance of a channel; the number of threads changes no bit of it."""
    blocks, holes, segments = log.blocks(), log.holes, log.segments
    gaps = count_gaps(log.blocks()) if holes else NO_GAPS
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


def read_curves(path: Path, samples: Mapping[str, int]) -> dict[str, AllanCurve]:
    """Read the Allan variances of a recording by channel; `samples`: their lengths with gaps."""
    return {
        channel: AllanCurve(
            tau=table["tau"].to_numpy(),
            cluster_size=table["cluster_size"].to_numpy(),
            variance=table["adev"].to_numpy() ** 2,
            samples=samples[channel],
            exponent=table["exponent"].to_numpy(),
            averaged=table["averaged"].to_numpy(),
            share=table["share"].to_numpy(),
            **_read_degrees(table),
        )
        for (channel,), table in split_table(read("allan", [path]), "channel").items()
    }


def _read_degrees(table: pa.Table) -> dict[str, Any]:
    return {
        "edf": table["edf"].to_numpy(),
        "edf_upper": table["edf_upper"].to_numpy(),
        "edf_source": tuple(table["edf_source"].to_pylist()),
    }


def read_compensated_curves(
    path: Path, measured: Mapping[str, AllanCurve]
) -> dict[str, AllanCurve]:
    """Read the curves of ``allan_compensated`` by channel; `measured`: the uncompensated curves."""
    return {
        channel: replace(
            measured[channel], variance=table["adev"].to_numpy() ** 2, **_read_degrees(table)
        )
        for (channel,), table in split_table(read("allan_compensated", [path]), "channel").items()
    }
