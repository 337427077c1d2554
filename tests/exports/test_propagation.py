"""The prediction of each filter, with its file, against the errors of simulated sensors.

A filter predicts the variance of an angle (or velocity) and of a bias that were both known at the
start. Each function below is the prediction of one program, after its source, with two states.
"""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import yaml
from scipy.linalg import expm

from imubench_pipeline.extensions.exports.imu import Imu
from imubench_pipeline.extensions.exports.overbound import growth
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from tests.exports.sensors import Array, imu, write_text
from tests.exports.test_filters import calls, constants, ekf2, from_pyins, mavparm, opencv
from tests.exports.test_own_parser import script

RATE, SECONDS = 100.0, 30.0
WALKS = {"gyro": NoiseModel(N=8e-5, K=3e-5), "accel": NoiseModel(N=1.5e-3, K=3e-4)}
PROCESSES = {
    "gyro": NoiseModel(N=8e-5, B=9e-5, T_B=20.0),
    "accel": NoiseModel(N=1e-3, B=7e-4, T_B=20.0),
}
"""The slow terms add as much to the error as the white noise, or more."""

Step = Callable[[Array], Array]
Prediction = Callable[[Imu, str], tuple[Step, float]]
"""Takes a file and a quantity; returns the prediction of a step, and its duration in s."""


def linear(transition: Array, noise: Array) -> Step:
    return lambda P: transition @ P @ transition.T + noise


def coupled(dt: float, decay: float = 1.0) -> Array:
    """Return the transition of (integral, bias), to first order in dt."""
    return np.array([[1.0, dt], [0.0, decay]])


def continuous(white: float, walk: float, dt: float = 1.0 / RATE) -> tuple[Step, float]:
    """Multiply both densities by dt."""
    return linear(coupled(dt), np.diag([white, walk]) * dt), dt


def kalibr(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # open_vins, Propagator.cpp: sigma^2 / dt and sigma^2 dt, times the squares of the Jacobians
    found = yaml.safe_load(write_text("kalibr", sensor))
    word = {"gyro": "gyroscope", "accel": "accelerometer"}[quantity]
    sample = found[f"{word}_noise_density"] ** 2 * RATE
    return continuous(sample / RATE, found[f"{word}_random_walk"] ** 2)


def vins(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # integration_base.h: V diag(n0, n1, w) V', with halves of dt for both ends of a step
    found = opencv(write_text("vins-fusion", sensor))
    word, dt = {"gyro": "gyr", "accel": "acc"}[quantity], 1.0 / RATE
    ends = 2.0 * (0.5 * dt * found[f"{word}_n"]) ** 2
    return linear(coupled(dt), np.diag([ends, (dt * found[f"{word}_w"]) ** 2])), dt


def lio_sam(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # ImuFactor between two key frames, with one bias; the bias changes at a key frame
    found = yaml.safe_load(write_text("lio-sam", sensor))["lio_sam"]
    word, between = {"gyro": "Gyr", "accel": "Acc"}[quantity], 0.1
    white = found[f"imu{word}Noise"] ** 2
    walk = (np.sqrt(between) * found[f"imu{word}BiasN"]) ** 2
    return linear(coupled(between), np.diag([white * between, walk])), between


def fast_lio(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # esekfom.hpp, predict: (dt f_w) Q (dt f_w)'
    found = yaml.safe_load(write_text("fast-lio", sensor))["mapping"]
    word, dt = {"gyro": "gyr", "accel": "acc"}[quantity], 1.0 / RATE
    Q = np.diag([found[f"{word}_cov"], found[f"b_{word}_cov"]])
    return linear(coupled(dt), dt**2 * Q), dt


def gtsam(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # CombinedImuFactor.cpp: theta_H_omega (wCov / dt) theta_H_omega', dt biasOmegaCovariance
    found = calls(write_text("gtsam", sensor))
    white, walk = {
        "gyro": ("setGyroscopeCovariance", "setBiasOmegaCovariance"),
        "accel": ("setAccelerometerCovariance", "setBiasAccCovariance"),
    }[quantity]
    return continuous(found[white][0], found[walk][0])


def matlab_factor(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # imu_factor.cpp: GyroscopeNoise / DeltaT a sample; SumDeltaT GyroscopeBiasNoise between nodes
    (statement,) = script(write_text("matlab-factor", sensor))
    word, between = {"gyro": "Gyroscope", "accel": "Accelerometer"}[quantity], 0.1
    white, walk = (
        float(statement.split(f"{word}{kind}=[")[1].split(",")[0])
        for kind in ("Noise", "BiasNoise")
    )
    dt = 1.0 / RATE
    samples = round(between / dt) * dt**2 * (white / dt)
    return linear(coupled(between), np.diag([samples, between * walk])), between


def ceres(sensor: Imu, quantity: str) -> tuple[Step, float]:
    found = constants(write_text("ceres", sensor))
    word = {"gyro": "Gyro", "accel": "Accel"}[quantity]
    return continuous(found[f"k{word}NoiseDensity"][0] ** 2, found[f"k{word}RandomWalk"][0] ** 2)


def pyins(sensor: Imu, quantity: str) -> tuple[Step, float]:
    _, sample, step, rate = from_pyins(sensor)[quantity]
    return continuous(sample**2 / rate, step**2 * rate)


def px4_ekf2(sensor: Imu, quantity: str) -> tuple[Step, float]:
    found = ekf2(write_text("px4", sensor))
    word, dt = {"gyro": "GYR", "accel": "ACC"}[quantity], found["EKF2_PREDICT_US"] * 1e-6
    noises = [found[f"EKF2_{word}_NOISE"], found[f"EKF2_{word}_B_NOISE"]]
    return linear(coupled(dt), np.diag(np.square(noises)) * dt**2), dt


def ekf3(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # AP_NavEKF3_core.cpp: sq(dt _gyrNoise), sq(sq(dt) _gyroBiasProcessNoise) of a delta angle
    found, dt = mavparm(write_text("ardupilot", sensor)), 0.012
    word, bias = {"gyro": ("GYRO", "GBIAS"), "accel": ("ACC", "ABIAS")}[quantity]
    noises = [dt * found[f"EK3_{word}_P_NSE"], dt**2 * found[f"EK3_{bias}_P_NSE"]]
    return linear(coupled(1.0), np.diag(np.square(noises))), dt


def gins(found: dict[str, float], quantity: str) -> tuple[Step, float]:
    # gi_engine.cpp and preintegration_normal.cc: Phi = I + F dt, Qd = (Phi Q Phi' + Q) / 2
    names = {"gyro": ("arw", "gbstd"), "accel": ("vrw", "abstd")}[quantity]
    units = {
        "gyro": (np.radians(1.0) / 60.0, np.radians(1.0) / 3600.0),
        "accel": (1.0 / 60.0, 1e-5),
    }[quantity]
    white, deviation = (np.ravel(found[n])[0] * u for n, u in zip(names, units, strict=True))
    time, dt = found["corrtime"] * 3600.0, 1.0 / RATE
    phi = coupled(dt, 1.0 - dt / time)
    Q = np.diag([white**2, 2.0 * deviation**2 / time]) * dt
    return linear(phi, (phi @ Q @ phi.T + Q) / 2.0), dt


def kf_gins(sensor: Imu, quantity: str) -> tuple[Step, float]:
    return gins(yaml.safe_load(write_text("kf-gins", sensor))["imunoise"], quantity)


def ob_gins(sensor: Imu, quantity: str) -> tuple[Step, float]:
    return gins(yaml.safe_load(write_text("ob-gins", sensor))["imumodel"], quantity)


def navego(sensor: Imu, quantity: str) -> tuple[Step, float]:
    # kf_prediction.m: A = expm(F dt), Qd = G Q G' dt, Q = diag([arw, vrw, gb_psd, ab_psd].^2)
    found = {}
    for statement in script(write_text("navego", sensor)):
        name, values = statement.removeprefix("imu.").rstrip(";").split(" = ")
        found[name] = [float(one) for one in values.strip("[]").split(", ")]
    letter, white = {"gyro": ("g", "arw"), "accel": ("a", "vrw")}[quantity]
    dt = 1.0 / found["freq"][0]
    phi = expm(np.array([[0.0, 1.0], [0.0, -1.0 / found[f"{letter}b_corr"][0]]]) * dt)
    noises = np.square([found[white][0], found[f"{letter}b_psd"][0]])
    assert found[f"{letter}_std"][0] == pytest.approx(found[white][0] / np.sqrt(dt))
    return linear(phi, np.diag(noises) * dt), dt


PREDICTIONS: dict[str, Prediction] = {
    "kalibr": kalibr,
    "openvins": kalibr,
    "vins-fusion": vins,
    "lio-sam": lio_sam,
    "fast-lio": fast_lio,
    "gtsam": gtsam,
    "matlab-factor": matlab_factor,
    "ceres": ceres,
    "pyins": pyins,
    "px4": px4_ekf2,
    "ardupilot": ekf3,
    "kf-gins": kf_gins,
    "ob-gins": ob_gins,
    "navego": navego,
}


@cache
def simulated_variance(model: NoiseModel) -> float:
    """Return the variance of the integral of simulated noise, from a bias of 0; 2.2 % 1 sigma."""
    rng = np.random.default_rng(7)
    runs, dt = 4000, 1.0 / RATE
    decay = 1.0 if model.T_B is None else np.exp(-dt / model.T_B)
    # B of IEEE Std 952 is 0.9294 times the deviation of a process (R. M. Gray's peak: 1 / 1.0761)
    of_step = (
        model.K * np.sqrt(dt) if model.T_B is None else 1.0761 * model.B * np.sqrt(1.0 - decay**2)
    )
    angle, bias = np.zeros(runs), np.zeros(runs)
    for _ in range(round(SECONDS * RATE)):
        angle += dt * bias + model.N * np.sqrt(dt) * rng.standard_normal(runs)
        bias = decay * bias + of_step * rng.standard_normal(runs)
    return float(np.mean(angle**2))


@pytest.mark.parametrize("name", PREDICTIONS)
@pytest.mark.parametrize("quantity", ["gyro", "accel"])
def test_the_predicted_covariance_is_the_one_of_simulated_errors(name: str, quantity: str) -> None:
    models = PROCESSES if TARGETS[name].family == "N+GM" else WALKS
    step, dt = PREDICTIONS[name](imu(**models, rate=RATE, horizon=SECONDS), quantity)
    P = np.zeros((2, 2))
    steps = round(SECONDS / dt)
    for _ in range(steps):
        P = step(P)
    model = models[quantity]
    assert P[0, 0] == pytest.approx(simulated_variance(model), rel=4.0 * np.sqrt(2.0 / 4000))
    exact = growth(model, np.array([steps * dt]), RATE)[0][0]
    assert exact > 2.0 * model.N**2 * SECONDS  # the bias is seen, too
    assert P[0, 0] == pytest.approx(exact, rel=0.01)  # LIO-SAM's key frames: 0.5 %


def test_each_filter_is_propagated() -> None:
    simulators = {"basalt", "orb-slam3", "px4-mavparm", "ros", "gazebo", "gnss-ins-sim"}
    filters = {name for name, one in TARGETS.items() if one.family != "N+GM+K"}
    assert filters - simulators == PREDICTIONS.keys()


@pytest.mark.parametrize("quantity", ["gyro", "accel"])
def test_covariances_of_ros_and_bias_of_pyins_are_those_of_readings(quantity: str) -> None:
    model, horizon = WALKS[quantity], 10.0
    sensor = imu(**WALKS, rate=20.0, horizon=horizon)
    message = yaml.safe_load(write_text("ros", sensor))
    word = {"gyro": "angular_velocity", "accel": "linear_acceleration"}[quantity]
    covariance = np.reshape(message[f"{word}_covariance"], (3, 3))
    assert np.array_equal(covariance, np.diag(np.diag(covariance)))
    assert message["orientation_covariance"][0] == -1.0

    rng, runs, half = np.random.default_rng(3), 4000, 200  # samples of a horizon
    walk = np.cumsum(model.K * np.sqrt(0.05) * rng.standard_normal((runs, 2 * half)), axis=1)
    log = walk + model.N * np.sqrt(20.0) * rng.standard_normal((runs, 2 * half))
    bias = log[:, :half].mean(axis=1)
    readings = np.mean((log[:, half:] - bias[:, None]) ** 2)
    assert covariance[0, 0] == pytest.approx(readings, rel=0.03)  # 1 % 1 sigma

    text = write_text("pyins", sensor).split(f"{quantity}_model")[1]
    deviation = float(text.split("bias_sd=[")[1].split(",")[0])
    assert deviation == pytest.approx(np.std(walk[:, half - 1] - bias), rel=0.06)
