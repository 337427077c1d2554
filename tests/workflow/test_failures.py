"""Logs that cannot be used and steps that fail, in real runs: the report is made all the same."""

from __future__ import annotations

import html
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

import imubench_pipeline
from imubench_pipeline.run.lock import Lock, locate_lock
from tests.conftest import PROJECT
from tests.workflow.project import BAD, Project, linked, put_bad_logs, put_log, put_sensor

pytestmark = pytest.mark.workflow

FAULTS = """
    import os, time
    if key.recording == "raises":
        raise ValueError("need at least\\none array")
    if key.recording == "sleeps":
        time.sleep(600)
    if key.recording == "dies":
        os.kill(os.getpid(), 9)
    channel = _Channel(key, log, curve, settings, bandwidth)
"""
IN_OUTLOOK = """
    if sensor == "two":
        raise ZeroDivisionError("no rest")
    rows: dict[str, Sequence[TableRow]] = {"alignment": [], "earth_rate_prediction": []}
"""
IN_INGEST = """
    if recording == "unread":
        raise IndexError("list index out of range")
    names = _name_recording(plan, sensor, recording)
"""


def put_fault(path: Path, before: str, fault: str) -> None:
    text = path.read_text()
    line = fault.strip().splitlines()[-1]
    assert text.count(line) == 1 and line.strip() == before
    path.write_text(text.replace(line, fault.strip("\n"), 1))


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("failures")
    linked(folder)
    for sensor in ("one", "two"):
        put_sensor(folder / f"sensors/{sensor}.yaml")
    for seed, name in enumerate(("good", "raises", "sleeps", "dies", "unread")):
        put_log(folder / f"logs/one/{name}.csv", seed, samples=5000)
    put_log(folder / "logs/two/a.csv", 9, samples=5000)
    put_bad_logs(folder / "logs/two")
    settings = ["logs=logs", "sensors=sensors", "results=results", "requirements=false",
                'estimate={"methods": ["weighted"]}', 'limits={"recording": "12 s"}']  # fmt: skip
    return Project(folder, folder / "results", folder, settings)


@pytest.fixture(scope="module")
def faulty(project: Project, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a run with a package that has faults, and is compiled."""
    place = tmp_path_factory.mktemp("code") / "src"
    package = Path(imubench_pipeline.__file__).parent
    shutil.copytree(PROJECT / "config", place.parent / "config")  # as beside a checkout's src/
    copy = place / package.name
    shutil.copytree(package, copy)  # with what numba has compiled
    put_fault(
        copy / "steps/estimate.py",
        "channel = _Channel(key, log, curve, settings, bandwidth)",
        FAULTS,
    )
    names = "names = _name_recording(plan, sensor, recording)"
    put_fault(copy / "recordings/ingest.py", names, IN_INGEST)
    rows = 'rows: dict[str, Sequence[TableRow]] = {"alignment": [], "earth_rate_prediction": []}'
    put_fault(copy / "extensions/earth_rate/outlook.py", rows, IN_OUTLOOK)
    project.environment = os.environ | {"PYTHONPATH": str(place)}
    kernels = ("whittle_kernels", "posterior_kernels")
    if not all(any(copy.glob(f"estimators/__pycache__/{name}.*.nbc")) for name in kernels):
        # They would take longer than a recording may.
        settings = project.settings.copy()
        project.settings.pop()
        done = project.run("results/recordings/one/good/scores.parquet")
        assert done.returncode == 0, done.stdout + done.stderr
        project.settings[:] = settings
    return project.environment


REASONS = {
    "raises": "the step estimate failed: ValueError: need at least one array",
    "sleeps": "the step estimate ran for longer than 12.52 s (limits.recording, ",
    "dies": "the step estimate was killed twice: SIGKILL, perhaps because memory was exhausted",
    "unread": "the step ingest failed: IndexError: list index out of range",
}
NO_REST = "the step outlook failed: ZeroDivisionError: no rest"


@pytest.fixture(scope="module")
def run(project: Project, faulty: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """The run in which steps fail, of a process that works on the results as its parent does."""
    project.environment = faulty
    with Lock(locate_lock(project.results)) as lock:
        lock.acquire()
        # Without printed figures, which take a third of it.
        return project.run("report", "tables", lock=lock)


def test_the_report_says_which_recordings_a_step_failed_for(
    project: Project, run: subprocess.CompletedProcess[str]
) -> None:
    said = run.stdout + run.stderr
    assert run.returncode == 1, said
    assert "2 recordings analysed, 3 rejected, 4 failed" in said, said
    assert "\none/good: 0.0139 h at 100 Hz, 2 channels" in said
    assert "\ntwo/empty: rejected: empty.csv: the file is empty" in said
    recordings = {(row["sensor"], row["recording"]): row for row in project.table("recordings")}
    failed = {
        name: row["reason"] for (_, name), row in recordings.items() if row["status"] == "failed"
    }
    assert failed.keys() == REASONS.keys()
    page = html.unescape((project.results / "report/index.html").read_text())
    logs = project.results / "logs/recordings/one"
    for name, reason in REASONS.items():
        assert failed[name].startswith(reason)
        assert f"one/{name} is left out: {reason}" in run.stderr
        (line,) = (line for line in page.splitlines() if f">{name}</a>: {reason}" in line)
        assert page.index(line) < page.index('id="comparison"')
        step = "ingest" if name == "unread" else "estimate"
        assert reason in (logs / name / f"{step}.log").read_text()
        own = (project.results / f"report/recordings/one/{name}.html").read_text()
        assert reason in html.unescape(own)
    assert 'raise ValueError("need at least' in (logs / "raises/estimate.log").read_text()
    assert "Traceback" in run.stderr and "<li>V two: " + NO_REST in page
    fatal = {row["recording"] for row in project.table("findings") if row["severity"] == "fatal"}
    assert fatal == REASONS.keys() | BAD.keys()
    failures = {(row["sensor"], row["recording"], row["step"]) for row in project.table("failures")}
    assert failures == {("one", name, "estimate") for name in ("raises", "sleeps", "dies")} | {
        ("one", "unread", "ingest"),
        ("two", None, "outlook"),
    }


@pytest.mark.usefixtures("run")
def test_bad_logs_are_rejected_with_their_reasons(project: Project) -> None:
    rejected = {
        row["recording"]: row["reason"]
        for row in project.table("recordings")
        if row["status"] == "rejected"
    }
    assert rejected.keys() == BAD.keys()
    page = html.unescape((project.results / "report/index.html").read_text())
    assert "3 rejected" in page
    for name, text in BAD.items():
        assert text in rejected[name]
        (line,) = (line for line in page.splitlines() if f">{name}</a>:" in line)
        assert line.startswith("<li>V two, <a ") and text in line
        assert page.index(line) < page.index('id="comparison"')
        assert f"recordings/two/{name}.html" in project.pages()


@pytest.mark.usefixtures("run")
def test_what_did_not_fail_is_complete(project: Project) -> None:
    whole = {("one", "good"), ("two", "a")}
    for name in ("allan", "parameters", "reconstruction", "scores", "error_budget", "datasheet"):
        assert {(row["sensor"], row["recording"]) for row in project.table(name)} == whole
    assert {row["sensor"] for row in project.table("alignment")} == {"one"}
    assert not list(project.results.rglob("*.part"))


@pytest.mark.release  # every day, tests/test_faults.py
@pytest.mark.usefixtures("run")
def test_what_failed_is_tried_again_and_nothing_else(project: Project) -> None:
    jobs = project.job_list()
    of = {step: {name for rule, name in jobs if rule == step} for step, _ in jobs}
    assert of["ingest"] == of["allan"] == {"one/unread"}
    assert of["estimate"] == {f"one/{name}" for name in REASONS}
    assert of["outlook"] == {"one", "two"}


@pytest.mark.release
def test_a_nightly_run_tries_again_and_says_in_its_exit_status_what_failed(
    project: Project, faulty: dict[str, str]
) -> None:
    project.environment = faulty
    done = subprocess.run(
        project.nightly_command(), cwd=project.place, env=faulty, capture_output=True,
        text=True, check=False, timeout=600,
    )  # fmt: skip
    assert done.returncode == 2
    for name, reason in REASONS.items():
        assert f"one/{name}: {reason}" in done.stderr
    assert f"two: {NO_REST}" in done.stderr
    summary = json.loads((project.results / "nightly/latest.json").read_text())
    assert summary["outcome"] == "failed" and summary["failure"] == []
    assert summary["recordings"] == 9 and len(summary["failed"]) == 5
    log = Path(summary["log"]).read_text()
    assert "Traceback" in log and "ValueError: need at least\none array" in log


@pytest.mark.release
def test_a_run_of_mended_code_makes_it_good(project: Project) -> None:
    project.environment = None
    project.settings.pop()
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    assert {row["status"] for row in project.table("recordings")} == {"ok", "rejected"}
    assert project.table("failures") == []
    assert "failed" not in {row["finding"] for row in project.table("findings")}
    assert project.job_list() == set()
    assert not list(project.results.glob("faults/**/*.log"))
