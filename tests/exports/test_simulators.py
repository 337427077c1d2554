"""Files of simulators: their parameters, read back, in the recursions of the programs."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.extensions.exports.imu import AxisNoise, Imu
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from tests.exports.sensors import ACCEL, EACH, GYRO, Array, imu, imu_of_each, write_text

RATE = 20.0


def compared(log: Array, model: NoiseModel, rate: float, tau: list[float]) -> Array:
    """Return the relative differences of the Allan variance, over their spread."""
    n = np.array([round(t * rate) for t in tau])
    curve = allan_variance(log, rate, cluster_sizes=n, overlap="octave")
    ratio = curve.variance / model.allan_variance(curve.tau)
    return (ratio - 1.0) / np.sqrt(2.0 / curve.edf)


def error_dictionary(sensor: Imu) -> dict[str, Array]:
    namespace: dict[str, dict[str, Array]] = {}
    exec(write_text("gnss-ins-sim", sensor), namespace)
    return namespace["imu_err"]


def gnss_ins_sim_log(
    walk: float, stability: float, corr: float, rate: float, samples: int, seed: int
) -> Array:
    """Return what bias_drift and the white noise of gyro_gen and acc_gen make; SI."""
    rng = np.random.default_rng(seed)
    drive = stability * np.sqrt(1.0 - np.exp(-2.0 / (rate * corr)))
    drift = lfilter([0.0, drive], [1.0, -(1.0 - 1.0 / rate / corr)], rng.standard_normal(samples))
    return drift + walk * np.sqrt(rate) * rng.standard_normal(samples)


def test_gnss_ins_sim_makes_the_model() -> None:
    found = error_dictionary(imu(rate=RATE))
    assert all(value.shape == (3,) for value in found.values())
    samples = round(40_000.0 * RATE)
    gyro = gnss_ins_sim_log(
        np.radians(found["gyro_arw"][0]) / 60.0,
        np.radians(found["gyro_b_stability"][0]) / 3600.0,
        found["gyro_b_corr"][0],
        RATE,
        samples,
        1,
    )
    accel = gnss_ins_sim_log(
        found["accel_vrw"][0] / 60.0,
        found["accel_b_stability"][0],
        found["accel_b_corr"][0],
        RATE,
        samples,
        2,
    )
    for log, model in ((gyro, GYRO), (accel, ACCEL)):
        assert np.all(np.abs(compared(log, model, RATE, [0.2, 2.0, 20.0, 60.0])) < 4.0)


def test_gnss_ins_sim_takes_the_deviation_of_the_process_and_not_its_bias_instability() -> None:
    found = error_dictionary(imu(gyro=NoiseModel(N=1e-4, B=1e-4, T_B=50.0)))
    assert np.radians(found["gyro_b_stability"][0]) / 3600.0 == pytest.approx(1.0761e-4, rel=1e-4)
    assert found["gyro_b_corr"][0] == 50.0
    none = error_dictionary(imu(gyro=NoiseModel(N=1e-4)))
    # an infinite correlation time would be white noise to the program
    assert none["gyro_b_stability"][0] == 0.0
    assert np.isfinite(none["gyro_b_corr"][0])


def test_gnss_ins_sim_says_where_a_process_is_too_short_for_it() -> None:
    text = write_text("gnss-ins-sim", imu(gyro=NoiseModel(N=1e-4, B=1e-4, T_B=0.1), rate=RATE))
    assert "inaccurate for so short a process" in text.replace("\n#  ", "")


def imu_sensor_log(text: str, member: str, rate: float, samples: int, seed: int) -> Array:
    """Return what an imuSensor of the script makes."""
    block = re.search(rf"IMU\.{member} = \w+\((.*?)\); ", text, re.DOTALL)
    assert block
    assert "'NoiseType', 'single-sided'" in block[1]
    values = {
        name: float(value)
        for name, value in re.findall(r"'(\w+)', \[([^,\]]+), [^\]]+\]", block[1])
        if name != "Denominator"
    }
    poles = re.search(r"fractalcoef\((\d+)\)", block[1])
    denominator = re.search(r"'Denominator', \[1, ([^\]]+)\]", block[1])
    if poles:
        k = np.arange(1, int(poles[1]) + 1)
        coefficients = np.concatenate(([1.0], np.cumprod((k - 1.5) / k)))  # Kasdin, eq. 116
    else:
        assert denominator
        coefficients = np.array([1.0, float(denominator[1])])
    rng = np.random.default_rng(seed)
    bandwidth = rate  # "single-sided"; half of it otherwise
    drift = lfilter([1.0], coefficients, values["BiasInstability"] * rng.standard_normal(samples))
    walk = np.cumsum(values["RandomWalk"] / np.sqrt(bandwidth) * rng.standard_normal(samples))
    white = values["NoiseDensity"] * np.sqrt(bandwidth) * rng.standard_normal(samples)
    return drift + walk + white


@pytest.mark.parametrize("member", ["Gyroscope", "Accelerometer"])
def test_matlab_makes_the_model_at_every_tau(member: str) -> None:
    text = write_text("matlab", imu(rate=RATE))
    assert f"IMU.SampleRate = {RATE:g};" in text
    log = imu_sensor_log(text, member, RATE, round(80_000.0 * RATE), 3)
    model = {"Gyroscope": GYRO, "Accelerometer": ACCEL}[member]
    assert np.all(np.abs(compared(log, model, RATE, [0.2, 2.0, 20.0, 60.0, 500.0])) < 4.0)


def test_matlab_makes_flicker_noise_up_to_the_horizon() -> None:
    model = NoiseModel(N=1e-5, B=1e-3, K=1e-6)
    rate = 10.0
    text = write_text("matlab", imu(gyro=model, rate=rate, horizon=15.0))
    assert "fractalcoef(300)" in text
    log = imu_sensor_log(text, "Gyroscope", rate, 400_000, 4)
    n = np.array([10, 50, 150])
    curve = allan_variance(log, rate, cluster_sizes=n, overlap="octave")
    np.testing.assert_allclose(curve.deviation / np.sqrt(model.allan_variance(n / rate)), 1.0, 0.05)


def test_matlab_without_poles_enough_takes_the_nearest_process() -> None:
    text = write_text("matlab", imu(gyro=NoiseModel(N=1e-5, B=1e-3), rate=1000.0, horizon=60.0))
    assert "replaced by a Gauss-Markov process" in text.replace("\n%  ", "")


def test_matlab_takes_one_quantity_alone() -> None:
    text = write_text(
        "matlab", Imu(sensor="one", rate=100.0, estimated={"gyro": AxisNoise(GYRO, "gyro_x")})
    )
    assert "IMU.Gyroscope" in text
    assert "IMU.Accelerometer" not in text


def test_two_processes_are_replaced_by_one_in_both() -> None:
    model = NoiseModel(N=1e-4, B=1e-4, T_B=5.0, further=[GaussMarkov(1e-4, 50.0)])
    for target in ("matlab", "gnss-ins-sim"):
        text = write_text(target, imu(gyro=model))
        joined = re.sub(r"\n[#%]  +", " ", text)
        assert "with the same Allan variance at the horizon of 60 s" in joined


def gazebo_noise(text: str) -> dict[str, dict[str, float]]:
    """Return the settings of each axis, by its path in the element ``imu``."""
    sensor = ElementTree.fromstring(text.encode()).find("model/link/sensor/imu")
    assert sensor is not None
    return {
        f"{quantity.tag}/{axis.tag}": {
            each.tag: float(each.text or "") for noise in axis for each in noise
        }
        for quantity in sensor
        for axis in quantity
    }


def gazebo_log(found: dict[str, float], rate: float, samples: int, seed: int) -> Array:
    """Return what GaussianNoiseModel::ApplyImpl adds, with the bias of Load."""
    rng = np.random.default_rng(seed)
    tau, drive = found["dynamic_bias_correlation_time"], found["dynamic_bias_stddev"]
    step = np.sqrt(-(drive**2) * tau / 2.0 * np.expm1(-2.0 / rate / tau))
    phi = np.exp(-1.0 / rate / tau)
    first = found["bias_mean"] + found["bias_stddev"] * rng.standard_normal()
    bias, _ = lfilter([1.0], [1.0, -phi], step * rng.standard_normal(samples), zi=[phi * first])
    return bias + found["mean"] + found["stddev"] * rng.standard_normal(samples)


@pytest.mark.parametrize("path", ["angular_velocity/x", "linear_acceleration/z"])
def test_gazebo_makes_the_model(path: str) -> None:
    model = NoiseModel(N=1e-4, B=9e-5, T_B=30.0)
    text = write_text("gazebo", imu(gyro=model, accel=model, rate=RATE))
    found = gazebo_noise(text)[path]
    assert f"<update_rate>{RATE}</update_rate>" in text
    log = gazebo_log(found, RATE, round(60_000.0 * RATE), 5)
    assert np.all(np.abs(compared(log, model, RATE, [0.2, 2.0, 20.0, 200.0])) < 4.0)
    # stationary from the first sample
    assert found["bias_stddev"] == pytest.approx(1.0761 * model.B, rel=1e-4)


def test_each_axis_is_simulated_with_its_own_noise() -> None:
    sensor = imu_of_each()
    N = {name: [models.get(axis, models["z"]).N for axis in "xyz"] for name, models in EACH.items()}
    text = write_text("gnss-ins-sim", sensor)
    namespace: dict[str, dict[str, Array]] = {}
    exec(text, namespace)
    found = namespace["imu_err"]
    np.testing.assert_allclose(np.radians(found["gyro_arw"]) / 60.0, N["gyro"], rtol=1e-6)
    np.testing.assert_allclose(found["accel_vrw"] / 60.0, N["accel"], rtol=1e-6)
    joined = text.replace("\n#  ", "")
    assert "gyro x: gyro x of a." in joined and "accel y: accel y of a." in joined
    assert "gyro: the axes without an estimate have the following noise." in joined
    assert "accel: the axes" not in joined
    stddev = {
        name: one["stddev"] for name, one in gazebo_noise(write_text("gazebo", sensor)).items()
    }
    for axis, of_gyro, of_accel in zip("xyz", N["gyro"], N["accel"], strict=True):
        assert stddev[f"angular_velocity/{axis}"] == pytest.approx(10.0 * of_gyro, rel=1e-6)
        assert stddev[f"linear_acceleration/{axis}"] == pytest.approx(10.0 * of_accel, rel=1e-6)
    vectors = re.findall(r"'NoiseDensity', \[([^\]]+)\]", write_text("matlab", sensor))
    for vector, expected in zip(vectors, N.values(), strict=True):
        np.testing.assert_allclose([float(one) for one in vector.split(", ")], expected, rtol=1e-6)


def test_an_overbound_is_of_the_chosen_axis_for_all() -> None:
    sensor = imu_of_each()
    gyro = replace(sensor.estimated["gyro"], bounded=(0.01, 1.0))
    bounded = replace(sensor, estimated={**sensor.estimated, "gyro": gyro})
    found = gazebo_noise(write_text("gazebo", bounded))
    assert len({found[f"angular_velocity/{axis}"]["stddev"] for axis in "xyz"}) == 1


def test_axes_with_other_correlation_times_share_one_filter_in_matlab() -> None:
    times = {"x": 20.0, "y": 60.0, "z": 90.0}
    models = {axis: NoiseModel(N=1e-5, B=4e-5, T_B=T) for axis, T in times.items()}
    each = {axis: AxisNoise(model, axis) for axis, model in models.items()}
    sensor = Imu(sensor="s", rate=RATE, estimated={"gyro": AxisNoise(models["z"], "z", each=each)})
    text = write_text("matlab", sensor)
    pole = float(re.search(r"'Denominator', \[1, -([^\]]+)\]", text)[1])  # type: ignore[index]  # or fails
    T_B = -1.0 / (RATE * np.log(pole))
    assert 20.0 < T_B < 90.0
    drives = re.search(r"'BiasInstability', \[([^\]]+)\]", text)
    assert drives
    for axis, drive in zip("xyz", map(float, drives[1].split(", ")), strict=True):
        own = models[axis].allan_variance(np.array([60.0]))
        deviation = drive / np.sqrt(1.0 - pole**2)
        made = NoiseModel(N=1e-5, B=deviation / 1.0761, T_B=T_B).allan_variance(np.array([60.0]))
        np.testing.assert_allclose(made, own, rtol=1e-3)
        assert f"gyro {axis}: Gauss-Markov process" in text.replace("\n%  ", "")
