"""The programs that a noise model can be exported to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from imubench_pipeline.extensions.exports import ardupilot, matrices, px4
from imubench_pipeline.extensions.exports import factor_graphs as graphs
from imubench_pipeline.extensions.exports import gnss_filters as gnss
from imubench_pipeline.extensions.exports import simulators as sim
from imubench_pipeline.extensions.exports import visual_inertial as vi
from imubench_pipeline.extensions.exports.imu import Imu
from imubench_pipeline.extensions.exports.overbound import Family
from imubench_pipeline.extensions.exports.programs import Program
from imubench_pipeline.report.site import make_command

_MATRICES = "https://doi.org/10.1109/TAC.1978.1101743"  # C. Van Loan (1978), the discretisation
_JSON = Program("any: matrices as JSON", "N+GM+K", _MATRICES)
_NPZ = Program("any: matrices as NumPy arrays", "N+GM+K", _MATRICES)
_PYTHON = Program("Python with NumPy", "N+GM+K", _MATRICES)
_MAVPARM = replace(px4.PX4, name="PX4 (EKF2), for pymavlink")


@dataclass(frozen=True)
class Target:
    """A program that a noise model can be exported to."""

    name: str  # in commands and settings
    file_name: str  # the usual name of its file
    write: Callable[[Imu], str | bytes]
    """Returns the content of the file; ExportError if the program needs a quantity without
    estimate, or a density above 0."""
    declared: Program  # with the numbers in the file

    @property
    def program(self) -> str:
        """Name of the program for people."""
        return self.declared.name

    @property
    def family(self) -> Family:
        """Terms that the program supports; an overbound for it has these."""
        return self.declared.family


TARGETS: Mapping[str, Target] = {
    target.name: target
    for target in (
        Target("kalibr", "imu.yaml", vi.write_kalibr, vi.KALIBR),
        Target("openvins", "kalibr_imu_chain.yaml", vi.write_openvins, vi.OPENVINS),
        Target("vins-fusion", "vins_imu.yaml", vi.write_vins_fusion, vi.VINS_FUSION),
        Target("basalt", "calibration_imu.json", vi.write_basalt, vi.BASALT),
        Target("orb-slam3", "orb_slam3_imu.yaml", vi.write_orb_slam3, vi.ORB_SLAM3),
        Target("lio-sam", "lio_sam_imu.yaml", vi.write_lio_sam, vi.LIO_SAM),
        Target("fast-lio", "fast_lio_imu.yaml", vi.write_fast_lio, vi.FAST_LIO),
        Target("gtsam", "gtsam_imu.py", graphs.write_gtsam, graphs.GTSAM),
        Target("matlab-factor", "imu_factor.m", graphs.write_matlab_factor, graphs.MATLAB_FACTOR),
        Target("ceres", "imu_noise.hpp", graphs.write_ceres, graphs.CERES),
        Target("px4", "ekf2.params", px4.write, px4.PX4),
        Target("px4-mavparm", "ekf2.parm", px4.write_mavparm, _MAVPARM),
        Target("ardupilot", "ekf3.param", ardupilot.write, ardupilot.ARDUPILOT),
        Target("ros", "imu_covariance.yaml", gnss.write_ros, gnss.ROS),
        Target("pyins", "pyins_imu.py", gnss.write_pyins, gnss.PYINS),
        Target("kf-gins", "kf_gins_imu.yaml", gnss.write_kf_gins, gnss.KF_GINS),
        Target("ob-gins", "ob_gins_imu.yaml", gnss.write_ob_gins, gnss.OB_GINS),
        Target("navego", "navego_imu.m", gnss.write_navego, gnss.NAVEGO),
        Target("gazebo", "imu.sdf", sim.write_gazebo, sim.GAZEBO),
        Target("gnss-ins-sim", "imu_err.py", sim.write_gnss_ins_sim, sim.GNSS_INS_SIM),
        Target("matlab", "imu_noise.m", sim.write_matlab, sim.MATLAB),
        Target("json", "noise.json", matrices.write_json, _JSON),
        Target("npz", "noise.npz", matrices.write_npz, _NPZ),
        Target("python", "noise.py", matrices.write_python, _PYTHON),
    )
}
"""All targets by their name in commands and settings."""


def list_targets() -> tuple[str, list[tuple[str, ...]]]:
    """Return a title, and a line per program after the header, for `imubench formats`."""
    lines = [(one.name, one.program, one.file_name, one.family) for one in TARGETS.values()]
    title = "Programs that files are written for: `imubench export --target`, `exports: targets`"
    return title, [("target", "program", "file", "terms"), *lines]


def list_commands(sensor: str, results: str) -> tuple[str, list[tuple[str, str]]]:
    """Return a label, and for each program the command that writes the file of a sensor."""
    lines = []
    for one in TARGETS.values():
        options = {"--sensor": sensor, "--target": one.name, "--output": one.file_name}
        lines.append((one.program, make_command("export", results, options)))
    return "Export to filters and simulators", lines
