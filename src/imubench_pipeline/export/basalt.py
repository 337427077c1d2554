"""Basalt: the noise of a calibration file in JSON.

``accel_noise_std`` and ``gyro_noise_std`` are N, ``accel_bias_std`` and ``gyro_bias_std`` K:
continuous in time, vectors of three axes; Basalt multiplies the first by sqrt(imu_update_rate)
and divides the weight of a change of bias by sqrt(dt). (Older releases take scalars.) A Basalt
calibration file also has cameras: copy these fields into the ``value0`` of your own file.

Sources: VladyslavUsenko/basalt, data/euroc_ds_calib.json (form);
basalt-headers, include/basalt/calibration/calibration.hpp ("continuous time noise standard
deviation", sigma_d = sigma_c sqrt(r)) and include/basalt/serialization/headers_serialization.h
(names); VladyslavUsenko/basalt, src/vi_estimator/sqrt_keypoint_vio.cpp (weight of the biases).
"""

from __future__ import annotations

import json

from imubench_pipeline.export.comments import describe_model
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.target import Target
from imubench_pipeline.export.walks import map_to_positive_walks

_CONVENTION = (
    "*_noise_std is N (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)) and *_bias_std is K (rad/s^2/sqrt(Hz), "
    "m/s^3/sqrt(Hz)), continuous in time and two-sided, of x, y and z."
)


def write(imu: Imu) -> str:
    """Return JSON with the fields of the sensor in ``value0``; Basalt divides by K."""
    mapped = map_to_positive_walks(imu, "Basalt")
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    content = {
        "about": describe_model(imu, "Basalt", _CONVENTION, mapped),
        "value0": {
            "imu_update_rate": imu.rate,
            "accel_noise_std": [accel.N] * 3,
            "gyro_noise_std": [gyro.N] * 3,
            "accel_bias_std": [accel.K] * 3,
            "gyro_bias_std": [gyro.K] * 3,
        },
    }
    return json.dumps(content, indent=4) + "\n"


TARGET = Target("basalt", "Basalt", "calibration_imu.json", write, "N+K")
