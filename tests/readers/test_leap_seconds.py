"""A leap second in the stamps of a text log: nothing is lost, and time goes on."""

from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.settings.sensor import LogFormat

CHANNELS = {"gyro_x": {"column": "wx", "unit": "rad/s"}}
BEFORE = 30
"""s of each log before the leap second."""


def stamp(seconds: float, form: str) -> str:
    """Return UTC so many seconds after 23:59:30 of the last day of 2016, which had 86401 s."""
    whole, millis = divmod(round(seconds * 1000), 1000)
    leap = whole == BEFORE
    beginning = datetime(2016, 12, 31, 23, 59, 30) if whole < BEFORE else datetime(2017, 1, 1)
    date = beginning + timedelta(seconds=whole if whole < BEFORE else whole - BEFORE - 1)
    if leap:
        date = datetime(2016, 12, 31, 23, 59)
    written = date.strftime(form.replace("%S", "{:02d}").replace("%f", "{:03d}"))
    return written.format(60 if leap else date.second, millis)


def written(path: Path, times: np.ndarray, form: str) -> Path:
    rows = "".join(f"{stamp(time, form)},{k}\n" for k, time in enumerate(times))
    path.write_text(f"t,wx\n{rows}")
    return path


def taken(path: Path, **time: Any) -> tuple[LogFile, np.ndarray, np.ndarray]:
    log = LogFormat.model_validate({"channels": CHANNELS, "time": {"column": "t"} | time})
    (file,) = read(path, log)
    batches = list(file.batches())
    stamps = np.concatenate([batch.time for batch in batches if batch.time is not None])
    return file, stamps, np.concatenate([batch.columns["gyro_x"] for batch in batches])


@pytest.mark.parametrize("rate", [1, 10, 100])
@pytest.mark.parametrize(
    ("form", "declared"),
    [
        ("%Y-%m-%dT%H:%M:%S.%fZ", "iso8601"),
        ("%Y-%m-%d %H:%M:%S.%f", "iso8601"),
        ("%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f"),
        ("%H:%M:%S.%f", "%H:%M:%S.%f"),
    ],
)
def test_time_goes_on_through_a_leap_second(
    rate: int, form: str, declared: str, tmp_path: Path
) -> None:
    times = np.arange(60 * rate) / rate
    file, stamps, values = taken(written(tmp_path / "a.csv", times, form), format=declared)
    np.testing.assert_allclose(stamps, times, atol=1e-6)
    np.testing.assert_array_equal(values, np.arange(len(times)))
    assert [finding.finding for finding in file.findings] == ["leap_second"]


def test_what_was_read_before_a_leap_second_is_not_read_twice(tmp_path: Path) -> None:
    times = np.concatenate([np.linspace(0.0, 29.0, 100_000), np.arange(2900, 6000) / 100])
    path = written(tmp_path / "a.csv", times, "%Y-%m-%dT%H:%M:%S.%fZ")
    assert path.stat().st_size > 3 << 20  # several blocks
    _, stamps, values = taken(path, format="iso8601")
    np.testing.assert_allclose(stamps, times, atol=6e-4)
    np.testing.assert_array_equal(values, np.arange(len(times)))


def test_a_figure_that_was_rounded_up_is_no_leap_second(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    seconds = [f"00:{s // 60:02d}:{s % 60:02d}" for s in range(58, 130)]
    seconds = [text.replace("01:00", "00:60").replace("02:00", "01:60") for text in seconds]
    path.write_text("t,wx\n" + "".join(f"2016-12-31 {s},1\n" for s in seconds))
    file, stamps, _ = taken(path, format="iso8601")
    np.testing.assert_allclose(stamps, np.arange(72.0), atol=1e-9)
    assert file.findings == []


def test_what_is_wrong_behind_a_leap_second_is_found(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", np.arange(60.0), "%Y-%m-%dT%H:%M:%S.%fZ")
    path.write_text(path.read_text().replace("00:00:09.000Z,", "00:00:61.000Z,"))
    with pytest.raises(RecordingError, match=r"line 42, column 't': found '2017-01-01T00:00:61"):
        taken(path, format="iso8601")
