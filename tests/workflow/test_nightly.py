"""Real runs of `imubench nightly` on a project of its own."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from tests.conftest import PROJECT
from tests.workflow.project import FEW, put_log, put_sensor

pytestmark = pytest.mark.release  # every day, tests/test_nightly.py and verification/finished.py

ENTRY = """
import sys
from imubench_pipeline.run.cli import main
sys.exit(main(["nightly", *sys.argv[1:]]))
"""
SETTINGS = ["sensors=sensors", "simulated=false", "requirements=false",
            'estimate={"methods": ["weighted"]}', *FEW]  # fmt: skip
LAYOUT = {"rate": "100 Hz", "channels": {"gyro_x": {"column": "wx", "unit": "deg/s"}}}
SAMPLES = 2000
DEADLINE = 600.0


@dataclass
class Project:
    folder: Path

    @property
    def nightly(self) -> Path:
        return self.folder / "results/nightly"

    def start(self, **options: Any) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", ENTRY, "-c2", "--settle", "1 s", "--project",
                   str(self.folder), "--config", *SETTINGS, "--", "--until", "ranking"]  # fmt: skip
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        return subprocess.Popen(command, **(pipes | options))

    def run(self, **options: Any) -> tuple[int, str]:
        with self.start(**options) as process:
            said, _ = process.communicate(timeout=DEADLINE)
        return process.returncode, said or ""

    def summary(self) -> dict[str, Any]:
        return json.loads((self.nightly / "latest.json").read_text())

    def log(self, name: str) -> Path:
        return self.folder / "logs/one" / name

    def samples(self) -> dict[str, int]:
        rows = pq.read_table(self.folder / "results/tables/recordings.parquet").to_pylist()
        return {row["recording"]: row["samples"] for row in rows}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("nightly")
    for name in ("config", "workflow", "profiles"):
        (folder / name).symlink_to(PROJECT / name)
    shutil.copy(PROJECT / "Snakefile", folder)
    put_sensor(folder / "sensors/one.yaml", log=LAYOUT)
    made = Project(folder)
    put_complete(made.log("a.csv"), 1)
    return made


def put_complete(path: Path, seed: int, samples: int = SAMPLES) -> None:
    """Write a log that was complete long ago."""
    put_log(path, seed, samples)
    put_text(path, path.read_text())


def put_text(path: Path, text: str) -> None:
    path.write_text(text)
    os.utime(path, (time.time() - 3600.0,) * 2)


def until(happens: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + DEADLINE
    while not (found := happens()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


@contextlib.contextmanager
def growing(path: Path) -> Iterator[None]:
    """Write to a log again and again, opened anew each time."""
    stop = threading.Event()

    def write() -> None:
        while not stop.wait(0.1):
            with path.open("a") as log:
                log.write("0.5,9.81\n")

    path.write_text("wx,ax\n")
    writer = threading.Thread(target=write)
    writer.start()
    try:
        yield
    finally:
        stop.set()
        writer.join()


def test_a_second_run_is_refused_as_long_as_snakemake_lives(project: Project) -> None:
    with project.start() as first:
        note = until(lambda: lock_note(project).get("snakemake"))
        os.kill(note, signal.SIGSTOP)  # it is not done before the others have asked
        status, said = project.run()
        assert status == 2
        assert f"another run works on {project.folder}/results: process {first.pid} (" in said
        first.kill()
    status, said = project.run()
    assert status == 2
    assert f"process {first.pid} (" in said
    assert f"is gone, but Snakemake ({note}) goes on" in said
    os.kill(note, signal.SIGCONT)
    until(lambda: list(project.folder.glob("results/recordings/one/a/*")))
    os.kill(note, signal.SIGKILL)  # its steps run on
    (project.folder / "results/tables").mkdir(exist_ok=True)
    left = project.folder / "results/tables/.recordings.csv.abcdefgh.part"
    left.write_text("x")
    os.utime(left, (time.time() - 3600.0,) * 2)


def lock_note(project: Project) -> dict[str, Any]:
    with contextlib.suppress(OSError, ValueError):
        return json.loads((project.nightly / "lock").read_text())
    return {}


def test_the_next_run_puts_it_right_and_skips_what_grows(project: Project) -> None:
    master, slave = os.openpty()
    drawn: list[bytes] = []

    def read() -> None:
        with contextlib.suppress(OSError):
            while part := os.read(master, 65536):
                drawn.append(part)

    reader = threading.Thread(target=read)
    reader.start()
    with growing(project.log("b.csv")):
        environment = os.environ | {"TERM": "xterm"}
        status, said = project.run(stderr=slave, env=environment)
    os.close(slave)
    reader.join()
    os.close(master)
    assert status == 0, said + b"".join(drawn).decode()
    found = project.summary()
    assert "did not reach its end" in found["put_right"][0]
    assert any("temporary files removed: 1 " in line for line in found["put_right"])
    assert not list(project.folder.glob("results/**/.*.part"))
    assert not list(project.folder.glob(".snakemake/locks/*"))
    assert found["new"] == ["one/a"]
    assert [(one["recording"], one["keeps_results"]) for one in found["skipped"]] == [
        ("one/b", False)
    ]
    assert project.samples() == {"a": SAMPLES}
    # The terminal shows the progress in one line; the file has what was said, and no drawing.
    assert b" steps, about " in b"".join(drawn)
    log = Path(found["log"]).read_bytes()
    assert b"\n1 recording analysed" in log
    assert b"\x1b" not in log and b" steps, about " not in log


@pytest.fixture
def analysed(project: Project) -> Project:
    """The project after a run, which the tests before have made where they are asked for."""
    if not (project.nightly / "latest.json").exists():
        status, said = project.run()
        assert status == 0, said
    return project


def test_a_log_that_is_rewritten_keeps_its_results(analysed: Project) -> None:
    project = analysed
    put_log(project.log("b.csv"), 2, SAMPLES + 500)
    lines = project.log("b.csv").read_text().splitlines(keepends=True)
    put_text(project.log("b.csv"), "".join(lines[:-500]))
    put_complete(project.log("c.csv"), 3)
    broken = project.log("c.csv").read_text().replace("wx", "wy", 1)
    put_text(project.log("c.csv"), broken)
    parameters = project.folder / "results/recordings/one/a/parameters.parquet"
    before = parameters.stat().st_mtime_ns
    with project.log("a.csv").open("w") as rewritten:
        rewritten.write("wx,ax\n")
        rewritten.flush()
        with project.start() as process:
            until(lambda: lock_note(project).get("snakemake"))
            with project.log("b.csv").open("a") as log:  # it had settled, but was not complete
                log.writelines(lines[-500:])
            said, _ = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1, said
    found = project.summary()
    assert found["new"] == ["one/c"]
    assert [(one["recording"], one["new"]) for one in found["rejected"]] == [("one/c", True)]
    held_back, late = found["skipped"]
    assert (held_back["recording"], held_back["keeps_results"]) == ("one/a", True)
    assert "has it open for writing" in held_back["reason"]
    assert (late["recording"], late["keeps_results"]) == ("one/b", False)
    assert "written to while it was read" in late["reason"]
    assert found["changed"] == [] and found["removed"] == []
    assert project.samples()["a"] == SAMPLES
    assert parameters.stat().st_mtime_ns == before
    assert "one/c (new): c.csv: no column 'wx'" in said


def test_logs_that_settled_are_taken_and_what_is_known_flags_nothing_again(
    project: Project,
) -> None:
    put_complete(project.log("a.csv"), 4, SAMPLES + 100)
    os.utime(project.log("b.csv"), (time.time() - 3600.0,) * 2)
    status, said = project.run()
    assert status == 0, said
    found = project.summary()
    assert found["changed"] == [
        {"recording": "one/a", "because": "its log changed", "new_log": True}
    ]
    assert [(one["recording"], one["new"]) for one in found["rejected"]] == [("one/c", False)]
    assert found["new"] == ["one/b"] and found["skipped"] == []
    samples = project.samples()
    assert (samples["a"], samples["b"]) == (SAMPLES + 100, SAMPLES + 500)
    assert len(list(project.nightly.glob("*Z.json"))) == 3


def test_a_failed_run_says_why_and_is_no_state_to_compare_with(project: Project) -> None:
    before = (project.nightly / "state.json").read_bytes()
    (project.folder / "sensors").rename(project.folder / "elsewhere")
    status, said = project.run()
    assert status == 2
    assert "sensors: no such folder; expected a YAML file for each sensor" in said
    assert project.summary()["outcome"] == "failed"
    assert (project.nightly / "state.json").read_bytes() == before
    assert (project.nightly / "latest.txt").read_text() in said
