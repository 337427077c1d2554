"""A small project in two states, and whether what lies in its results is whole."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import threading
from collections import defaultdict
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import yaml

from tests.workflow.project import Project, linked, put_sensor

NIGHTLY, SNAKEMAKE = "nightly", "snakemake"
"""What runs: ``imubench nightly``, or Snakemake by hand."""

LONGEST = 300.0  # s; of a run

_CHANNEL = {"gyro_x": {"column": "wx", "unit": "deg/s"}}
_PAUSE = 0.05  # s between two looks


class FaultError(AssertionError):
    """What a user would call a broken run."""


STATES = 3


def put_state(folder: Path, state: int, samples: int) -> None:
    """Write the logs and settings of a small project, in one of its states.

    In all of them the logs have the same names, sizes and dates, but for one that only the second
    has: what is left of one state could pass for another. From the first to the third a setting
    changes that one step of one recording depends on, and no log.
    """
    shutil.rmtree(folder / "logs", ignore_errors=True)
    of_logs = state % 2
    layout = {"rate": "100 Hz", "channels": _CHANNEL}
    density = {"value": 0.01 + 0.01 * of_logs, "unit": "deg/s/sqrt(Hz)"}
    put_sensor(folder / "sensors/one.yaml", log=layout,
               datasheet={"gyro": {"noise_density": density}})  # fmt: skip
    bandwidth = {"bandwidth": "20 Hz"} if state == 2 else {}
    put_sensor(folder / "sensors/two.yaml", log=layout | bandwidth)
    _put_log(folder / "logs/one/a.csv", 1 + of_logs, samples)
    if of_logs:
        _put_log(folder / "logs/one/b.csv", 3, samples)
    simulated = {
        "sensor": "two",
        "recording": "sim_a",
        "duration": f"{samples / 100} s",
        "rate": "100 Hz",
        "seed": 1 + of_logs,
        "source": "none",
        "channels": {"gyro_x": {"N": "0.01 deg/s/sqrt(Hz)"}},
    }
    (folder / "simulated.yaml").write_text(yaml.safe_dump({"recordings": [simulated]}))


def _put_log(path: Path, seed: int, samples: int) -> None:
    values = np.random.default_rng(seed).normal(0.0, 0.1, samples)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("wx\n" + "".join(f"{value:+.8f}\n" for value in values))
    os.utime(path, (1e9, 1e9))


def small_project(folder: Path, state: int, samples: int) -> Project:
    """Make a project that has no results yet."""
    linked(folder)
    put_state(folder, state, samples)
    settings = ["logs=logs", "sensors=sensors", "results=results", "requirements=false",
                "simulated=simulated.yaml", 'estimate={"methods": ["weighted"]}']  # fmt: skip
    return Project(folder, folder / "results", folder, settings)


def command(made: Project, run: str) -> list[str]:
    """Return the command of a run; a nightly one waits for another that goes on."""
    return made.nightly_command("--wait", f"{LONGEST:g} s") if run == NIGHTLY else made.command()


def completed(run: str, status: int) -> bool:
    """Tell whether a run says that it completed; a nightly one may have something to flag."""
    return status == 0 or (run == NIGHTLY and status == 1)


def visible(results: Path) -> Iterator[Path]:
    """Yield the files that have their final names."""
    for place, folders, files in os.walk(results):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place, name) for name in files if not name.startswith("."))


def left_over(results: Path) -> set[Path]:
    """Return the temporary files and folders of steps, killed or running."""
    found = set()
    for place, folders, files in os.walk(results):  # what vanishes meanwhile is no error
        found |= {Path(place, name) for name in (*folders, *files) if fnmatch(name, ".*.part")}
        folders[:] = [name for name in folders if not name.startswith(".")]
    return found


class Undisturbed:
    """What undisturbed runs leave.

    Parameters
    ----------
    folder : Path
        For their projects.
    states : int
        How many states of the project.
    samples : int
        Of each log.
    """

    def __init__(self, folder: Path, states: int, samples: int) -> None:
        self.samples = samples
        self.results: list[Path] = []
        self._known: defaultdict[Path, set[bytes]] = defaultdict(set)
        for state in range(states):
            made = small_project(folder / f"undisturbed_{state}", state, samples)
            done = made.run()
            if done.returncode:
                raise FaultError(f"an undisturbed run failed:\n{done.stdout}{done.stderr}")
            if left := left_over(made.results):
                raise FaultError(f"an undisturbed run left {left}")
            if {row["status"] for row in made.table("recordings")} != {"ok"}:
                raise FaultError("a log was rejected")
            self.results.append(made.results)
            for path in visible(made.results):
                self._known[path.relative_to(made.results)].add(_digest(path))

    def is_whole(self, name: Path, path: Path) -> bool:
        """Tell whether a file is one that an undisturbed run leaves under this name."""
        if name.parts[0] == "logs":  # what the steps said: no result, and cut where a disk is full
            return True
        if name.parts[0] == "nightly":
            return name.suffix in (".log", "") or _is_text(path)
        # Which pages have been written again so far; dates.
        if name.name == "pages.json" or _is_dated(name):
            return _is_text(path)
        return _digest(path) in self._known.get(name, set())

    def faults(self, results: Path) -> list[str]:
        """Return what is not whole among the files that have their final names; nothing runs."""
        names = sorted(path.relative_to(results) for path in visible(results))
        return [f"{name} is not whole" for name in names if not self.is_whole(name, results / name)]

    def differences(self, results: Path, state: int) -> list[str]:
        """Return which files are not those of a state; logs that are gone leave their folder."""
        expected = self.results[state]
        names = {path.relative_to(expected) for path in visible(expected)}
        found = []
        for name in sorted(names):
            if not (results / name).is_file():
                found.append(f"{name} is not there")
            elif _is_dated(name):
                continue  # `imubench verify` reads it
            elif (results / name).read_bytes() != (expected / name).read_bytes():
                found.append(f"{name} differs")
        for name in sorted({path.relative_to(results) for path in visible(results)} - names):
            of = Path(*name.parts[name.parts[0] in ("seals", "logs") :][:3])
            gone = of.parts[0] == "recordings" and not (expected / of).exists()
            if not gone and of.parts[0] != "nightly":
                found.append(f"{name} should not be there")
        return found


def _is_dated(name: Path) -> bool:
    """Tell whether a file holds dates of others, which each run has its own of."""
    return name.parts[0] in ("seals", "nightly") or name.name == "log.json"


def _digest(path: Path) -> bytes:
    return hashlib.sha256(path.read_bytes()).digest()


def _is_text(path: Path) -> bool:
    try:
        text = path.read_text()
        if path.suffix == ".json":
            json.loads(text)
    except ValueError:
        return False
    return text.endswith("\n")


class Watch:
    """Looks again and again whether each file that has its final name is whole.

    Parameters
    ----------
    results : Path
    expected : Undisturbed

    Attributes
    ----------
    faults : list of str
        What was not, in the order in which it was seen.
    """

    def __init__(self, results: Path, expected: Undisturbed) -> None:
        self.faults: list[str] = []
        self._results = results
        self._expected = expected
        self._seen: set[tuple[Path, int, int, int]] = set()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._look_on, daemon=True)
        self._thread.start()

    def look(self) -> None:
        """Look at every file that has changed since the last look."""
        with self._lock:
            for path in visible(self._results):
                self._look_at(path)

    def _look_at(self, path: Path) -> None:
        name = path.relative_to(self._results)
        try:
            about = path.stat()
            key = (name, about.st_ino, about.st_size, about.st_mtime_ns)
            if key in self._seen:
                return
            if not self._expected.is_whole(name, path):
                self.faults.append(f"{name} is not whole ({about.st_size} bytes)")
        except (FileNotFoundError, NotADirectoryError):
            return  # replaced, or taken away for a step that makes it again
        self._seen.add(key)

    def close(self) -> None:
        """Look no more."""
        self._stop.set()
        self._thread.join()

    def _look_on(self) -> None:
        try:
            while not self._stop.wait(_PAUSE):
                self.look()
        except Exception as error:
            self.faults.append(f"the watch ended: {error!r}")
            raise
