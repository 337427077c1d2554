"""What runs again after a change, and that nothing else does: Snakemake's own list of jobs."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

import imubench_pipeline
from imubench_pipeline.recordings.kept import remove_old_samples
from tests.conftest import PROJECT, few
from tests.verification.finished import (
    REQUIREMENT,
    SIMULATED,
    Finished,
    project_in,
    put_requirement,
    put_two,
)
from tests.workflow.project import STEPS, TOGETHER, Job, Project, put_log, put_sensor

pytestmark = [pytest.mark.workflow, pytest.mark.release]

ONE = ("one/a", "one/b")
TWO = ("two/f", "two/sim_a")
ALL = (*ONE, *TWO)
INPUTS = ("logs", "sensors", "requirements")


def steps_of(*recordings: str, since: str = "ingest") -> set[Job]:
    """The steps of recordings, and what joins them."""
    steps = {(step, of) for step in STEPS[STEPS.index(since) :] for of in recordings}
    noise = STEPS.index(since) <= STEPS.index("estimate")
    return steps | joined(*recordings) | (outlooks(*recordings) if noise else set())


def outlooks(*recordings: str) -> set[Job]:
    return {("outlook", of.partition("/")[0]) for of in recordings}


def joined(*recordings: str) -> set[Job]:
    sensors = {("sensor_tables", of.partition("/")[0]) for of in recordings}
    return sensors | {(rule, "") for rule in TOGETHER}


def replace(path: Path, old: str, new: str, count: int = 1) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


def exchange_lines(path: Path, first: int) -> None:
    """Exchange two lines: the same size, other content."""
    lines = path.read_text().splitlines(keepends=True)
    lines[first : first + 2] = lines[first + 1], lines[first]
    assert path.write_text("".join(lines)) == sum(map(len, lines))


@contextlib.contextmanager
def restored(path: Path) -> Iterator[None]:
    """Leave a file as it was, with its date."""
    data, date = path.read_bytes(), path.stat().st_mtime_ns
    try:
        yield
    finally:
        path.write_bytes(data)
        os.utime(path, ns=(date, date))


@pytest.fixture
def project(done: Finished, tmp_path: Path) -> Iterator[Project]:
    """The same before every test: a dry run leaves the results as they are."""
    made = done.project
    for name in INPUTS:
        shutil.copytree(made.folder / name, tmp_path / name)
    settings = list(made.settings)
    yield made
    made.settings, made.environment = settings, None
    for name in INPUTS:
        shutil.rmtree(made.folder / name)
        shutil.copytree(tmp_path / name, made.folder / name)


@pytest.fixture
def code(project: Project, tmp_path: Path) -> Path:
    """A copy of the package that the project runs with."""
    package, checkout = Path(imubench_pipeline.__file__).parent, tmp_path / "checkout"
    shutil.copytree(package, checkout / "src" / package.name)  # with what Python has compiled
    (checkout / "config").symlink_to(PROJECT / "config")
    project.environment = os.environ | {"PYTHONPATH": str(checkout / "src")}
    return checkout / "src" / package.name


def test_nothing_runs_again_when_dates_and_comments_alone_change(project: Project) -> None:
    logs = project.folder / "logs"
    now = time.time()
    dates = {"a.csv": now, "b.csv": 2e9, "../two/f/gyro_x.csv": now, "../two/f/accel_x.csv": 1e9}
    for name, date in dates.items():
        os.utime(logs / "one" / name, (date, date))
    for path in project.folder.glob("sensors/*.yaml"):
        path.write_text("# a comment\n" + path.read_text())
    assert project.job_list() == set()


def test_notes_of_comments_alone_run_the_table_of_files(project: Project) -> None:
    (project.folder / "logs/one/a.yaml").write_text("# a log of nothing in particular\n")
    assert project.job_list() == {("files", ""), ("report", "")}


def test_a_new_log_runs_its_own_steps(project: Project) -> None:
    put_log(project.folder / "logs/one/new.csv.gz", 4)
    assert project.job_list() == steps_of("one/new")


@pytest.mark.release  # every day, an older one of the same size
def test_a_replaced_log_runs_its_own_steps(project: Project) -> None:
    put_log(project.folder / "logs/one/a.csv", 5)
    assert project.job_list() == steps_of("one/a")


def test_logs_replaced_by_older_ones_of_their_size_run_their_own_steps(project: Project) -> None:
    logs = project.folder / "logs"
    exchange_lines(logs / "one/b.csv", 1)
    exchange_lines(logs / "two/f/accel_x.csv", 1000)
    for path in (logs / "one/b.csv", logs / "two/f/accel_x.csv"):
        os.utime(path, (1e9, 1e9))
    assert project.job_list() == steps_of("one/b", "two/f")


@pytest.mark.release
def test_a_removed_log_runs_what_joins_the_others(project: Project) -> None:
    (project.folder / "logs/one/a.csv").unlink()
    assert project.job_list() == joined(*ONE) | outlooks(*ONE)


@pytest.mark.release
def test_a_renamed_log_is_a_new_one(project: Project) -> None:
    logs = project.folder / "logs/one"
    (logs / "a.csv").rename(logs / "c.csv")
    assert project.job_list() == steps_of("one/c")


def test_notes_run_the_steps_of_their_log(project: Project) -> None:
    (project.folder / "logs/one/a.yaml").write_text("device: serial 7\n")
    assert project.job_list() == steps_of("one/a")


def test_an_edit_of_a_layout_runs_the_logs_of_its_sensor(project: Project) -> None:
    put_two(project.folder, rate="101 Hz")
    assert project.job_list() == steps_of("two/f")


def test_an_edit_of_a_bandwidth_runs_the_estimates_of_its_sensor(project: Project) -> None:
    put_two(project.folder, bandwidth="40 Hz")
    assert project.job_list() == steps_of(*TWO, since="estimate")


def test_removed_samples_are_read_again_only_for_a_step_that_needs_them(project: Project) -> None:
    folders = [project.results / f"recordings/{name}" for name in ALL]
    files = [path for folder in folders for path in folder.glob("log*.parquet")]
    with contextlib.ExitStack() as stack:
        for path in files:
            stack.enter_context(restored(path))
        assert remove_old_samples(folders, 0)[0] == len(ALL)
        assert project.job_list() == set()
        put_two(project.folder, bandwidth="40 Hz")  # with all samples, only since the estimate
        assert project.job_list() == steps_of(*TWO)


def test_an_edit_of_a_datasheet_runs_its_comparison(project: Project) -> None:
    density = {"value": 0.02, "unit": "deg/s/sqrt(Hz)"}
    put_sensor(project.folder / "sensors/one.yaml", datasheet={"gyro": {"noise_density": density}})
    compared = {("datasheet", of) for of in ONE} | {("catalogue", "")}
    assert project.job_list() == compared | joined(*ONE)


@pytest.mark.release
def test_an_edit_of_a_price_class_runs_what_joins_the_logs(project: Project) -> None:
    # The catalogue of the package decides which figures are unusual, so `two` keeps its tables.
    put_sensor(project.folder / "sensors/one.yaml", price_class="consumer")
    assert project.job_list() == joined(*ONE)


def test_an_edit_of_a_threshold_runs_every_log(project: Project) -> None:
    project.settings.append('quality={"step": 13}')
    assert project.job_list() == steps_of(*ALL)


@pytest.mark.release
def test_an_edit_of_the_tolerance_runs_every_comparison(project: Project) -> None:
    project.settings.append('datasheet={"tolerance": 0.2}')
    assert project.job_list() == {("datasheet", of) for of in ALL} | joined(*ALL)


def test_an_edit_of_a_requirement_runs_every_error_budget(project: Project) -> None:
    put_requirement(project.folder, limits=[REQUIREMENT["limits"][0] | {"at_most": "2 deg"}])
    assert project.job_list() == steps_of(*ALL, since="error_budget")


@pytest.mark.release
def test_edits_of_titles_run_the_report(project: Project) -> None:
    put_requirement(project.folder, title="Rover", note="of no consequence")
    project.settings.append('report={"title": "Sensors"}')
    simulated = project.folder / "simulated.yaml"
    with restored(simulated):
        entry = SIMULATED | {"shows": {"steps": "a step in the rate"}}
        simulated.write_text(yaml.safe_dump({"recordings": [entry]}))
        assert project.job_list() == {("report", "")}


@pytest.mark.release
def test_an_edit_of_a_reader_runs_every_log(project: Project, code: Path) -> None:
    replace(code / "readers/text/csv.py", '"""', '"""Again. ')
    assert project.job_list() == steps_of(*ALL)


@pytest.mark.release
def test_an_edit_of_the_overbound_runs_the_exports(project: Project, code: Path) -> None:
    replace(code / "extensions/exports/overbound.py", '"""', '"""Again. ')
    assert project.job_list() == {("exports", "")}


@pytest.mark.release
def test_an_edit_of_a_template_runs_the_report(project: Project, code: Path) -> None:
    replace(code / "report/templates/index.html.jinja", "<h2", '<h2 class="again"')
    assert project.job_list() == {("report", "")}


@pytest.mark.parametrize("damage", few(["cut"], ["lost", "unreadable"]))
def test_samples_that_are_not_as_they_were_left_are_read_again(
    project: Project, damage: str
) -> None:
    kept = project.results / "recordings/one/a"
    path = kept / ("quality.json" if damage == "unreadable" else "log.parquet")
    data = path.read_bytes()
    with restored(path):
        if damage == "lost":
            path.unlink()
        else:
            path.write_bytes(data[:-1] if damage == "cut" else data.replace(b"1", b"2", 1))
        assert project.job_list() == steps_of("one/a")
    assert project.job_list() == set()


@pytest.mark.release
def test_what_is_lost_or_damaged_is_made_again_or_named(done: Finished) -> None:
    made = done.project
    kept = made.results / "recordings/one/a"
    right = {path: path.read_bytes() for path in made.results.glob("tables/*")}
    every = {path.name for path in kept.iterdir() if path.is_file()}
    for names in ({"log.parquet"}, {"quality.json"}, every - {"log.parquet", "quality.json"}):
        for name in names:
            (kept / name).unlink()
        ran = made.run()
        assert ran.returncode == 0, ran.stdout + ran.stderr
        assert made.job_list() == set(), names
        assert right == {path: path.read_bytes() for path in right}, names
    # bits that a step meets: it fails for its recording alone, and the next run is right again
    kept = made.results / "recordings/one/b"  # a large one: small ones are looked at whole, before
    log, curve = kept / "log.parquet", kept / "curve.parquet"
    data = bytearray(log.read_bytes())
    data[5000:5008] = bytes(8)
    log.write_bytes(data)
    curve.unlink()
    (kept / "allan.parquet").unlink()
    ran = made.run()
    assert ran.returncode == 1 and f"{log.relative_to(made.folder)}: is damaged" in ran.stderr
    assert {row["recording"]: row["status"] for row in made.table("recordings")} == {
        "a": "ok", "b": "failed", "f": "ok", "sim_a": "ok",
    }  # fmt: skip
    ran = made.run()
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert right == {path: path.read_bytes() for path in right}
    # a table that was cut is made again
    curve.write_bytes(curve.read_bytes()[:-20])
    (kept / "allan.parquet").unlink()
    ran = made.run()
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert right == {path: path.read_bytes() for path in right}


@pytest.mark.release
def test_an_interrupted_run_ends_as_a_fresh_one(done: Finished, tmp_path: Path) -> None:
    made = done.project
    # The last of this file: it runs, and leaves another project.
    logs = made.folder / "logs"
    quality = "results/recordings/one/a/quality.json"
    exchange_lines(logs / "one/a.csv", 2)
    os.utime(logs / "one/a.csv", (1e9, 1e9))
    (logs / "one/b.csv").unlink()
    (logs / "two/f").rename(logs / "two/g")
    put_two(made.folder, bandwidth="40 Hz")

    assert made.run(quality).returncode == 0
    assert made.job_list() == (
        steps_of("one/a", since="allan")
        | steps_of("two/g")
        | steps_of("two/sim_a", since="estimate")
    )

    ran = made.run()
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert made.job_list() == set()
    fresh = project_in(tmp_path)
    for name in INPUTS:
        shutil.copytree(made.folder / name, fresh.folder / name)
    shutil.copy(made.folder / "simulated.yaml", fresh.folder)
    ran = fresh.run("results/tables/ranking.parquet")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    tables = sorted(fresh.results.glob("tables/*"))
    assert len(tables) > 30
    for path in (*tables, *fresh.results.glob("recordings/*/*/*")):
        if path.name == "log.json":  # has the dates of the log's file
            continue
        same = made.results / path.relative_to(fresh.results)
        assert same.read_bytes() == path.read_bytes(), same
