"""The Earth's rate of one recording, from what a run keeps of it and of its sensor."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.experiments.earth_rate.published import RunDesign, published_row
from imubench_pipeline.recordings.kept import kept_logs
from imubench_pipeline.recordings.recording import read_metadata
from imubench_pipeline.settings.config import EarthRateSettings
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.settings.two_position import TwoPosition
from imubench_pipeline.simulate.models import axis_model
from imubench_pipeline.steps.noise_source import noise_source
from imubench_pipeline.steps.turned import WHOLE, earth_rate_of, unusable
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.tables.of_experiments import EARTH_RATE_TABLES
from imubench_pipeline.typing import Row
from imubench_pipeline.units import quantity_to_si


def earth_rate_tables(
    folder: Path, static: Sequence[Path], sensor: str, recording: str, settings: str
) -> dict[str, list[Row]]:
    """Return the rows of the tables of a gyro that was turned.

    Parameters
    ----------
    folder : Path
        Of the recording, with ``quality.json`` and ``log.parquet``.
    static : sequence of Path
        Folders of the static recordings of the same sensor.
    sensor, recording : str
    settings : str
        As `imubench_pipeline.run.plan.Plan.earth_rate_settings` gives them.

    Returns
    -------
    dict
        By table; no rows of a rejected recording.
    """
    rows: dict[str, list[Row]] = {name: [] for name in EARTH_RATE_TABLES}
    sections = json.loads(settings)
    simulated = (
        SimulatedRecording.model_validate(sections["simulated"])
        if "simulated" in sections
        else None
    )
    logs = kept_logs(folder)
    if not logs:
        return rows
    if simulated is not None and simulated.two_position is not None:
        declared = simulated.two_position.declared
    else:
        declared = TwoPosition.model_validate(sections["two_position"])
    metadata = read_metadata(next(iter(logs.values())).path)
    channel = declared.turned([*logs, *metadata["unusable"]])
    key = Key(sensor, recording, channel)
    if channel not in logs:
        rows["earth_rate"] = list(unusable(asdict(key), declared))
        return rows
    how = EarthRateSettings.model_validate(sections["earth_rate"])
    source = noise_source(folder, static, key, Sensor.model_validate(sections["sensor"]), how.draws)
    begins = metadata.get("begins", 0.0)
    rows |= asdict(earth_rate_of(key, logs[channel], declared, source, how, begins=begins))
    if simulated is not None:
        rows["earth_rate_published"] = list(_published(key, simulated, rows["earth_rate"]))
    return rows


def _published(key: Key, simulated: SimulatedRecording, estimates: Sequence[Row]) -> Iterator[Row]:
    """Yield what the source of a simulated recording prints, beside what is found of it."""
    turns = simulated.two_position
    if turns is None:
        return
    rate = quantity_to_si(simulated.rate, "frequency")
    schedule = RunDesign(turns.seconds("dwell"), turns.seconds("turning"), rate, turns.latitude_si)
    (noise,) = (
        axis_model(axis, name).noise
        for name, axis in simulated.channels.items()
        if name == key.channel
    )
    values = {(row["part"], row["method"]): row.get("value") for row in estimates}
    for figure in turns.published:
        part = figure.part
        text = simulated.duration if part == WHOLE else part.removeprefix("last ")
        value = quantity_to_si(figure.printed, "angular_rate")
        yield (
            asdict(key)
            | {"part": part, "place": figure.where, "printed": figure.printed}
            | published_row(value, schedule, quantity_to_si(text, "time"), noise)
            | {
                "simulated": values.get((part, "pairs")),
                "simulated_filter": values.get((part, "filter")),
                "assumed": ", ".join(turns.assumed) or None,
            }
        )
