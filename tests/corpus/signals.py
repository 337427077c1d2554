"""The samples that the corpus is written from: a sensor at rest, and how its log is described."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

RATE = 100
ROWS = 1000
LONG = 6000
"""Records of a log, and of one whose blocks tell steps and knocks."""

GRAVITY = 9.80665
EPOCH = 1_700_000_000
"""s since 1970."""

WX = {"column": "wx", "unit": "rad/s"}
AZ = {"column": "az", "unit": "m/s^2"}
TIME = {"column": "t", "unit": "s"}
TWO: dict[str, Any] = {"gyro_x": WX, "accel_z": AZ}
STAMPED: dict[str, Any] = {"time": TIME, "channels": TWO}
UNSTAMPED: dict[str, Any] = {"rate": f"{RATE} Hz", "channels": TWO}
PLACED: dict[str, Any] = {
    "rate": f"{RATE} Hz",
    "channels": {
        "gyro_x": {"column": 1, "unit": "rad/s"},
        "accel_z": {"column": 2, "unit": "m/s^2"},
    },
}
"""Channels by their positions, in a log without a header."""

MATRIX: dict[str, Any] = {
    "time": {"column": 1, "unit": "s"},
    "channels": {
        "gyro_x": {"column": 2, "unit": "rad/s"},
        "accel_z": {"column": 3, "unit": "m/s^2"},
    },
}
"""Channels by their columns in a matrix."""


def rest(rows: int = ROWS) -> dict[str, Array]:
    """Return time in s, angular rate in rad/s and acceleration in m/s² of a sensor at rest."""
    rng = np.random.default_rng(7)
    return {
        "t": np.arange(rows) / RATE,
        "wx": np.round(1e-3 * rng.standard_normal(rows), 7),
        "az": np.round(GRAVITY + 1e-2 * rng.standard_normal(rows), 5),
    }


def text(columns: Mapping[str, Array], delimiter: str = ",", header: bool = True) -> str:
    """Return columns as lines of text, each figure in the digits that it needs."""
    lines = [delimiter.join(columns)] if header else []
    for row in np.column_stack(list(columns.values())).tolist():
        lines.append(repr(row)[1:-1].replace(", ", delimiter))
    return "\n".join(lines) + "\n"


def log(rows: int = ROWS, **columns: Array) -> str:
    """Return the text of a log at rest, with other columns in place of its own."""
    return text(rest(rows) | columns)


def matrix(rows: int = ROWS) -> Array:
    """Return time and the samples of a log at rest as columns."""
    return np.column_stack(list(rest(rows).values()))
