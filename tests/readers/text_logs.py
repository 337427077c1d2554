"""What the tests of text logs share: a log format, a written file, and what is read of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from imubench_pipeline.readers import read
from imubench_pipeline.settings.sensor import LogFormat

TWO = {
    "gyro_x": {"column": "wx", "unit": "rad/s"},
    "accel_x": {"column": "ax", "unit": "m/s^2"},
}
PLACED = {
    "gyro_x": {"column": 1, "unit": "rad/s"},
    "accel_x": {"column": 2, "unit": "m/s^2"},
}


def log_format(channels: dict[str, Any] | None = None, **keys: Any) -> LogFormat:
    given = {"rate": None if "time" in keys else "100 Hz"} | keys
    return LogFormat.model_validate({"channels": channels or TWO} | given)


def columns(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], np.ndarray | None, Any]:
    (file,) = read(path, log)
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in file.sources}
    times = [b.time for b in batches if b.time is not None]
    return joined, np.concatenate(times) if times else None, file


def written(tmp_path: Path, text: str | bytes, name: str = "a.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path
