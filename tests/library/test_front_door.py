"""What `import imubench_pipeline as imu` gives."""

import doctest
import importlib
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import imubench_pipeline as imu
from imubench_pipeline import simulate as room
from imubench_pipeline.noise import simulate as noise
from imubench_pipeline.units import UnitError
from tests.conftest import few

NAMES = ["NoiseModel", "__version__", "allan_variance", "compare", "convert", "estimate",
         "export", "read_log", "simulate"]  # fmt: skip


def test_the_door_has_few_names_and_all_are_there() -> None:
    assert dir(imu) == sorted(imu.__all__) == NAMES
    assert all(getattr(imu, name) is not None for name in NAMES)
    assert imu.__version__ == version("imubench_pipeline")
    with pytest.raises(AttributeError, match="no attribute 'read_logs'"):
        _ = imu.read_logs


@pytest.mark.parametrize(
    "statement", ["import imubench_pipeline", "from imubench_pipeline import units"]
)
def test_an_import_loads_no_numerics(statement: str) -> None:
    heavy = "{'numpy', 'scipy', 'numba', 'pandas', 'matplotlib', 'pyarrow', 'pint', 'pydantic'}"
    code = f"import sys; {statement}; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_simulate_is_called_and_is_a_room() -> None:
    model = imu.NoiseModel(N=1e-4, K=1e-6)
    expected = noise.simulate(model, 100.0, 500, np.random.default_rng(3))
    for log in (
        imu.simulate(model, "100 Hz", duration="5 s", seed=3),
        imu.simulate(model, 100.0, 500, np.random.default_rng(3)),
        room.simulate(model, 100.0, 500, np.random.default_rng(3)),
    ):
        np.testing.assert_array_equal(log, expected)
    importlib.import_module("imubench_pipeline.simulate.imu")
    assert imu.simulate is room and callable(imu.simulate)


def test_channels_are_simulated_each_by_a_stream_of_its_own() -> None:
    model = imu.NoiseModel(N=1e-4)
    both = imu.simulate({"gyro_x": model, "gyro_y": model}, 10, 50, seed=1)
    alone = imu.simulate({"gyro_y": model}, 10, 50, seed=1)
    np.testing.assert_array_equal(both["gyro_y"], alone["gyro_y"])
    assert abs(np.corrcoef(both["gyro_x"], both["gyro_y"])[0, 1]) < 0.5


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"rate": "100 deg/s", "samples": 5}, "rate: 'deg/s' is no unit of frequency"),
        ({"rate": 0.0, "samples": 5}, "rate is 0.0, expected a value of frequency above 0"),
        ({"rate": np.nan, "samples": 5}, "expected a value of frequency above 0"),
        ({"rate": [1], "samples": 5}, r"rate is \[1\]"),
        ({"rate": 10}, "neither is given"),
        ({"rate": 10, "samples": 5, "duration": 1}, "both are given"),
        ({"rate": 10, "samples": 5.5}, "samples is 5.5; expected a whole number"),
        ({"rate": 10, "duration": "5 Hz"}, "duration: 'Hz' is no unit of time"),
        ({"rate": 10, "samples": 5, "seed": 1, "rng": np.random.default_rng(1)}, "expected one of"),
        ({"model": 3, "rate": 10, "samples": 5}, "model is 3, expected a NoiseModel"),
    ],
)
def test_what_cannot_be_simulated_says_why(arguments: dict, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        imu.simulate(**{"model": imu.NoiseModel(N=1.0)} | arguments)


def test_figures_are_converted_between_units_of_one_dimension() -> None:
    # 1 °/√h is 1/60 °/s/√Hz
    assert imu.convert(0.3, "deg/sqrt(h)", "deg/s/sqrt(Hz)") == pytest.approx(0.3 / 60)
    assert imu.convert(1.0, "g", "m/s^2") == 9.80665 and imu.convert(2.0, "g", "kg") == 0.002
    np.testing.assert_allclose(imu.convert(np.array([0.0, 25.0]), "degC", "K"), [273.15, 298.15])
    with pytest.raises(UnitError, match="'m/s' is no unit of angular rate but of velocity"):
        imu.convert(1.0, "deg/h", "m/s")
    with pytest.raises(UnitError, match="unknown unit 'furlong'"):
        imu.convert(1.0, "furlong", "m")
    with pytest.raises(UnitError, match=r"'K\*s' is no unit of an inertial"):
        imu.convert(1.0, "K*s", "m/s")


@pytest.mark.parametrize(
    "module",
    few(
        ["units", "simulate.samples", "library.logs", "library.curves", "library.estimates"],
        ["library.comparison"],
    ),
)
def test_the_examples_of_docstrings_hold(
    module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    table = np.random.default_rng(1).normal(0.0, 0.1, (2000, 3))
    table[:, 0] = np.arange(2000) / 100.0
    table[:, 2] += 9.81
    header = "t [s],gyro_z,acc_z [m/s^2]"
    np.savetxt("run.csv", table, delimiter=",", header=header, comments="", fmt="%.6f")
    done = doctest.testmod(importlib.import_module(f"imubench_pipeline.{module}"))
    assert done.attempted and not done.failed
