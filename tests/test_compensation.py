from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.rows import read_estimates
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.config import EstimateSettings, Run, read_run
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.steps.allan import read_compensated_curves
from imubench_pipeline.steps.estimate import Estimation, estimate_channel
from imubench_pipeline.tables.files import build, write
from imubench_pipeline.tables.keys import Key
from tests.kept import curve_of, kept

RATE = 5.0
SAMPLES = 60_000
BIAS, SENSITIVITY = 0.02, 1e-3
NOISE = NoiseModel(N=1e-3, K=3e-6)
TEMPERATURE = 25.0 + 4.0 * np.sin(2 * np.pi * np.arange(SAMPLES) / RATE / 4_000.0 + 0.4)
SHORT = slice(0, 20_000)
BRIEF = 6_000
"""Samples of a log in which a temperature goes five times as fast up and down."""

KEY = Key("sensor", "sim_1", "gyro_x")
METHODS = ("likelihood", "compensated", "curve")

Row = Mapping[str, Any]


def recorded(folder: Path, columns: Mapping[str, np.ndarray], holes: bool = False) -> ChannelLog:
    """The gyro of a recording as the ingest keeps it, with the other columns beside it."""
    logs = kept(folder, columns, RATE, holes=holes)
    assert list(logs) == ["gyro_x"]
    return logs["gyro_x"]


def samples(sensitivity: float = SENSITIVITY, temperature: np.ndarray = TEMPERATURE) -> np.ndarray:
    noise = simulate(NOISE, RATE, len(temperature), np.random.default_rng(20260118))
    return BIAS + noise + sensitivity * (temperature - temperature.mean())


def estimated(log: ChannelLog, **settings: Any) -> Estimation:
    found = Estimation()
    how = EstimateSettings.model_validate({"methods": METHODS} | settings)
    estimate_channel(KEY, log, curve_of(log), how, None, found)
    return found


@pytest.fixture(scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory) -> ChannelLog:
    columns = {"gyro_x": samples(), "temperature": TEMPERATURE}
    return recorded(tmp_path_factory.mktemp("warm"), columns)


@pytest.fixture(scope="module")
def found(warm: ChannelLog) -> Estimation:
    return estimated(warm)


Brief = tuple[Estimation, np.ndarray]


@pytest.fixture(scope="module")
def brief(tmp_path_factory: pytest.TempPathFactory) -> Brief:
    """Of a log with holes, by the curve and what temperature leaves; and the noise in it."""
    readings = TEMPERATURE[::5][:BRIEF]
    log, alone = samples(temperature=readings), samples(0.0, readings)
    lost = np.random.default_rng(2).random(len(log)) < 0.02
    log[lost] = alone[lost] = np.nan
    columns = {"gyro_x": log, "temperature": readings}
    kept_log = recorded(tmp_path_factory.mktemp("brief"), columns, holes=True)
    return estimated(kept_log, methods=("compensated", "curve")), alone


def figures(rows: list[Row]) -> dict[str, Row]:
    named = {row["parameter"]: row for row in rows}
    assert len(named) == len(rows)
    return named


def test_every_row_fits_the_schema_of_its_table(found: Estimation) -> None:
    for name in ("temperature", "allan_compensated", "low_pass", "parameters"):
        rows = getattr(found, name)
        assert rows
        assert build(name, rows).num_rows == len(rows)
        assert all(row.items() >= asdict(KEY).items() for row in rows)


def test_the_sensitivity_is_that_of_the_simulation(found: Estimation) -> None:
    rows = figures(found.temperature)
    assert list(rows) == ["T_0", "sensitivity", "quadratic", "lag", "bias"]
    assert all(row["compensated"] for row in rows.values())
    units = {"T_0": "degC", "sensitivity": "rad/s/K", "quadratic": "rad/s/K^2", "lag": "s",
             "bias": "rad/s"}  # fmt: skip
    assert {name: row["unit"] for name, row in rows.items()} == units
    sensitivity = rows["sensitivity"]
    assert sensitivity["status"] == "ok"
    assert sensitivity["value"] == pytest.approx(SENSITIVITY, rel=0.02)
    assert sensitivity["lower"] < SENSITIVITY < sensitivity["upper"]
    assert "BIC prefers" in sensitivity["reason"]
    assert rows["quadratic"]["status"] == "absent" and rows["quadratic"]["value"] is None


def test_the_bias_is_that_at_the_mean_temperature(found: Estimation) -> None:
    rows = figures(found.temperature)
    assert rows["T_0"]["value"] == pytest.approx(TEMPERATURE.mean(), abs=0.01)
    # The random walk moves the mean by far more than white noise or temperature does.
    assert rows["bias"]["lower"] < BIAS < rows["bias"]["upper"]
    assert rows["bias"]["value"] == pytest.approx(found.fixed_bias[0]["value"], rel=1e-4)


def test_the_compensated_curve_is_lower_where_temperature_moved_the_log(
    found: Estimation, warm: ChannelLog
) -> None:
    measured = curve_of(warm)
    left = found.allan_compensated
    assert [row["tau"] for row in left] == measured.tau.tolist()
    adev = np.array([row["adev"] for row in left])
    ratio = measured.deviation / adev
    assert ratio[measured.tau < 10] == pytest.approx(1.0, abs=0.01)
    # At a quarter to a half of the period the cosine of 4 K is far above the noise.
    slow = (measured.tau > 800) & (measured.tau < 2500)
    assert slow.sum() >= 3 and ratio[slow].min() > 5.0
    assert all(row["lower"] < row["adev"] < row["upper"] for row in left)


def test_the_compensated_curve_is_that_of_the_noise_alone(
    found: Estimation, warm: ChannelLog
) -> None:
    measured = curve_of(warm)
    alone = allan_variance(
        samples(0.0), RATE, cluster_sizes=measured.cluster_size, overlap="octave"
    )
    adev = np.array([row["adev"] for row in found.allan_compensated])
    np.testing.assert_allclose(adev, alone.deviation, rtol=0.05)


def test_method_compensated_has_the_noise_that_temperature_leaves(found: Estimation) -> None:
    by_method = {method: [row for row in found.parameters if row["method"] == method]
                 for method in METHODS}  # fmt: skip
    compensated = figures(by_method["compensated"])
    assert compensated["N"]["value"] == pytest.approx(NOISE.N, rel=0.02)
    assert compensated["K"]["lower"] < NOISE.K < compensated["K"]["upper"]
    # The cosine passes for slow noise, or for periodic drift, where it is not taken out.
    assert {row["model"] for row in by_method["compensated"]} == {"N+K"}
    with_cosine = figures(by_method["likelihood"])["K"]
    drift = any(row["kind"] == "periodic_drift" for row in found.deterministic)
    assert drift or with_cosine["value"] is None or with_cosine["lower"] > NOISE.K
    assert not any(row["recommended"] for row in by_method["compensated"])
    assert all(row["recommended"] for row in by_method["likelihood"])


def test_the_robust_method_fits_the_compensated_log_if_it_is_among_the_methods(
    found: Estimation, warm: ChannelLog
) -> None:
    robust = estimated(warm, methods=("robust", "compensated"))
    own, other = (
        figures([row for row in rows if row["method"] == "compensated"])
        for rows in (robust.parameters, found.parameters)
    )
    assert own["N"]["lower"] < NOISE.N < own["N"]["upper"]
    assert own["K"]["upper"] > NOISE.K
    assert own["N"]["upper"] != other["N"]["upper"]  # of the likelihood
    assert [row["adev"] for row in robust.allan_compensated] == [
        row["adev"] for row in found.allan_compensated
    ]


def test_the_tables_give_estimate_and_curve_back(
    found: Estimation, warm: ChannelLog, tmp_path: Path
) -> None:
    write("parameters", found.parameters, tmp_path / "parameters.parquet")
    write("allan_compensated", found.allan_compensated, tmp_path / "left.parquet")
    (back,) = (
        one
        for one in read_estimates(tmp_path / "parameters.parquet")["gyro_x"]
        if one.method == "compensated"
    )
    assert back.model.name == "N+K"
    measured = curve_of(warm)
    curve = read_compensated_curves(tmp_path / "left.parquet", {"gyro_x": measured})["gyro_x"]
    adev = [row["adev"] for row in found.allan_compensated]
    np.testing.assert_allclose(curve.deviation, adev, rtol=1e-12)
    assert curve.edf_source == ("fitted spectrum",) * len(measured.tau)
    assert curve.limits()[1] == pytest.approx([row["upper"] for row in found.allan_compensated])


@pytest.mark.release
def test_a_log_whose_temperature_does_nothing_is_left_as_it_is(tmp_path: Path) -> None:
    columns = {"gyro_x": samples(0.0)[SHORT], "temperature": TEMPERATURE[SHORT]}
    found = estimated(recorded(tmp_path, columns))
    rows = figures(found.temperature)
    assert not any(row["compensated"] for row in rows.values())
    assert rows["sensitivity"]["reason"]
    assert rows["sensitivity"]["lower"] < 0.0 < rows["sensitivity"]["upper"]
    assert found.allan_compensated == []
    assert {row["method"] for row in found.parameters} == {"likelihood", "curve"}


@pytest.mark.release  # thermal/test_fit.py has a constant temperature every day
def test_a_temperature_that_does_not_vary_is_not_taken_out(tmp_path: Path) -> None:
    columns = {"gyro_x": samples()[SHORT], "temperature": np.full(20_000, 25.0)}
    found = estimated(recorded(tmp_path, columns))
    rows = figures(found.temperature)
    assert rows["sensitivity"]["value"] is None
    assert rows["sensitivity"]["status"] == "not_identified"
    assert "changes by 0 K only" in rows["sensitivity"]["reason"]
    assert rows["T_0"]["value"] == pytest.approx(25.0)
    assert found.allan_compensated == []
    assert build("temperature", found.temperature).num_rows == 5


@pytest.mark.release
def test_missing_samples_are_missing_in_what_is_left(brief: Brief) -> None:
    found, alone = brief
    sensitivity = figures(found.temperature)["sensitivity"]
    assert sensitivity["compensated"]
    assert sensitivity["value"] == pytest.approx(SENSITIVITY, rel=0.03)
    sizes = np.array([round(row["tau"] * RATE) for row in found.allan_compensated])
    wanted = allan_variance(alone, RATE, cluster_sizes=sizes, overlap="octave")
    adev = np.array([row["adev"] for row in found.allan_compensated])
    # The longest clusters are few: there the error of the sensitivity shows.
    known = wanted.tau < 150
    np.testing.assert_allclose(adev[known], wanted.deviation[known], rtol=0.05)


# Where it is not asked for.


def test_without_readings_there_is_nothing_of_temperature(tmp_path: Path) -> None:
    log = recorded(tmp_path, {"gyro_x": samples()[SHORT]})
    assert not log.temperature
    found = estimated(log)
    assert found.temperature == found.allan_compensated == []
    assert {row["method"] for row in found.parameters} == {"likelihood", "curve"}
    assert found.low_pass


def test_temperature_is_left_alone_where_it_is_not_asked_for(warm: ChannelLog) -> None:
    assert warm.temperature
    found = estimated(warm, methods=("curve", "weighted"))
    assert found.temperature == found.allan_compensated == found.low_pass == []


@pytest.mark.release  # the test before this has the methods of the curve every day
def test_temperature_is_left_alone_beside_the_likelihood(warm: ChannelLog) -> None:
    found = estimated(warm, methods=("likelihood",))
    assert found.temperature == found.allan_compensated == []
    assert {row["method"] for row in found.parameters} == {"likelihood"}
    assert found.low_pass


@pytest.mark.release
def test_compensated_beside_the_curve_alone_is_never_recommended(brief: Brief) -> None:
    found, _ = brief
    recommended = {row["method"]: row["recommended"] for row in found.parameters}
    assert recommended == {"compensated": False, "curve": True}


def test_compensated_does_not_stand_alone() -> None:
    with pytest.raises(ConfigError, match=r"methods: .*compensated requires another method"):
        read_run({"estimate": {"methods": ["compensated"]}})
    assert "compensated" in Run().estimate.methods


def test_readings_of_temperature_are_no_channel_and_come_in_the_blocks_of_the_log(
    warm: ChannelLog,
) -> None:
    blocks, readings = list(warm.blocks()), list(warm.temperatures())
    assert [len(one) for one in blocks] == [len(one) for one in readings]
    np.testing.assert_array_equal(np.concatenate(readings), TEMPERATURE)


# The sensor's own low-pass.


def test_a_log_without_a_filter_has_the_row_that_says_so(found: Estimation) -> None:
    rows = figures(found.low_pass)
    assert list(rows) == ["cutoff"]
    assert rows["cutoff"]["status"] == "absent" and rows["cutoff"]["value"] is None
    assert rows["cutoff"]["order"] is None
    assert rows["cutoff"]["unit"] == "Hz"
    assert not [row for row in found.parameters if row["parameter"] == "N_sensor"]


@pytest.mark.release
def test_a_filter_has_its_cutoff_order_and_the_noise_on_both_sides(tmp_path: Path) -> None:
    # A first-order filter of 0.5 Hz, exactly: an AR(1) sequence of variance N^2 pi f_c.
    rng, N, cutoff = np.random.default_rng(4), 1e-3, 0.5
    decay = np.exp(-2 * np.pi * cutoff / RATE)
    driven = N * np.sqrt(np.pi * cutoff * (1 - decay**2)) * rng.standard_normal(SAMPLES)
    log = np.empty(SAMPLES)
    value = 0.0
    for i, step in enumerate(driven):
        value = decay * value + step
        log[i] = value
    floor = 2e-4
    log += floor * np.sqrt(RATE) * rng.standard_normal(SAMPLES)
    found = estimated(recorded(tmp_path, {"gyro_x": log}), methods=("likelihood",))
    rows = figures(found.low_pass)
    assert list(rows) == ["cutoff", "floor"]
    assert {row["order"] for row in rows.values()} == {1}
    rows |= {row["parameter"]: row for row in found.parameters if "N" in row["parameter"]}
    in_the_log = N * np.sqrt(np.pi * cutoff / RATE / np.tanh(np.pi * cutoff / RATE))
    assert rows["N"]["value"] == pytest.approx(np.hypot(in_the_log, floor), rel=0.05)
    for name, true in (("cutoff", cutoff), ("N_sensor", N)):
        assert rows[name]["lower"] < true < rows[name]["upper"], name
        assert rows[name]["value"] == pytest.approx(true, rel=0.05), name
    assert rows["floor"]["value"] == pytest.approx(floor, rel=0.1)
    assert rows["floor"]["unit"] == "rad/s/sqrt(Hz)"
    assert build("low_pass", found.low_pass).num_rows == 2
