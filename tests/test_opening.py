"""A log that does not open within its time is rejected, with its reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.recordings.availability import check_opening
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat
from tests.readers.hostile.bags import bag, chunk, connection, message

ON_TOPIC = {"gyro_x": {"variable": "/imu", "column": "angular_velocity.x", "unit": "rad/s"}}
ON_COLUMN = {"gyro_x": {"column": "wx", "unit": "rad/s"}}


def layout(channels: dict[str, dict[str, str]]) -> LogFormat:
    return LogFormat.model_validate({"rate": "100 Hz", "channels": channels})


def slow(folder: Path) -> Path:
    """Write a bag without an index and without the topic: all of its messages are looked at."""
    path = folder / "log.bag"
    messages = chunk(b"".join(message(300) for _ in range(30_000)))
    path.write_bytes(bag(connection(0, b"/camera"), *[messages] * 10))
    return path


@pytest.mark.release
def test_a_log_that_takes_too_long_is_rejected(tmp_path: Path) -> None:
    quality = QualitySettings(opening=0.05)
    given = {"log": layout(ON_TOPIC).model_dump(), "quality": quality.model_dump()}
    settings = json.dumps(given | {"simulated": False})
    found = ingest_as_planned(slow(tmp_path), settings, "s", "log", tmp_path / "kept", guarded=True)
    assert found.recording.status == "rejected"
    reason = found.recording.reason
    assert reason.startswith("log.bag: reading its first records took more than 0.")
    assert "quality.opening" in reason


def test_what_a_log_says_wrong_is_said_as_ever(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("wy\n" + "1\n" * 200)
    with pytest.raises(RecordingError, match="'wx'"):
        check_opening(path, layout(ON_COLUMN), 10.0)


def test_a_log_that_opens_is_no_error_and_one_that_is_away_is(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("wx\n" + "1\n" * 200)
    check_opening(path, layout(ON_COLUMN), 10.0)
    path.unlink()
    with pytest.raises(FileNotFoundError):
        check_opening(path, layout(ON_COLUMN), 10.0)
