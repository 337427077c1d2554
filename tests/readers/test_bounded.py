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
import psutil
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.bounded import BoundError, is_kept_waiting, run_bounded
from imubench_pipeline.run.cli import main
from tests.readers.hostile import ATTACKS

MEMORY = 100 << 20


def refuse() -> None:
    raise RecordingError("a.csv: no log")


def test_what_is_returned_or_raised_comes_back() -> None:
    assert run_bounded(10.0, MEMORY, sum, [1, 2]) == 3
    assert len(run_bounded(10.0, MEMORY, np.ones, 10**6)) == 10**6
    with pytest.raises(RecordingError, match=r"^a.csv: no log$"):
        run_bounded(10.0, MEMORY, refuse)


@pytest.mark.parametrize(
    ("function", "given", "said"),
    [
        (time.sleep, 60.0, "took more than 0.5 s"),
        (np.ones, 10**8, "took more than 100 MiB of memory"),
        (bytes, 10**9, "took more than 100 MiB of memory"),
        (os._exit, 3, "ended the process with exit code 3"),
    ],
)
def test_what_takes_more_is_ended(
    function: Callable[[float], object], given: float, said: str
) -> None:
    begin = time.monotonic()
    with pytest.raises(BoundError, match=said):
        run_bounded(0.5 if function is time.sleep else 30.0, MEMORY, function, given)
    assert time.monotonic() - begin < 20.0
    assert len(np.ones(2 * MEMORY // 8)) == 2 * MEMORY // 8  # not limited here


@pytest.mark.release
def test_what_others_keep_waiting_is_not_ended_for_it() -> None:
    busy, idle = (
        subprocess.Popen([sys.executable, "-c", code])
        for code in ("while True: pass", "import time; time.sleep(60)")
    )
    try:
        working, sleeping = psutil.Process(busy.pid), psutil.Process(idle.pid)
        while working.cpu_times().user < 0.1 or sleeping.status() != psutil.STATUS_SLEEPING:
            time.sleep(0.01)
        assert is_kept_waiting(working, 60.0)  # it had less than a minute of a core, and goes on
        assert not is_kept_waiting(working, 0.1)  # it had what it may
        assert not is_kept_waiting(sleeping, 60.0)  # a core would not help it
    finally:
        for process in (busy, idle):
            process.kill()
            process.wait()
    assert not is_kept_waiting(working, 60.0)
    with pytest.raises(BoundError, match=r"took more than 0.1 s"):
        run_bounded(0.1, MEMORY, compute)


def compute() -> None:
    while True:
        pass


def test_the_command_says_what_listing_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = ATTACKS["6 GB of comments"].write(tmp_path)
    monkeypatch.setattr("imubench_pipeline.run.analysis.project.INSPECTED_S", 0.001)
    assert main(["inspect", str(path)]) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(r"log.csv.gz: the inspection took more than 0.001 s; expected .*\n", said)
