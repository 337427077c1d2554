"""The text export of Xsens MT Manager, as versions 4 to 2022 write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from tests.readers.text_logs import columns, log_format, written

SHORT = """\
// Start Time: Unknown
// Update Rate: 100.0Hz
//Filter Profile: human (46.1)
// Option Flags: AHS Disabled ICC Disabled
// Firmware Version: 4.0.2
"""
LONG = """\
// General information:
//  MT Manager version: 2022.2.0
//  XDA version: 2022.2.0 build 7381 rev 124627 built on 2023-07-19
// Device information:
//  DeviceId: 00B42D4B
//  ProductCode: MTW2-3A7G6
//  Firmware Version: 4.4.0
// Device settings:
//  Filter Profile: human(46.1)
//  Option Flags: Orientation Smoother Disabled, Position/Velocity Smoother Disabled, ICC Disabled
//  Update Rate: 40.0Hz
// Coordinate system: ENU
"""
OLD = """\
// Start Time: 2013-05-13 11:42:05.250
// Sample rate: 50.0Hz
// Scenario: 4.9
// Firmware Version: 2.5.1
"""
NAMES = [
    *("PacketCounter", "SampleTimeFine", "Year", "Month", "Day", "Second"),
    *("Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z", "Mat[1][1]", "Mat[2][1]"),
]
CHANNELS = {
    f"{quantity}_{axis.lower()}": {"column": f"{column}_{axis}", "unit": unit}
    for quantity, column, unit in (("accel", "Acc", "m/s^2"), ("gyro", "Gyr", "rad/s"))
    for axis in "XYZ"
}
COUNTER = {"column": "PacketCounter", "unit": "samples", "wraps": 65536}
TICKS = {"column": "SampleTimeFine", "unit": "ms", "scale": 0.1, "wraps": 2**32}


def export(
    preamble: str, sign: str, counts: np.ndarray, data: np.ndarray, ticks: np.ndarray | None = None
) -> str:
    lines = [sign.join(NAMES)]
    for row, (count, figures) in enumerate(zip(counts, data, strict=True)):
        tick = "" if ticks is None else str(ticks[row])
        cells = [f"{count % 65536:05d}", tick, "", "", "", "", *(f"{x:.6f}" for x in figures)]
        lines.append(sign.join([*cells, "0.440001", "-0.897938"]))
    return preamble + "\n".join(lines) + "\n"


@pytest.fixture
def data(rng: np.random.Generator) -> np.ndarray:
    return np.round(rng.standard_normal((400, 6)), 6)


@pytest.mark.parametrize("sign", ["\t", ",", ";", " "])
@pytest.mark.parametrize(
    ("preamble", "rate", "started"),
    [(SHORT, 100.0, None), (LONG, 40.0, None), (OLD, 50.0, "2013-05-13T11:42:05.250")],
)
def test_an_export(
    tmp_path: Path, data: np.ndarray, preamble: str, rate: float, started: str | None, sign: str
) -> None:
    counts = np.delete(np.arange(65_400, 65_801), 200)
    path = written(tmp_path, export(preamble, sign, counts, data), "MT_00B42D4B.txt")
    log = log_format(CHANNELS, time=COUNTER, rate=f"{rate} Hz")
    found, time, file = columns(path, log)
    for column, name in enumerate(CHANNELS):
        np.testing.assert_allclose(found[name], data[:, column], rtol=1e-12)
    np.testing.assert_allclose(time, (counts - counts[0]) / rate, rtol=1e-12)
    assert (file.rate, file.started) == (rate, started)
    assert file.findings == []


def test_sample_time_fine_counts_tenths_of_milliseconds(tmp_path: Path, data: np.ndarray) -> None:
    ticks = (2**32 - 20_000 + 100 * np.arange(400)) % 2**32
    text = export(SHORT, "\t", np.arange(400), data, ticks)
    _, time, _ = columns(written(tmp_path, text), log_format(CHANNELS, time=TICKS))
    np.testing.assert_allclose(time, np.arange(400) / 100, rtol=1e-12)


def test_missing_cells_written_as_nan(tmp_path: Path, data: np.ndarray) -> None:
    text = (
        export(LONG, "\t", np.arange(400), data)
        .replace("\t\t", "\tNaN\t")
        .replace("\t\t", "\tNaN\t")
    )
    found, _, _ = columns(written(tmp_path, text), log_format(CHANNELS, time=COUNTER, rate="40 Hz"))
    np.testing.assert_allclose(found["gyro_x"], data[:, 3], rtol=1e-12)


def test_an_empty_column_of_stamps_is_named(tmp_path: Path, data: np.ndarray) -> None:
    path = written(tmp_path, export(SHORT, "\t", np.arange(400), data))
    with pytest.raises(RecordingError, match=r"no time stamp in the first 400 records; correct"):
        columns(path, log_format(CHANNELS, time=TICKS))


def test_a_decimal_comma(tmp_path: Path, data: np.ndarray) -> None:
    text = export("", ";", np.arange(400), data).replace(".", ",")
    found, _, _ = columns(written(tmp_path, SHORT + text), log_format(CHANNELS))
    np.testing.assert_allclose(found["accel_z"], data[:, 2], rtol=1e-12)
