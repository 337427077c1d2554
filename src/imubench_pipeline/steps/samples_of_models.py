"""Samples of a log beside samples of the models that were found of it, before and after the fit.

001 figures 34, 35, 38, 39, 44 and 50 compare them by eye. Before the fit is what the curve reads,
after it the estimate, with what temperature does where that is taken out of the log; both are
behind the low-pass that was found. The first samples of each are compared, an hour or so.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from imubench_pipeline.estimators.rows import estimates
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings.kept import kept_static_logs
from imubench_pipeline.recordings.overview import (
    BUCKETS,
    PRESENT,
    TOTAL,
    bucket_edges,
    envelope_rows,
    gather,
    no_figures,
)
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift, before_the_filter
from imubench_pipeline.simulate.simulation import Signal, simulate_blocks
from imubench_pipeline.tables import read
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array, Row

STRETCH = 1.0
"""Length of the stretch of which every sample is shown, s."""

MOST = 1_500_000
"""Samples of each that are compared: those of three sensors take 8 s."""

_SPAN = ("start", "end", "low", "high", "mean")

_SMOOTHED = 100.0
"""Time over which readings of the temperature are averaged, s."""


def samples_of_models(folder: Path, sensor: str, recording: str, seed: int) -> Iterator[Row]:
    """Yield the rows of the table ``samples_of_models``; none of a rejected recording.

    Parameters
    ----------
    folder : Path
        Of the recording.
    sensor, recording : str
    seed : int
        Each channel and model has a stream of its own.
    """
    logs = kept_static_logs(folder)
    if not logs:
        return
    tables = {
        name: _by_channel(read(name, [folder / f"{name}.parquet"]).to_pylist())
        for name in ("low_pass", "temperature", "fixed_bias")
    }
    by_method = {
        channel: {estimate.method: estimate.model for estimate in own}
        for channel, own in estimates(folder / "parameters.parquet").items()
    }
    for channel, log in logs.items():
        key = Key(sensor, recording, channel)
        known = {name: rows.get(channel, {}) for name, rows in tables.items()}
        samples = min(log.grid, MOST)
        yield from _rows(key, "log", log.rate, samples, log.blocks())
        plain = SensorModel(low_pass=_low_pass(known["low_pass"]), bias=log.mean())
        models = by_method.get(channel, {})
        warm = known["temperature"] and known["temperature"]["sensitivity"]["compensated"]
        after = models.get("compensated" if warm else "likelihood")
        for of, noise in (("before", models.get("curve")), ("after", after)):
            if noise is None:
                continue
            noise = before_the_filter(plain, noise, log.rate)
            model = SensorModel(noise=noise, low_pass=plain.low_pass, bias=plain.bias)
            temperature = None
            if of == "after" and warm:
                model, temperature = _warmed(model, known["temperature"], log)
            rng = channel_rng(seed, repr(noise), channel, f"samples {of}")
            blocks = simulate_blocks(model, log.rate, samples, rng, temperature=temperature)
            yield from _rows(key, of, log.rate, samples, blocks)


def _by_channel(rows: Iterable[Row]) -> dict[str, dict[str, Row]]:
    found: dict[str, dict[str, Row]] = {}
    for row in rows:
        found.setdefault(row["channel"], {})[row.get("parameter", "bias")] = row
    return found


def _low_pass(rows: Mapping[str, Row]) -> LowPass | None:
    cutoff = rows.get("cutoff")
    if cutoff is None or cutoff["value"] is None:
        return None
    return LowPass(cutoff["value"], cutoff["order"])


def _warmed(
    model: SensorModel, rows: Mapping[str, Row], log: ChannelLog
) -> tuple[SensorModel, Signal]:
    """Return a model with its drift with temperature, and the temperature of the log."""
    value = {
        name: row["fitted"] if row["value"] is None else row["value"] for name, row in rows.items()
    }
    drift = TemperatureDrift(
        sensitivity=value["sensitivity"] or 0.0,
        reference=value["T_0"],
        quadratic=value["quadratic"] or 0.0,
        lag=value["lag"] or 0.0,
    )
    bias = model.bias if value.get("bias") is None else value["bias"]
    warmed = SensorModel(noise=model.noise, low_pass=model.low_pass, bias=bias, drift=drift)
    readings = np.concatenate([*log.temperatures()])
    size = max(round(_SMOOTHED * log.rate), 1)
    at, means = [], []
    for start in range(0, len(readings), size):
        part = readings[start : start + size]
        present = part[np.isfinite(part)]
        if len(present):
            at.append(start + 0.5 * len(part))
            means.append(float(present.mean()))
    return warmed, lambda start, stop: np.interp(np.arange(start, stop), at, means)


def _rows(key: Key, of: str, rate: float, samples: int, blocks: Iterable[Array]) -> Iterator[Row]:
    """Yield the deviation of the samples, those of a stretch, and the envelope."""
    names = asdict(key) | {"of": of}
    edges = bucket_edges(samples, BUCKETS)
    figures = no_figures(edges)
    stretch = round(STRETCH * rate)
    parts: list[Array] = []
    squares, reached, first = 0.0, 0, math.nan
    for block in blocks:
        block = np.ascontiguousarray(block[: samples - reached])
        gather(block, reached, edges, figures)
        if reached < stretch:
            parts.append(block[: stretch - reached])
        present = block[np.isfinite(block)]
        if math.isnan(first) and len(present):
            first = float(present[0])
        squares += float(np.sum((present - first) ** 2))
        reached += len(block)
        if reached == samples:
            break
    number, total = figures[:, PRESENT].sum(), figures[:, TOTAL].sum()
    deviation = math.sqrt(max(squares / number - (total / number - first) ** 2, 0.0))
    yield names | {"what": "deviation", "start": 0.0, "end": samples / rate, "mean": deviation}
    for k, value in enumerate(np.concatenate(parts).tolist()):
        at = {"start": k / rate, "end": (k + 1) / rate}
        yield names | at | {"what": "stretch", "mean": None if math.isnan(value) else value}
    for row in envelope_rows(edges / rate, figures):
        yield names | {"what": "envelope"} | {name: row[name] for name in _SPAN}
