"""Real runs of Snakemake with gyros that were turned, on a rate table, or at rest."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.calibration.recordings import BIAS, SCALE, STEPS, UP, on_table
from tests.earth_rate.runs import turned
from tests.workflow.project import TOGETHER, Job, Project, linked

# Every day, the demonstration has turned gyros, and tests/earth_rate what is computed of them.
pytestmark = [pytest.mark.workflow, pytest.mark.release]

JOINED: set[Job] = {(rule, "") for rule in TOGETHER}
WITHOUT_FIGURES = [rule for rule in TOGETHER if rule != "figures"]
"""Printed figures take a fifth of a run, and do not know of turns."""

RATE = 32.0
NOISE = NoiseModel(N=2e-4)
NOTES = {"latitude": "40 deg", "dwell": "30 s", "turning": "1.5 s", "first": "north"}
POINTING = {"latitude": "40 deg", "heading": "90 deg", "heading_sigma": "1 deg"}
DEGREES = 180.0 / math.pi


def put_log(project: Project, name: str, samples: np.ndarray, **notes: object) -> None:
    path = project.folder / f"logs/gyro/{name}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("w\n" + "".join(f"{value:.7g}\n" for value in samples * DEGREES))
    if notes:
        path.with_suffix(".yaml").write_text(yaml.safe_dump(notes))


def run_of(minutes: float, seed: int) -> np.ndarray:
    starts = np.arange(29.0, 60.0 * minutes - 3.0, 30.0)
    return turned(list(starts), 60.0 * minutes, noise=NOISE, seed=seed)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("earth_rate")
    linked(folder)
    settings = ["logs=logs", "sensors=sensors", "results=results", "requirements=false",
                'estimate={"methods": ["likelihood"]}']  # fmt: skip
    made = Project(folder, folder / "results", folder, settings)
    sensor = {"vendor": "V", "model": "G", "log": {"rate": f"{RATE:g} Hz", "channels": {
        "gyro_x": {"column": "w", "unit": "deg/s"}}}}  # fmt: skip
    (folder / "sensors").mkdir()
    (folder / "sensors/gyro.yaml").write_text(yaml.safe_dump(sensor))
    rest = simulate(NOISE, RATE, 40_000, np.random.default_rng(5))
    put_log(made, "rest", rest, device="serial 7")
    put_log(made, "run", run_of(12.0, 6), device="serial 7", two_position=NOTES)
    put_log(made, "minute", turned([29.0], 60.0, noise=NOISE), two_position=NOTES)
    put_log(made, "still", rest[: round(300 * RATE)], two_position=NOTES)
    put_log(made, "nowhere", run_of(3.0, 7), two_position={"dwell": "30 s"})
    table = on_table(8, model=NOISE)
    put_log(made, "table", table, device="serial 7", rate_table={"steps": STEPS, "axis": UP})
    put_log(made, "no_steps", table, rate_table={"settling": "1 s"})
    put_log(made, "pointing", rest[:30_000] + BIAS, device="serial 7", pointing=POINTING)
    done = made.run(*WITHOUT_FIGURES, "catalogue")
    assert done.returncode == 0, done.stdout + done.stderr
    return made


def estimates(project: Project, recording: str) -> dict[str, dict]:
    rows = project.table("earth_rate")
    return {row["method"]: row for row in rows if row["recording"] == recording}


def test_the_rate_is_found_with_the_noise_of_the_same_device_at_rest(project: Project) -> None:
    found = estimates(project, "run")
    for method in ("pairs", "triples", "filter", "smoother"):
        assert found[method]["status"] == "ok" and abs(found[method]["off_sigma"]) < 3.5
        assert found[method]["model_from"] == "static recording rest; method likelihood"
    turns = [row for row in project.table("turning") if row["recording"] == "run"]
    assert sum(row["what"] == "turn" for row in turns) == 23
    assert len([row for row in project.table("earth_rate_prediction")
                if row["recording"] == "run" and row["of"] == "goal"]) == 1  # fmt: skip


def test_a_minute_never_knows_the_rate_better_than_white_noise_allows(project: Project) -> None:
    (density,) = (row["value"] for row in project.table("parameters")
                  if row["recording"] == "rest" and row["parameter"] == "N")  # fmt: skip
    least = density / math.sqrt(60.0) / math.cos(math.radians(40.0))
    found = estimates(project, "minute")
    for method in ("pairs", "filter", "smoother"):
        assert found[method]["sigma"] >= least
        assert found[method]["upper"] - found[method]["lower"] >= 2 * 1.95 * least


def test_a_turned_gyro_stays_out_of_what_is_for_static_logs(project: Project) -> None:
    kinds = {row["recording"]: (row["kind"], row["status"]) for row in project.table("recordings")}
    assert kinds == {
        "rest": ("static", "ok"),
        "run": ("two_position", "ok"),
        "minute": ("two_position", "ok"),
        "still": ("two_position", "ok"),
        "nowhere": ("two_position", "rejected"),
        "table": ("rate_table", "ok"),
        "no_steps": ("rate_table", "rejected"),
        "pointing": ("static", "ok"),
    }
    for table in ("allan", "parameters", "error_budget", "fixed_bias", "pooled"):
        assert {row.get("recording") for row in project.table(table)} <= {
            "rest",
            "pointing",
            None,
        }, table


def test_what_is_wrong_stands_in_tables_and_pages(project: Project) -> None:
    assert {row["status"] for row in estimates(project, "still").values()} == {"no_turns"}
    reason = next(row["reason"] for row in project.table("recordings")
                  if row["recording"] == "nowhere")  # fmt: skip
    assert "nowhere.yaml: two_position: latitude is missing; expected the latitude" in reason
    report = project.results / "report"
    page = (report / "earth_rate.html").read_text()
    assert "latitude is missing" in page and "No turns: nothing shows" in page
    assert 'data-kind="turning"' in (report / "recordings/gyro/run.html").read_text()


def test_a_rate_table_gives_scale_factor_and_bias(project: Project) -> None:
    found = {row["parameter"]: row for row in project.table("calibration")
             if row["recording"] == "table"}  # fmt: skip
    for name, true in (("scale_factor", SCALE), ("bias", BIAS)):
        assert found[name]["status"] == "ok"
        assert found[name]["lower"] < true < found[name]["upper"]
        assert found[name]["model_from"] == "static recording rest; method likelihood"
    assert len(project.table("calibration_points")) == len(STEPS)
    page = (project.results / "report/recordings/gyro/table.html").read_text()
    assert 'data-kind="table_residuals"' in page
    (reason,) = (row["reason"] for row in project.table("recordings")
                 if row["recording"] == "no_steps")  # fmt: skip
    assert "no_steps.yaml: rate_table.steps: missing; expected the steady rates" in reason
    assert "rate_table.steps: missing" in (project.results / "report/earth_rate.html").read_text()


def test_a_direction_gives_a_static_recording_a_bias(project: Project) -> None:
    found = {row["parameter"]: row for row in project.table("calibration")
             if row["recording"] == "pointing"}  # fmt: skip
    assert found["bias"]["lower"] < BIAS < found["bias"]["upper"]
    assert found["earth_rate"]["status"] == "not_observable"
    assert any(row["recording"] == "pointing" for row in project.table("allan"))
    page = (project.results / "report/recordings/gyro/pointing.html").read_text()
    assert "Bias without the Earth’s rate" in page


def test_a_second_run_has_nothing_to_do_and_notes_run_their_own(project: Project) -> None:
    assert project.job_list() == {("figures", "")}
    path = project.folder / "logs/gyro/run.yaml"
    before = path.read_text()
    path.write_text(yaml.safe_dump({"device": "serial 7",
                                    "two_position": NOTES | {"latitude": "41 deg"}}))  # fmt: skip
    changed = project.job_list()
    path.write_text(before)
    assert changed == {("earth_rotation", "gyro/run"), *JOINED}


def test_steps_and_directions_run_their_own_again(project: Project) -> None:
    for name, key, change in (
        ("table", "rate_table", {"steps": STEPS, "axis": UP, "settling": "3 s"}),
        ("pointing", "pointing", POINTING | {"heading": "80 deg"}),
    ):
        path = project.folder / f"logs/gyro/{name}.yaml"
        before = path.read_text()
        path.write_text(yaml.safe_dump({"device": "serial 7", key: change}))
        changed = project.job_list()
        path.write_text(before)
        assert changed == {("calibration", f"gyro/{name}"), *JOINED}


def test_one_core_gives_the_same_tables(project: Project, tmp_path: Path) -> None:
    settings = [one for one in project.settings if not one.startswith("results=")]
    alone = Project(
        project.folder, tmp_path / "r", project.place, [*settings, f"results={tmp_path / 'r'}"]
    )
    done = alone.run(*WITHOUT_FIGURES, cores=1)
    assert done.returncode == 0, done.stdout + done.stderr
    for path in sorted((project.results / "tables").glob("*.csv")):
        assert path.read_bytes() == (tmp_path / "r/tables" / path.name).read_bytes(), path.name
