"""ORB-SLAM3: the lines ``IMU.*`` of its settings.

``IMU.NoiseGyro`` and ``IMU.NoiseAcc`` are N, ``IMU.GyroWalk`` and ``IMU.AccWalk`` K: continuous in
time; the tracking multiplies the first by sqrt(IMU.Frequency) and divides the second by it. Each
must be written as a real number, the frequency too, or the program ends.

Sources: UZ-SLAMLab/ORB_SLAM3, src/Settings.cc (readIMU, readParameter<float>), src/Tracking.cc
(``IMU::Calib(Tbc, Ng*sf, Na*sf, Ngw/sf, Naw/sf)`` and the units it prints), src/ImuTypes.cc
(the propagation).
"""

from __future__ import annotations

from imubench_pipeline.export.comments import (
    describe_model,
    format_comments,
    format_decimal,
    format_exponential,
    format_setting,
)
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.target import Target
from imubench_pipeline.export.walks import map_to_positive_walks

_CONVENTION = (
    "N as IMU.Noise* and K as IMU.*Walk: continuous in time, two-sided, SI; the program itself "
    "multiplies by the root of IMU.Frequency, or divides by it."
)


def write(imu: Imu) -> str:
    """Return the lines of the settings that concern the noise of the sensor; walks are inverted."""
    mapped = map_to_positive_walks(imu, "ORB-SLAM3")
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    about = [
        *describe_model(imu, "ORB-SLAM3", _CONVENTION, mapped),
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


TARGET = Target("orb-slam3", "ORB-SLAM3", "orb_slam3_imu.yaml", write, "N+K")
