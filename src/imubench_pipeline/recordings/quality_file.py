"""What the ingest leaves beside the samples that it keeps: ``quality.json``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Quality:
    """``quality.json``: what the ingest found, and the channels that go on.

    With the digest of the samples that were kept, the file is another one whenever they are: what
    stands on them is made again, even if the run that read them was stopped in between.
    """

    recording: dict[str, Any]
    findings: list[dict[str, Any]]
    channels: dict[str, dict[str, Any]]
    samples: str | None
    failure: dict[str, Any] | None = None
    """Why the ingest failed (`imubench_pipeline.tables.failures.Failure`)."""
    gravity: dict[str, Any] | None = None
    """How gravity turns against the sensor (`recordings.quality.rotation.GravityTurn`)."""

    @classmethod
    def read(cls, path: Path) -> Quality:
        """Read the file that `ingest` wrote."""
        return cls(**json.loads(path.read_text(encoding="utf-8")))
