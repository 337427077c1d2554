"""Samples of a log and of its estimated models, before and after the fit, of about an hour.

Engers (2021, figures 34, 35, 38, 39, 44 and 50) compares them by eye. The model before the fit is
read from the curve, the model after it is the estimate. Both pass the estimated low-pass.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np

from imubench_pipeline.estimators.rows import read_estimates
from imubench_pipeline.model.estimates import LowPassRow, ModelSampleRow, TemperatureRow
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings import overview
from imubench_pipeline.recordings.kept import load_static_logs
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift, before_the_filter
from imubench_pipeline.simulate.simulation import Signal, simulate_blocks
from imubench_pipeline.tables.files import read
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array

STRETCH = 1.0  # length of the section in which every sample is shown, s
MAX_SAMPLES = 1_500_000  # max. number of compared samples of each; three sensors take 8 s.

_TEMPERATURE_AVERAGING_TIME = 100.0  # averaging time of temperature readings, s


def simulate_samples_of_models(
    folder: Path, sensor: str, recording: str, seed: int
) -> Iterator[ModelSampleRow]:
    """Yield the rows of the table ``samples_of_models``; none for a rejected recording."""
    logs = load_static_logs(folder)
    if not logs:
        return
    low_pass = {
        row.channel: LowPass(row.value, row.order)
        for row in LowPassRow.rows_of(read("low_pass", [folder / "low_pass.parquet"]))
        if row.parameter == "cutoff" and row.value is not None and row.order is not None
    }
    thermal = TemperatureRow.rows_of(read("temperature", [folder / "temperature.parquet"]))
    by_method = {
        channel: {estimate.method: estimate.model for estimate in own}
        for channel, own in read_estimates(folder / "parameters.parquet").items()
    }
    for channel, log in logs.items():
        key = Key(sensor, recording, channel)
        followed = {row.parameter: row for row in thermal if row.channel == channel}
        samples = min(log.grid, MAX_SAMPLES)
        yield from _rows(key, "log", log.rate, samples, log.blocks())
        plain = SensorModel(low_pass=low_pass.get(channel), bias=log.mean())
        models = by_method.get(channel, {})
        warm = bool(followed) and followed["sensitivity"].compensated
        after = models.get("compensated" if warm else "likelihood")
        for of, noise in (("before", models.get("curve")), ("after", after)):
            if noise is None:
                continue
            noise = before_the_filter(plain, noise, log.rate)
            model = replace(plain, noise=noise)
            temperature = None
            if of == "after" and warm:
                model, temperature = _warmed(model, followed, log)
            rng = channel_rng(seed, repr(noise), channel, f"samples {of}")
            blocks = simulate_blocks(model, log.rate, samples, rng, temperature=temperature)
            yield from _rows(key, of, log.rate, samples, blocks)


def _warmed(
    model: SensorModel, rows: Mapping[str, TemperatureRow], log: ChannelLog
) -> tuple[SensorModel, Signal]:
    """Return a model with its temperature effect, and the temperature of the log."""
    value = {name: row.fitted if row.value is None else row.value for name, row in rows.items()}
    reference, bias = value["T_0"], value.get("bias")
    assert reference is not None  # the mean temperature is never unknown
    drift = TemperatureDrift(
        sensitivity=value["sensitivity"] or 0.0,
        reference=reference,
        quadratic=value["quadratic"] or 0.0,
        lag=value["lag"] or 0.0,
    )
    warmed = replace(model, bias=model.bias if bias is None else bias, drift=drift)
    readings = np.concatenate([*log.temperatures()])
    size = max(round(_TEMPERATURE_AVERAGING_TIME * log.rate), 1)
    at, means = [], []
    for start in range(0, len(readings), size):
        part = readings[start : start + size]
        present = part[np.isfinite(part)]
        if len(present):
            at.append(start + 0.5 * len(part))
            means.append(float(present.mean()))
    return warmed, lambda start, stop: np.interp(np.arange(start, stop), at, means)


def _rows(
    key: Key, of: str, rate: float, samples: int, blocks: Iterable[Array]
) -> Iterator[ModelSampleRow]:
    """Yield the deviation of the samples, the samples of a section, and the envelope."""
    row = partial(ModelSampleRow, **asdict(key), of=of)
    edges = overview.bucket_edges(samples, overview.BUCKETS)
    figures = overview.no_figures(edges)
    stretch = round(STRETCH * rate)
    parts: list[Array] = []
    squares, reached, first = 0.0, 0, math.nan
    for block in blocks:
        block = np.ascontiguousarray(block[: samples - reached])
        overview.gather(block, reached, edges, figures)
        if reached < stretch:
            parts.append(block[: stretch - reached])
        present = block[np.isfinite(block)]
        if math.isnan(first) and len(present):
            first = float(present[0])
        squares += float(np.sum((present - first) ** 2))
        reached += len(block)
        if reached == samples:
            break
    number, total = figures[:, overview.PRESENT].sum(), figures[:, overview.TOTAL].sum()
    deviation = math.sqrt(max(squares / number - (total / number - first) ** 2, 0.0))
    yield row(what="deviation", start=0.0, end=samples / rate, mean=deviation)
    for k, value in enumerate(np.concatenate(parts).tolist()):
        mean = None if math.isnan(value) else value
        yield row(what="stretch", start=k / rate, end=(k + 1) / rate, mean=mean)
    for seen in overview.envelope_rows(key, edges / rate, figures):
        span = partial(row, what="envelope", start=seen.start, end=seen.end)
        yield span(low=seen.low, high=seen.high, mean=seen.mean)
