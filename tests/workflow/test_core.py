"""Without the folder of extensions, static logs are analysed as with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from imubench_pipeline.readers.other_formats import EXTENSION_MARKS
from imubench_pipeline.registry import references
from tests.conftest import PROJECT
from tests.corpus import ENTRIES
from tests.readers.test_formats import SAMPLES
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

READ = """
import sys
from pathlib import Path
from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.content import find_format, recognise_content

for reader, path in zip(sys.argv[1::2], map(Path, sys.argv[2::2]), strict=True):
    for recognise in (recognise_content, lambda path: find_format(path, reader)):
        try:
            print(recognise(path))
        except RecordingError as error:
            print(error)
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


def test_a_log_of_an_extension_names_it(core: Path, tmp_path: Path) -> None:
    arguments = []
    for reader in EXTENSION_MARKS:
        folder = tmp_path / reader
        folder.mkdir()
        arguments += [reader, str(ENTRIES[SAMPLES[reader]].write(folder))]
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").touch()
    command = [sys.executable, "-c", READ, *arguments, "rosbag", str(bag)]
    done = subprocess.run(command, env=surroundings(core), cwd=core, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    readers = [reader for reader in [*EXTENSION_MARKS, "rosbag"] for _ in range(2)]
    for reader, line in zip(readers, done.stdout.splitlines(), strict=True):
        assert f"needs the reader '{reader}' of the extension 'formats'" in line


def test_the_formats_of_the_extension_are_those_named_without_it() -> None:
    assert references("formats").keys() == EXTENSION_MARKS.keys()


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
