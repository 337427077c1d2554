"""The exports of programs and phones: Xsens MT Manager, phyphox, Sensor Logger."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.corpus.entry import Entry, Rejected, archive, file, folder_of, kept, part
from tests.corpus.signals import ROWS, rest
from tests.readers.test_phone import channels, phyphox, sensor_logger
from tests.readers.test_xsens import CHANNELS, COUNTER, SHORT, TICKS, export


def axes(noise: float, seed: int) -> np.ndarray:
    """Return time and the samples of three axes at rest."""
    figures = noise * np.random.default_rng(seed).standard_normal((ROWS, 3))
    figures[:, 2] += 9.8 * (noise > 5e-3)
    return np.column_stack([rest()["t"], np.round(figures, 6)])


GYRO, ACCEL = axes(1e-3, 1), axes(1e-2, 2)
COUNTS = np.arange(65_000, 65_000 + ROWS)
DATA = np.hstack([ACCEL[:, 1:], GYRO[:, 1:]])
XSENS = export(SHORT, "\t", COUNTS, DATA)
MT_MANAGER: dict[str, Any] = {"rate": "100 Hz", "time": COUNTER, "channels": CHANNELS}

PHYPHOX = phyphox(GYRO, ACCEL)
PHYPHOX_LOG: dict[str, Any] = {
    "time": {"column": "Time (s)", "unit": "s"},
    "channels": channels(
        {"gyro": "Gyroscope.csv", "accel": "Accelerometer.csv"}, "{title} {axis} ({unit})"
    ),
}
LOGGER = sensor_logger(GYRO, ACCEL)
LOGGER_LOG: dict[str, Any] = {
    "time": {"column": "time", "unit": "ns"},
    "channels": channels({"gyro": "Gyroscope.csv", "accel": "TotalAcceleration.csv"}, "{axis}"),
}


def without(files: dict[str, str], name: str) -> dict[str, str]:
    return {key: text for key, text in files.items() if key != name}


def lines_without(text: str, *numbers: int) -> str:
    return "".join(
        line for number, line in enumerate(text.splitlines(True)) if number not in numbers
    )


TEXTS = [
    Entry("xsens", file(XSENS, "MT_1.txt"), MT_MANAGER, kept(ROWS)),
    Entry(
        "xsens with lost packets",
        file(lambda: lines_without(XSENS, *range(100, 120), 700), "MT_1.txt"),
        MT_MANAGER,
        kept(ROWS - 21, "missing_samples"),
    ),
    Entry(
        "xsens whose preamble contradicts its stamps",
        file(
            lambda: export(SHORT.replace("100.0Hz", "40.0Hz"), "\t", COUNTS, DATA, 100 * COUNTS),
            "MT_1.txt",
        ),
        {"time": TICKS, "channels": CHANNELS},
        kept(ROWS, "rate_contradicts_stamps"),
    ),
    Entry(
        "xsens without the stamps that are named",
        file(XSENS, "MT_1.txt"),
        {"time": TICKS, "channels": CHANNELS},
        Rejected(r"MT_1\.txt: no time stamp in the first \d+ records; correct 'column'"),
    ),
    Entry(
        "xsens cut in a record",
        file(XSENS[:-30], "MT_1.txt"),
        MT_MANAGER,
        kept(ROWS - 1, "incomplete_last_record"),
    ),
]
FOLDERS = [
    Entry("phyphox", file(lambda: archive(PHYPHOX), "run.zip"), PHYPHOX_LOG, kept(ROWS)),
    Entry("phyphox in a folder", folder_of(PHYPHOX, "run"), PHYPHOX_LOG, kept(ROWS)),
    Entry(
        "phyphox with decimal commas",
        file(lambda: archive(phyphox(GYRO, ACCEL, ";", ",")), "run.zip"),
        PHYPHOX_LOG,
        kept(ROWS),
    ),
    Entry(
        "phyphox without the gyroscope",
        file(lambda: archive(without(PHYPHOX, "Gyroscope.csv")), "run.zip"),
        PHYPHOX_LOG,
        Rejected(r"run\.zip: no file 'Gyroscope\.csv' for gyro_x; the folder has Accel"),
    ),
    Entry(
        "phyphox cut short",
        file(lambda: part(archive(PHYPHOX), 0.7), "run.zip"),
        PHYPHOX_LOG,
        kept(ROWS, "truncated_file", "incomplete_last_record"),
    ),
    Entry(
        "phyphox without acceleration",
        file(
            lambda: archive(
                PHYPHOX | {"Accelerometer.csv": PHYPHOX["Accelerometer.csv"].split("\n")[0] + "\n"}
            ),
            "run.zip",
        ),
        PHYPHOX_LOG,
        Rejected(r"Accelerometer\.csv: no record after the header"),
    ),
    Entry("sensor logger", file(lambda: archive(LOGGER), "run.zip"), LOGGER_LOG, kept(ROWS)),
    Entry("sensor logger in a folder", folder_of(LOGGER, "run"), LOGGER_LOG, kept(ROWS)),
    Entry(
        "sensor logger with an empty file",
        folder_of(LOGGER | {"Gyroscope.csv": ""}, "run"),
        LOGGER_LOG,
        Rejected(r"Gyroscope\.csv: the file is empty"),
    ),
    Entry(
        "sensor logger packed with its folder",
        file(lambda: archive({f"run/{name}": text for name, text in LOGGER.items()}), "run.zip"),
        LOGGER_LOG,
        kept(ROWS),
    ),
    Entry(
        "sensor logger without its file names",
        file(lambda: archive(LOGGER), "run.zip"),
        {"time": LOGGER_LOG["time"], "channels": {"gyro_x": {"column": "x", "unit": "rad/s"}}},
        Rejected(r"run\.zip: expected one file, the archive has Annotation\.csv, .*'file:'"),
    ),
]
