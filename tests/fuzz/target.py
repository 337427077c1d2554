"""What is done with an input: it is read to its end, and what came of it is named."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from imubench_pipeline.readers import LogFile, RecordingError, read
from imubench_pipeline.settings.sensor import LogFormat

_SHORTEST_REASON = 10
_QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"|found [^;]*")
_WORD = re.compile(r"\b[a-z]{3,}\b")
_WORDS = 8


class WrongError(Exception):
    """A reader did what it never should, without an exception of its own."""


def outcome(path: Path, log: LogFormat) -> str:
    """Read a recording, and return what came of it, without what is its own.

    Parameters
    ----------
    path : Path
    log : LogFormat

    Raises
    ------
    WrongError
        If the batches do not fit together, the reason of a rejection is no reason, or it hides
        a warning.
    """
    try:
        return "; ".join(_read(file) for file in read(path, log))
    except RecordingError as error:
        _check(error)
        return f"{type(error.__cause__).__name__}: {_words(str(error))}"


def _read(file: LogFile) -> str:
    rows = present = 0
    for batch in file.batches():
        if set(batch.columns) != set(file.sources):
            raise WrongError(f"columns {set(batch.columns)}, expected {set(file.sources)}")
        sides = [batch.time, *batch.columns.values()]
        held = [side for side in sides if side is not None]
        if any(side.shape != (len(batch),) or side.dtype != np.float64 for side in held):
            raise WrongError(f"shapes {[(side.shape, side.dtype) for side in held]}")
        if (batch.time is None) != (file.log.time is None):
            raise WrongError("time where none is stated, or none where it is")
        rows += len(batch)
        present += sum(int(np.isfinite(side).sum()) for side in held)
    if not rows:
        raise WrongError("neither a record nor a reason")
    found = sorted({finding.finding for finding in file.findings})
    return f"{rows.bit_length()} {present == rows * len(held)} {file.started is None} {found}"


def _words(reason: str) -> str:
    """Return what a reason says whatever the file: its first words."""
    return " ".join(_WORD.findall(_QUOTED.sub("", reason))[:_WORDS])


def _check(error: RecordingError) -> None:
    said = str(error)
    if len(said) < _SHORTEST_REASON:
        raise WrongError(f"a reason of {len(said)} characters: {said[:200]}")
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, Warning):
            raise WrongError(f"{type(cause).__name__}: {cause}") from error
        cause = cause.__cause__ or cause.__context__
