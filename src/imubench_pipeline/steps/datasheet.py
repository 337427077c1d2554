"""Compare the estimates of a recording, and its fixed bias, with its sensor's datasheet."""

import json
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from imubench_pipeline.datasheets.comparable import SENSITIVITY, read_comparables
from imubench_pipeline.datasheets.deltas import bias_deltas, compute_sensitivity, curve_rms, deltas
from imubench_pipeline.estimators.rows import read_estimates
from imubench_pipeline.model.comparisons import DatasheetCurveRow, DatasheetRow
from imubench_pipeline.model.estimates import FixedBiasRow, TemperatureRow
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.steps.allan import read_curves
from imubench_pipeline.tables.files import read


def compare_with_datasheet(
    folder: Path, sensor: str, recording: str, settings: str
) -> dict[str, list[Any]]:
    """Return the rows of ``datasheet`` and ``datasheet_curve``; none for a rejected recording."""
    quality = Quality.read(folder / "quality.json")
    measured = read_curves(folder / "allan.parquet", quality.grids)
    temperatures = [quality.recording.temperature_min, quality.recording.temperature_max]
    thermal = TemperatureRow.rows_of(read("temperature", [folder / "temperature.parquet"]))
    biases = FixedBiasRow.rows_of(read("fixed_bias", [folder / "fixed_bias.parquet"]))
    means = {row.channel: row.value for row in biases}
    sections = json.loads(settings)
    datasheet, tolerance = Datasheet.model_validate(sections["datasheet"]), sections["tolerance"]
    rows, of_curves = list[DatasheetRow](), list[DatasheetCurveRow]()
    for channel, by_method in read_estimates(folder / "parameters.parquet").items():
        row = partial(DatasheetRow, sensor=sensor, recording=recording, channel=channel)
        curve = measured[channel]
        tau = curve.tau[curve.cluster_size <= sections["longest"] * curve.samples]
        for estimate in by_method:
            for delta in deltas(datasheet, channel, estimate, tau, tolerance):
                rows.append(row(method=estimate.method, **asdict(delta)))
        own = compute_sensitivity([row for row in thermal if row.channel == channel], *temperatures)
        for delta in bias_deltas(datasheet, channel, means, tolerance, own):
            method = "temperature" if delta.statistic == SENSITIVITY else "mean"
            rows.append(row(method=method, **asdict(delta)))
    for channel, curve in measured.items():
        printed = list(read_comparables(datasheet, channel))
        above_zero = curve.deviation > 0.0  # 0 at multiples of the period of a periodic log
        tau, deviation = curve.tau[above_zero], curve.deviation[above_zero]
        for distance in curve_rms(printed, tau, deviation) if above_zero.any() else ():
            names: dict[str, Any] = {"sensor": sensor, "recording": recording, "channel": channel}
            of_curves.append(DatasheetCurveRow(**names, **asdict(distance)))
    return {"datasheet": rows, "datasheet_curve": of_curves}
