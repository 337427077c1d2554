"""What is wrong with a recording, in findings with a severity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.findings import Finding
from imubench_pipeline.readers import TEMPERATURE


@dataclass
class Spread:
    """What is counted of one column while it passes."""

    present: int = 0
    missing: int = 0
    not_finite: int = 0
    low: float = np.inf
    high: float = -np.inf

    def add(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Count a block and return it with infinities made missing."""
        finite = np.isfinite(values)
        good = values[finite]
        infinite = int(np.isinf(values).sum())
        self.present += len(good)
        self.missing += len(values) - len(good) - infinite
        self.not_finite += infinite
        if len(good):
            self.low = min(self.low, float(good.min()))
            self.high = max(self.high, float(good.max()))
        return np.where(finite, values, np.nan) if infinite else values


def column_findings(spreads: Mapping[str, Spread], shortest: int) -> list[Finding]:
    """Return what the spread of each column tells; a channel that cannot be used is fatal."""
    findings = []
    for channel, spread in spreads.items():
        if channel == TEMPERATURE:
            continue
        if spread.present == 0:
            findings.append(
                Finding("no_samples", "fatal", f"{channel} holds no number", 0, channel)
            )
        elif spread.present < shortest:
            findings.append(
                Finding(
                    "too_short",
                    "fatal",
                    f"{channel} has {spread.present} samples, expected at least {shortest} "
                    "(quality.shortest); record for longer",
                    spread.present,
                    channel,
                )
            )
        elif spread.low == spread.high:
            findings.append(
                Finding(
                    "stuck",
                    "fatal",
                    f"{channel} never changes (it stays at {spread.low:.6g} in SI); the axis "
                    "is dead or the column is not the one meant",
                    spread.low,
                    channel,
                )
            )
        if spread.missing:
            findings.append(
                Finding(
                    "empty_cells",
                    "note",
                    f"{channel} has {spread.missing} records without a number; treated as "
                    "missing samples",
                    spread.missing,
                    channel,
                )
            )
        if spread.not_finite:
            findings.append(
                Finding(
                    "not_finite",
                    "warning",
                    f"{channel} has {spread.not_finite} infinities; treated as missing samples",
                    spread.not_finite,
                    channel,
                )
            )
    return findings
