"""A real log in SI, into which the mistakes that users make are built."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pyarrow.csv as pacsv

from imubench_pipeline.recordings.quality.columns import check_columns
from imubench_pipeline.recordings.quality.copies import find_copied_channels
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.tables.findings import Finding

Log = dict[str, np.ndarray]

RATE = 100.0
SAMPLES = 120_000
UNITS = {"gyro": np.radians(1.0), "accel": 9.80665}


@cache
def _adis16405(path: Path) -> Log:
    table = pacsv.read_csv(path)
    return {
        name: table[name].to_numpy()[:SAMPLES] * UNITS[name.split("_")[0]]
        for name in table.column_names
    }


def adis16405(shared: Path) -> Log:
    """Return the first 1200 s of a log of an ADIS16405, a copy of its own."""
    log = _adis16405(shared / "logs/adis16405/imu1.csv.gz")
    return {name: values.copy() for name, values in log.items()}


def findings(log: Log, rate: float = RATE) -> list[Finding]:
    """Return what the channels tell, one by one and together."""
    columns = {}
    for name, values in log.items():
        columns[name] = ColumnSummary()
        for piece in np.array_split(values, 7):
            columns[name].add(piece)
    found = check_columns(columns, rate, QualitySettings())
    return [*found, *find_copied_channels(columns)]


def warnings(log: Log) -> list[tuple[str, str | None]]:
    """Return name and channel of the findings that are more than notes."""
    return [(f.finding, f.channel) for f in findings(log) if f.severity != "note"]
