"""One run at a time in a folder of results."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from imubench_pipeline.run.lock import Lock, locate_lock
from tests.workflow.dry_runs import dry_run, run_snakemake
from tests.workflow.project import Project, linked, put_log, put_sensor


def test_a_second_run_is_refused_and_told_who_works_there(tmp_path: Path) -> None:
    put_sensor(tmp_path / "sensors/s.yaml")
    put_log(tmp_path / "logs/s/a.csv", 1, samples=200)
    project = Project(tmp_path, tmp_path / "results", linked(tmp_path / "place"))
    asked = ["-c1", "--until", "ingest", "--config", *project.config()]
    with Lock(locate_lock(project.results)) as lock:
        lock.acquire()
        refused = run_snakemake(project.place, asked)
        assert refused.returncode == 1
        assert f"another run works on {project.results}: process {os.getpid()}" in refused.stderr
        assert not (project.results / "recordings").exists()
        # It may look on; the child of the process that holds the lock may run: test_failures.py.
        assert dry_run(project.place, asked).returncode == 0


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
