"""Files of filters with white noise and random walk: loaded as they load, simulated as they do."""

import ast
import json
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.extensions.exports.imu import AxisNoise, ExportError, Imu
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from tests.exports.sensors import ACCEL, GYRO, Array, imu, midpoint, white_and_walk, write_text

SAMPLED = 100.0  # Hz; MATLAB's factorIMUParameters takes no less

Recursion = tuple[Callable[[float, float, int, int], Array], float, float, float]
"""Maker of a log, its deviation a sample and a step, and its rate."""


def opencv(text: str) -> dict[str, Any]:
    """Read YAML as OpenCV's FileStorage does: its own first line, and its grammar of numbers."""
    first, rest = text.split("\n", 1)
    assert first == "%YAML:1.0"
    found = yaml.safe_load(rest)
    for line in rest.splitlines():
        match = re.match(r"\s*[\w.]+: ([-+]?[\d.][^ #]*)", line)
        if match:
            # digits, then a point or an exponent makes it real (persistence_yml.cpp)
            assert re.fullmatch(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?", match[1]), line
    return found


def from_kalibr(sensor: Imu) -> dict[str, Recursion]:
    found = yaml.safe_load(write_text("kalibr", sensor))
    rate = found["update_rate"]
    assert found["rostopic"] == "/imu0"
    return densities(found, rate)


def from_openvins(sensor: Imu) -> dict[str, Recursion]:
    found = opencv(write_text("openvins", sensor))["imu0"]
    assert set(found) >= {"T_i_b", "Tw", "Ta", "Tg", "R_IMUtoGYRO", "R_IMUtoACC", "time_offset"}
    assert np.array_equal(found["T_i_b"], np.eye(4))
    assert not np.any(found["Tg"])
    assert found["model"] == "kalibr"
    return densities(found, found["update_rate"])


def densities(found: dict[str, float], rate: float) -> dict[str, Recursion]:
    return {
        name: (
            white_and_walk,
            found[f"{word}_noise_density"] * np.sqrt(rate),
            found[f"{word}_random_walk"] / np.sqrt(rate),
            rate,
        )
        for name, word in (("gyro", "gyroscope"), ("accel", "accelerometer"))
    }


def from_vins(sensor: Imu) -> dict[str, Recursion]:
    found = opencv(write_text("vins-fusion", sensor))
    assert found["g_norm"] == STANDARD_GRAVITY
    return {
        name: (midpoint, found[f"{word}_n"], found[f"{word}_w"] / sensor.rate, sensor.rate)
        for name, word in (("gyro", "gyr"), ("accel", "acc"))
    }


def from_orb(sensor: Imu) -> dict[str, Recursion]:
    text = write_text("orb-slam3", sensor)
    found = opencv(text)
    # the program ends at a number without a point
    assert all(isinstance(value, float) for value in found.values())
    root = np.sqrt(found["IMU.Frequency"])
    return {
        name: (
            white_and_walk,
            found[f"IMU.Noise{word}"] * root,
            found[f"IMU.{word}Walk"] / root,
            found["IMU.Frequency"],
        )
        for name, word in (("gyro", "Gyro"), ("accel", "Acc"))
    }


def from_basalt(sensor: Imu) -> dict[str, Recursion]:
    found = json.loads(write_text("basalt", sensor))["value0"]
    rate = found["imu_update_rate"]
    for key, value in found.items():
        assert key == "imu_update_rate" or len(value) == 3
    return {
        name: (
            white_and_walk,
            found[f"{name}_noise_std"][0] * np.sqrt(rate),
            found[f"{name}_bias_std"][0] / np.sqrt(rate),
            rate,
        )
        for name in ("gyro", "accel")
    }


def from_px4(sensor: Imu) -> dict[str, Recursion]:
    found = ekf2(write_text("px4", sensor))
    step = found["EKF2_PREDICT_US"] * 1e-6
    return {
        name: (
            white_and_walk,
            found[f"EKF2_{word}_NOISE"],
            step * found[f"EKF2_{word}_B_NOISE"],
            1.0 / step,
        )
        for name, word in (("gyro", "GYR"), ("accel", "ACC"))
    }


def from_px4_mavparm(sensor: Imu) -> dict[str, Recursion]:
    text = write_text("px4-mavparm", sensor)
    assert mavparm(text) == ekf2(write_text("px4", sensor))
    return from_px4(sensor)


def from_ardupilot(sensor: Imu) -> dict[str, Recursion]:
    found, step = mavparm(write_text("ardupilot", sensor)), 0.012  # EKF_TARGET_DT
    return {
        name: (
            white_and_walk,
            found[f"EK3_{word}_P_NSE"],
            step * found[f"EK3_{bias}_P_NSE"],
            1.0 / step,
        )
        for name, word, bias in (("gyro", "GYRO", "GBIAS"), ("accel", "ACC", "ABIAS"))
    }


def from_lio_sam(sensor: Imu) -> dict[str, Recursion]:
    found = yaml.safe_load(write_text("lio-sam", sensor))["lio_sam"]
    assert found["imuGravity"] == STANDARD_GRAVITY
    root = np.sqrt(sensor.rate)
    return {
        name: (
            white_and_walk,
            found[f"imu{word}Noise"] * root,
            found[f"imu{word}BiasN"] / root,
            sensor.rate,
        )
        for name, word in (("gyro", "Gyr"), ("accel", "Acc"))
    }


def from_fast_lio(sensor: Imu) -> dict[str, Recursion]:
    both = yaml.safe_load(write_text("fast-lio", sensor))
    assert both["imu"] == both["mapping"]
    found = both["mapping"]
    return {
        name: (
            white_and_walk,
            np.sqrt(found[f"{word}_cov"]),
            np.sqrt(found[f"b_{word}_cov"]) / sensor.rate,
            sensor.rate,
        )
        for name, word in (("gyro", "gyr"), ("accel", "acc"))
    }


def from_gtsam(sensor: Imu) -> dict[str, Recursion]:
    found = calls(write_text("gtsam", sensor))
    return {
        "gyro": of_densities(
            found["setGyroscopeCovariance"], found["setBiasOmegaCovariance"], sensor.rate
        ),
        "accel": of_densities(
            found["setAccelerometerCovariance"], found["setBiasAccCovariance"], sensor.rate
        ),
    }


def calls(text: str) -> dict[str, list[float]]:
    """Return the numbers of ``params.setX(np.diag([...]))`` by setX."""
    found = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.args:
            lists = [each for each in ast.walk(node.args[0]) if isinstance(each, ast.List)]
            if node.func.attr.startswith("set") and lists:
                found[node.func.attr] = ast.literal_eval(lists[0])
    return found


def from_matlab_factor(sensor: Imu) -> dict[str, Recursion]:
    text = write_text("matlab-factor", sensor)
    found = {
        name: [float(value) for value in values.split(", ")]
        for name, values in re.findall(r"(\w+)=\[([^\]]+)\]", text)
    }
    assert f"SampleRate={sensor.rate:g});" in text
    return {
        name: of_densities(found[f"{word}Noise"], found[f"{word}BiasNoise"], sensor.rate)
        for name, word in (("gyro", "Gyroscope"), ("accel", "Accelerometer"))
    }


def of_densities(white: list[float], walk: list[float], rate: float) -> Recursion:
    """Divide white noise by the interval of the samples, and multiply the walk by it."""
    return white_and_walk, np.sqrt(white[0] * rate), np.sqrt(walk[0] / rate), rate


def from_ceres(sensor: Imu) -> dict[str, Recursion]:
    found = constants(write_text("ceres", sensor))
    root = np.sqrt(found["kRate"][0])
    return {
        name: (
            white_and_walk,
            found[f"k{word}NoiseDensity"][0] * root,
            found[f"k{word}RandomWalk"][0] / root,
            sensor.rate,
        )
        for name, word in (("gyro", "Gyro"), ("accel", "Accel"))
    }


def constants(text: str) -> dict[str, list[float]]:
    """Return the constants of a header of C++."""
    code = "\n".join(line for line in text.split("\n") if not line.startswith("//"))
    found = re.findall(r"constexpr double (\w+)(?:\[3\])? = \{?([^;}]+)\}?;", code)
    return {name: [float(value) for value in values.split(", ")] for name, values in found}


def from_pyins(sensor: Imu) -> dict[str, Recursion]:
    tree, found = ast.parse(write_text("pyins", sensor)), {}
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            (target,) = node.targets
            values = {word.arg: ast.literal_eval(word.value) for word in node.value.keywords}
            found[target.id.removesuffix("_model")] = values  # type: ignore[attr-defined]  # a name
    root = np.sqrt(sensor.rate)
    return {
        name: (white_and_walk, model["noise"][0] * root, model["bias_walk"][0] / root, sensor.rate)
        for name, model in found.items()
    }


def mavparm(text: str) -> dict[str, float]:
    """Read lines as MAVParmDict.load does: comments, then two words, with a comma or space."""
    found = {}
    for line in text.splitlines():
        if not line.startswith("#"):
            name, value = line.replace(",", " ").split()
            found[name] = float(value)
    return found


def ekf2(text: str) -> dict[str, float]:
    found = {}
    for line in text.splitlines():
        if not line.startswith("#"):
            vehicle, component, name, value, kind = line.split("\t")
            assert (vehicle, component) == ("1", "1")
            found[name] = float(value) if kind == "9" else int(value)
    return found


PROGRAMS = {
    "kalibr": from_kalibr,
    "openvins": from_openvins,
    "vins-fusion": from_vins,
    "orb-slam3": from_orb,
    "basalt": from_basalt,
    "px4": from_px4,
    "px4-mavparm": from_px4_mavparm,
    "ardupilot": from_ardupilot,
    "lio-sam": from_lio_sam,
    "fast-lio": from_fast_lio,
    "gtsam": from_gtsam,
    "matlab-factor": from_matlab_factor,
    "ceres": from_ceres,
    "pyins": from_pyins,
}


def test_each_program_that_takes_a_walk_is_run_on_its_file() -> None:
    walks = {name for name, one in TARGETS.items() if one.family == "N+K"}
    walks.remove("ros")  # whose filter has no walk: test_covariances.py
    assert walks == PROGRAMS.keys(), f"PROGRAMS lacks {walks - PROGRAMS.keys()}"


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_file_means_the_model_in_white_noise_and_at_the_horizon(name: str) -> None:
    for quantity, (maker, sample, step, rate) in PROGRAMS[name](imu(rate=SAMPLED)).items():
        model = {"gyro": GYRO, "accel": ACCEL}[quantity]
        # what the recursion stands for: white noise halves where two fresh ends are averaged
        N = sample / np.sqrt(rate) / (np.sqrt(2.0) if maker is midpoint else 1.0)
        implied = NoiseModel(N=N, K=step * np.sqrt(rate))
        tau = np.array([0.1, 60.0])
        ratio = implied.allan_variance(tau) / model.allan_variance(tau)
        # the slow terms are in the Allan variance at 0.1 s as well
        np.testing.assert_allclose(ratio, 1.0, rtol=2e-4)


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("quantity", ["gyro", "accel"])
def test_what_the_program_simulates_has_the_allan_deviation_of_the_model(
    name: str, quantity: str
) -> None:
    maker, sample, step, rate = PROGRAMS[name](imu(rate=SAMPLED))[quantity]
    model = {"gyro": GYRO, "accel": ACCEL}[quantity]
    log = maker(sample, step, round(10_000.0 * rate), 1)
    n = np.array([round(0.2 * rate), round(rate), round(60.0 * rate)])
    curve = allan_variance(log, rate, cluster_sizes=n, overlap="octave")
    spread = np.sqrt(2.0 / curve.edf)
    ratio = curve.variance / model.allan_variance(curve.tau)
    assert np.all(np.abs(ratio - 1.0) < 4.0 * spread + 1e-3), ratio


def test_white_noise_without_a_limit_of_the_walk_is_refused() -> None:
    white = NoiseModel(N=1e-4)
    for name in ("kalibr", "openvins", "orb-slam3", "basalt", "lio-sam", "gtsam", "matlab-factor"):
        with pytest.raises(ExportError, match="gyro: K is 0"):
            TARGETS[name].write(imu(gyro=white, rate=SAMPLED))
    for name in ("kf-gins", "ob-gins", "navego"):
        with pytest.raises(ExportError, match="gyro: B is 0"):
            TARGETS[name].write(imu(gyro=white))
    assert ekf2(write_text("px4", imu(gyro=white)))["EKF2_GYR_B_NOISE"] == 0.0


def test_px4_keeps_its_ranges_and_says_so() -> None:
    quiet = imu(gyro=NoiseModel(N=1e-6, K=1e-9), accel=NoiseModel(N=1.0, K=1e-3))
    text = write_text("px4", quiet)
    assert ekf2(text)["EKF2_GYR_NOISE"] == 1e-4
    assert ekf2(text)["EKF2_ACC_NOISE"] == 1.0
    assert "EKF2_GYR_NOISE: 1e-05 is outside the range" in text


@pytest.mark.parametrize("name", TARGETS)
def test_every_file_names_its_axis_its_horizon_where_it_matters_and_units(name: str) -> None:
    content = TARGETS[name].write(imu(rate=SAMPLED))
    text = content if isinstance(content, str) else content.decode("utf-32-le", "ignore")
    joined = re.sub(r"\n(#|%|//)  +", " ", text)
    if isinstance(content, str):
        assert "gyro_z of recording a" in joined
        assert "two-sided" in joined
        longest = max(len(line) for line in text.splitlines())
        code = ("basalt", "json", "matlab", "gtsam", "ceres", "ros")
        assert name in code or longest <= 100
    if TARGETS[name].family == "N+K":
        assert "horizon of 60 s" in joined
        assert "at 30 s" in joined
        assert "at 120 s" in joined


def test_numbers_are_written_the_same_way_twice() -> None:
    for target in TARGETS.values():
        assert target.write(imu(rate=SAMPLED)) == target.write(imu(rate=SAMPLED))


def test_the_rate_of_a_factor_of_matlab_has_a_lowest_value() -> None:
    with pytest.raises(ExportError, match="the rate is 50 Hz"):
        write_text("matlab-factor", imu(rate=50.0))


def test_an_axis_with_a_zero_takes_the_noise_of_the_chosen() -> None:
    each = {
        "x": AxisNoise(NoiseModel(N=1e-5), "x"),
        "y": AxisNoise(NoiseModel(N=2e-5, K=3e-7), "y"),
    }
    sensor = imu(rate=SAMPLED)
    gyro = replace(sensor.estimated["gyro"], each=each)
    sensor = replace(sensor, estimated={**sensor.estimated, "gyro": gyro})
    text = write_text("basalt", sensor)
    values = json.loads(text)["value0"]
    chosen = values["gyro_bias_std"][2]
    assert values["gyro_noise_std"] == pytest.approx([GYRO.N, 2e-5, GYRO.N], rel=1e-6)
    assert values["gyro_bias_std"] == pytest.approx([chosen, 3e-7, chosen], rel=1e-6)
    assert "gyro x: K is 0, and Basalt takes values above 0 only; the noise of the chosen" in text
    # C++ takes a 0
    numbers = constants(write_text("ceres", sensor))
    assert numbers["kGyroNoiseDensity"] == pytest.approx([1e-5, 2e-5, GYRO.N], rel=1e-6)
    assert numbers["kGyroRandomWalk"][0] == 0.0
