"""A process that mutates and reads until its time is over, or a library takes it down."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import resource
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

import imubench_pipeline.readers
from imubench_pipeline.settings.sensor import LogFormat
from tests.fuzz.arcs import Arc, Arcs
from tests.fuzz.held import Input
from tests.fuzz.mutations import mutated

CURRENT = "current"
"""Folder of the input that is being read."""

FAILED = "failed"
"""Folder of the inputs that a reader failed with."""

_MEMORY_MIB = 1024
_ADDRESSES = 4 << 30
_REPORT_S = 0.5
_LIMIT_AGAIN = 500
_MOST_KEPT = 3000
_TRACED = 3

Target = Callable[[Path, LogFormat], str]


def target_of(name: str) -> Target:
    """Return the function that a name such as ``tests.fuzz.target:outcome`` stands for."""
    module, _, function = name.partition(":")
    found: Target = getattr(import_module(module), function)
    return found


def limit_memory() -> None:
    """Let this process have 4 GiB more of addresses than it has now.

    A library that believes what a damaged file says of a size is refused them; what it touches
    of those it gets is measured.
    """
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + _ADDRESSES, hard))


class Memory:
    """Measures, within a ``with`` block, how much more memory this process takes.

    Raises
    ------
    MemoryError
        At the end of the block, if it is more than 1 GiB.
    """

    def __enter__(self) -> Memory:
        Path("/proc/self/clear_refs").write_text("5")  # the peak is counted from now on
        self._before = self._peak()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        taken = self._peak() - self._before
        if taken > _MEMORY_MIB and kind is None:
            raise MemoryError(f"took {taken} MiB")

    def _peak(self) -> int:
        status = Path("/proc/self/status").read_text()
        return int(status.partition("VmHWM:")[2].split()[0]) // 1024


class _Worker:
    """Mutates inputs, reads them, and keeps those that lead somewhere new."""

    def __init__(self, read: Target, work: Path, inputs: list[Input], rng: random.Random) -> None:
        self._read = read
        self._work = work
        self._rng = rng
        self._queue = inputs
        self._arcs: set[Arc] = set()
        self._outcomes: set[str] = set()
        self._unsaid: list[str] = []
        self._tracer = Arcs(Path(imubench_pipeline.readers.__file__).parent)
        self._reported = 0.0
        self._tried = 0

    def run(self, seconds: float) -> None:
        seeds = list(self._queue)
        for seed in seeds:  # imports and compiles what is needed, before memory is limited
            self._read(self._placed(seed), seed.format())
        limit_memory()
        for seed in seeds:
            self._try(seed)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._try(self._next())
            if self._tried % _LIMIT_AGAIN == 0:
                limit_memory()
        self._report()

    def _next(self) -> Input:
        rng = self._rng
        # What is short is read sooner.
        one = min((rng.choice(self._queue) for _ in range(2)), key=lambda held: held.size)
        name = rng.choice(list(one.files))
        others = list(rng.choice(self._queue).files.values())
        return one.with_file(name, mutated(one.files[name], others, rng))

    def _placed(self, held: Input) -> Path:
        held.keep(self._work / CURRENT)
        return held.path_in(self._work / CURRENT)

    def _try(self, held: Input) -> None:
        path, log = self._placed(held), held.format()
        fault = outcome = ""
        try:
            # To trace takes several times as long as to read.
            traced = self._tried % _TRACED == 0
            with Memory(), self._tracer if traced else nullcontext():
                outcome = self._read(path, log)
        except Exception:
            fault = traceback.format_exc()
        self._tried += 1
        if fault:
            self._save(held, fault)
            return
        new = outcome not in self._outcomes
        farther = traced and not self._tracer.taken <= self._arcs
        if (new or farther) and len(self._queue) < _MOST_KEPT:
            self._queue.append(held)
        if new:
            self._outcomes.add(outcome)
            self._unsaid.append(hashlib.blake2b(outcome.encode(), digest_size=8).hexdigest())
        if traced:
            self._arcs |= self._tracer.taken
        if time.monotonic() - self._reported > _REPORT_S:
            self._report()

    def _save(self, held: Input, fault: str) -> None:
        name = hashlib.blake2b(repr(held).encode(), digest_size=6).hexdigest()
        held.keep(self._work / FAILED / name, fault)
        self._say({"failure": name})

    def _report(self) -> None:
        self._reported = time.monotonic()
        self._say({"tried": self._tried, "outcomes": self._unsaid})
        self._unsaid = []

    def _say(self, what: dict[str, Any]) -> None:
        print(json.dumps(what), flush=True)


def main(arguments: list[str]) -> None:
    """Run a worker.

    Parameters
    ----------
    arguments : list of str
        Of the command line.
    """
    parser = argparse.ArgumentParser()
    parser.add_argument("seeds", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--target", required=True)
    parser.add_argument("--seed", required=True)
    parser.add_argument("--seconds", type=float, required=True)
    given = parser.parse_args(arguments)
    warnings.simplefilter("error")
    inputs = [Input.kept(folder) for folder in sorted(given.seeds.iterdir())]
    rng = random.Random(given.seed)
    _Worker(target_of(given.target), given.work, inputs, rng).run(given.seconds)
    # A reader that stopped half-way leaves threads of Arrow, which may abort while the interpreter
    # ends: that is the fault of no input.
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1:])
