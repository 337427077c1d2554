"""A small project that is finished, and the jobs of its run, for all tests of what is kept."""

from __future__ import annotations

import os
import pickle
import subprocess
from dataclasses import dataclass
from pathlib import Path

import yaml

from imubench_pipeline.run.processes import Job
from tests.conftest import PROJECT
from tests.workflow.project import CHANNELS, Project, linked, put_log, put_sensor

SAMPLES = 2000
BIG = 60_000
"""Samples, of a log above 1 MB."""

IN_FILES = {
    name: {**source, "file": f"{name}.csv", "column": 1} for name, source in CHANNELS.items()
}
REQUIREMENT = {
    "title": "Robot",
    "static_window": "30 s",
    "limits": [{"error": "heading", "after": "60 s", "at_most": "1 deg"}],
}
SIMULATED = {
    "sensor": "two",
    "recording": "sim_a",
    "duration": f"{SAMPLES / 100} s",
    "rate": "100 Hz",
    "seed": 1,
    "source": "none",
    "channels": {"gyro_x": {"N": "0.01 deg/s/sqrt(Hz)"}},
}

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


def put_requirement(folder: Path, **changes: object) -> None:
    """Write a requirement."""
    path = folder / "requirements/robot.yaml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(REQUIREMENT | changes))


def put_two(folder: Path, **changes: object) -> None:
    """Write a sensor whose recordings are of two files, one a channel."""
    layout = {"rate": "100 Hz", "channels": IN_FILES, "header": True}
    put_sensor(folder / "sensors/two.yaml", log=layout | changes)


def put_parts(folder: Path, seed: int) -> None:
    """Write a recording of two files, one a channel."""
    put_log(folder / "whole", seed, SAMPLES)
    lines = (folder / "whole").read_text().splitlines()
    (folder / "whole").unlink()
    for column, name in enumerate(CHANNELS):
        text = "".join(line.split(",")[column] + "\n" for line in lines)
        (folder / f"{name}.csv").write_text(text)


def project_in(folder: Path) -> Project:
    """Make a project that runs in a folder of its own, and names everything relative to it."""
    linked(folder)
    settings = ["logs=logs", "sensors=sensors", "results=results", "requirements=requirements",
                "simulated=simulated.yaml", 'estimate={"methods": ["weighted"]}']  # fmt: skip
    return Project(folder, folder / "results", folder, settings)


def finished(folder: Path) -> Finished:
    """Make a project of four recordings, one of them simulated, and run it once."""
    made = project_in(folder / "project")
    put_sensor(made.folder / "sensors/one.yaml")
    put_two(made.folder)
    put_requirement(made.folder)
    put_log(made.folder / "logs/one/a.csv", 1, SAMPLES)
    put_log(made.folder / "logs/one/b.csv", 2, BIG)
    put_parts(made.folder / "logs/two/f", 3)
    simulated = yaml.safe_dump({"recordings": [SIMULATED]})
    (made.folder / "simulated.yaml").write_text(simulated)
    jobs, site = folder / "jobs", folder / "site"
    jobs.mkdir()
    site.mkdir()
    (site / "sitecustomize.py").write_text(_KEEP_JOBS)
    paths = os.pathsep.join([str(site), str(PROJECT / "src")])
    ran = subprocess.run(
        made.nightly_command(cores=1),  # the first of all runs: two steps would compile the same
        cwd=made.place,
        env=os.environ | {"PYTHONPATH": paths, "JOBS": str(jobs)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert ran.returncode in (0, 1), ran.stdout + ran.stderr  # warnings are new
    return Finished(made, [pickle.loads(path.read_bytes()) for path in sorted(jobs.iterdir())])
