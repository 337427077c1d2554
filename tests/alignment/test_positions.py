"""A log of a triad in several positions gives the attitude that it was made with."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.extensions.calibration.alignment.attitude import matrix
from imubench_pipeline.extensions.calibration.alignment.triad import Site
from imubench_pipeline.extensions.calibration.calibration import make_calibration_tables
from imubench_pipeline.extensions.calibration.settings import InPositions
from imubench_pipeline.extensions.calibration.simulated import compute_readings
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.recordings.kept import Quality, identify_files
from imubench_pipeline.recordings.recording import list_log_files
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.steps.simulate import _blocks
from imubench_pipeline.tables.files import build
from tests.conftest import catalogue
from tests.kept import kept
from tests.rows import typed

DEGREE = math.pi / 180.0
RATE, DWELL, TURN = 8.0, 40.0, 2.0
SENSOR = catalogue()["sirrs01_03_triad"]
DECLARED = {"latitude": "50 deg", "dwell": "40 s", "turning": "2 s", "turned": ["0 deg", "180 deg"],
            "gyro_bias": "0.05 deg/s"}  # fmt: skip
EARTH, GRAVITY = 7.292115e-5, 9.80665


def by_hand(roll: float, pitch: float, heading: float, positions: int) -> dict[str, np.ndarray]:
    """Rates and forces with white noise and biases, from three turns one after the other."""

    def about(axis: int, angle: float) -> np.ndarray:
        c, s = math.cos(angle), math.sin(angle)
        turn = np.eye(3)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        turn[i, i] = turn[j, j] = c
        turn[i, j], turn[j, i] = -s, s
        return turn

    attitude = about(2, heading) @ about(1, pitch) @ about(0, roll)
    latitude = 50 * DEGREE
    rate = EARTH * np.array([math.cos(latitude), 0.0, -math.sin(latitude)])
    force = np.array([0.0, 0.0, -GRAVITY])
    rng = np.random.default_rng(4)
    size, turn = round(DWELL * RATE), round(TURN * RATE)
    log = np.empty((positions * size, 6))
    for k in range(positions):
        to_body = (attitude @ about(2, math.pi * k)).T
        log[k * size : (k + 1) * size] = [*(to_body @ rate), *(to_body @ force)]
        log[(k + 1) * size - turn : (k + 1) * size, 2] += 90 * DEGREE  # it turns there
    white = np.repeat([0.0122 * DEGREE, 9.6e-4], 3) * math.sqrt(RATE)
    biases = np.array([0.03 * DEGREE, -0.05 * DEGREE, 0.02 * DEGREE, 0.1, -0.05, 0.07])
    log += biases + white * rng.standard_normal(log.shape)
    return dict(zip(CHANNELS, log.T, strict=True))


def found(folder: Path, columns: dict[str, np.ndarray], **changes: Any) -> dict[str, Any]:
    kept(folder, columns, RATE)
    about = {"sensor": "s", "recording": folder.name, "status": "ok", "kind": "positions"}
    Quality(*typed(RecordingRow, [about]), [], {}, identify_files(list_log_files(folder))).write(
        folder / "quality.json"
    )
    settings = {
        "sensor": SENSOR.model_dump(mode="json", exclude_unset=True),
        "positions": DECLARED | changes,
    }
    tables = make_calibration_tables(folder, [], "s", folder.name, json.dumps(settings))
    rows = build("calibration", tables["calibration"]).to_pylist()
    return {row["parameter"]: row for row in rows}


def test_the_attitude_is_found_within_what_is_said_of_it(tmp_path: Path) -> None:
    true = {"roll": 1.5 * DEGREE, "pitch": -2 * DEGREE, "heading": 130 * DEGREE}
    rows = found(tmp_path / "run", by_hand(*true.values(), positions=60))
    for name, value in true.items():
        row = rows[name]
        assert row["status"] == "ok" and abs(row["value"] - value) < 3.5 * row["sigma"], name
        assert row["lower"] < row["value"] < row["upper"]
    assert rows["heading"]["rates"] == 60 and "typical figures" in rows["heading"]["model_from"]
    # N / sqrt(T) over the horizontal part of the Earth's rate, and what flickers beside it.
    least = 0.0122 * DEGREE / math.sqrt(60 * 38.0) / (EARTH * math.cos(50 * DEGREE))
    assert least < rows["heading"]["sigma"] < 1.5 * least
    # Biases of a centimetre a second squared and more would be a tilt of half a degree.
    assert rows["roll"]["sigma"] < 0.02 * DEGREE


def test_in_one_position_alone_there_is_no_heading(tmp_path: Path) -> None:
    columns = by_hand(0.0, 0.0, 0.0, positions=2)
    still = {name: np.tile(values[: len(values) // 2 - 16], 4) for name, values in columns.items()}
    row = found(tmp_path / "run", still, turned=["0 deg"])["heading"]
    assert row["value"] is None and row["status"] == "not_observable"


def test_an_axis_that_is_missing_is_named(tmp_path: Path) -> None:
    columns = by_hand(0.0, 0.0, 0.0, positions=2)
    del columns["accel_y"]
    row = found(tmp_path / "run", columns)["roll"]
    assert row["status"] == "not_shown" and row["reason"].startswith("accel_y cannot be used")
    with pytest.raises(ValueError, match="the log has no accel_y"):
        InPositions.model_validate(DECLARED).moved_gyro(list(columns))


def test_what_is_sensed_turns_with_the_triad() -> None:
    attitude = matrix(0.1, -0.2, 0.7)
    angle = np.array([0.0, math.pi, 2 * math.pi])
    true = compute_readings(Site(latitude=0.6), attitude, angle, np.array([0.0, 1.0, 0.0]))
    assert true[0] == pytest.approx(true[2])
    assert true[1, [0, 1, 3, 4]] == pytest.approx(-true[0, [0, 1, 3, 4]])
    assert true[1, 2] == pytest.approx(true[0, 2] + 1.0)
    assert np.linalg.norm(true[:, 3:], axis=1) == pytest.approx(GRAVITY)


def test_the_simulated_recording_is_of_the_declared_attitude() -> None:
    plain = {name: {"N": "1e-9 rad/s/sqrt(Hz)" if name[0] == "g" else "1e-9 m/s^2/sqrt(Hz)"}
             for name in CHANNELS}  # fmt: skip
    recording = SimulatedRecording.model_validate(
        {
            "sensor": "s", "recording": "sim_a", "duration": "160 s", "rate": "8 Hz", "seed": 1,
            "source": "here", "channels": plain,
            "positions": DECLARED | {"roll": "1 deg", "heading": "90 deg"},
        }
    )  # fmt: skip
    assert recording.kind == "positions"
    (block,) = _blocks(recording, 8.0)
    # The nose to the east: the axis across it points south, and senses the less of the rate.
    assert block["gyro_x"][10] == pytest.approx(0.0, abs=1e-8)
    north = EARTH * math.cos(50 * DEGREE)
    assert block["gyro_y"][10] == pytest.approx(-north * math.cos(DEGREE), rel=0.05)
    assert block["accel_z"][10] == pytest.approx(-GRAVITY * math.cos(DEGREE))
    assert block["gyro_y"][400] == pytest.approx(-block["gyro_y"][10], rel=1e-3)
    assert np.sum(block["gyro_z"][280:340]) / 8.0 == pytest.approx(math.pi, rel=0.01)
