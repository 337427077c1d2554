"""One run at a time in a folder of results, and the balance of the drop zone that each prints."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from imubench_pipeline.run.lock import INHERITED, Lock, locate_lock
from tests.workflow.project import FEW, Project, linked, put_log, put_sensor


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("locked")
    put_sensor(folder / "sensors/s.yaml")
    put_log(folder / "logs/s/a.csv", 1, samples=2000)
    settings = [f"{name}={folder / name}" for name in ("logs", "sensors", "results")]
    settings += ["simulated=false", "requirements=false", *FEW]
    return Project(folder, folder / "results", linked(folder / "place"), settings)


def test_a_second_run_is_refused_and_told_who_works_there(project: Project) -> None:
    other = Project(
        project.folder, project.results, linked(project.folder / "other"), project.settings
    )
    with Lock(locate_lock(project.results)) as lock:
        lock.acquire()
        refused = other.run("--until", "ingest")
        assert refused.returncode == 1
        assert f"another run works on {project.results}: process {os.getpid()}" in refused.stderr
        assert not (project.results / "recordings").exists()
        # It may look on, and so may who holds the lock for it.
        assert other.run("-n", "--until", "ingest").returncode == 0
        done = subprocess.run(
            other.command("--until", "ingest"),
            cwd=other.place,
            env=os.environ | {INHERITED: str(lock.descriptor)},
            pass_fds=(lock.descriptor,),
            capture_output=True,
            text=True,
            check=False,
            timeout=600,
        )
        assert done.returncode == 0, done.stderr
        assert (project.results / "recordings/s/a/quality.json").is_file()


def test_who_was_killed_holds_nothing(tmp_path: Path) -> None:
    held = (
        "import os, sys; from pathlib import Path; from imubench_pipeline.run.lock import Lock; "
        "Lock(Path(sys.argv[1])).acquire(); os.kill(os.getpid(), 9)"
    )
    path = locate_lock(tmp_path)
    subprocess.run([sys.executable, "-c", held, str(path)], check=False, timeout=60)
    assert json.loads(path.read_text())["process"] > 0
    with Lock(path) as lock:
        lock.acquire_unless_inherited()
        assert lock.left_over == {}
