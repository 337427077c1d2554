"""What the profile for Slurm asks for, without a Slurm."""

import re
from pathlib import Path

import pytest

from tests.workflow.dry_runs import dry_run
from tests.workflow.project import Project, linked, put_log, put_sensor

pytestmark = pytest.mark.workflow


@pytest.mark.release
def test_the_profile_runs_the_jobs_of_a_local_run(tmp_path: Path) -> None:
    put_sensor(tmp_path / "sensors/one.yaml")
    for seed, name in enumerate(("a", "b")):
        put_log(tmp_path / f"logs/one/{name}.csv", seed, samples=200)
    project = Project(tmp_path, tmp_path / "results", linked(tmp_path / "place"))
    jobs = []
    for flags in ([], ["--workflow-profile", "profiles/slurm"]):
        done = dry_run(project.place, ["-c1", *flags, "--config", *project.config()])
        assert done.returncode == 0, done.stdout + done.stderr
        jobs.append(dict(re.findall(r"^(\w+) +(\d+)$", done.stdout, re.MULTILINE)))
    assert jobs[0] == jobs[1] and jobs[0]["estimate"] == "2"
