"""A real run in which one log is in another unit: it is analysed, said, and decides nothing."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.workflow.project import Project, put_log, put_sensor

pytestmark = [pytest.mark.workflow, pytest.mark.xdist_group("workflow")]

REASON = "b does not decide: suspicious unit (gyro_x)"


def put_log_in_radians(path: Path, seed: int) -> None:
    """Write a log whose gyro is in rad/s, where the sensor file says deg/s."""
    put_log(path, seed)
    wx, ax = np.loadtxt(path, delimiter=",", skiprows=1).T
    rows = "".join(f"{w:.9g},{a:.9g}\n" for w, a in zip(np.radians(wx), ax, strict=True))
    path.write_text("wx,ax\n" + rows)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("decides")
    put_sensor(folder / "sensors/one.yaml")
    put_log(folder / "logs/one/a.csv", 1)
    put_log_in_radians(folder / "logs/one/b.csv", 2)
    put_log(folder / "logs/one/c.csv", 3)
    made = Project(folder, folder / "results")
    done = made.run()
    assert done.returncode == 0, done.stdout + done.stderr
    return made


def test_it_is_analysed_and_does_not_decide(project: Project) -> None:
    about = {row["recording"]: row for row in project.table("recordings")}
    assert {name: row["decides"] for name, row in about.items()} == {
        "a": True,
        "b": False,
        "c": True,
    }
    assert about["b"]["fitness"] == "unfit"
    (doubt,) = (row for row in project.table("doubts") if row["code"] == "suspicious_unit")
    assert doubt["factor"] == pytest.approx(57.3, rel=1e-3)
    (found,) = (
        row["value"]
        for row in project.table("parameters")
        if row["recommended"] and row["recording"] == "b" and row["channel"] == "gyro_x"
        and row["parameter"] == "N"
    )  # fmt: skip
    assert found == pytest.approx(1e-4 / 57.3, rel=0.05)


def test_pools_and_rankings_stand_on_the_others(project: Project) -> None:
    (pooled,) = (
        row
        for row in project.table("pooled")
        if row["channel"] == "gyro_x" and row["parameter"] == "N"
    )
    assert (pooled["recordings"], pooled["left_out"]) == (2, 1)
    assert pooled["value"] == pytest.approx(1e-4, rel=0.05)
    ranked = project.table("ranking")
    assert ranked
    for row in ranked:
        assert row["recording"] in ("a", "c")
        assert row["left_out"].startswith(REASON)


def test_exports_and_pages_say_so(project: Project) -> None:
    exported = (project.results / "exports/one/kalibr/imu.yaml").read_text()
    said = " ".join(exported.replace("#", "").split())
    assert f"CAUTION: left out: {REASON}" in said
    assert yaml.safe_load(exported)["gyroscope_noise_density"] == pytest.approx(1e-4, rel=0.05)
    report = project.results / "report"
    assert REASON in (report / "index.html").read_text()
    assert "does not decide (suspicious unit" in (report / "recordings.html").read_text()
    assert "Does not decide" in (report / "recordings/one/b.html").read_text()
    assert "Does not decide" not in (report / "recordings/one/a.html").read_text()


def test_to_include_it_makes_the_tables_and_the_report_anew(project: Project) -> None:
    project.settings = ["decide={include: [one/b]}"]
    jobs = project.jobs()
    project.settings = []
    assert set(jobs) == {
        "sensor_tables", "tables", "ranking", "shortlist", "repeatability", "fusion", "exports",
        "figures", "report",
    }  # fmt: skip


@pytest.mark.release
def test_who_includes_it_has_it_decide(project: Project) -> None:
    project.settings = ["decide={include: [one/b]}"]
    done = project.run()
    assert done.returncode == 0, done.stdout + done.stderr
    about = {row["recording"]: row for row in project.table("recordings")}
    assert (about["b"]["fitness"], about["b"]["decides"]) == ("unfit", True)
    (pooled,) = (
        row
        for row in project.table("pooled")
        if row["channel"] == "gyro_x" and row["parameter"] == "N"
    )
    assert pooled["recordings"] == 3
