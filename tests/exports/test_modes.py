"""The modes of an exported file."""

import math

import pytest
import yaml

from imubench_pipeline.extensions.exports.imu import AxisNoise, ExportError, Imu
from imubench_pipeline.extensions.exports.in_use import InUseNoise
from imubench_pipeline.extensions.exports.modes import (
    FLIGHT_TARGETS,
    FLOORS,
    apply_mode,
    choose_mode,
)
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from tests.exports.sensors import imu_of_each, write_text
from tests.exports.test_filters import mavparm

GYRO = AxisNoise(NoiseModel(N=1e-4, B=2e-5, K=1e-6), "gyro x of bench")
ACCEL = AxisNoise(NoiseModel(N=1e-3, K=2e-5), "accel x of bench")
IMU = Imu(sensor="mine", rate=200.0, estimated={"gyro": GYRO, "accel": ACCEL})


def test_a_program_that_flies_has_its_defaults_unless_bench_is_asked_for() -> None:
    assert choose_mode(None, "px4") == "in-use"
    assert choose_mode("bench", "px4") == "bench"
    assert choose_mode(None, "kalibr") == "bench"
    text = write_text("px4", apply_mode(IMU, TARGETS["px4"], choose_mode(None, "px4")))
    values = {
        row.split("\t")[2]: float(row.split("\t")[3])
        for row in text.splitlines()
        if not row.startswith("#")
    }
    # The defaults of EKF2, as its parameter reference lists them.
    assert values["EKF2_GYR_NOISE"] == pytest.approx(0.015, rel=1e-6)
    assert values["EKF2_ACC_NOISE"] == pytest.approx(0.35, rel=1e-6)
    assert values["EKF2_GYR_B_NOISE"] == pytest.approx(1e-3, rel=1e-6)
    assert values["EKF2_ACC_B_NOISE"] == pytest.approx(3e-3, rel=1e-6)
    assert "IN USE, NOT MEASURED: at least the defaults of EKF2" in text


def test_ardupilot_has_the_defaults_of_ekf3() -> None:
    target = TARGETS["ardupilot"]
    text = str(target.write(apply_mode(IMU, target, choose_mode(None, "ardupilot"))))
    # as AP_NavEKF3.cpp has them, for every vehicle
    assert mavparm(text) == pytest.approx(
        {
            "EK3_GYRO_P_NSE": 0.015,
            "EK3_ACC_P_NSE": 0.35,
            "EK3_GBIAS_P_NSE": 1e-3,
            "EK3_ABIAS_P_NSE": 0.02,
        }
    )
    assert choose_mode(None, "px4-mavparm") == "in-use"


def test_the_noise_of_each_axis_is_raised() -> None:
    measured = {"gyro_x": InUseNoise(4e-5, 0.1, 10.0, [])}
    raised = apply_mode(imu_of_each(), TARGETS["gazebo"], "in-use", measured)
    N = {axis: one.model.N for axis, one in raised.estimated["gyro"].each.items()}
    assert N == pytest.approx({"x": 4e-5, "z": 5e-5})  # at rest 3e-5 and 5e-5


def test_vins_fusion_has_the_values_of_its_examples() -> None:
    target = TARGETS["vins-fusion"]
    text = target.write(apply_mode(IMU, target, "in-use"))
    found = yaml.safe_load(str(text).replace("%YAML:1.0", ""))
    assert [found[key] for key in ("acc_n", "gyr_n", "acc_w", "gyr_w")] == pytest.approx(
        [0.1, 0.01, 1e-3, 1e-4], rel=1e-5
    )


def test_fast_lio_has_the_values_of_its_examples() -> None:
    target = TARGETS["fast-lio"]
    text = str(target.write(apply_mode(IMU, target, "in-use")))
    found = {
        line.split(":")[0].strip(): float(line.split(":")[1].split("#")[0])
        for line in text.splitlines()
        if "_cov:" in line
    }
    assert found["gyr_cov"] == found["acc_cov"] == pytest.approx(0.1, rel=1e-5)
    assert found["b_gyr_cov"] == found["b_acc_cov"] == pytest.approx(1e-4, rel=1e-5)


def test_ten_times_is_ten_times_every_density() -> None:
    raised = apply_mode(IMU, TARGETS["kalibr"], "in-use")
    bench = yaml.safe_load(str(TARGETS["kalibr"].write(IMU)))
    found = yaml.safe_load(str(TARGETS["kalibr"].write(raised)))
    for key in bench:
        if key.endswith(("density", "walk")):
            assert found[key] == pytest.approx(10.0 * bench[key], rel=1e-5)


@pytest.mark.parametrize(("noise", "expected"), [(5e-4, 5e-4), (2e-5, 1e-4)])
def test_the_noise_of_a_log_in_use_never_lowers_the_noise_at_rest(
    noise: float, expected: float
) -> None:
    measured = {
        "gyro_x": InUseNoise(noise / 2, 0.1, 10.0, []),
        "gyro_y": InUseNoise(noise, 0.1, 10.0, [(50.0, 0.2)]),
    }
    raised = apply_mode(IMU, TARGETS["json"], "in-use", measured)
    assert raised.estimated["gyro"].model.N == pytest.approx(expected)
    assert raised.estimated["gyro"].model.B == GYRO.model.B  # what is slow is not seen in motion
    assert raised.estimated["accel"].model.terms == ACCEL.model.terms
    assert f"lines at 50 Hz ({number(0.2)} °/s rms)" in raised.mode
    assert "Below 10 Hz all is taken as motion" in raised.mode
    assert ("no more noise than the log at rest" in raised.mode) == (noise < 1e-4)


def number(rate: float) -> str:
    return f"{math.degrees(rate):.3g}"


def test_a_program_without_a_recommendation_needs_a_log() -> None:
    with pytest.raises(ExportError, match="add --in-use LOG"):
        apply_mode(IMU, TARGETS["json"], "in-use")


def test_floors_are_of_targets() -> None:
    assert set(FLOORS) | FLIGHT_TARGETS <= set(TARGETS)
    assert set(FLOORS) >= FLIGHT_TARGETS
