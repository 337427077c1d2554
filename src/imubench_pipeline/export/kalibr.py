"""Kalibr: ``imu.yaml``.

Densities are continuous in time and two-sided, ``*_noise_density`` is N and ``*_random_walk`` is
K; Kalibr itself multiplies the first by sqrt(update_rate). All four must be above 0.

Sources: ethz-asl/kalibr, wiki page "IMU Noise Model" (E[n n'] = sigma^2 delta, sigma_d = sigma /
sqrt(dt)), and aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py, class
ImuParameters (names, checks, conversion).
"""

from __future__ import annotations

from imubench_pipeline.export.comments import (
    describe_model,
    format_comments,
    format_decimal,
    format_setting,
)
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.target import Target
from imubench_pipeline.export.walks import (
    CONVENTION,
    TOPIC,
    format_densities,
    map_to_positive_walks,
)


def write(imu: Imu) -> str:
    """Return ``imu.yaml``."""
    mapped = map_to_positive_walks(imu, "Kalibr")
    return (
        format_comments(describe_model(imu, "Kalibr", CONVENTION, mapped))
        + format_densities(mapped)
        + format_setting("rostopic", TOPIC, "of sensor_msgs/Imu")
        + format_setting("update_rate", format_decimal(imu.rate), "Hz")
    )


TARGET = Target("kalibr", "Kalibr", "imu.yaml", write, "N+K")
