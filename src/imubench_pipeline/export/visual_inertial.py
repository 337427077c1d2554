"""Programs of visual-inertial navigation, with white noise N and random walk K.

Kalibr, OpenVINS, Basalt and ORB-SLAM3 take densities that are continuous in time and two-sided, SI,
all above 0; VINS-Fusion takes standard deviations of samples.
"""

import json
import math

from imubench_pipeline.export.comments import (
    describe_model,
    format_comments,
    format_decimal,
    format_exponential,
    format_setting,
)
from imubench_pipeline.export.imu import ExportError, Imu
from imubench_pipeline.export.mapping import Mapped, as_walk

_KALIBR_CONVENTION = (
    "N as *_noise_density and K as *_random_walk: continuous in time, two-sided (sigma^2(tau) = "
    "N^2 / tau and K^2 tau / 3), SI; not multiplied by the root of the rate."
)
_VINS_CONVENTION = (
    "acc_n, gyr_n = N sqrt(2 rate) and acc_w, gyr_w = K sqrt(rate): discrete in time, for samples "
    "at {rate:g} Hz only. What the midpoint propagation makes of them is N^2 and K^2 times the "
    "time; N and K are two-sided densities."
)
_BASALT_CONVENTION = (
    "*_noise_std is N (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)) and *_bias_std is K (rad/s^2/sqrt(Hz), "
    "m/s^3/sqrt(Hz)), continuous in time and two-sided, of x, y and z."
)
_ORB_CONVENTION = (
    "N as IMU.Noise* and K as IMU.*Walk: continuous in time, two-sided, SI; the program itself "
    "multiplies by the root of IMU.Frequency, or divides by it."
)


def map_to_walks(imu: Imu) -> dict[str, Mapped]:
    """Return gyro and accelerometer as white noise and random walk; ExportError without both."""
    imu.require_both()
    return {name: as_walk(axis.model, imu.horizon, imu.rate) for name, axis in imu.axes.items()}


def _map_to_positive_walks(imu: Imu, program: str) -> dict[str, Mapped]:
    """Return `map_to_walks` for a program that takes no 0; ExportError if a density is 0."""
    mapped = map_to_walks(imu)
    for name, axis in mapped.items():
        for letter in ("N", "K"):
            if not getattr(axis.model, letter) > 0.0:
                raise ExportError(
                    f"{name}: {letter} is 0, and {program} takes values above 0 only; a longer "
                    "log, or an overbound, gives one"
                )
    return mapped


def _format_densities(mapped: dict[str, Mapped], indent: str = "") -> str:
    """Return the four densities of Kalibr and OpenVINS."""
    text = ""
    for name, word, unit, slower in (
        ("accel", "accelerometer", "m/s^2", "m/s^3"),
        ("gyro", "gyroscope", "rad/s", "rad/s^2"),
    ):
        N, K = (format_exponential(value) for value in (mapped[name].model.N, mapped[name].model.K))
        text += format_setting(f"{word}_noise_density", N, f"N, {unit}/sqrt(Hz)", indent)
        text += format_setting(f"{word}_random_walk", K, f"K, {slower}/sqrt(Hz)", indent)
    return text


def write_kalibr(imu: Imu) -> str:
    """Return ``imu.yaml``; Kalibr itself multiplies N by sqrt(update_rate).

    Sources: ethz-asl/kalibr, wiki page "IMU Noise Model" (E[n n'] = sigma^2 delta, sigma_d = sigma
    / sqrt(dt)), and aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py, class
    ImuParameters (names, checks, conversion).
    """
    mapped = _map_to_positive_walks(imu, "Kalibr")
    return (
        format_comments(describe_model(imu, "Kalibr", _KALIBR_CONVENTION, mapped))
        + _format_densities(mapped)
        + format_setting("rostopic", json.dumps(imu.ros_topic), "of sensor_msgs/Imu")
        + format_setting("update_rate", format_decimal(imu.rate), "Hz")
    )


def write_openvins(imu: Imu) -> str:
    """Return ``kalibr_imu_chain.yaml``, with the identity for extrinsics and intrinsics.

    The propagation takes sigma^2 / dt for the white noise and sigma^2 dt for the biases.

    Sources: rpng/open_vins, config/euroc_mav/kalibr_imu_chain.yaml (form and names),
    ov_msckf/src/utils/NoiseManager.h (units), ov_msckf/src/state/Propagator.cpp (discretisation).
    """
    mapped = _map_to_positive_walks(imu, "OpenVINS")
    about = [
        *describe_model(imu, "OpenVINS", _KALIBR_CONVENTION, mapped),
        "Extrinsics and intrinsics (T_i_b, Tw, Ta, Tg, R_*) describe an ideal sensor.",
    ]
    indent = "  "

    def matrix(name: str, size: int, diagonal: float = 1.0) -> str:
        rows = [[diagonal if i == j else 0.0 for j in range(size)] for i in range(size)]
        return f"  {name}:\n" + "".join(f"    - {row}\n" for row in rows)

    return (
        "%YAML:1.0\n\n"
        + format_comments(about)
        + "imu0:\n"
        + matrix("T_i_b", 4)
        + _format_densities(mapped, indent)
        + format_setting("rostopic", json.dumps(imu.ros_topic), "of sensor_msgs/Imu", indent)
        + format_setting("time_offset", format_decimal(0.0), "s", indent)
        + format_setting("update_rate", format_decimal(imu.rate), "Hz", indent)
        + format_setting("model", '"kalibr"', "of the intrinsics", indent)
        + "".join(matrix(name, 3) for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"))
        + matrix("Tg", 3, diagonal=0.0)
    )


def write_vins_fusion(imu: Imu) -> str:
    """Return the lines of the configuration of VINS-Fusion and VINS-Mono that concern the sensor.

    The configuration calls ``acc_n``, ``gyr_n``, ``acc_w`` and ``gyr_w`` standard deviations and
    gives no unit. The propagation takes them per sample, discrete in time: a step of dt adds
    (dt / 2)^2 (n_k^2 + n_(k+1)^2) to the variance of angle and velocity, where the noises of both
    samples are independent and equal ``*_n``, and (dt ``*_w``)^2 to the variance of the bias. The
    true increments are N^2 dt and K^2 dt, so

        acc_n = N sqrt(2 rate),   acc_w = K sqrt(rate).

    A sample has the standard deviation N sqrt(rate). The factor sqrt(2) compensates for the
    midpoint rule: each sample enters two steps with half the weight, and the propagation treats it
    as two independent samples. With N sqrt(rate) the covariance would be half of the true one.

    Sources: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h
    (``noise``, ``V`` of the midpoint integration), vins_estimator/src/estimator/parameters.cpp and
    config/euroc/euroc_mono_imu_config.yaml (names).
    """
    mapped = map_to_walks(imu)
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    per_sample, per_step = math.sqrt(2.0 * imu.rate), math.sqrt(imu.rate)
    about = [
        *describe_model(imu, "VINS-Fusion", _VINS_CONVENTION.format(rate=imu.rate), mapped),
        "These lines replace the lines of the same name in the configuration.",
    ]
    values = [
        ("acc_n", accel.N * per_sample, f"m/s^2 a sample, N = {accel.N:.4e}"),
        ("gyr_n", gyro.N * per_sample, f"rad/s a sample, N = {gyro.N:.4e}"),
        ("acc_w", accel.K * per_step, f"m/s^3, K = {accel.K:.4e}"),
        ("gyr_w", gyro.K * per_step, f"rad/s^2, K = {gyro.K:.4e}"),
    ]
    return (
        "%YAML:1.0\n\n"
        + format_comments(about)
        + format_setting("imu", "1", "use it")
        + format_setting("imu_topic", json.dumps(imu.ros_topic), "of sensor_msgs/Imu")
        + "".join(
            format_setting(key, format_exponential(value), words) for key, value, words in values
        )
        + format_setting("g_norm", format_decimal(imu.gravity), "gravity, m/s^2")
    )


def write_basalt(imu: Imu) -> str:
    """Return JSON with the fields of the sensor in ``value0``; copy them into your own file.

    The noises are vectors of three axes (older releases take scalars); Basalt multiplies N by
    sqrt(imu_update_rate) and divides the weight of a change of bias by sqrt(dt).

    Sources: VladyslavUsenko/basalt, data/euroc_ds_calib.json (form);
    basalt-headers, include/basalt/calibration/calibration.hpp ("continuous time noise standard
    deviation", sigma_d = sigma_c sqrt(r)) and include/basalt/serialization/headers_serialization.h
    (names); VladyslavUsenko/basalt, src/vi_estimator/sqrt_keypoint_vio.cpp (weight of the biases).
    """
    mapped = _map_to_positive_walks(imu, "Basalt")
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    content = {
        "about": describe_model(imu, "Basalt", _BASALT_CONVENTION, mapped),
        "value0": {
            "imu_update_rate": imu.rate,
            "accel_noise_std": [accel.N] * 3,
            "gyro_noise_std": [gyro.N] * 3,
            "accel_bias_std": [accel.K] * 3,
            "gyro_bias_std": [gyro.K] * 3,
        },
    }
    return json.dumps(content, indent=4) + "\n"


def write_orb_slam3(imu: Imu) -> str:
    """Return the lines ``IMU.*`` of the settings of ORB-SLAM3 that concern the noise.

    The tracking multiplies N by sqrt(IMU.Frequency) and divides K by it. Each value must be written
    as a real number, the frequency too, or the program ends.

    Sources: UZ-SLAMLab/ORB_SLAM3, src/Settings.cc (readIMU, readParameter<float>), src/Tracking.cc
    (``IMU::Calib(Tbc, Ng*sf, Na*sf, Ngw/sf, Naw/sf)`` and the units it prints), src/ImuTypes.cc
    (the propagation).
    """
    mapped = _map_to_positive_walks(imu, "ORB-SLAM3")
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    about = [
        *describe_model(imu, "ORB-SLAM3", _ORB_CONVENTION, mapped),
        "These lines go into the settings of the camera, beside IMU.T_b_c1.",
    ]
    return (
        "%YAML:1.0\n\n"
        + format_comments(about)
        + format_setting("IMU.NoiseGyro", format_exponential(gyro.N), "N, rad/s/sqrt(Hz)")
        + format_setting("IMU.NoiseAcc", format_exponential(accel.N), "N, m/s^2/sqrt(Hz)")
        + format_setting("IMU.GyroWalk", format_exponential(gyro.K), "K, rad/s^2/sqrt(Hz)")
        + format_setting("IMU.AccWalk", format_exponential(accel.K), "K, m/s^3/sqrt(Hz)")
        + format_setting("IMU.Frequency", format_decimal(imu.rate), "Hz")
    )
