"""Findings of the estimation: no Allan variance, unusual figures."""

from __future__ import annotations

from dataclasses import dataclass

from imubench_pipeline.words.findings.base import ALL, FindingData


@dataclass(frozen=True)
class TooSparse(FindingData, code="too_short", affects=ALL):
    """Too few samples for an Allan variance."""

    grid: int
    rate: float

    def text(self, channel: str) -> str:
        """Return the finding in a sentence."""
        return (
            f"{channel} has too many missing samples for an Allan variance: no two adjacent "
            f"clusters are full. The grid has {self.grid} points at {self.rate:.6g} Hz. Record "
            "without losses, or for longer"
        )
