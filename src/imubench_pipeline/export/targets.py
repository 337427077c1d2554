"""The programs that a noise model can be exported to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from imubench_pipeline.export import matrices, px4
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.overbound import Family
from imubench_pipeline.export.simulators import write_gnss_ins_sim, write_matlab
from imubench_pipeline.export.visual_inertial import (
    write_basalt,
    write_kalibr,
    write_openvins,
    write_orb_slam3,
    write_vins_fusion,
)


@dataclass(frozen=True)
class Target:
    """A program that a noise model can be exported to."""

    name: str  # in commands and settings
    program: str  # its name for people
    file_name: str  # the usual name of its file
    write: Callable[[Imu], str | bytes]
    """Returns the content of the file; ExportError if the program needs a quantity without
    estimate, or a density above 0."""
    family: Family  # terms that the program supports; an overbound for it has these


TARGETS: Mapping[str, Target] = {
    target.name: target
    for target in (
        Target("kalibr", "Kalibr", "imu.yaml", write_kalibr, "N+K"),
        Target("openvins", "OpenVINS", "kalibr_imu_chain.yaml", write_openvins, "N+K"),
        Target("vins-fusion", "VINS-Fusion, VINS-Mono", "vins_imu.yaml", write_vins_fusion, "N+K"),
        Target("basalt", "Basalt", "calibration_imu.json", write_basalt, "N+K"),
        Target("orb-slam3", "ORB-SLAM3", "orb_slam3_imu.yaml", write_orb_slam3, "N+K"),
        Target("px4", "PX4 (EKF2)", "ekf2.params", px4.write, "N+K"),
        Target("gnss-ins-sim", "gnss-ins-sim", "imu_err.py", write_gnss_ins_sim, "N+GM"),
        Target("matlab", "MATLAB (imuSensor)", "imu_noise.m", write_matlab, "N+GM+K"),
        Target("json", "any: matrices as JSON", "noise.json", matrices.write_json, "N+GM+K"),
        Target("npz", "any: matrices as NumPy arrays", "noise.npz", matrices.write_npz, "N+GM+K"),
        Target("python", "Python with NumPy", "noise.py", matrices.write_python, "N+GM+K"),
    )
}
"""All targets by their name in commands and settings."""
