"""The step: what a filter may be tuned with, from files as earlier steps leave them."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.aided.navigate import (
    _is_consistent,
    collect_tunings,
    navigate,
)
from imubench_pipeline.extensions.aided.runs import Share
from imubench_pipeline.extensions.aided.settings import NavigateSettings
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.settings.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.tables.files import build, write
from imubench_pipeline.tables.keys import Key
from tests.kept import kept
from tests.rows import typed

RATE = 20.0
MODELS = {
    "gyro": NoiseModel(N=1e-4, B=8e-5, T_B=60.0, K=1e-6),
    "accel": NoiseModel(N=1e-3, B=4e-4, T_B=40.0, K=2e-5),
}
SENSOR = Sensor.model_validate(
    {
        "vendor": "V",
        "model": "M",
        "log": {
            "rate": "20 Hz",
            "channels": {
                "gyro_x": {"column": 1, "unit": "rad/s"},
                "accel_x": {"column": 2, "unit": "m/s^2"},
            },
        },
        "datasheet": {
            "gyro": {
                "noise_density": {
                    "value": 0.01,
                    "unit": "deg/s/sqrt(Hz)",
                    "sidedness": "one-sided",
                },
                "bias_instability": {"value": 10, "unit": "deg/h"},
            },
            "accel": {
                "noise_density": {"value": 100, "unit": "ug/sqrt(Hz)", "sidedness": "two-sided"},
                "bias_instability": {"value": 40, "unit": "ug"},
            },
        },
    }
)
HOW = NavigateSettings(
    of="all", duration="200 s", rate="20 Hz", runs=4, outages=("10 s",), trajectories=("car",)
)


def put(folder: Path, channels: tuple[str, ...], samples: int = 20_000) -> None:
    """Leave a recording whose estimates are right, with a log of its noise."""
    rng = np.random.default_rng(3)
    columns = {c: simulate(MODELS[quantity_of(c)], RATE, samples, rng) for c in channels}
    kept(folder, columns, RATE)
    about = {
        "sensor": "imu", "device": "a", "recording": "a", "kind": "static", "simulated": False,
        "status": "ok", "reason": None, "rate": RATE, "duration": samples / RATE,
    }  # fmt: skip
    Quality(*typed(RecordingRow, [about]), findings=[], channels={}).write(folder / "quality.json")
    rows, curve = [], []
    for channel in channels:
        model = MODELS[quantity_of(channel)]
        own = {name: Parameter(getattr(model, name)) for name in ("N", "B", "T_B", "K")}
        key = Key("imu", "a", channel)
        absent = dict.fromkeys(("B", "T_B", "K"), Parameter(None, "not_shown", "flat"))
        rows += make_parameter_rows(key, Estimate("likelihood", own), recommended=True)
        rows += make_parameter_rows(key, Estimate("curve", own | absent), recommended=False)
        tau = np.geomspace(1.0 / RATE, 100.0, 25)
        for t in np.unique(np.rint(tau * RATE)) / RATE:
            level = math.sqrt(model.allan_variance([t], RATE)[0])
            curve.append(
                {"sensor": "imu", "recording": "a", "channel": channel, "tau": t,
                 "cluster_size": round(t * RATE), "averaged": 1.0, "adev": level,
                 "lower": level, "upper": level, "edf": 99.0, "edf_upper": 99.0,
                 "edf_source": "fitted spectrum", "exponent": 0, "share": 1.0}
            )  # fmt: skip
    write("parameters", rows, folder / "parameters.parquet")
    write("allan", curve, folder / "allan.parquet")
    write("draws", [], folder / "draws.parquet")
    write("low_pass", [], folder / "low_pass.parquet")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("results") / "a"
    put(made, CHANNELS)
    return made


def run(folder: Path, asked: list[Any], sensor: Sensor | None = SENSOR) -> list[dict[str, Any]]:
    settings = {
        "navigate": HOW.model_dump(mode="json"),
        "asked": asked,
        "sensor": sensor and sensor.model_dump(mode="json", exclude_unset=True),
        "truths": [],
    }
    return build("navigation", navigate([folder], "imu", json.dumps(settings))).to_pylist()


def test_tunings_are_what_is_known_of_the_sensor(folder: Path) -> None:
    found, lacking = collect_tunings(folder, "imu", SENSOR, 60.0, {})
    assert lacking == {}
    assert set(found) == {
        *("datasheet", "datasheet_misread", "times_ten", "overbound", "likelihood", "curve")
    }
    gyro = MODELS["gyro"]
    assert found["likelihood"]["gyro_z"] == gyro
    assert found["curve"]["gyro_z"] == NoiseModel(N=gyro.N)
    assert found["times_ten"]["gyro_z"] == gyro.scaled(10.0)
    assert found["times_ten"]["gyro_z"].K == pytest.approx(10.0 * gyro.K)
    # 0.01 deg/s one-sided, 10 deg/h at the lowest point of the curve, that is 0.664 B.
    right, wrong = found["datasheet"]["gyro_x"], found["datasheet_misread"]["gyro_x"]
    assert right.N == pytest.approx(math.radians(0.01) / math.sqrt(2.0))
    assert wrong.N == pytest.approx(math.radians(0.01))
    assert wrong.B == pytest.approx(math.radians(10.0 / 3600.0))
    assert right.B == pytest.approx(wrong.B / 0.6643, rel=1e-3)
    # A two-sided density is N, however it is read.
    right, wrong = found["datasheet"]["accel_x"], found["datasheet_misread"]["accel_x"]
    assert right.N == wrong.N == pytest.approx(100e-6 * 9.80665)
    bound = found["overbound"]["gyro_x"]
    tau = np.array([1.0, 10.0, 60.0])
    assert (bound.allan_variance(tau) >= gyro.allan_variance(tau)).all()


@pytest.mark.release  # every day, the demonstration
def test_every_tuning_runs_on_the_signals_of_the_estimate_and_of_the_log(folder: Path) -> None:
    rows = run(folder, [("field", "20 s")])
    assert {row["signals"] for row in rows} == {"estimate", "log"}
    # What the settings and a requirement ask for, in one run long enough for both.
    asked = {(row["trajectory"], row["outage"]) for row in rows}
    assert asked == {(name, outage) for name in ("car", "field") for outage in (None, 10.0, 20.0)}
    simulated = [row for row in rows if row["signals"] == "estimate"]
    of_log = [row for row in rows if row["signals"] == "log"]
    assert {row["tuning"] for row in simulated} == {row["tuning"] for row in of_log} | {"true"}
    for row in simulated:
        assert row["recommended"] == (row["tuning"] == "likelihood")
        if row["tuning"] == "likelihood":  # it is the true model
            assert row["position_ratio"] == pytest.approx(1.0, abs=1e-6)
            assert row["states"] == 21
        assert row["position_lower"] < row["position"] < row["position_upper"]
    assert all(row["position_ratio"] is None and row["nees_gyro"] is None for row in of_log)
    assert {row["runs"] for row in of_log} == {4}  # pieces of 201 s of a log of 1000 s


@pytest.mark.parametrize(
    ("value", "error", "verdict"),
    [
        (0.95, 0.01, True),
        (0.92, 0.01, True),
        (0.89, 0.01, False),
        (0.94, 0.05, None),  # the runs do not tell
        (0.18, 0.05, False),  # but of this they do
        (0.905, 0.01, None),
        (0.885, 0.028, None),  # twelve runs of a tuning of which a hundred say: not consistent
    ],
)
def test_a_share_is_judged_as_far_as_the_runs_tell(
    value: float, error: float, verdict: bool | None
) -> None:
    assert _is_consistent(Share(value, error)) is verdict


@pytest.mark.release
def test_gyro_only_recording_gets_assumed_accelerometers(tmp_path: Path) -> None:
    put(tmp_path / "a", ("gyro_x", "gyro_y"))
    rows = run(tmp_path / "a", [], None)
    assert {row["assumed"] for row in rows} == {"accelerometers: 100 ug/sqrt(Hz)"}
    assert {row["signals"] for row in rows} == {"estimate"}  # pieces lack a quantity
    assert {row["model"] for row in rows if row["tuning"] == "true"} == {"gyro N+GM+K; accel N"}


def test_accelerometers_alone_say_why_they_do_not_navigate(tmp_path: Path) -> None:
    put(tmp_path / "a", ("accel_x",))
    (row,) = run(tmp_path / "a", [], None)
    assert row["position"] is None
    assert row["reason"] == "the recording has no estimate of gyro white noise"
