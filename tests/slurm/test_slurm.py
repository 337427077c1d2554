"""A run on a Slurm of one node, which lives in a temporary folder, against a run without it.

For a release: most of the time it waits for Slurm. What the profile asks for is looked at every
day, in test_profile.py.
"""

import importlib.util
import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import psutil
import pytest

from imubench_pipeline.run.resources import Extent, compute_resources
from tests.workflow.many import RECORDINGS, SETTINGS, put_many, read_tables, run_local
from tests.workflow.project import Project, linked, put_log, put_sensor
from tests.workflow.rules import costs
from tests.workflow.test_workflow import STEPS_OF_A_RECORDING

pytestmark = [pytest.mark.workflow, pytest.mark.release]

SCRIPTS = Path(__file__).parent
PROGRAMS = ("slurmctld", "slurmd", "munged", "sbatch", "srun", "squeue")
PLUGIN = "snakemake_executor_plugin_slurm"
ENOUGH = compute_resources(costs()["estimate"], Extent())["mem_mb"]
TOO_LITTLE = 100  # MB; Snakemake alone takes 180: it is killed within 3 s
MEMORY = f"{TOO_LITTLE} if attempt == 1 or wildcards.recording == 'doomed' else {ENOUGH}"
FLAGS = [
    "report",  # all tables are made for it
    "--workflow-profile", "profiles/slurm",
    "--set-resources", *(f"{rule}:mem_mb={MEMORY}" for rule in STEPS_OF_A_RECORDING),
    "--slurm-status-command", "squeue",  # there is no accounting
]  # fmt: skip


def flags(seconds: int) -> list[str]:
    """Flags of a run that asks for the state of jobs after so many s, and then ever more rarely."""
    return [*FLAGS, "--slurm-init-seconds-before-status-checks", str(seconds)]


@pytest.fixture(scope="module")
def slurm() -> Iterator[dict[str, str]]:
    """The environment that talks to a Slurm which was started for this module."""
    path = os.environ["PATH"] + ":/usr/sbin:/sbin"
    missing = [name for name in PROGRAMS if not shutil.which(name, path=path)]
    missing += [PLUGIN] if importlib.util.find_spec(PLUGIN) is None else []
    if missing:
        said = f"not installed: {', '.join(missing)}"
        if os.environ.get("CI") == "true":
            pytest.fail(said)
        pytest.skip(said)  # only on a developer's machine: CI fails above
    # Not in pytest's folder, which is closed to others: munge refuses to put its socket there.
    folder = Path(tempfile.mkdtemp(prefix="imubench.slurm."))
    try:
        subprocess.run([SCRIPTS / "start_slurm.sh", folder], check=True, timeout=60)
        bin_first = f"{folder / 'bin'}:{os.environ['PATH']}"
        yield os.environ | {"SLURM_CONF": str(folder / "slurm.conf"), "PATH": bin_first}
    finally:
        subprocess.run([SCRIPTS / "stop_slurm.sh", folder], check=False, timeout=60)
    assert not folder.exists()


@pytest.fixture(scope="module")
def project(slurm: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("cluster")
    put_sensor(folder / "sensors/one.yaml")
    for seed, name in enumerate(("hungry (1)", "doomed")):
        put_log(folder / f"logs/one/{name}.csv", seed, samples=2_000)
    settings = ['reconstruction={"seed": 7}']
    return Project(folder, folder / "results", linked(folder / "place"), settings, slurm)


def submitted(environment: dict[str, str] | None) -> list[tuple[str, ...]]:
    """State, memory and processors of all jobs, in order."""
    listed = subprocess.run(
        ["squeue", "--noheader", "--states=all", "--sort=i", "--format=%T %m %C"],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [tuple(line.split()) for line in listed.stdout.splitlines()]


@contextmanager
def watched(folder: Path) -> Iterator[set[str]]:
    """Collect what is called meanwhile to run one step of a group alone."""
    seen: set[str] = set()
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(0.3):
            for process in psutil.process_iter(["cmdline"]):
                command = " ".join(process.info["cmdline"] or [])
                if str(folder) in command and "--mode subprocess" in command:
                    seen.add(command)

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        yield seen
    finally:
        ended.set()
        watching.join()


def test_a_job_that_is_killed_is_named_and_the_rest_is_done(project: Project) -> None:
    with watched(project.folder) as alone:
        done = project.run(*flags(4), cores=1)
    said = done.stdout + done.stderr
    assert done.returncode == 1, said
    # A job a recording; what is killed is tried again, with more for one of them.
    jobs = [("COMPLETED", f"{ENOUGH}M", "1")] + [("FAILED", f"{TOO_LITTLE}M", "1")] * 3
    assert sorted(submitted(project.environment)) == jobs, said
    assert alone == set()
    (named,) = (line for line in said.splitlines() if line.startswith("  a step of "))
    assert named.startswith("  a step of one/doomed (")
    assert "exceeded memory limit" in Path(named.partition("(")[2].rstrip(")")).read_text()
    folder = project.results / "recordings/one"
    assert (folder / "hungry (1)/scores.parquet").is_file()
    assert not (folder / "doomed/scores.parquet").exists()
    assert not (project.results / "tables").exists()


def test_the_tables_are_those_of_a_local_run(project: Project, tmp_path: Path) -> None:
    (project.folder / "logs/one/doomed.csv").unlink()
    before = len(submitted(project.environment))
    local = Project(project.folder, tmp_path / "results", linked(tmp_path), project.settings)
    with ThreadPoolExecutor(1) as beside:  # Slurm is waited for
        of_slurm = beside.submit(project.run, *flags(1), cores=1)
        of_local = local.run("report")
    for done in (of_slurm.result(), of_local):
        assert done.returncode == 0, done.stdout + done.stderr
    states = [state for state, *_ in submitted(project.environment)[before:]]
    # A recording is one job, unless it is analysed already, and the tables and the report another.
    assert states[-1] == "COMPLETED" and states.count("COMPLETED") <= 2
    assert (project.results / "report/index.html").is_file()
    made = sorted(path.name for path in (local.results / "tables").iterdir())
    assert made == sorted(path.name for path in (project.results / "tables").iterdir())
    for name in made:
        expected = (local.results / "tables" / name).read_bytes()
        assert (project.results / "tables" / name).read_bytes() == expected, name
    assert {row["recording"] for row in project.table("scores")} == {"hungry (1)"}


def test_a_killed_run_of_many_continues_and_makes_the_tables_of_a_local_run(
    slurm: dict[str, str], tmp_path: Path
) -> None:
    put_many(tmp_path)
    project = Project(tmp_path, tmp_path / "results", linked(tmp_path / "place"), SETTINGS, slurm)
    command = project.command(
        "report", "--workflow-profile", "profiles/slurm", "--group-components", "recording=10",
        "--slurm-status-command", "squeue", "--slurm-init-seconds-before-status-checks", "5",
        cores=1,
    )  # fmt: skip

    def done() -> dict[Path, int]:
        found = (project.results / "recordings").glob("*/*/scores.parquet")
        return {path: path.stat().st_mtime_ns for path in found}

    before = len(submitted(slurm))
    with (tmp_path / "said").open("w") as said:
        start = partial(
            subprocess.Popen, command, cwd=project.place, env=slurm, stdout=said,
            stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        with start() as process:
            while len(done()) < RECORDINGS // 2:
                assert process.poll() is None, (tmp_path / "said").read_text()
                time.sleep(1.0)
            os.killpg(process.pid, signal.SIGKILL)
        # Slurm still has its jobs: as the guide says, they are cancelled before another run.
        subprocess.run(["scancel", "--user", str(os.getuid())], env=slurm, check=True, timeout=60)
        while any(state in ("RUNNING", "COMPLETING") for state, *_ in submitted(slurm)):
            time.sleep(1.0)
        left = done()  # a step that was running has removed its outputs: one on each core
        assert RECORDINGS // 2 - 2 <= len(left) < RECORDINGS + 3
        first = len(submitted(slurm))
        with start() as process:
            assert process.wait(timeout=7200) == 0, (tmp_path / "said").read_text()
    after = done()
    assert len(after) == RECORDINGS + 3
    assert sum(after[path] != written for path, written in left.items()) <= 2  # one on each core
    jobs = [state for state, *_ in submitted(slurm)]
    # Ten recordings a job, and the joint steps in three; the second run has fewer jobs.
    assert first - before == -(-(RECORDINGS + 3) // 10) and len(jobs) - first < first - before + 3
    assert set(jobs[first:]) == {"COMPLETED"}
    assert read_tables(project) == read_tables(run_local(tmp_path))
