"""Estimates of what users have: the truth in their intervals, and the numbers of the workflow."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import imubench_pipeline as imu
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.config import AllanSettings
from imubench_pipeline.steps.allan import yield_allan_rows
from imubench_pipeline.steps.estimate import estimate_recording
from imubench_pipeline.tables.files import write
from tests.library.conftest import ACCEL, GYRO, RATE


@pytest.fixture(scope="module")
def of_workflow(drop_zone: Path, tmp_path_factory: pytest.TempPathFactory):
    """What the steps of a run leave of the same log."""
    folder = tmp_path_factory.mktemp("recording")
    plan = Plan(
        {"logs": str(drop_zone / "logs"), "sensors": str(drop_zone / "sensors"),
         "results": str(folder), "simulated": None, "requirements": None,
         "estimate": {"methods": ["robust", "likelihood", "curve"]}}
    )  # fmt: skip
    names = ("sensor_1", "run")
    settings = plan.ingest_settings(*names)
    quality = ingest_as_planned(plan.recordings[names].path, settings, *names, folder)
    quality.write(folder / "quality.json")
    write("allan", yield_allan_rows(folder, *names, AllanSettings()), folder / "curve.parquet")
    asked = plan.estimate_settings(*names)
    return estimate_recording(folder, *names, asked)


@pytest.mark.release
def test_the_truth_is_in_the_intervals(estimates) -> None:
    gyro, accel = estimates["gyro_x"], estimates["accel_z"]
    for parameter, truth in (
        (gyro["N"], GYRO.N), (gyro["K"], GYRO.K), (accel["N"], ACCEL.N),
        (accel["B"], ACCEL.B),
    ):  # fmt: skip
        assert parameter.lower < truth < parameter.upper
    # the fit may add a small part, without a value
    assert estimates.models["gyro_x"].name in ("N+K", "N+F+K") and gyro["B"].value is None
    assert accel.model.name == "N+F"
    with pytest.raises(ValueError, match="models of gyro_x, accel_z; expected"):
        _ = estimates.model
    with pytest.raises(KeyError, match="no parameter 'ARW'; robust has"):
        gyro["ARW"]


def test_a_log_has_the_numbers_of_the_workflow(estimates, of_workflow) -> None:
    rows = [row for row in of_workflow.parameters if row["method"] == "robust"]
    table = estimates.to_pandas()
    pd.testing.assert_frame_equal(
        table, pd.DataFrame(rows).drop(columns="recommended"), check_exact=True
    )
    for channel, own in estimates.items():
        draws = of_workflow.estimates[channel]["robust"].draws
        np.testing.assert_array_equal(own.draws.first, draws.first)
    found = [row["finding"] for row in of_workflow.estimate_findings]
    assert [finding.finding for finding in estimates.findings][-len(found) or 99 :] == found


@pytest.mark.release
def test_another_method_has_its_numbers_too(log, of_workflow) -> None:
    """With what the likelihood makes doubtful of them."""
    own = imu.estimate(log, method="curve", channels="gyro_x").to_pandas()
    rows = [
        row
        for row in of_workflow.parameters
        if row["method"] == "curve" and row["channel"] == "gyro_x"
    ]
    pd.testing.assert_frame_equal(own, pd.DataFrame(rows).drop(columns="recommended"))


@pytest.mark.release
def test_an_array_is_judged_as_a_file_is(log, estimates) -> None:
    degrees = np.degrees(log["gyro_x"])
    degrees[10_000] += 5.0  # a knock
    units = {"gyro": "deg/s"}
    own = imu.estimate(degrees, "10 Hz", channels="gyro_x", units=units, name="bench")
    assert own.name == "array/bench" and own.log.rate == RATE
    assert "knocks" in {finding.finding for finding in own.findings}
    N = estimates["gyro_x"]["N"]
    assert own["gyro_x"]["N"].value == pytest.approx(N.value, rel=1e-3)
    assert own.model.name == estimates["gyro_x"].model.name


@pytest.mark.usefixtures("no_screen")
def test_estimates_are_shown_drawn_and_given_as_tables(estimates) -> None:
    text = repr(estimates)
    assert "gyro_x   N" in text and "°/√h" in text and "µg/√Hz" in text and len(text) < 3000
    assert "warning" not in text  # of a single knock
    assert repr(estimates["gyro_x"]).startswith("gyro_x of sensor_1/run: N+F+K, by robust")
    practical = estimates.to_pandas("practical").set_index(["channel", "parameter"])
    N = practical.loc["gyro_x", "N"]
    assert N.unit == "°/√h"
    assert N.value == pytest.approx(np.degrees(estimates["gyro_x"]["N"].value) * 60.0)
    with pytest.raises(ValueError, match="units is 'imperial'"):
        estimates.to_pandas("imperial")
    axes = estimates.plot()
    assert [panel.get_title() for panel in axes] == ["gyro_x", "accel_z"]
    lines = {line.get_label(): line for line in axes[0].get_lines()}
    assert {"log, 95 % limits", "model: N+F+K"} <= set(lines) and len(lines) == 5
    tau = estimates.curves["gyro_x"].tau
    model = np.degrees(np.sqrt(estimates["gyro_x"].model.allan_variance(tau, RATE))) * 3600.0
    np.testing.assert_allclose(lines["model: N+F+K"].get_ydata(), model)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"method": "ols"}, "method is 'ols', expected one of robust, likelihood"),
        ({"method": "compensated"}, "has no temperature, as compensated needs"),
        ({"rate": 10.0}, "a Log has its own rate and units"),
        ({"seed": -1}, "estimate: seed: found -1"),
        ({"sede": 1}, "did you mean 'seed'"),
        ({"channels": "gyro_z"}, "has no channel gyro_z"),
    ],
)
def test_what_cannot_be_estimated_says_why(log, arguments: dict, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        imu.estimate(log, **{"channels": "gyro_x"} | arguments)


@pytest.mark.release  # the fit of the temperature takes five seconds
def test_what_temperature_explains_is_taken_out() -> None:
    """Of one axis; the other does not follow it, and says so."""
    time = np.arange(12_000) / RATE
    temperature = 25.0 + 5.0 * np.sin(2.0 * np.pi * time / 600.0)
    gyro = imu.NoiseModel(N=8e-5)
    data = imu.simulate({"gyro_x": gyro, "gyro_y": gyro}, RATE, len(time), seed=1)
    data |= {"temperature": temperature, "gyro_x": data["gyro_x"] + 1e-4 * temperature}
    estimates = imu.estimate(data, RATE, method="compensated")
    assert list(estimates) == ["gyro_x"] and estimates.model.name == "N"
    assert "sensitivity" in estimates.left_out["gyro_y"]
    assert estimates["gyro_x"]["N"].lower < gyro.N < estimates["gyro_x"]["N"].upper
    np.testing.assert_allclose(estimates.log["temperature"], temperature)
