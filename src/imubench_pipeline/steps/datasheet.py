"""Compare the estimates of a recording, and its fixed bias, with its sensor's datasheet."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.datasheets.comparable import SENSITIVITY, comparables
from imubench_pipeline.datasheets.deltas import bias_deltas, curve_rms, deltas
from imubench_pipeline.datasheets.measured import sensitivity
from imubench_pipeline.estimators.rows import estimates
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.steps.kept_curves import curves
from imubench_pipeline.tables import read
from imubench_pipeline.typing import Row


def rows(folder: Path, sensor: str, recording: str, settings: str) -> Iterator[Row]:
    """Yield the rows of the table ``datasheet``; none of a rejected recording."""
    quality = Quality.read(folder / "quality.json")
    measured = curves(folder / "allan.parquet", quality.grids)
    temperatures = [quality.recording.get(f"temperature_{end}") for end in ("min", "max")]
    thermal = read("temperature", [folder / "temperature.parquet"]).to_pylist()
    biases = read("fixed_bias", [folder / "fixed_bias.parquet"]).to_pylist()
    means = {row["channel"]: row["value"] for row in biases}
    sections = json.loads(settings)
    datasheet, tolerance = Datasheet.model_validate(sections["datasheet"]), sections["tolerance"]
    for channel, by_method in estimates(folder / "parameters.parquet").items():
        tau = measured[channel].up_to(sections["longest"])
        names = {"sensor": sensor, "recording": recording, "channel": channel}
        for estimate in by_method:
            for delta in deltas(datasheet, channel, estimate, tau, tolerance):
                yield names | {"method": estimate.method} | asdict(delta)
        own = [row for row in thermal if row["channel"] == channel]
        for delta in bias_deltas(
            datasheet, channel, means, tolerance, sensitivity(own, *temperatures)
        ):
            method = "temperature" if delta.statistic == SENSITIVITY else "mean"
            yield names | {"method": method} | asdict(delta)


def curve_rows(folder: Path, sensor: str, recording: str, settings: str) -> Iterator[Row]:
    """Yield the rows of the table ``datasheet_curve``; none where a datasheet has no line."""
    measured = curves(folder / "allan.parquet", Quality.read(folder / "quality.json").grids)
    datasheet = Datasheet.model_validate(json.loads(settings)["datasheet"])
    for channel, curve in measured.items():
        names = {"sensor": sensor, "recording": recording, "channel": channel}
        printed = list(comparables(datasheet, channel))
        above_zero = curve.deviation > 0.0  # 0 at multiples of the period of a periodic log
        tau, deviation = curve.tau[above_zero], curve.deviation[above_zero]
        for distance in curve_rms(printed, tau, deviation) if above_zero.any() else ():
            yield names | {
                "sidedness": distance.noise.sidedness if distance.noise else None,
                "N": distance.noise.value if distance.noise else None,
                "floor": distance.floor.value if distance.floor else None,
                "rms": distance.rms,
                "rms_log10": distance.rms_log10,
            }
