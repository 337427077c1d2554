"""Whatever became of a drop zone, a run leaves what a run from nothing leaves."""

from __future__ import annotations

import errno
import gzip
import os
import shutil
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule

from imubench_pipeline.recordings import known_logs
from tests.history.project import DiskFullError, KilledError, Project, on_access

GOOD = "wx,ax\n" + "".join(f"{k % 7 / 10},{9.8 + k % 5 / 100}\n" for k in range(60))
OTHER = GOOD.replace("0.1,", "0.3,")
CONTENTS = {
    "good": GOOD,
    "other": OTHER,
    "word": GOOD[:-2] + "x\n",
    "empty": "",
    "header": "wx,ax\n",
}
NAMES = st.sampled_from(["a.csv", "b.csv", "b.csv.gz", "c"])
ODD = st.sampled_from([".hidden", "a.YAML", "a.csv~", "x.md", "b.csv.part", "lone.yaml", "c/.x"])
NOTES = st.sampled_from(["", "device: '7'", "use: {start: 0.1 s}", "device: [", "devise: 7"])
CONTENT = st.sampled_from(sorted(CONTENTS))


class Histories(RuleBasedStateMachine):
    """Random histories of a drop zone, and of runs that meet faults."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp(prefix="history."))
        self.project = Project(self.folder)
        self.logs = self.project.logs / "s"
        self.away = self.folder / "away"
        self.away.mkdir()

    def path_of(self, name: str) -> Path:
        return self.logs / name / "c.csv" if name == "c" else self.logs / name

    @rule(name=NAMES, content=CONTENT)
    def put(self, name: str, content: str) -> None:
        path = self.path_of(name)
        path.parent.mkdir(exist_ok=True)
        data = CONTENTS[content].encode()
        path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)

    @rule(name=NAMES, content=CONTENT)
    def replace(self, name: str, content: str) -> None:
        path = self.path_of(name)
        path.parent.mkdir(exist_ok=True)
        new = path.with_name(".new")
        new.write_text(CONTENTS[content])
        new.replace(path)

    @rule(name=NAMES)
    def edit_in_place(self, name: str) -> None:
        """Change one digit; size and date stay."""
        path = self.path_of(name)
        if path.is_file() and path.stat().st_size > 40:
            about = path.stat()
            data = bytearray(path.read_bytes())
            data[20] = ord("5") if data[20] != ord("5") else ord("6")
            with path.open("r+b") as file:
                file.write(data)
            os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))

    @rule(name=NAMES, old=st.booleans())
    def touch(self, name: str, old: bool) -> None:
        if self.path_of(name).is_file():
            os.utime(self.path_of(name), (1e9, 1e9) if old else None)

    @rule(name=NAMES)
    def remove(self, name: str) -> None:
        path = self.logs / name
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)

    @rule(name=NAMES)
    def take_away(self, name: str) -> None:
        if (self.logs / name).exists() and not (self.away / name).exists():
            (self.logs / name).rename(self.away / name)

    @rule()
    def put_back(self) -> None:
        for path in sorted(self.away.iterdir()):
            if not (self.logs / path.name).exists():
                path.rename(self.logs / path.name)

    @rule(
        text=st.sampled_from(["", "device: '7'", "use: {start: 0.1 s}", "device: [", "devise: 7"])
    )
    def write_notes(self, text: str) -> None:
        (self.logs / "a.yaml").write_text(text)

    @rule(name=ODD)
    def put_odd(self, name: str) -> None:
        with suppress(FileNotFoundError):
            (self.logs / name).write_text("x")

    @rule()
    def run(self) -> None:
        with suppress(DiskFullError):
            self.project.run()

    @rule(
        at=st.integers(1, 60),
        fault=st.sampled_from(["kill", "full", "io", "away", "moment", "written", "moved"]),
        name=NAMES,
    )
    def run_with_fault(self, at: int, fault: str, name: str) -> None:
        count = 0
        path_of_log = self.path_of(name)
        content = path_of_log.read_bytes() if path_of_log.is_file() else b""

        def meet(event: str, path: Path, flags: int) -> None:
            nonlocal count
            of_log = self.project.logs in path.parents
            if not of_log and self.project.results not in path.parents:
                return
            count += 1
            if fault == "written" and count == at + 5 and path_of_log.is_file():
                path_of_log.write_bytes(content)  # as it was before the run
            if fault == "moment" and count == at + 5:
                self.put_back()
            if count != at:
                return
            if fault == "kill":
                raise KilledError
            if fault == "full" and not of_log and flags & (os.O_WRONLY | os.O_RDWR):
                raise OSError(errno.ENOSPC, "No space left on device", str(path))
            if fault == "io" and of_log:
                raise OSError(errno.EIO, "Input/output error", str(path))
            if fault in ("away", "moment"):
                self.take_away(name)
            if fault == "written" and path_of_log.is_file():
                path_of_log.write_bytes(content[: len(content) // 2] + b"x\n")
            if fault == "moved" and path_of_log.is_file():
                path_of_log.rename(path_of_log.with_name("d.csv"))

        with suppress(DiskFullError, KilledError, OSError), on_access(meet):
            self.project.run()

    @precondition(lambda self: any(self.away.iterdir()))
    @rule()
    def run_and_put_back(self) -> None:
        self.run()
        self.put_back()

    def teardown(self) -> None:
        try:
            self.project.run()
            self.project.run()  # what failed with a fault is tried again
            assert self.project.outcome() == self.project.from_nothing()
            assert sorted(self.project.run()) == sorted(self.project.failed())
        finally:
            shutil.rmtree(self.folder)


class HistoriesByStamps(Histories):
    """The same, where the stamps of files are trusted as soon as they are made."""

    def __init__(self) -> None:
        super().__init__()
        self.resolution = known_logs._STAMP_RESOLUTION
        known_logs._STAMP_RESOLUTION = 0

    @rule()
    def run(self) -> None:
        time.sleep(0.02)  # stamps of the system move in steps
        super().run()
        time.sleep(0.02)

    def teardown(self) -> None:
        try:
            time.sleep(0.02)
            super().teardown()
        finally:
            known_logs._STAMP_RESOLUTION = self.resolution


DAILY = settings(
    max_examples=4,
    stateful_step_count=12,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
MANY = settings(DAILY, max_examples=60, stateful_step_count=25)


@pytest.mark.parametrize("machine", [Histories, HistoriesByStamps])
def test_a_history_ends_as_a_run_from_nothing(machine: type[Histories]) -> None:
    from hypothesis.stateful import run_state_machine_as_test

    run_state_machine_as_test(machine, settings=DAILY)


@pytest.mark.release
@pytest.mark.parametrize("machine", [Histories, HistoriesByStamps])
def test_many_histories_end_as_a_run_from_nothing(machine: type[Histories]) -> None:
    from hypothesis.stateful import run_state_machine_as_test

    run_state_machine_as_test(machine, settings=MANY)
