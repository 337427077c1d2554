"""What Silva et al. print (SiRRS01-03, and the Earth's rotation)."""

from __future__ import annotations

from imubench_pipeline.experiments.papers.about import SILVA
from imubench_pipeline.experiments.papers.claims import Claim, Paper

CLAIMS: tuple[Claim, ...] = ()

PAPER = Paper(about=SILVA, claims=lambda _: CLAIMS)
