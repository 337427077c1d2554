"""What Engers prints (SCC2130, MPU-9250, BNO055)."""

from __future__ import annotations

from imubench_pipeline.experiments.papers.about import ENGERS
from imubench_pipeline.experiments.papers.claims import Claim, Paper

CLAIMS: tuple[Claim, ...] = ()

PAPER = Paper(about=ENGERS, claims=lambda _: CLAIMS)
