"""Without the folder of extensions, static logs are analysed as with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import PROJECT
from tests.workflow.project import Project, linked, put_log, put_sensor

WHAT_THERE_IS = """
from imubench_pipeline.registry import installed_extensions
from imubench_pipeline.report.pages import ENTRIES
from imubench_pipeline.run.cli import COMMANDS
from imubench_pipeline.settings.sensor import RecordingNotes
from imubench_pipeline.tables.schemas import TABLES

assert installed_extensions() == ()
assert not {"papers", "nightly"} & COMMANDS.keys()
assert "earth_rate.html" not in [entry.file for entry in ENTRIES]
assert "two_position" not in RecordingNotes.model_fields
assert "calibration" not in TABLES
"""


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of a checkout without extensions."""
    place = tmp_path_factory.mktemp("core")
    package = Path("src/imubench_pipeline")
    ignored = shutil.ignore_patterns("extensions")
    shutil.copytree(PROJECT / package, place / package, ignore=ignored)
    for name in ("Snakefile", "workflow", "profiles", "config"):
        (place / name).symlink_to(PROJECT / name)
    return place


def surroundings(core: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(core / "src")}


def test_nothing_of_an_extension_is_left(core: Path) -> None:
    command = [sys.executable, "-c", WHAT_THERE_IS]
    done = subprocess.run(command, env=surroundings(core), cwd=core, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.release
def test_a_static_log_is_analysed(core: Path, tmp_path: Path) -> None:
    put_log(tmp_path / "logs/s/a.csv", 1)
    put_sensor(tmp_path / "sensors/s.yaml")
    project = Project(tmp_path, tmp_path / "results", linked(tmp_path / "place"))
    settings = [one for one in project.config() if not one.startswith("earth_rate")]
    command = [sys.executable, "-m", "snakemake", "-c2", "--replace-workflow-config", "--config"]
    done = subprocess.run(
        [*command, *settings, "requirements=false"],
        env=surroundings(core),
        cwd=project.place,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (row,) = project.table("recordings")
    assert row["status"] == "ok"
    assert {row["parameter"] for row in project.table("parameters")} >= {"N", "B"}
    assert (project.results / "report/index.html").is_file()
    assert not (project.results / "tables/earth_rate.parquet").exists()
