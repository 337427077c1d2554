"""The calibration of one recording, from what a run keeps of it and of its sensor."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from imubench_pipeline.recordings.kept import kept_logs
from imubench_pipeline.recordings.recording import read_metadata
from imubench_pipeline.settings.known_rates import AtRest, OnRateTable
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.steps.known_rates import GyroLog, at_rest, on_rate_table, unusable
from imubench_pipeline.steps.noise_source import noise_source
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.tables.of_experiments import CALIBRATION_TABLES
from imubench_pipeline.typing import Row
from imubench_pipeline.units import quantity_to_si


def calibration_tables(
    folder: Path, static: Sequence[Path], sensor: str, recording: str, settings: str
) -> dict[str, list[Row]]:
    """Return the rows of the tables of a gyro on a rate table, or at rest where it points known.

    Parameters
    ----------
    folder : Path
        Of the recording, with ``quality.json`` and ``log.parquet``.
    static : sequence of Path
        Folders of the static recordings of the same sensor.
    sensor, recording : str
    settings : str
        As `imubench_pipeline.run.plan.Plan.experiment_settings` gives them.

    Returns
    -------
    dict
        By table; no rows of a rejected recording.
    """
    rows: dict[str, list[Row]] = {name: [] for name in CALIBRATION_TABLES}
    logs = kept_logs(folder)
    if not logs:
        return rows
    sections = json.loads(settings)
    declared, simulated = _declared(sections)
    # Of several gyros the notes name one: the ingest has seen to it.
    metadata = read_metadata(next(iter(logs.values())).path)
    gyros = (name for name in [*logs, *metadata["unusable"]] if name.startswith("gyro_"))
    channel: str = declared.channel or next(gyros)
    key = Key(sensor, recording, channel)
    if channel not in logs:
        rows["calibration"] = list(unusable(asdict(key), isinstance(declared, OnRateTable)))
        return rows
    log = GyroLog(
        key,
        logs[channel],
        noise_source(folder, static, key, Sensor.model_validate(sections["sensor"])),
        metadata.get("begins", 0.0),
        _truth(simulated, channel),
    )
    if isinstance(declared, OnRateTable):
        return rows | asdict(on_rate_table(log, declared))
    return rows | asdict(at_rest(log, declared))


def _declared(
    sections: Mapping[str, Any],
) -> tuple[OnRateTable | AtRest, SimulatedRecording | None]:
    """Return what stands beside a log, or would stand beside a simulated one."""
    if "simulated" not in sections:
        if "rate_table" in sections:
            return OnRateTable.model_validate(sections["rate_table"]), None
        return AtRest.model_validate(sections["pointing"]), None
    simulated = SimulatedRecording.model_validate(sections["simulated"])
    if simulated.rate_table is not None:
        return simulated.rate_table.declared, simulated
    assert simulated.pointing is not None  # only recordings with one of both are calibrated
    return simulated.pointing.declared, simulated


def _truth(simulated: SimulatedRecording | None, channel: str) -> dict[str, float]:
    """Return the true figures of a simulation: its bias, and what it has of a line."""
    if simulated is None:
        return {}
    truth = {}
    for name, axis in simulated.channels.items():
        if name == channel and axis.bias is not None:
            truth["bias"] = quantity_to_si(axis.bias, "angular_rate")
    if simulated.rate_table is not None:
        truth |= {"scale_factor": simulated.rate_table.scale_factor}
        truth |= {"quadratic": 0.0, "asymmetry": 0.0}
    return truth
