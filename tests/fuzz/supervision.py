"""Runs workers, each a process of its own, and records how they and the readers fail."""

from __future__ import annotations

import hashlib
import json
import os
import re
import select
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path

from tests.conftest import PROJECT
from tests.fuzz.held import FAULT, Input
from tests.fuzz.inputs import seeds
from tests.fuzz.worker import CURRENT, FAILED

TARGET = "tests.fuzz.target:outcome"
HANG_S = 20.0
_START_S = 300.0
_PROGRESS_S = 10.0
_OF_ONE_KIND = 3
_OURS = re.compile(r'File ".*/(imubench_pipeline/.*)", line (\d+)')


@dataclass
class Result:
    """What came of one reader.

    Attributes
    ----------
    reader : str
    inputs : int
    seconds : float
    outcomes : set of str
        Digests of what came of the inputs.
    failures : Counter of str
        How often each kind of failure was met.
    folders : list of Path
        Inputs that failed, at most three of a kind.
    """

    reader: str
    inputs: int = 0
    seconds: float = 0.0
    outcomes: set[str] = field(default_factory=set)
    failures: Counter[str] = field(default_factory=Counter)
    folders: list[Path] = field(default_factory=list)


class Fuzzing:
    """The fuzzing of one reader.

    Parameters
    ----------
    reader : str
    seconds : float
    failures : Path
        Folder for the inputs that fail.
    processes : int
    seed : int
    target : str
        What reads an input, as ``module:function``.
    hang : float
        Seconds that the reading of one input may take.
    """

    def __init__(
        self,
        reader: str,
        seconds: float,
        failures: Path,
        processes: int = 1,
        seed: int = 0,
        target: str = TARGET,
        hang: float = HANG_S,
    ) -> None:
        self.result = Result(reader)
        self._seconds = seconds
        self._failures = failures / reader
        self._processes = processes
        self._seed = seed
        self._target = target
        self._hang = hang
        self._lock = threading.Lock()

    def run(self, say: Callable[[str], object] = print) -> Result:
        """Run the workers to their end, and say now and then how far they are."""
        begin = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="imubench.fuzz.") as name:
            work = Path(name)
            for number, seed in enumerate(seeds(self.result.reader)):
                seed.keep(work / "seeds" / f"{number:04d}")
            with ThreadPoolExecutor(self._processes) as pool:
                running = [
                    pool.submit(self._supervised, work, number) for number in range(self._processes)
                ]
                while wait(running, _PROGRESS_S).not_done:
                    say(self._progress(time.monotonic() - begin))
            for ended in running:
                ended.result()
        self.result.seconds = time.monotonic() - begin
        return self.result

    def _progress(self, seconds: float) -> str:
        found = self.result
        return (
            f"{found.reader}: {found.inputs} inputs in {seconds:.0f} s, {len(found.outcomes)} "
            f"outcomes, {found.failures.total()} failures"
        )

    def _supervised(self, work: Path, number: int) -> None:
        """Run one worker after another, for each may be taken down by an input."""
        left = self._seconds
        start = 0
        while left > 0:
            mine = work / f"worker{number}.{start}"
            mine.mkdir()
            running = _Running(
                work / "seeds", mine, self._target, f"{self._seed}.{number}.{start}", left
            )
            fault = running.follow(self._hang, self._note)
            left -= running.seconds
            if fault:
                self._fail(mine / CURRENT, fault)
            if not running.tried:
                break  # it would fail in the same way again
            start += 1

    def _note(self, mine: Path, said: dict[str, object], new: int) -> None:
        """Take what a worker says."""
        with self._lock:
            self.result.inputs += new
            self.result.outcomes.update(said.get("outcomes", ()))  # type: ignore[arg-type]  # read from JSON: a list of texts
        if "failure" in said:
            folder = mine / FAILED / str(said["failure"])
            self._fail(folder, (folder / FAULT).read_text("utf-8"))

    def _fail(self, folder: Path, fault: str) -> None:
        """Keep an input that failed, unless there are enough of its kind."""
        kind = _kind(fault)
        with self._lock:
            self.result.failures[kind] += 1
            if self.result.failures[kind] > _OF_ONE_KIND or not folder.exists():
                return
            held = Input.kept(folder)
            name = hashlib.blake2b(repr(held).encode(), digest_size=6).hexdigest()
            held.keep(self._failures / name, fault)
            self.result.folders.append(self._failures / name)


def _kind(fault: str) -> str:
    """Return what failures of one cause share: the exception, and where in our code it was met."""
    last = fault.strip().splitlines()[-1]
    places = _OURS.findall(fault)
    return f"{last.partition(':')[0]} at {':'.join(places[-1])}" if places else last[:200]


class _Running:
    """A worker that is running.

    Attributes
    ----------
    tried : int
        Inputs that it has read.
    seconds : float
        How long it ran.
    """

    def __init__(self, seeds: Path, mine: Path, target: str, seed: str, seconds: float) -> None:
        self.tried = 0
        self.seconds = 0.0
        self._mine = mine
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - read when the worker has ended
        command = [sys.executable, "-X", "faulthandler", "-m", "tests.fuzz.worker"]
        command += [str(seeds), str(mine), "--target", target]
        command += ["--seed", seed, "--seconds", str(seconds)]
        self._process = subprocess.Popen(
            command,
            cwd=PROJECT,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )

    def follow(self, hang: float, note: Callable[[Path, dict[str, object], int], None]) -> str:
        """Hand on what it says until it ends; return how it failed, if it did."""
        begin = heard = time.monotonic()
        held = b""
        stream = self._process.stdout
        assert stream is not None  # a pipe
        fault = ""
        while True:
            if select.select([stream], [], [], 0.2)[0]:
                read = os.read(stream.fileno(), 1 << 16)
                if not read:
                    break
                *lines, held = (held + read).split(b"\n")
                for line in lines:
                    said = json.loads(line)
                    new = int(said.get("tried", self.tried)) - self.tried
                    self.tried += new
                    note(self._mine, said, new)
                heard = time.monotonic()
            elif time.monotonic() - heard > (hang if self.tried else _START_S):
                fault = f"no answer for {hang:.0f} s"
                self._process.kill()
                break
        status = self._process.wait()
        stream.close()
        self.seconds = time.monotonic() - begin
        self._errors.seek(0)
        said_last = self._errors.read().decode("utf-8", "replace")[-5000:]
        self._errors.close()
        if status and not fault:
            end = f"signal {-status}" if status < 0 else f"exit status {status}"
            fault = f"{said_last}\n{end}"
        return fault


def table(results: list[Result]) -> str:
    """Return what came of the readers as lines of text."""
    rows = [["reader", "inputs", "seconds", "outcomes", "failures"]]
    for found in results:
        figures = found.inputs, round(found.seconds), len(found.outcomes), found.failures.total()
        rows.append([found.reader, *map(str, figures)])
    return "\n".join(f"{row[0]:10}" + "".join(f"{cell:>10}" for cell in row[1:]) for row in rows)
