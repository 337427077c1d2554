"""Findings about recordings: their data, affected parameters and sentences."""

from imubench_pipeline.words.findings import (
    changes,
    files,
    plausibility,
    samples,
    spectrum,
    time_base,
)
from imubench_pipeline.words.findings.base import FINDINGS, FindingData

__all__ = [
    "FINDINGS",
    "FindingData",
    "changes",
    "files",
    "plausibility",
    "samples",
    "spectrum",
    "time_base",
]
