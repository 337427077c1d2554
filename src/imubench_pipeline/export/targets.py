"""The programs that a noise model can be exported to; each is declared in its module."""

from __future__ import annotations

from collections.abc import Mapping

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
from imubench_pipeline.export.target import Target

TARGETS: Mapping[str, Target] = {
    target.name: target
    for target in (
        kalibr.TARGET,
        openvins.TARGET,
        vins_fusion.TARGET,
        basalt.TARGET,
        orb_slam3.TARGET,
        px4.TARGET,
        gnss_ins_sim.TARGET,
        matlab.TARGET,
        matrices.JSON,
        matrices.NPZ,
        snippet.TARGET,
    )
}
"""All targets by their name in commands and settings."""
