"""Kalibr: ``imu.yaml``.

Densities are continuous in time and two-sided, ``*_noise_density`` is N and ``*_random_walk`` is
K; Kalibr itself multiplies the first by sqrt(update_rate). All four must be above 0.

Sources: ethz-asl/kalibr, wiki page "IMU Noise Model" (E[n n'] = sigma^2 delta, sigma_d = sigma /
sqrt(dt)), and aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py, class
ImuParameters (names, checks, conversion).
"""

from __future__ import annotations

from imubench_pipeline.export.comments import commented, heading, plain, setting
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.target import Target
from imubench_pipeline.export.walks import CONVENTION, TOPIC, densities, positive_walks


def write(imu: Imu) -> str:
    """Return ``imu.yaml``."""
    mapped = positive_walks(imu, "Kalibr")
    return (
        commented(heading(imu, "Kalibr", CONVENTION, mapped))
        + densities(mapped)
        + setting("rostopic", TOPIC, "of sensor_msgs/Imu")
        + setting("update_rate", plain(imu.rate), "Hz")
    )


TARGET = Target("kalibr", "Kalibr", "imu.yaml", write, "N+K")
