"""Recordings as a run keeps them, of a gyro on a rate table and of one at rest."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.calibration import make_calibration_tables
from imubench_pipeline.extensions.earth_rate.settings import EarthRateSettings
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.earth_rate.recordings import SENSOR
from tests.earth_rate.runs import PAPER, RATE

BIAS = math.radians(0.3)
SCALE = 1.002
DEGREES = (0.0, 10.0, -10.0, 50.0, -50.0, 0.0)
STEPS: list[dict[str, Any]] = [
    {"start": f"{70 * k} s", "end": f"{70 * k + 60} s", "rate": f"{rate} deg/s"}
    for k, rate in enumerate(DEGREES)
]
UP = {"latitude": "45 deg", "elevation": "90 deg"}
Rows = list[dict[str, Any]]


def true_rates(extra: float = 0.0) -> np.ndarray:
    """Rate of the table at each sample, rad/s; it goes straight from one to the next."""
    times = [70.0 * k + part for k in range(len(DEGREES)) for part in (0.0, 60.0)]
    return np.interp(
        np.arange(round((410.0 + extra) * RATE)) / RATE, times, np.repeat(np.radians(DEGREES), 2)
    )


def on_table(seed: int = 1, *, model: NoiseModel = PAPER, scale: float = SCALE) -> np.ndarray:
    """Seven minutes of a gyro whose axis and the table's are vertical, at 45 degrees."""
    true = true_rates() + EARTH_RATE * math.sin(math.radians(45.0))
    noise = simulate(model, RATE, len(true), np.random.default_rng(seed))
    return np.asarray(noise + BIAS + scale * true)


def at_rest(rate: float, seed: int = 1, *, seconds: float = 600.0) -> np.ndarray:
    """A gyro that stands still and senses a constant rate, rad/s."""
    samples = round(seconds * RATE)
    noise = simulate(PAPER, RATE, samples, np.random.default_rng(seed))
    return np.asarray(noise + BIAS + rate)


def run(
    folder: Path, static: list[Path], sensor: dict[str, Any] | None = None, **declared: Any
) -> dict[str, Rows]:
    """What a run finds in a kept recording."""
    settings = {
        "earth_rate": EarthRateSettings().model_dump(mode="json"),
        "sensor": SENSOR if sensor is None else sensor,
    } | declared
    found = make_calibration_tables(folder, static, "s", folder.name, json.dumps(settings))
    return {name: [dict(row) for row in rows] for name, rows in found.items()}


def by_parameter(rows: Rows) -> dict[str, dict[str, Any]]:
    """The rows of the table ``calibration``, by parameter and status."""
    return {row["parameter"]: row for row in rows}
