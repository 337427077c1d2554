"""What a log holds, and a sensor file drafted for it: `imubench inspect`."""

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
    """What was found of a recording."""

    listing: str
    """What it holds, for a human."""
    block: str
    """The sensor file, YAML."""
    draft: Draft
    """The same, as values."""
    proof: Proof
    """What came of reading the first records with it."""

    @property
    def complete(self) -> bool:
        """Whether nothing is left to fill in, and the log is read so."""
        return self.proof.read and not self.draft.unfilled()


def inspect(path: Path, model: str | None = None) -> Inspection:
    """Look into a recording, and draft a sensor file for it.

    Only the beginning of each file is read, so that it takes no longer for a long log.

    Parameters
    ----------
    path : Path
        A log file, or the folder, zip archive or ROS 2 bag of a recording.
    model : str or None
        What the sensor is called; None: as the log.

    Raises
    ------
    RecordingError
        If it cannot be read, or is no log.
    """
    # What stands in a damaged file may overflow.
    with np.errstate(all="ignore"):
        log = contents(path)
        drafted = draft(log, model)
        return Inspection(listing(log), block(drafted, path.name), drafted, proof(path, drafted))
