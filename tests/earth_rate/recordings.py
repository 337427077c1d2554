"""Recordings as a run keeps them, of a gyro that is turned and of the same at rest."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.earth_rate.earth_rotation import make_earth_rate_tables
from imubench_pipeline.extensions.earth_rate.settings import EarthRateSettings
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.recordings.kept import Quality, identify_files
from imubench_pipeline.recordings.recording import LogWriter, list_log_files
from imubench_pipeline.tables.files import write
from imubench_pipeline.tables.keys import Key
from tests.earth_rate.runs import PAPER, RATE, turned
from tests.rows import typed

SENSOR: dict[str, Any] = {
    "vendor": "V",
    "model": "s",
    "log": {"rate": "32 Hz", "channels": {"gyro_x": {"column": 1, "unit": "deg/s"}}},
}
PRINTED = {"gyro": {"noise_density": {"value": 0.0122, "unit": "deg/s/sqrt(Hz)",
                                      "sidedness": "two-sided", "kind": "typ"}}}  # fmt: skip
DECLARED = {"latitude": "0 deg", "dwell": "30 s", "turning": "1.5 s", "first": "north"}
EVERY_30 = [29.0 + 30.0 * k for k in range(19)]


def put(folder: Path, columns: dict[str, np.ndarray], **about: Any) -> Path:
    """Keep a recording in a folder, whose name is its name."""
    unusable = about.pop("unusable", [])
    row = {"sensor": "s", "device": "7", "recording": folder.name, "kind": "two_position",
           "simulated": False, "status": "ok", "rate": RATE} | about  # fmt: skip
    samples = len(next(iter(columns.values())))
    row["duration"] = row.get("duration", samples / RATE)
    folder.mkdir(parents=True)
    with LogWriter(folder / "log.parquet", dict.fromkeys(columns, pa.float64())) as log:
        log.write(columns)
        log.finish(
            {
                "kind": row["kind"],
                "rate": RATE,
                "begins": about.get("begins", 0.0),
                "grid": samples,
                "segments": about.pop("segments", [[0, samples]]),
                "holes": {},
                "unusable": unusable,
            }
        )
    for name in ("segments", "begins"):
        row.pop(name, None)
    kept = identify_files(list_log_files(folder))
    Quality(*typed(RecordingRow, [row]), [], {}, kept).write(folder / "quality.json")
    return folder


def put_at_rest(
    folder: Path, model: NoiseModel = PAPER, *, channel: str = "gyro_x", **about: Any
) -> Path:
    """Keep what a run says of a static recording: its estimates, and no samples to speak of."""
    put(folder, {channel: np.zeros(3)}, **{"kind": "static", "duration": 3600.0} | about)
    known = {name: Parameter(getattr(model, name)) for name in ("N", "B", "T_B", "K")}
    known = {name: one for name, one in known.items() if one.value}
    key = Key("s", folder.name, channel)
    rows = [
        row
        for method in ("likelihood", "likelihood_gm")
        for row in make_parameter_rows(
            key, Estimate(method, known), recommended=method == "likelihood"
        )
    ]
    write("parameters", rows, folder / "parameters.parquet")
    write("draws", [], folder / "draws.parquet")
    return folder


def run(
    folder: Path,
    static: list[Path],
    *,
    sensor: dict[str, Any] | None = None,
    asked: dict[str, Any] | None = None,
    **declared: Any,
) -> dict[str, list[dict[str, Any]]]:
    """What a run finds in a kept recording."""
    settings = {
        "earth_rate": EarthRateSettings(**asked or {}).model_dump(mode="json"),
        "sensor": SENSOR if sensor is None else sensor,
        "two_position": DECLARED | declared,
    }
    found = make_earth_rate_tables(folder, static, "s", folder.name, json.dumps(settings))
    return {name: [dict(row) for row in rows] for name, rows in found.items()}


def turned_log(seed: int = 1, **how: Any) -> dict[str, np.ndarray]:
    """Ten minutes of a gyro that is turned every 30 s."""
    return {"gyro_x": turned(EVERY_30, 600.0, seed=seed, **how)}
