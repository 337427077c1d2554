"""Real runs of Snakemake on a small project of real files."""

import contextlib
import html
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
import yaml

from imubench_pipeline.run.cli import main
from tests.report.pages import unfolded
from tests.workflow.project import (
    BAD,
    CHANNELS,
    FEW,
    STEPS,
    TOGETHER,
    Project,
    linked,
    put_bad_logs,
    put_log,
    put_sensor,
)

pytestmark = pytest.mark.release  # every day test_failures.py, and the demonstration

STEPS_OF_A_RECORDING = dict.fromkeys(STEPS, 1)
GLOBAL_STEPS = dict.fromkeys(("sensor_tables", *TOGETHER), 1)

METHODS = ['estimate={"methods": ["likelihood", "weighted"]}']

RADIAN = np.pi / 180.0
REASON = "recording c is not used: the unit of measurement of gyro x looks wrong"


def put_log_times(path: Path, seed: int, factor: float) -> None:
    """Write a log with what its gyro reads multiplied."""
    put_log(path, seed)
    wx, ax = np.loadtxt(path, delimiter=",", skiprows=1).T
    rows = "".join(f"{w:.9g},{a:.9g}\n" for w, a in zip(factor * wx, ax, strict=True))
    path.write_text("wx,ax\n" + rows)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("project")
    put_sensor(folder / "sensors/one.yaml")
    put_sensor(folder / "sensors/two.yaml")
    put_log(folder / "logs/one/a.csv", 1)
    put_log(folder / "logs/one/b.csv.gz", 2)
    put_log_times(folder / "logs/one/c.csv", 6, RADIAN)  # the sensor file says deg/s
    put_log_times(folder / "logs/two/a.csv", 3, 1.5)  # the worse sensor
    put_bad_logs(folder / "logs/two")
    (folder / "logs/unknown").mkdir()
    put_log(folder / "logs/unknown/a.csv", 5, samples=10)
    return Project(folder, folder / "results", linked(folder / "place"), METHODS)


@pytest.fixture(scope="module")
def said(files: Project) -> str:
    done = files.run(cores=1)  # of a fresh checkout: two steps would compile the same twice
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def project(files: Project, said: str) -> Project:
    """The project after its first run."""
    return files


def test_a_run_leaves_tables_and_a_report(project: Project) -> None:
    estimates = {
        (row["sensor"], row["recording"], row["channel"]): row["value"]
        for row in project.table("parameters")
        if row["method"] == "weighted" and row["parameter"] == "N"
    }
    assert len(estimates) == 8
    factors = {("one", "c"): RADIAN, ("two", "a"): 1.5}
    for (sensor, recording, channel), value in estimates.items():
        gyro = 1e-4 * factors.get((sensor, recording), 1.0)
        assert value == pytest.approx({"gyro_x": gyro, "accel_x": 1e-3}[channel], rel=0.05)
    for name in ("scores", "reconstruction", "datasheet", "findings", "simulated_truth", "allan"):
        assert (project.results / f"tables/{name}.csv").is_file()
    page = (project.results / "report/recordings.html").read_text()
    assert "8 recordings of 3 sensors" in page and "4 analysed, 4 rejected" in page
    assert set(project.pages()) == {
        "index.html",
        "compare.html",
        "recordings.html",
        "datasheets.html",
        "shortlist.html",
        "fusion.html",
        "earth_rate.html",
        "experiments.html",
        "theory.html",
        "made.html",
        "sensors/one.html",
        "sensors/two.html",
        "sensors/unknown.html",
        "recordings/one/a.html",
        "recordings/one/b.html",
        "recordings/one/c.html",
        "recordings/two/a.html",
        "recordings/unknown/a.html",
        *(f"recordings/two/{name}.html" for name in BAD),
    }
    figures = {path.name for path in (project.results / "report/figures").iterdir()}
    assert {"allan_gyro_x.svg", "allan_accel_x.pdf"} <= figures
    assert not list(project.results.rglob("*.part"))


def test_logs_that_are_analysed_at_once_have_the_same_numbers(
    project: Project, tmp_path: Path
) -> None:
    config = tmp_path / "config.yaml"
    given = (setting.split("=") for setting in [*FEW, *METHODS])
    config.write_text(yaml.safe_dump({key: yaml.safe_load(value) for key, value in given}))
    log = str(project.folder / "logs/one/b.csv.gz")
    sensor = str(project.folder / "sensors/one.yaml")
    made = tmp_path / "made"
    status = main(
        ["analyse", log, "--sensor", sensor, "--config", str(config), "--output", str(made)]
    )
    assert status == 0
    for table in ("parameters", "allan", "models", "recordings"):
        lines = (project.results / f"tables/{table}.csv").read_text().splitlines()
        # In `recordings`, the second name is that of the device.
        of_run = [line for line in lines if line.startswith(('"sensor"', '"one","b"'))]
        assert (made / f"{table}.csv").read_text().splitlines() == of_run
    assert "V one" in (made / "report.html").read_text()
    assert (made / "figures/allan_gyro_x.svg").is_file()


def test_bad_logs_are_rejected_and_stop_nothing_else(project: Project, said: str) -> None:
    reasons = BAD | {"a": "no sensor file"}
    rejected = {
        row["recording"]: row["reason"]
        for row in project.table("recordings")
        if row["status"] == "rejected"
    }
    assert set(rejected) == set(reasons)
    for name, text in reasons.items():
        assert text in rejected[name]
    complete = {
        (row["sensor"], row["recording"])
        for row in project.table("scores")
        if row["method"] == "weighted"
    }
    assert complete == {("one", "a"), ("one", "b"), ("one", "c"), ("two", "a")}
    assert "4 recordings analysed, 4 rejected" in said
    assert "\none/a: 0.0556 h at 100 Hz, 2 channels" in said
    assert "\ntwo/empty: rejected: empty.csv: the file is empty" in said
    page = (project.results / "report/index.html").read_text()
    assert "4 rejected" in page
    for name, text in BAD.items():
        (line,) = (line for line in page.splitlines() if f">{name}</a>:" in line)
        assert line.startswith("<li>V two, <a ") and text in html.unescape(line)
        assert page.index(line) < page.index('id="comparison"')
        assert f"recordings/two/{name}.html" in project.pages()


def test_a_log_in_another_unit_is_analysed_and_does_not_decide(project: Project) -> None:
    about = {row["recording"]: row for row in project.table("recordings") if row["sensor"] == "one"}
    assert {name: row["decides"] for name, row in about.items()} == {
        "a": True,
        "b": True,
        "c": False,
    }
    assert about["c"]["fitness"] == "unfit"
    (doubt,) = (row for row in project.table("doubts") if row["code"] == "suspicious_unit")
    assert doubt["factor"] == pytest.approx(57.3, rel=1e-3)


def test_pools_and_rankings_stand_on_the_others(project: Project) -> None:
    pooled = pooled_of_one(project)
    assert (pooled["recordings"], pooled["left_out"]) == (2, 1)
    assert pooled["value"] == pytest.approx(1e-4, rel=0.05)
    ranked = [row for row in project.table("ranking") if row["sensor"] == "one"]
    assert ranked
    for row in ranked:
        assert row["recording"] in ("a", "b")
        first = {"recording": "c", "code": "suspicious_unit", "channels": ["gyro_x"]}
        assert row["left_out"][0] == first


def pooled_of_one(project: Project) -> dict:
    of = {"sensor": "one", "channel": "gyro_x", "parameter": "N"}
    (found,) = (row for row in project.table("pooled") if row.items() >= of.items())
    return found


def test_exports_and_pages_say_what_does_not_decide(project: Project) -> None:
    exported = (project.results / "exports/one/kalibr/imu.yaml").read_text()
    said = " ".join(exported.replace("#", "").split())
    assert f"CAUTION: {REASON}" in said
    assert yaml.safe_load(exported)["gyroscope_noise_density"] == pytest.approx(1e-4, rel=0.05)
    report = project.results / "report"
    assert (
        "Not used: c: the unit of measurement of gyro x looks wrong"
        in (report / "index.html").read_text()
    )
    assert (
        "not used (the unit of measurement of gyro x looks wrong"
        in (report / "recordings.html").read_text()
    )
    assert "Not used in comparisons" in (report / "recordings/one/c.html").read_text()
    assert "Not used in comparisons" not in (report / "recordings/one/a.html").read_text()


def test_to_include_it_makes_the_tables_and_the_report_anew(project: Project) -> None:
    project.settings = [*METHODS, "decide={include: [one/c]}"]
    jobs = project.jobs()
    project.settings = METHODS
    assert set(jobs) == set(GLOBAL_STEPS)


def test_what_the_samples_look_like_is_kept_with_each_recording(project: Project) -> None:
    folder = project.results / "recordings/one/a"
    for name in ("envelope", "histogram"):
        rows = pq.read_table(folder / f"{name}.parquet").to_pylist()
        assert {row["channel"] for row in rows} == set(CHANNELS)
        assert not (project.results / f"tables/{name}.parquet").exists()
    counted = sum(row["count"] for row in rows if row["channel"] == "gyro_x")
    assert counted == 20_000
    page = unfolded((project.results / "report/recordings/one/a.html").read_text())
    assert 'data-kind="timeline"' in page and 'data-kind="histogram"' in page


def test_a_second_run_has_nothing_to_do(project: Project) -> None:
    assert project.jobs() == {}


def test_one_core_and_two_give_the_same_tables(project: Project, tmp_path: Path) -> None:
    both = Project(project.folder, tmp_path / "results", linked(tmp_path), METHODS)
    rules = ("tables", "ranking", "shortlist", "repeatability", "fusion", "papers", "catalogue")
    assert both.run(*rules, cores=2).returncode == 0
    made = sorted((both.results / "tables").iterdir())
    assert len(made) > 60
    for path in made:
        assert path.read_bytes() == (project.results / "tables" / path.name).read_bytes(), path.name


def test_an_edit_of_a_datasheet_runs_its_deltas_and_the_global_steps(project: Project) -> None:
    density = {"value": 0.02, "unit": "deg/s/sqrt(Hz)"}
    put_sensor(project.folder / "sensors/one.yaml", datasheet={"gyro": {"noise_density": density}})
    steps = {"datasheet": 3, "catalogue": 1}
    assert project.jobs() == GLOBAL_STEPS | steps
    assert project.run().returncode == 0
    printed = {
        row["sensor"]: row["printed"] for row in project.table("datasheet") if row["printed"]
    }
    assert printed == {"one": 0.02, "two": 0.01}


def analysed(project: Project) -> int:
    return sum(row["status"] == "ok" for row in project.table("recordings"))


def test_one_more_log_runs_its_own_steps_and_the_global_ones(project: Project) -> None:
    put_log(project.folder / "logs/two/b.csv", 4)
    assert project.jobs() == STEPS_OF_A_RECORDING | GLOBAL_STEPS | {"outlook": 1}
    before = project.pages()
    assert project.run().returncode == 0
    assert analysed(project) == 5
    after = project.pages()
    assert set(after) - set(before) == {"recordings/two/b.html"}
    same = {path for path in before if after[path] == before[path]}
    of_others = {"sensors/one.html", "recordings/one/a.html", "recordings/one/b.html"}
    assert same >= of_others | {"recordings/two/a.html", "theory.html", "made.html"}


def test_a_removed_log_runs_the_global_steps(project: Project) -> None:
    (project.folder / "logs/two/b.csv").unlink()
    assert project.jobs() == GLOBAL_STEPS | {"outlook": 1}
    assert project.run().returncode == 0
    assert analysed(project) == 4
    assert "recordings/two/b.html" not in project.pages()


def test_a_wrong_setting_stops_the_run_before_it_begins(project: Project) -> None:
    done = replace(project, settings=[*project.settings, "qualty={}"]).run("-n")
    assert done.returncode != 0
    assert "qualty: unknown key; did you mean 'quality'?" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_steps_that_were_killed_after_an_edit_are_run_again(project: Project) -> None:
    sensor = project.folder / "sensors/one.yaml"
    written = yaml.safe_load(sensor.read_text())
    written["log"]["bandwidth"] = "20 Hz"
    sensor.write_text(yaml.safe_dump(written))
    to_do = project.job_list()
    edited = {job for job in to_do if job[0] == "estimate"}
    assert edited == {("estimate", f"one/{name}") for name in "abc"}
    with subprocess.Popen(project.command(), cwd=project.place) as process:
        killed = set()
        while process.poll() is None:
            for step in steps_of(process.pid, "estimate"):
                step.kill()
                killed.add(step.pid)
    # Each is run once more, and then leaves its recording out.
    assert process.returncode == 1 and len(killed) == 6
    failed = {row["recording"]: row["cause"] for row in project.table("failures")}
    assert failed == dict.fromkeys("abc", "killed")
    # Snakemake has noted the new settings for them, but what they left is no result.
    assert project.job_list() == to_do


def test_who_includes_it_has_it_decide(project: Project) -> None:
    project.settings = [*METHODS, "decide={include: [one/c]}"]
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    about = {row["recording"]: row for row in project.table("recordings") if row["sensor"] == "one"}
    assert (about["c"]["fitness"], about["c"]["decides"]) == ("unfit", True)
    assert pooled_of_one(project)["recordings"] == 3


def steps_of(run: int, name: str) -> list[psutil.Process]:
    with contextlib.suppress(psutil.NoSuchProcess):
        return [one for one in psutil.Process(run).children(recursive=True) if one.name() == name]
    return []
