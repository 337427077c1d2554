"""A call that takes too much memory or time ends, and nothing else does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.bounded import BoundError, bounded
from imubench_pipeline.run.cli import main
from tests.readers.hostile import ATTACKS

MEMORY = 100 << 20


def refuse() -> None:
    raise RecordingError("a.csv: no log")


def test_what_is_returned_or_raised_comes_back() -> None:
    assert bounded(10.0, MEMORY, sum, [1, 2]) == 3
    assert len(bounded(10.0, MEMORY, np.ones, 10**6)) == 10**6
    with pytest.raises(RecordingError, match=r"^a.csv: no log$"):
        bounded(10.0, MEMORY, refuse)


@pytest.mark.parametrize(
    ("function", "given", "said"),
    [
        (time.sleep, 60.0, "took more than 0.5 s"),
        (np.ones, 10**8, "took more than 100 MiB of memory"),
        (bytes, 10**9, "took more than 100 MiB of memory"),
        (os._exit, 3, r"ended the process that read it \(3\)"),
    ],
)
def test_what_takes_more_is_ended(
    function: Callable[[float], object], given: float, said: str
) -> None:
    begin = time.monotonic()
    with pytest.raises(BoundError, match=said):
        bounded(0.5 if function is time.sleep else 30.0, MEMORY, function, given)
    assert time.monotonic() - begin < 20.0
    assert len(np.ones(2 * MEMORY // 8)) == 2 * MEMORY // 8  # not limited here


def compute(seconds: float) -> float:
    while time.process_time() < seconds:  # of a process that has just begun
        pass
    return seconds


def test_what_others_keep_waiting_is_not_ended_for_it() -> None:
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    try:
        begin = time.monotonic()
        assert bounded(0.3, MEMORY, compute, 0.15) == 0.15  # with a third of a core at most
        assert time.monotonic() - begin > 0.3
        with pytest.raises(BoundError, match=r"took more than 0.1 s"):
            bounded(0.1, MEMORY, compute, 60.0)
        assert time.monotonic() - begin < 20.0
    finally:
        for process in busy:
            process.kill()
            process.wait()
        os.sched_setaffinity(0, cores)


def test_the_command_says_what_listing_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ATTACKS["20 GB of zeros"].write(tmp_path)
    monkeypatch.setattr("imubench_pipeline.run.cli.INSPECTED_S", 0.001)
    assert main(["inspect", str(path)]) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(r"log.csv.gz: to list it took more than 0.001 s; expected .*\n", said)
