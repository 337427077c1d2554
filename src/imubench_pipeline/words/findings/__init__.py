"""Findings about recordings: their data, affected parameters and sentences."""

from imubench_pipeline.words.findings import copies, files, samples, time_base
from imubench_pipeline.words.findings.base import FINDINGS, FindingData

__all__ = ["FINDINGS", "FindingData", "copies", "files", "samples", "time_base"]
