"""What a sensor at rest could find, from what a run keeps of its static recordings."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.calibration.alignment.accuracy import accuracies
from imubench_pipeline.extensions.calibration.alignment.fine import UNIFORM_HEADING_SIGMA
from imubench_pipeline.extensions.calibration.alignment.triad import Site, Triad
from imubench_pipeline.extensions.calibration.noise_source import load_noise_at_rest
from imubench_pipeline.extensions.earth_rate.outlook import TIMES, make_outlook_tables
from imubench_pipeline.extensions.earth_rate.settings import EarthRateSettings
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.tables.files import build, write
from imubench_pipeline.tables.keys import Key
from tests.earth_rate.recordings import put

SITE = Site(latitude=math.radians(45.0))
GYRO, ACCELEROMETER = NoiseModel(N=1e-6), NoiseModel(N=1e-3)


def put_triad(folder: Path, models: dict[str, NoiseModel], **about: Any) -> Path:
    """Keep what a run says of a static recording of several axes."""
    known = {"kind": "static", "duration": 3600.0}
    put(folder, {name: np.zeros(3) for name in models}, **known | about)
    rows = [
        row
        for name, model in models.items()
        for row in make_parameter_rows(
            Key("s", folder.name, name),
            Estimate("likelihood", {"N": Parameter(model.N)}),
            recommended=True,
        )
    ]
    write("parameters", rows, folder / "parameters.parquet")
    return folder


def six(gyro: float = 1e-6, accelerometer: float = 1e-3) -> dict[str, NoiseModel]:
    gyros = {f"gyro_{axis}": NoiseModel(N=gyro) for axis in "xyz"}
    return gyros | {f"accel_{axis}": NoiseModel(N=accelerometer) for axis in "xyz"}


def outlook(
    folders: list[Path], datasheet: dict[str, Any] | None = None, **changes: Any
) -> dict[str, list[dict[str, Any]]]:
    # The best dwell, which nothing here looks at, takes longest of long runs.
    asked: dict[str, Any] = {"run_time": "2 min"} | changes
    settings = {
        "earth_rate": EarthRateSettings(**asked).model_dump(mode="json"),
        "datasheet": datasheet or {},
    }
    found = make_outlook_tables(folders, "s", json.dumps(settings))
    for table, rows in found.items():
        assert build(table, rows).num_rows == len(rows)
    return {name: [dict(row) for row in rows] for name, rows in found.items()}


def test_one_position_is_no_better_than_its_biases() -> None:
    bias = 0.1 * EARTH_RATE
    triad = Triad(
        gyros=[GYRO] * 3,
        accelerometers=[ACCELEROMETER] * 3,
        gyro_bias=bias,
        accelerometer_bias=0.05,
    )
    for one in accuracies(triad, SITE, 100.0, [3600.0]):
        if one.positions == 1:
            tilt, north = 0.05 / SITE.gravity, bias / EARTH_RATE / math.cos(SITE.latitude)
            np.testing.assert_allclose(one.sigma[:2], tilt, rtol=2e-3)
            # East: the heading has a part of the tilt, times the tangent of the latitude.
            assert one.sigma[2] == pytest.approx(math.hypot(north, tilt), rel=5e-3)
            assert one.reason is None


def test_two_positions_of_white_noise_have_the_mean_of_both() -> None:
    triad = Triad(
        gyros=[GYRO] * 3, accelerometers=[ACCELEROMETER] * 3, gyro_bias=0.01, accelerometer_bias=0.2
    )
    for one in accuracies(triad, SITE, 100.0, [602.0]):
        if one.positions == 2:
            tilt = 1e-3 / math.sqrt(600.0) / SITE.gravity
            np.testing.assert_allclose(one.sigma[:2], tilt, rtol=2e-3)
            north = 1e-6 / math.sqrt(600.0) / EARTH_RATE / math.cos(SITE.latitude)
            assert one.sigma[2] == pytest.approx(math.hypot(north, tilt), rel=5e-3)


@pytest.mark.parametrize("density", [1e-6, 3e-4])  # the heading is small, and it is not
def test_errors_of_simulated_triads_are_as_large_as_said(density: float) -> None:
    gyro = NoiseModel(N=density, B=density / 30, T_B=60.0)
    triad = Triad(
        gyros=[gyro] * 3,
        accelerometers=[NoiseModel(N=1e-3, B=3e-4, T_B=40.0)] * 3,
        gyro_bias=1e-3,
        accelerometer_bias=0.2,
    )
    rng = np.random.default_rng(3)
    for one in accuracies(triad, SITE, 100.0, [300.0, 600.0], runs=400, rng=rng):
        assert (one.errors is not None) == (one.method == "fine" and one.time == 600.0)
        if one.errors is not None:
            there = np.isfinite(one.errors)
            assert there.tolist() == [True, True, one.sigma[2] < UNIFORM_HEADING_SIGMA]
            assert np.all(np.abs(one.errors[there] - 1.0) < 0.15), one


@pytest.mark.release
def test_where_there_is_no_heading_the_words_say_why(tmp_path: Path) -> None:
    rows = outlook([put_triad(tmp_path / "night", six(gyro=1e-2))])["alignment"]
    assert len(rows) == 4 * len(TIMES)
    for row in rows:
        if row["positions"] == 1 or row["time"] <= 60.0:
            assert row["heading"] is None
        assert (row["heading"] is None) == (row["reason"] is not None)
    said = {row["positions"]: row["reason"] for row in rows if row["reason"]}
    assert "biases exceeds the horizontal part" in said[1] and "record for longer" in said[2]


@pytest.mark.release
def test_the_biases_are_printed_or_assumed(tmp_path: Path) -> None:
    folder = put_triad(tmp_path / "night", six())
    printed = {"gyro": {"offset": [{"value": 3, "unit": "deg/s", "kind": "max"},
                                   {"value": 1, "unit": "deg/s", "kind": "typ"}]}}  # fmt: skip
    row = outlook([folder], printed)["alignment"][0]
    assert row["gyro_bias"] == pytest.approx(math.radians(1.0))
    assert row["gyro_bias_from"] == "offset 1 deg/s (typ), datasheet"
    assert row["accelerometer_bias"] == pytest.approx(0.02 * 9.80665)
    assert row["accelerometer_bias_from"] == "20 mg (earth_rate.accelerometer_bias), assumed"
    changed = outlook([folder], gyro_bias="2 deg/s", latitude="60 deg")
    assert changed["alignment"][0]["gyro_bias"] == pytest.approx(math.radians(2.0))
    assert {row["latitude"] for rows in changed.values() for row in rows} == {math.radians(60.0)}


@pytest.mark.release
def test_axes_that_are_not_there_are_lent_by_those_that_are(tmp_path: Path) -> None:
    models = {"gyro_x": NoiseModel(N=1e-6), "accel_z": NoiseModel(N=1e-3)}
    row = outlook([put_triad(tmp_path / "night", models)])["alignment"][0]
    assert row["gyros"] == ("gyro_x",) * 3
    assert row["accelerometers"] == ("accel_z",) * 3


def test_the_longest_measured_recording_answers_with_its_middle_gyro(tmp_path: Path) -> None:
    models = six() | {"gyro_x": NoiseModel(N=2e-6), "gyro_z": NoiseModel(N=5e-7)}
    folders = [
        put_triad(tmp_path / "short", models, duration=60.0),
        put_triad(tmp_path / "long", models),
        put_triad(tmp_path / "sim_longer", models, duration=1e5, simulated=True),
    ]
    found = load_noise_at_rest(folders)
    assert found is not None and found.recording == "long"
    rows = outlook(folders)["earth_rate_prediction"]
    assert {(row["recording"], row["channel"]) for row in rows} == {("long", "gyro_y")}
    goals = {row["goal"]: row for row in rows if row["of"] == "goal"}
    # White noise: N / sqrt(T) / cos(latitude) is the goal.
    data = (goals[0.01]["turns"] + 1) * goals[0.01]["dwell"]
    least = (1e-6 / (0.01 * EARTH_RATE * math.cos(math.radians(45.0)))) ** 2
    assert least <= data < least + 3 * goals[0.01]["dwell"]


def test_what_is_not_there_gives_no_rows(tmp_path: Path) -> None:
    assert outlook([]) == {"alignment": [], "earth_rate_prediction": []}
    gyros = {name: model for name, model in six().items() if name.startswith("gyro")}
    found = outlook([put_triad(tmp_path / "gyros", gyros)])
    assert found["alignment"] == [] and found["earth_rate_prediction"]
    accels = {name: model for name, model in six().items() if name.startswith("accel")}
    assert outlook([put_triad(tmp_path / "accels", accels)])["earth_rate_prediction"] == []
    rejected = put_triad(tmp_path / "rejected", six(), status="rejected")
    assert load_noise_at_rest([rejected]) is None
