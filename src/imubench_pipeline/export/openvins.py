"""OpenVINS: ``kalibr_imu_chain.yaml``.

The densities are Kalibr's: continuous in time, two-sided. The propagation takes sigma^2 / dt for
the white noise and sigma^2 dt for the biases. Extrinsics and intrinsics of the sensor, which the
file also holds, are the identity here.

Sources: rpng/open_vins, config/euroc_mav/kalibr_imu_chain.yaml (form and names),
ov_msckf/src/utils/NoiseManager.h (units), ov_msckf/src/state/Propagator.cpp (discretisation).
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
    """Return ``kalibr_imu_chain.yaml``."""
    mapped = map_to_positive_walks(imu, "OpenVINS")
    about = [
        *describe_model(imu, "OpenVINS", CONVENTION, mapped),
        "Extrinsics and intrinsics (T_i_b, Tw, Ta, Tg, R_*) are those of an ideal sensor.",
    ]
    indent = "  "
    return (
        "%YAML:1.0\n\n"
        + format_comments(about)
        + "imu0:\n"
        + _format_matrix("T_i_b", 4)
        + format_densities(mapped, indent)
        + format_setting("rostopic", TOPIC, "of sensor_msgs/Imu", indent)
        + format_setting("time_offset", format_decimal(0.0), "s", indent)
        + format_setting("update_rate", format_decimal(imu.rate), "Hz", indent)
        + format_setting("model", '"kalibr"', "of the intrinsics", indent)
        + "".join(_format_matrix(name, 3) for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"))
        + _format_matrix("Tg", 3, diagonal="0.0")
    )


def _format_matrix(name: str, size: int, diagonal: str = "1.0") -> str:
    text = f"  {name}:\n"
    for i in range(size):
        text += f"    - [{', '.join(diagonal if i == j else '0.0' for j in range(size))}]\n"
    return text


TARGET = Target("openvins", "OpenVINS", "kalibr_imu_chain.yaml", write, "N+K")
