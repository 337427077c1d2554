"""VINS-Fusion and VINS-Mono: the lines ``acc_n``, ``gyr_n``, ``acc_w``, ``gyr_w`` and ``g_norm``.

The configuration calls them standard deviations and gives no unit. The propagation takes them per
sample, discrete in time: a step of dt adds (dt / 2)^2 (n_k^2 + n_(k+1)^2) to the variance of
angle and velocity, where the noises of both samples are independent and equal ``*_n``, and
(dt ``*_w``)^2 to the variance of the bias. The true increments are N^2 dt and K^2 dt, so

    acc_n = N sqrt(2 rate),   acc_w = K sqrt(rate).

A sample has the standard deviation N sqrt(rate). The factor sqrt(2) compensates for the midpoint
rule: each sample enters two steps with half the weight, and the propagation treats it as two
independent samples. With N sqrt(rate) the covariance would be half of the true one.

Sources: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h
(``noise``, ``V`` of the midpoint integration), vins_estimator/src/estimator/parameters.cpp and
config/euroc/euroc_mono_imu_config.yaml (names).
"""

from __future__ import annotations

import math

from imubench_pipeline.export.comments import (
    describe_model,
    format_comments,
    format_decimal,
    format_exponential,
    format_setting,
)
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.target import Target
from imubench_pipeline.export.walks import TOPIC, map_to_walks

_CONVENTION = (
    "acc_n, gyr_n = N sqrt(2 rate) and acc_w, gyr_w = K sqrt(rate): discrete in time, for samples "
    "at {rate:g} Hz only. What the midpoint propagation makes of them is N^2 and K^2 times the "
    "time; N and K are two-sided densities."
)


def write(imu: Imu) -> str:
    """Return the lines of the configuration that concern the sensor."""
    mapped = map_to_walks(imu)
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    per_sample, per_step = math.sqrt(2.0 * imu.rate), math.sqrt(imu.rate)
    about = [
        *describe_model(imu, "VINS-Fusion", _CONVENTION.format(rate=imu.rate), mapped),
        "These lines replace those of the same name in the configuration.",
    ]
    return (
        "%YAML:1.0\n\n"
        + format_comments(about)
        + format_setting("imu", "1", "use it")
        + format_setting("imu_topic", f'"{TOPIC}"', "of sensor_msgs/Imu")
        + format_setting(
            "acc_n", format_exponential(accel.N * per_sample), f"m/s^2 a sample, N = {accel.N:.4e}"
        )
        + format_setting(
            "gyr_n", format_exponential(gyro.N * per_sample), f"rad/s a sample, N = {gyro.N:.4e}"
        )
        + format_setting(
            "acc_w", format_exponential(accel.K * per_step), f"m/s^3, K = {accel.K:.4e}"
        )
        + format_setting(
            "gyr_w", format_exponential(gyro.K * per_step), f"rad/s^2, K = {gyro.K:.4e}"
        )
        + format_setting("g_norm", format_decimal(imu.gravity), "gravity, m/s^2")
    )


TARGET = Target("vins-fusion", "VINS-Fusion, VINS-Mono", "vins_imu.yaml", write, "N+K")
