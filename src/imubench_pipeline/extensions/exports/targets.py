"""The programs that a noise model can be exported to."""

from collections.abc import Mapping

from imubench_pipeline.extensions.exports import (
    ardupilot,
    factor_graphs,
    gnss_filters,
    matrices,
    px4,
    simulators,
    visual_inertial,
)
from imubench_pipeline.extensions.exports.programs import Program
from imubench_pipeline.report.site import make_command

TARGETS: Mapping[str, Program] = {
    program.name: program
    for program in (
        visual_inertial.KALIBR,
        visual_inertial.OPENVINS,
        visual_inertial.VINS_FUSION,
        visual_inertial.BASALT,
        visual_inertial.ORB_SLAM3,
        visual_inertial.LIO_SAM,
        visual_inertial.FAST_LIO,
        factor_graphs.GTSAM,
        factor_graphs.MATLAB_FACTOR,
        factor_graphs.CERES,
        px4.PX4,
        px4.MAVPARM,
        ardupilot.ARDUPILOT,
        gnss_filters.ROS,
        gnss_filters.PYINS,
        gnss_filters.KF_GINS,
        gnss_filters.OB_GINS,
        gnss_filters.NAVEGO,
        simulators.GAZEBO,
        simulators.GNSS_INS_SIM,
        simulators.MATLAB,
        matrices.JSON,
        matrices.NPZ,
    )
}
"""All programs by their name in commands and settings."""


def list_targets() -> tuple[str, list[tuple[str, ...]]]:
    """Return title and lines of the table of programs; the first line is the header."""
    lines = [(one.name, one.title, one.file_name, one.family) for one in TARGETS.values()]
    title = "Programs that files are written for: `imubench export --target`, `exports: targets`"
    return title, [("target", "program", "file", "terms"), *lines]


def list_commands(sensor: str, results: str) -> tuple[str, list[tuple[str, str]]]:
    """Return a label, and for each program the command that writes the file of a sensor."""
    lines = []
    for one in TARGETS.values():
        options = {"--sensor": sensor, "--target": one.name, "--output": one.file_name}
        lines.append((one.title, make_command("export", results, options)))
    return "Export to filters and simulators", lines
