"""What the package does where its extras are not installed, and what it says of the rest."""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable, Iterator
from importlib.metadata import distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from imubench_pipeline.readers.formats import FILE_FORMATS
from tests.conftest import PROJECT, few
from tests.readers.test_formats import LOADED
from tests.test_pins import project
from tests.workflow.project import put_log

pytestmark = pytest.mark.release

WORKFLOW = "which is not installed: pip install 'imubench_pipeline[workflow]'"


def needed(entries: list[str]) -> set[str]:
    """The packages of some requirements, with all that they need themselves."""
    names: set[str] = set()
    pending = entries
    while pending:
        ones = [Requirement(entry) for entry in pending]
        here = {one.name for one in ones if not one.marker or one.marker.evaluate({"extra": ""})}
        new = {canonicalize_name(name) for name in here} - names
        names |= new
        pending = [entry for name in new for entry in distribution(name).requires or ()]
    return names


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python with what ``pip install imubench_pipeline`` brings, and no more."""
    folder = tmp_path_factory.mktemp("base") / "venv"
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for name in needed(project()["project"]["dependencies"]):
        for top in {path.parts[0] for path in distribution(name).files or ()} - {
            "..",
            "__pycache__",
        }:
            (packages / top).symlink_to(Path(sysconfig.get_path("purelib")) / top)
    own = distribution("imubench_pipeline").locate_file("")
    (about,) = Path(str(own)).glob("imubench_pipeline-*.dist-info")
    (packages / about.name).symlink_to(about)
    (packages / "own.pth").write_text(f"{PROJECT / 'src'}\n")
    return folder / "bin/python"


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").touch()
    put_log(tmp_path / "logs/mine/run.csv", 1, samples=1_200)
    return tmp_path


FORKS = """
import gc, json, os, runpy, sys
import imubench_pipeline.run.analysis.chain, imubench_pipeline.run.cli
import imubench_pipeline.readers.inspection, imubench_pipeline.simulate.simulation
import pandas, pyarrow.parquet, scipy.optimize, scipy.signal
gc.disable()
gc.freeze()
for line in sys.stdin:
    lab, arguments = json.loads(line)
    if not (process := os.fork()):
        os.chdir(lab)
        for number in (1, 2):
            os.dup2(os.open(f"said_{number}", os.O_CREAT | os.O_WRONLY | os.O_TRUNC), number)
        if arguments[0] == "-c":
            exec(arguments[1], {})
            sys.exit()
        sys.argv[1:] = arguments
        runpy.run_module("imubench_pipeline.run.start", run_name="__main__", alter_sys=True)
    print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
"""
"""Runs each command, or the Python after ``-c``, in a fork of a process that has imported what most
of them import. Nothing is looked through for garbage, which would copy the memory of that process.
"""

Imubench = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="module")
def imubench(python: Path) -> Iterator[Imubench]:
    """Return what runs a command in a folder."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([str(python), "-c", FORKS], **pipes) as process:

        def ran(lab: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
            assert process.stdin is not None and process.stdout is not None
            process.stdin.write(json.dumps([str(lab), arguments]) + "\n")
            process.stdin.flush()
            status = int(process.stdout.readline())
            said = [(lab / f"said_{number}").read_text() for number in (1, 2)]
            return subprocess.CompletedProcess(arguments, status, *said)

        yield ran


def test_each_format_whose_library_is_not_installed_names_it(
    imubench: Imubench, tmp_path: Path
) -> None:
    done = imubench(tmp_path, "-c", LOADED)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    extras = {name: form.extra for name, form in FILE_FORMATS.items() if form.extra}
    assert said.keys() == extras.keys() == {"rosbag", "matlab", "hdf5", "excel"}
    for name, extra in extras.items():
        library = {"ros": "rosbags", "hdf5": "h5py", "excel": "python_calamine"}[extra]
        assert f"{library} is needed, which is not installed" in said[name]
        assert f"pip install 'imubench_pipeline[{extra}]'" in said[name]


STATED = ("--rate", "10 Hz", "--gyro-unit", "rad/s", "--accel-unit", "m/s^2")


@pytest.mark.parametrize(
    ("command", "status", "said"),
    few(
        [
            (("formats",), 0, "rosbag"),
            (("inspect", "logs/mine/run.csv"), 1, "gyro_x"),
            (("analyse", "logs/mine/run.csv", *STATED), 0, "gyro_x"),
            (("completion", "bash"), 0, "complete"),
        ],
        [
            (("shortlist", "ground_robot"), 0, "mti_7"),
            (("simulate", "bno055", "--hours", "0.01", "--out", "made.csv"), 0, "made.csv"),
        ],
    ),
    ids=lambda value: value[0] if isinstance(value, tuple) else None,
)
def test_a_command_that_needs_no_extra_does_without(
    imubench: Imubench, lab: Path, command: tuple[str, ...], status: int, said: str
) -> None:
    done = imubench(lab, *command)
    assert done.returncode == status, done.stderr
    assert said in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("command", "lacks"),
    [
        (("run", "."), "to run the workflow, snakemake"),
        # Every day: `run`, and what both are in tests/workflow.
        pytest.param(
            ("nightly", "."), "to run the workflow, snakemake", marks=pytest.mark.release
        ),
        (("report", "results"), "to write the report, jinja2"),
        (("analyse", "logs/mine/run.csv", *STATED, "--output", "made"),
         "to write pages and figures (--output), jinja2"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else None,
)  # fmt: skip
def test_a_command_that_needs_the_workflow_says_how_to_install_it(
    imubench: Imubench, lab: Path, command: tuple[str, ...], lacks: str
) -> None:
    done = imubench(lab, *command)
    assert done.returncode == 2
    assert done.stderr == f"imubench {command[0]}: {lacks} is needed, {WORKFLOW}\n"
    assert not (lab / "made").exists() and not (lab / "results").exists()


DRAWN = """
import numpy as np
import imubench_pipeline as imu
from imubench_pipeline.settings.extras import ExtraError

noise = np.random.default_rng(1).normal(size=(3000, 6))
curves = imu.allan_variance(noise, rate="10 Hz")
print(curves["gyro_x"].deviation[0])
try:
    curves.plot()
except ExtraError as error:
    print(error)
"""


def test_the_library_computes_without_what_draws(imubench: Imubench, tmp_path: Path) -> None:
    done = imubench(tmp_path, "-c", DRAWN)
    assert done.returncode == 0, done.stderr
    value, said = done.stdout.splitlines()
    assert 0.9 < float(value) < 1.1  # white noise of deviation 1, one sample a cluster
    assert said == f"to draw, matplotlib is needed, {WORKFLOW}"


def test_a_log_without_its_extra_is_one_that_cannot_be_read(
    imubench: Imubench, python: Path, lab: Path
) -> None:
    (lab / "run.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(2000))
    done = imubench(lab, "inspect", "run.h5")
    assert done.returncode == 2
    assert "h5py is needed, which is not installed: pip install 'imubench_pipeline[hdf5]'" in (
        done.stderr
    )
    assert sys.executable != str(python)
