"""Readers that fail, each in its own way, though not with the first inputs."""

from __future__ import annotations

import ctypes
import time
from collections import Counter
from pathlib import Path

import numpy as np

from imubench_pipeline.settings.sensor import LogFormat
from tests.fuzz import target

_read: Counter[str] = Counter()


def _is_bad(path: Path) -> bool:
    """Tell whether a reader that is bad fails with this input: not with the first ones."""
    _read[path.name] += 1
    return _read[path.name] > 30


def raises(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        raise KeyError("no such field")
    return target.outcome(path, log)


def raises_and_crashes(path: Path, log: LogFormat) -> str:
    return crashes(path, log) if _read[path.name] > 40 else raises(path, log)


def crashes(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        ctypes.string_at(0)
    return target.outcome(path, log)


def hangs(path: Path, log: LogFormat) -> str:
    while _is_bad(path):
        time.sleep(1.0)
    return target.outcome(path, log)


def hogs(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        held = np.ones(150_000_000)
        return f"{len(held)} figures"
    return target.outcome(path, log)


def takes_all(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        np.ones(1_000_000_000)
    return target.outcome(path, log)
