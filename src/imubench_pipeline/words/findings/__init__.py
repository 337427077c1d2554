"""Findings about recordings: their data, affected parameters and sentences."""

from imubench_pipeline.words.findings import estimation
from imubench_pipeline.words.findings.base import FINDINGS, FindingData

__all__ = ["FINDINGS", "FindingData", "estimation"]
