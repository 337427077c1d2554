"""Runs that are killed, meet a full disk or may not write: the next run must make it good.

``python -m tests.release.kills --kills 40`` kills steps, the process that forks them, Snakemake,
`imubench nightly` and all of these together with SIGKILL at random moments of runs on a small
project. At every moment each file that has its final name must be whole. After one to three kills
the next run must complete, leave the very files that an undisturbed run leaves, and have nothing
left to do. Meanwhile the logs and settings change, so that what an earlier state left could pass
for the later one. Then come disks that are full, or may not be written to.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import psutil

from tests.release.disks import disks
from tests.release.small import (
    LONGEST,
    NIGHTLY,
    SNAKEMAKE,
    STATES,
    FaultError,
    Undisturbed,
    Watch,
    command,
    completed,
    left_over,
    put_state,
    small_project,
)

_OF_SNAKEMAKE = [(kind, SNAKEMAKE) for kind in ("step", "step server", "snakemake", "all")]
_OF_NIGHTLY = [(kind, NIGHTLY) for kind, _ in _OF_SNAKEMAKE] + [("nightly", NIGHTLY)]
CARDS = 2 * _OF_NIGHTLY + _OF_SNAKEMAKE
"""What is killed, one process or all together, of which run: each comes up once in so many."""

_BEGINNING = 3.0  # s; in which a run has not come to its first step
_SOON = 10.0  # s; in which what was killed takes the rest with it
_ROW = "{:>7}  {:9}  {:11}  {:25}  {:45}  {}"
_HEAD = _ROW.format("kill", "run", "killed", "while", "moment", "verdict")


@dataclass
class Kill:
    """One kill, and what came of it."""

    run: str
    kind: str
    steps: str
    moment: str
    faults: list[str] = field(default_factory=list)
    made_good: bool = False

    def row(self, number: str) -> str:
        verdict = "FAULT" if self.faults else "whole, made good" if self.made_good else "whole"
        rows = [_ROW.format(number, self.run, self.kind, self.steps, self.moment, verdict)]
        return "\n".join(rows + [f"{'':9}{fault}" for fault in self.faults])


class Killer:
    """Kills runs of a project, and lets others complete.

    Parameters
    ----------
    folder : Path
    expected : Undisturbed
    seed : int
        Of all that is random here; what the system does meanwhile is not.
    """

    def __init__(self, folder: Path, expected: Undisturbed, seed: int) -> None:
        self._random = random.Random(seed)
        self._folder = folder
        self._expected = expected
        self._state = 0
        self._cards: list[tuple[str, str]] = []
        self._told = 0
        self._earlier_logs: set[Path] = set()
        self.kills: list[Kill] = []
        self.project = small_project(folder / "killed", 0, expected.samples)
        self._watch = Watch(self.project.results, expected)

    def faults(self) -> list[str]:
        """Return all that was found."""
        return [fault for kill in self.kills for fault in kill.faults]

    def series(self, number: int, say: Callable[[str], None]) -> None:
        """Kill so often, in chains of one to three; after each chain a run must complete."""
        missed = 0
        while len(self.kills) < number:
            first = len(self.kills)
            if self._random.random() < 0.2:
                shutil.rmtree(self.project.results, ignore_errors=True)
            self._change()
            for _ in range(min(number - first, self._random.randint(1, 3))):
                missed += not self.kill(*self._next_card())
                if self.kills and self.kills[-1].kind == "nightly":
                    break  # its Snakemake goes on
                if self._random.random() < 0.4:
                    self._change()
            if missed > 10 + number:
                raise FaultError("most runs end before they are killed")
            if len(self.kills) > first:
                self.complete(self._random.choice((NIGHTLY, SNAKEMAKE)), self.kills[first:])
                for index in range(first, len(self.kills)):
                    say(self.kills[index].row(f"{index + 1}/{number}"))

    def _next_card(self) -> tuple[str, str]:
        if not self._cards:
            self._cards = self._random.sample(CARDS, len(CARDS))
        return self._cards.pop()

    def _change(self) -> None:
        """Go to another state of the logs and settings, at once."""
        others = set(range(len(self._expected.results))) - {self._state}
        self._state = self._random.choice(sorted(others))
        put_state(self.project.folder, self._state, self._expected.samples)

    def kill(self, kind: str, run: str, latest: float = 1.0) -> bool:
        """Start a run and kill at a random moment; False if it ended before.

        ``latest`` is the share of its steps that may be done then.
        """
        before = left_over(self.project.results)
        process = self._start(run)
        if self._random.random() < 0.15:
            time.sleep(self._random.uniform(0.0, _BEGINNING))
        else:
            self._until(process, self._random.uniform(0.0, latest))
            time.sleep(self._random.uniform(0.0, 0.5))
            if self._random.random() < 0.5:
                self._until_writing(process, before)
        victims, steps = self._victims(process, kind)
        for victim in victims:
            with contextlib.suppress(psutil.NoSuchProcess):
                victim.kill()
        if not victims:
            process.wait(LONGEST)
            return False
        self.kills.append(Kill(run, kind, steps, self._moment(before)))
        self._watch.look()
        status = process.wait(LONGEST)
        self._note_seen("at the kill")
        if kind == "nightly" and status != -signal.SIGKILL:
            self._note([f"nightly ended with {status}"], "at the kill")
        elif completed(run, status):
            self._note(self._differences(), "after a run that said it completed")
        return True

    def _start(self, run: str) -> subprocess.Popen[bytes]:
        if run == SNAKEMAKE:
            if self.kills and self.kills[-1].kind == "nightly":
                self._settle(LONGEST)  # its Snakemake goes on
            if any(self.project.place.glob(".snakemake/locks/*")):
                self.project.run("--unlock").check_returncode()
        self._earlier_logs = self._logs()
        with self._output.open("wb") as output:
            return subprocess.Popen(
                command(self.project, run),
                cwd=self.project.place,
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    @property
    def _output(self) -> Path:
        return self._folder / "output.txt"

    def _said(self) -> str:
        """Return all that Snakemake says of the run that was started last."""
        logs = self._logs() - self._earlier_logs
        return max(logs).read_text(errors="replace") if logs else ""

    def _logs(self) -> set[Path]:
        """Return the files in which Snakemake says all, named by their dates."""
        return set(self.project.place.glob(".snakemake/log/*.log"))

    def _progress(self) -> tuple[int, int]:
        """Return how many steps are done, and of how many; 0 where that is not known yet."""
        said = self._said()
        total = re.search(r"^total +(\d+)$", said, re.MULTILINE)
        return said.count("\nFinished jobid"), int(total[1]) if total else 0

    def _until(self, process: subprocess.Popen[bytes], share: float) -> None:
        """Wait until a share of the steps has been done, or the run ends."""
        while process.poll() is None:
            done, total = self._progress()
            if total and done >= int(share * total):
                return
            time.sleep(0.02)

    def _until_writing(self, process: subprocess.Popen[bytes], before: set[Path]) -> None:
        """Wait until a step has a temporary file."""
        end = time.monotonic() + 5.0
        while time.monotonic() < end and process.poll() is None:
            if left_over(self.project.results) - before:
                return
            time.sleep(0.001)

    def _moment(self, before: set[Path]) -> str:
        """Return how far a run was, and a file that was being written."""
        written = sorted(path.name for path in left_over(self.project.results) - before)
        names = [re.sub(r"^\.(.+)\.\w{8}\.part$", r"\1", name) for name in written[:1]]
        done, total = self._progress()
        reached = f"{done} of {total} steps" if total else "before the first step"
        return reached + "".join(f", writing {name}" for name in names)

    def _victims(
        self, process: subprocess.Popen[bytes], kind: str
    ) -> tuple[list[psutil.Process], str]:
        """Return what to kill, and the names of the steps that run then."""
        end = time.monotonic() + 5.0
        while process.poll() is None and time.monotonic() < end:
            found = _processes(process.pid)
            steps = found["step"]
            chosen = [self._random.choice(steps)] if kind == "step" and steps else found[kind]
            if chosen:
                with contextlib.suppress(psutil.Error):
                    named = chosen if kind == "step" else steps
                    return chosen, ", ".join(one.name() for one in named)
            time.sleep(0.01)
        return [], ""

    def complete(self, run: str, after: Sequence[Kill]) -> None:
        """Let the next run complete, which must leave what an undisturbed run leaves."""
        faults = len(self.faults())
        status = self._start(run).wait(LONGEST)
        if not completed(run, status):
            said = self._output.read_text(errors="replace") + self._said()
            self._note([f"{run} ended with {status}:\n{said[-4000:]}"], "the next run")
        self._note_seen("in the next run")
        try:
            self._settle(_SOON)
            self._note(self._differences(), "after the next run")
            left = sorted(self.project.job_list())
            self._note([f"{job} is left to do" for job in left], "after the next run")
        except AssertionError as error:
            self._note([str(error)], "after the next run")
        for kill in after:
            kill.made_good = len(self.faults()) == faults

    def tidy(self) -> str:
        """Pretend that what was left is old: the next night must remove it."""
        left = left_over(self.project.results)
        for path in left:
            for one in (path, *path.rglob("*")):
                os.utime(one, (1e9, 1e9))
        status = self._start(NIGHTLY).wait(LONGEST)
        if still := sorted(left_over(self.project.results)):
            raise FaultError(f"status {status}, these are left over: {still}")
        return f"{len(left)} temporary files, all removed by the next night"

    def _differences(self) -> list[str]:
        return self._expected.differences(self.project.results, self._state)

    def _settle(self, patience: float) -> None:
        """Wait until nothing of a killed run goes on."""
        end = time.monotonic() + patience
        while working := list(_working_in(self.project.place)):
            if time.monotonic() > end:
                raise FaultError(f"these go on: {working}")
            time.sleep(0.05)

    def close(self) -> None:
        """End what still runs."""
        self._watch.close()
        for process in _working_in(self.project.place):
            process.kill()

    def _note(self, found: list[str], when: str) -> None:
        self.kills[-1].faults += [f"{when}: {one}" for one in found]

    def _note_seen(self, when: str) -> None:
        found = self._watch.faults[self._told :]
        self._told += len(found)
        self._note(found, when)


def _processes(root: int) -> dict[str, list[psutil.Process]]:
    """Return the processes of a run, by what they are."""
    found: defaultdict[str, list[psutil.Process]] = defaultdict(list)
    with contextlib.suppress(psutil.Error):
        first = psutil.Process(root)
        serving = set()
        for process in (first, *first.children(recursive=True)):
            with contextlib.suppress(psutil.Error):
                words = process.cmdline()
                if process.ppid() in serving:
                    kind = "step"
                elif "imubench_pipeline.run.step_server" in words:
                    kind = "step server"
                    serving.add(process.pid)
                else:
                    kind = NIGHTLY if "nightly" in words else SNAKEMAKE
                found[kind].append(process)
                found["all"].append(process)
    return found


def _working_in(folder: Path) -> Iterator[psutil.Process]:
    """Yield what works in a folder, besides this process."""
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            if process.pid != os.getpid() and Path(process.cwd()) == folder.resolve():
                yield process


def main() -> int:
    """Kill, fill and lock, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=int, default=20_000, help="of each log")
    parser.add_argument("--folder", type=Path, help="keep the projects here")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="imubench.kills."))
    begin = time.monotonic()
    say = partial(print, flush=True)
    expected = Undisturbed(folder, STATES, given.samples)
    say(_HEAD)
    with contextlib.closing(Killer(folder, expected, given.seed)) as killer:
        killer.series(given.kills, say)
        faults = len(killer.faults())
        faults += _told(say, "\nleft over", killer.tidy)
    kinds = Counter(f"{kill.kind} of {kill.run}" for kill in killer.kills)
    say("killed: " + ", ".join(f"{number} {kind}" for kind, number in kinds.most_common()) + "\n")
    for name, case in disks(folder, expected):
        faults += _told(say, name, case)
    say(f"\n{len(killer.kills)} kills, {faults} faults, {time.monotonic() - begin:.0f} s")
    if given.folder is None and not faults:
        shutil.rmtree(folder)
    return bool(faults)


def _told(say: Callable[[str], None], name: str, case: Callable[[], str]) -> bool:
    """Try a case and say what it met; return whether that was a fault."""
    try:
        say(f"{name}: {case()}")
    except FaultError as fault:
        say(f"{name}: FAULT: {fault}")
        return True
    return False


if __name__ == "__main__":
    sys.exit(main())
