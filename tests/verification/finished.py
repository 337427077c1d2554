"""A small project that is finished, and the jobs of its run, for all tests of what is kept."""

from __future__ import annotations

import os
import pickle
import subprocess
from dataclasses import dataclass
from pathlib import Path

from imubench_pipeline.run.processes import Job
from tests.conftest import PROJECT
from tests.release.small import small_project
from tests.workflow.project import Project

SAMPLES = 2000

_KEEP_JOBS = """
import os, pickle
from pathlib import Path
from imubench_pipeline.run.processes import Processes
run = Processes.run
def kept(self, job, seconds=None):
    name = "_".join([job.name, *map(str, job.wildcards)])
    Path(os.environ["JOBS"], name).write_bytes(pickle.dumps(job))
    return run(self, job, seconds)
Processes.run = kept
"""
"""Is run by every Python of the run before anything else."""


@dataclass
class Finished:
    """A project after a nightly run, and the jobs of that."""

    project: Project
    jobs: list[Job]

    @property
    def results(self) -> Path:
        return self.project.results


def finished(folder: Path) -> Finished:
    """Make a project of three recordings, one of them simulated, and run it once."""
    made = small_project(folder / "project", 1, SAMPLES)
    jobs, site = folder / "jobs", folder / "site"
    jobs.mkdir()
    site.mkdir()
    (site / "sitecustomize.py").write_text(_KEEP_JOBS)
    paths = os.pathsep.join([str(site), str(PROJECT / "src")])
    ran = subprocess.run(
        made.nightly_command(),
        cwd=made.place,
        env=os.environ | {"PYTHONPATH": paths, "JOBS": str(jobs)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert ran.returncode in (0, 1), ran.stdout + ran.stderr  # warnings are new
    return Finished(made, [pickle.loads(path.read_bytes()) for path in sorted(jobs.iterdir())])
