"""The programs that a noise model can be written for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from imubench_pipeline.export import (
    basalt,
    gnss_ins_sim,
    kalibr,
    matlab,
    matrices,
    openvins,
    orb_slam3,
    px4,
    snippet,
    vins_fusion,
)
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.smallest_model import Family


@dataclass(frozen=True)
class Target:
    """A program.

    Attributes
    ----------
    file_name : str
        Its usual one.
    write : callable
        Imu -> content of the file: str, or bytes.
    family : str
        Terms that it holds: those of an overbound for it.
    """

    file_name: str
    write: Callable[[Imu], str | bytes]
    family: Family


TARGETS: Mapping[str, Target] = {
    "kalibr": Target("imu.yaml", kalibr.write, "N+K"),
    "openvins": Target("kalibr_imu_chain.yaml", openvins.write, "N+K"),
    "vins-fusion": Target("vins_imu.yaml", vins_fusion.write, "N+K"),
    "basalt": Target("calibration_imu.json", basalt.write, "N+K"),
    "orb-slam3": Target("orb_slam3_imu.yaml", orb_slam3.write, "N+K"),
    "px4": Target("ekf2.params", px4.write, "N+K"),
    "gnss-ins-sim": Target("imu_err.py", gnss_ins_sim.write, "N+GM"),
    "matlab": Target("imu_noise.m", matlab.write, "N+GM+K"),
    "json": Target("noise.json", matrices.write_json, "N+GM+K"),
    "npz": Target("noise.npz", matrices.write_npz, "N+GM+K"),
    "python": Target("noise.py", snippet.write, "N+GM+K"),
}
"""Every target, by the name that the command takes."""
