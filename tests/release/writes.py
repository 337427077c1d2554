"""Each write of a run fails once: the next run must make it good.

``python -m tests.release.writes`` compiles a small library that makes one call fail which changes
what lies in the results, of Python and of what it calls in C++, and preloads it.

*Steps.* The jobs of a run on a small project are kept, one of each kind, and run alone, as often as
they have such calls: with a disk that is full from this call on, with an error of the disk, and
without permission. The step must fail with a reason or leave what an undisturbed one leaves, all
files that have their final names must be whole, and none may be left that has a temporary name;
then the step is run again, and must leave the very files that an undisturbed one leaves.

*Runs.* The same of whole runs of Snakemake with what it notes for itself, at random calls: the run
must end with a status that is not 0, or with all that an undisturbed run leaves.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import errno
import hashlib
import json
import mmap
import os
import pickle
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import yaml

from imubench_pipeline.run.processes import Job, Processes, StepError
from imubench_pipeline.tables.seals import read_sealed_json
from tests.calibration.recordings import STEPS, UP, on_table
from tests.earth_rate.runs import RATE, TURN, turned
from tests.release.small import FaultError, Undisturbed, left_over, small_project, visible
from tests.workflow.project import Project, put_sensor

_SOURCE = Path(__file__).with_name("faulty_writes.c")
_KINDS = (
    "",
    "open",
    "write",
    "close",
    "rename",
    "mkdir",
    "chmod",
    "truncate",
    "sync",
    "link",
    "times",
)
_REFUSED = {"open", "rename", "mkdir", "chmod", "link", "times"}
"""What needs a permission."""

_TAKEN_WHEN_FULL = {"chmod", "close", "times"}


class _Control(ctypes.Structure):
    """As in faulty_writes.c."""

    _fields_ = (
        ("count", ctypes.c_int64),
        ("at", ctypes.c_int64),
        ("error", ctypes.c_int64),
        ("lasting", ctypes.c_int64),
        ("struck", ctypes.c_int64),
        ("folder", ctypes.c_char * 1024),
        ("kinds", ctypes.c_uint8 * 65536),
    )


@dataclass(frozen=True)
class Fault:
    """How a call fails; ``lasting``: and all after it, as on a full disk."""

    error: int
    lasting: bool = False

    @property
    def name(self) -> str:
        return errno.errorcode[self.error]


FAULTS = (Fault(errno.ENOSPC, lasting=True), Fault(errno.EIO), Fault(errno.EACCES))


class Writes:
    """The calls that write to a folder, of all processes that are started with `environment`.

    Parameters
    ----------
    scratch : Path
        For the library, and the file that is shared with it.
    """

    def __init__(self, scratch: Path) -> None:
        scratch.mkdir(parents=True, exist_ok=True)
        library, shared = scratch / "faulty_writes.so", scratch / "control"
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            raise FaultError("not tried: there is no compiler of C")
        options = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
        subprocess.run([compiler, *options, "-o", library, _SOURCE, "-ldl"], check=True)
        shared.write_bytes(bytes(ctypes.sizeof(_Control)))
        with shared.open("r+b") as file:
            self._control = _Control.from_buffer(mmap.mmap(file.fileno(), 0))
        self.environment = {"LD_PRELOAD": str(library), "FAULTY_WRITES": str(shared)}

    @contextlib.contextmanager
    def counted(self, folder: Path, at: int = 0, fault: Fault = FAULTS[0]) -> Iterator[None]:
        """Count the calls within a block, and let one fail; 0: none."""
        self._control.count = self._control.struck = 0
        self._control.error, self._control.lasting = fault.error, fault.lasting
        self._control.at = at
        self._control.folder = str(folder.resolve()).encode()
        try:
            yield
        finally:
            self._control.folder = b""

    @property
    def count(self) -> int:
        """How many calls there were."""
        return int(self._control.count)

    @property
    def struck(self) -> int:
        """How many of them failed."""
        return int(self._control.struck)

    def kinds(self) -> list[str]:
        """Return what the calls were, from the first."""
        return [_KINDS[kind] for kind in self._control.kinds[1 : self.count + 1]]


# ------------------------------------------------------------------------------------- steps

_RECORDED = """
import pathlib, pickle, sys, threading
from imubench_pipeline.run.processes import Processes
folder, lock, run = pathlib.Path(sys.argv.pop(1)), threading.Lock(), Processes.run

def kept(self, job, seconds=None):
    run(self, job, seconds)
    with lock:
        path = folder / f"{len(list(folder.iterdir())):04d}_{job.name}"
        path.write_bytes(pickle.dumps(job))

Processes.run = kept
from snakemake.cli import main
main()
"""


def jobs_of(made: Project, folder: Path) -> list[Job]:
    """Run a project on one core; return its jobs in the order in which they ended."""
    folder.mkdir()
    command = [sys.executable, "-c", _RECORDED, str(folder), *made.command(cores=1)[3:]]
    done = subprocess.run(command, cwd=made.place, capture_output=True, text=True, check=False)
    if done.returncode:
        raise FaultError(f"an undisturbed run failed:\n{done.stdout}{done.stderr}")
    return [pickle.loads(path.read_bytes()) for path in sorted(folder.iterdir())]


class Kept:
    """The files of a folder as they are now, to which it can be put back."""

    def __init__(self, folder: Path, copy: Path) -> None:
        self._folder, self._copy = folder, copy
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy) if folder.exists() else copy.mkdir()
        self._signatures = dict(_signatures(folder))

    def put_back(self) -> None:
        """Remove what is new, and copy what has changed."""
        found = dict(_signatures(self._folder))
        for name in sorted(found.keys() - self._signatures.keys(), reverse=True):
            path = self._folder / name
            path.rmdir() if path.is_dir() else path.unlink()
        for name in sorted(self._signatures):
            path, source = self._folder / name, self._copy / name
            if found.get(name) != self._signatures[name]:
                path.mkdir(exist_ok=True) if source.is_dir() else shutil.copy2(source, path)
                self._signatures[name] = _signature(path)


def _signatures(folder: Path) -> Iterator[tuple[str, tuple[int, ...]]]:
    for path in folder.rglob("*"):
        yield str(path.relative_to(folder)), _signature(path)


def _signature(path: Path) -> tuple[int, ...]:
    about = path.stat()
    return (0,) if path.is_dir() else (about.st_ino, about.st_size, about.st_mtime_ns)


class Contents:
    """Digests of what has a final name in a folder; what has not changed is not read again."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: dict[tuple[str, tuple[int, ...]], bytes] = {}

    def now(self) -> dict[str, bytes]:
        found = {}
        for path in visible(self._folder):
            name = str(path.relative_to(self._folder))
            key = name, _signature(path)
            if key not in self._known:
                self._known[key] = hashlib.sha256(_undated(path)).digest()
            found[name] = self._known[key]
        return found


def _undated(path: Path) -> bytes:
    """Return what a file holds; of a seal that is whole, without the dates of what it seals."""
    if "seals" not in path.parts:
        return path.read_bytes()
    try:
        seal = read_sealed_json(path)
        outputs = {name: file | {"changed": 0} for name, file in seal["outputs"].items()}
    except (ValueError, KeyError, AttributeError, TypeError):
        return path.read_bytes()
    return json.dumps(seal | {"outputs": outputs}).encode()


@dataclass
class Steps:
    """Runs the steps of a project alone.

    Parameters
    ----------
    made : Project
    writes : Writes
    processes : Processes
        Started with the environment of the writes, in the folder of the project.
    scratch : Path
    """

    made: Project
    writes: Writes
    processes: Processes
    scratch: Path

    def trials(
        self, job: Job, of: Callable[[list[str]], list[tuple[int, Fault]]]
    ) -> Iterator[tuple[str, str, list[str]]]:
        """Yield the call and how it failed, what came of it, and what is not as it should be.

        Parameters
        ----------
        job : Job
        of : callable
            Takes the calls of the job, returns those that are to fail, and how.
        """
        results = self.made.results
        before, self._contents = Kept(results, self.scratch), Contents(results)
        with self.writes.counted(results):
            self.processes.run(job)
        kinds = self.writes.kinds()
        expected = self._contents.now()
        for at, fault in of(kinds):
            before.put_back()
            came, wrong = self._disturbed(job, at, fault, expected)
            self._prepare(job)
            try:
                self.processes.run(job)
                wrong += self._differences(expected)
            except StepError as error:
                wrong.append(f"the next time: {error}: {error.reason}")
            yield f"{fault.name} at {at}, {kinds[at - 1]}", came, wrong
        before.put_back()
        self.processes.run(job)

    def _disturbed(
        self, job: Job, at: int, fault: Fault, expected: dict[str, bytes]
    ) -> tuple[str, list[str]]:
        results = self.made.results
        wrong = []
        begin = time.monotonic()
        try:
            with self.writes.counted(results, at, fault):
                self.processes.run(job)
            came = "done all the same"
            wrong += self._differences(expected)
        except StepError as error:
            came = f"{error.cause or 'run ends'}: {error.reason}"
            if fault.lasting and error.cause is not None:
                wrong.append(f"a full disk is laid to the recording: {error.reason}")
            # Arrow says of a file that cannot be closed no more than that.
            said = (os.strerror(fault.error), "error closing file")
            if not any(words in error.reason for words in said):
                wrong.append(f"the reason does not say {os.strerror(fault.error)!r}: {came}")
        if not self.writes.struck:
            came = "no such call this time"
        wrong += [
            f"{name} is not whole"
            for name, content in self._contents.now().items()
            if name in expected and content != expected[name] and not name.endswith(".log")
        ]
        wrong += [f"left over: {path}" for path in left_over(results)]
        if time.monotonic() - begin > 60.0:
            wrong.append("took more than a minute")
        return came, wrong

    def _differences(self, expected: dict[str, bytes]) -> list[str]:
        found = self._contents.now()
        names = sorted(found.keys() | expected.keys())
        wrong = [f"{name} differs" for name in names if found.get(name) != expected.get(name)]
        return wrong + [f"left over: {path}" for path in left_over(self.made.results)]

    def _prepare(self, job: Job) -> None:
        """Remove what Snakemake does before a step is run again."""
        for path in (*map(Path, job.output), job.log):
            place = self.made.place / path
            shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)


def every(
    kinds: list[str], *, once: bool, most: int | None, rng: random.Random
) -> list[tuple[int, Fault]]:
    """Return all calls with the faults that they can meet, or so many of them.

    Parameters
    ----------
    kinds : list of str
        Of the calls.
    once : bool
        Each call with one fault, in turn.
    most : int or None
        So many at random; None: all.
    rng : Random
    """
    found = []
    for at, kind in enumerate(kinds, start=1):
        faults = [fault for fault in FAULTS if _met_by(kind, fault)]
        found += [(at, fault) for fault in ([faults[at % len(faults)]] if once else faults)]
    if most is None or most >= len(found):
        return found
    return [found[k] for k in sorted(rng.sample(range(len(found)), most))]


def _met_by(kind: str, fault: Fault) -> bool:
    if fault.error == errno.EACCES:
        return kind in _REFUSED
    return not fault.lasting or kind not in _TAKEN_WHEN_FULL


def _every_step(folder: Path) -> Project:
    """Make the small project with a gyro that was turned: it has all steps there are."""
    made = small_project(folder, 1, 4000)
    channels = {"gyro_x": {"column": "w", "unit": "deg/s"}}
    put_sensor(folder / "sensors/gyro.yaml", log={"rate": f"{RATE:g} Hz", "channels": channels})
    starts = list(np.arange(29.0, 177.0, 30.0))
    notes = {"latitude": "40 deg", "dwell": "30 s", "turning": f"{TURN} s", "first": "north"}
    of = {
        "run": (turned(starts, 180.0), {"two_position": notes}),
        "table": (on_table(), {"rate_table": {"steps": STEPS, "axis": UP}}),
    }
    (folder / "logs/gyro").mkdir()
    for name, (rates, about) in of.items():
        log = folder / f"logs/gyro/{name}.csv"
        log.write_text("w\n" + "".join(f"{rate:.7g}\n" for rate in np.degrees(rates)))
        log.with_suffix(".yaml").write_text(yaml.safe_dump(about))
    return made


def steps(
    folder: Path, writes: Writes, only: set[str], of: Callable[[list[str]], list[tuple[int, Fault]]]
) -> tuple[int, int]:
    """Try each kind of step alone; return how many faults were met, and how many were wrong."""
    made = _every_step(folder / "steps")
    listed = jobs_of(made, folder / "jobs")
    shutil.rmtree(made.results)
    tried = bad = 0
    seen: set[str] = set()
    os.environ |= writes.environment  # of the process that forks
    processes = Processes()
    with contextlib.chdir(made.place), contextlib.closing(processes):
        alone = Steps(made, writes, processes, folder / "before")
        for job in listed:
            if job.name in seen or (only and job.name not in only):
                processes.run(job)
                continue
            seen.add(job.name)
            begin, came, met = time.monotonic(), Counter[str](), tried
            for what, outcome, wrong in alone.trials(job, of):
                came[outcome.partition(":")[0]] += 1
                tried += 1
                bad += bool(wrong)
                for one in wrong:
                    print(f"  {job.name}, {what}: FAULT: {one}", flush=True)
            told = ", ".join(f"{number} {kind}" for kind, number in came.most_common())
            took = time.monotonic() - begin
            print(f"{job.name:14}{tried - met:6} faults: {told}; {took:.0f} s", flush=True)
    for name in writes.environment:
        del os.environ[name]
    return tried, bad


# -------------------------------------------------------------------------------------- runs


def runs(
    folder: Path, writes: Writes, number: int, samples: int, rng: random.Random
) -> tuple[int, int]:
    """Let whole runs meet faults; return how many, and how many were not made good."""
    expected = Undisturbed(folder, 1, samples)
    made = small_project(folder / "runs", 0, samples)
    made.environment = os.environ | writes.environment
    with writes.counted(made.folder):
        made.run().check_returncode()
    total = writes.count
    print(f"a run has {total} calls", flush=True)
    bad = 0
    for k in range(number):
        for name in ("results", ".snakemake"):
            shutil.rmtree(made.folder / name, ignore_errors=True)
        at, fault = rng.randint(1, total), rng.choice(FAULTS)
        with writes.counted(made.folder, at, fault):
            done = made.run()
        struck, wrong = writes.struck, []
        if done.returncode == 0:
            wrong += _but_records(expected.differences(made.results, 0))
        wrong += [f"left over: {path}" for path in left_over(made.results)]
        made.run("--unlock")
        again = made.run()
        if again.returncode:
            said = (done.stderr + again.stdout + again.stderr)[-6000:]
            wrong.append(f"the next run ended with {again.returncode}:\n{said}")
        wrong += _but_records(expected.differences(made.results, 0))
        wrong += [f"left over after the next run: {path}" for path in left_over(made.results)]
        made.environment, kept = None, made.environment
        wrong += [f"{job} is left to do" for job in sorted(made.job_list())]
        made.environment = kept
        bad += bool(wrong)
        verdict = "FAULT" if wrong else "made good"
        print(f"{k + 1:3}/{number} {fault.name:7} at {at:5}, {struck:4} calls failed, "
              f"status {done.returncode}: {verdict}", *wrong, sep="\n  ", flush=True)  # fmt: skip
    return number, bad


def _but_records(found: list[str]) -> list[str]:
    """Leave out the records of steps that failed and then succeeded, which stay."""
    return [one for one in found if not one.startswith("faults/")]


def main() -> int:
    """Let writes fail, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--steps", nargs="*", default=[], help="these alone")
    parser.add_argument("--most", type=int, help="faults of a step; without: all")
    parser.add_argument("--once", action="store_true", help="each call with one fault, in turn")
    parser.add_argument("--runs", type=int, default=20, help="whole ones")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = random.Random(given.seed)
    begin = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="imubench.writes.") as name:
        folder = Path(name).resolve()
        writes = Writes(folder / "library")
        of = partial(every, once=given.once, most=given.most, rng=rng)
        tried, bad = steps(folder, writes, set(given.steps), of) if given.most != 0 else (0, 0)
        more, worse = runs(folder, writes, given.runs, 4000, rng) if given.runs else (0, 0)
    print(f"\n{tried} faults of steps, {more} of runs; {bad + worse} not as they should be, "
          f"{time.monotonic() - begin:.0f} s")  # fmt: skip
    return bool(bad + worse)


if __name__ == "__main__":
    sys.exit(main())
