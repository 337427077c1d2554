"""Inspect a log and draft a sensor file for it: `imubench inspect`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from imubench_pipeline.readers.contents import contents
from imubench_pipeline.readers.inspection.draft import Draft, block
from imubench_pipeline.readers.inspection.drafting import draft
from imubench_pipeline.readers.inspection.listing import listing
from imubench_pipeline.readers.inspection.proof import Proof, proof

__all__ = ["Draft", "Inspection", "Proof", "inspect"]


@dataclass(frozen=True)
class Inspection:
    """Contents of a recording, and the drafted sensor file."""

    listing: str
    """The contents as text."""
    block: str
    """The sensor file as YAML."""
    draft: Draft
    """The sensor file as values."""
    proof: Proof
    """Result of reading the first records with it."""

    @property
    def complete(self) -> bool:
        """Whether the draft has no gaps and the log can be read with it."""
        return self.proof.read and not self.draft.unfilled()


def inspect(path: Path, model: str | None = None) -> Inspection:
    """Inspect a recording and draft a sensor file for it.

    Only the beginning of each file is read, so that the time does not depend on the length.

    Parameters
    ----------
    path : Path
        A log file, or the folder, zip archive or ROS 2 bag of a recording.
    model : str or None
        Name of the sensor; None: the name of the log.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or is no log.
    """
    # Numbers in a damaged file may overflow.
    with np.errstate(all="ignore"):
        log = contents(path)
        drafted = draft(log, model)
        return Inspection(listing(log), block(drafted, path.name), drafted, proof(path, drafted))
