"""What a run finds in kept recordings of a gyro that was turned."""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.extensions.calibration.noise_source import take_static_noise
from imubench_pipeline.extensions.earth_rate.tables import TURNED
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.recordings.kept import Quality, identify_files
from imubench_pipeline.recordings.recording import list_log_files
from imubench_pipeline.tables.files import build
from tests.earth_rate.recordings import (
    EVERY_30,
    PRINTED,
    SENSOR,
    put,
    put_at_rest,
    run,
    turned_log,
)
from tests.earth_rate.runs import EARTH, PAPER, RATE, turned
from tests.rows import typed

(OWN,) = typed(RecordingRow, [{"device": "7", "simulated": False}])

# What a run predicts takes longer than what it finds: of one run alone all of it is asked for.
briefly = partial(run, asked={"goals": (1.0,), "run_time": "2 min", "draws": 20})

Found = dict[str, list[dict[str, Any]]]


def by_method(rows: list[dict[str, Any]], part: str = "whole") -> dict[str, dict[str, Any]]:
    return {row["method"]: row for row in rows if row["part"] == part}


@pytest.fixture(scope="module")
def rest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return put_at_rest(tmp_path_factory.mktemp("s") / "night")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, rest: Path) -> Found:
    folder = put(tmp_path_factory.mktemp("t") / "a", turned_log())
    return run(folder, [rest], last=["5 min"])


def test_the_rate_is_found_within_what_is_said_of_it(found: Found) -> None:
    for table in TURNED:
        build(table, found[table])  # the columns and their types are those of the table
    rows = by_method(found["earth_rate"])
    for method in ("pairs", "triples", "filter", "smoother"):
        row = rows[method]
        assert row["status"] == "ok" and abs(row["off_sigma"]) < 3.0
        assert row["lower"] < row["value"] < row["upper"]
        assert row["sigma"] >= row["white"] > 0.0
        assert row["sigma"] == pytest.approx(PAPER.N / math.sqrt(570.0), rel=0.1)
    assert rows["filter"]["sigma"] <= rows["pairs"]["sigma"] * 1.001
    assert rows["filter"]["dwells"] == 20 and rows["filter"]["turns"] == 19
    assert rows["filter"]["model_from"] == "static recording night; method likelihood"
    given = rows["known_rate"]
    assert (given["status"], given["sigma"]) == ("given", None)
    assert "it is no estimate" in "; ".join(given["reasons"])
    last = by_method(found["earth_rate"], "last 5 min")["pairs"]
    assert last["dwells"] == 10
    assert last["sigma"] == pytest.approx(rows["pairs"]["sigma"] * math.sqrt(2), rel=0.05)
    turns = [row for row in found["turning"] if row["what"] == "turn"]
    np.testing.assert_allclose([row["time"] for row in turns], np.add(EVERY_30, 0.75), atol=0.5)
    senses = [row["sense"] for row in found["turning"] if row["what"] == "dwell"]
    assert senses == [1, -1] * 10


def test_the_courses_end_with_the_estimates(found: Found) -> None:
    rows = by_method(found["earth_rate"])
    series = [one for one in found["earth_rate_series"] if one["part"] == "whole"]
    for method, row in rows.items():
        own = [one for one in series
               if (one["method"], one["quantity"]) == (method, "rate")]  # fmt: skip
        assert own[-1]["value"] == row["value"] and own[-1]["sigma"] == row.get("sigma")
        assert [one["time"] for one in own] == sorted(one["time"] for one in own)
    # Before the second position is seen the filter says nothing.
    of_filter = [one for one in series
                 if (one["method"], one["quantity"]) == ("filter", "rate")]  # fmt: skip
    assert of_filter[0]["time"] > 30.0
    drift = [one for one in series if one["quantity"] == "drift"]
    assert drift and all(abs(one["value"] - 0.002) < 6 * one["sigma"] + 1e-3 for one in drift)


def test_sixty_seconds_never_know_the_rate_better_than_white_noise_allows(
    tmp_path: Path, rest: Path
) -> None:
    log = {"gyro_x": turned([29.0], 60.0)}
    found = briefly(put(tmp_path / "a", log), [rest], latitude="40 deg")
    least = PAPER.N / math.sqrt(60.0) / math.cos(math.radians(40.0))
    rows = by_method(found["earth_rate"])
    for method in ("pairs", "filter", "smoother"):
        assert rows[method]["sigma"] > least > 0.38 * EARTH
    assert rows["triples"]["status"] == "not_shown"
    assert "no three dwells" in "; ".join(rows["triples"]["reasons"])
    assert all(one["sigma"] > least for one in found["earth_rate_series"]
               if one["quantity"] == "rate" and one["sigma"] is not None)  # fmt: skip


@pytest.mark.release
def test_the_sign_of_the_latitude_changes_nothing(tmp_path: Path, rest: Path) -> None:
    folder = put(tmp_path / "a", {"gyro_x": turned_log()["gyro_x"][: round(120 * RATE)]})
    north, south = (
        by_method(briefly(folder, [rest], latitude=at)["earth_rate"])
        for at in ("40 deg", "-40 deg")
    )
    for method, row in north.items():
        assert row["value"] == south[method]["value"]
        assert row.get("sigma") == south[method].get("sigma")


@pytest.mark.release
def test_a_known_bias_and_a_drift_enter_the_filter(tmp_path: Path, rest: Path) -> None:
    folder = put(tmp_path / "a", {"gyro_x": turned_log()["gyro_x"][: round(90 * RATE)]})
    plain, known, drifting = (
        by_method(briefly(folder, [rest], **more)["earth_rate"])["filter"]["sigma"]
        for more in ({}, {"turn_on_bias": "1 deg/h"}, {"drift": "10000 deg/h/h"})
    )
    assert known < plain < drifting


@pytest.mark.release
def test_a_sense_that_is_not_known_is_said(tmp_path: Path, rest: Path) -> None:
    found = briefly(put(tmp_path / "a", turned_log(first=-1)), [rest], first=None)
    row = by_method(found["earth_rate"])["pairs"]
    assert row["status"] == "ambiguous" and row["value"] < 0.0
    assert "state 'first: north' or 'first: south'" in "; ".join(row["reasons"])
    assert any(
        "assumed" in "; ".join(one["doubts"]) for one in found["turning"] if one["what"] == "doubt"
    )


@pytest.mark.release
def test_turns_that_the_schedule_alone_says_are_a_doubt(
    tmp_path: Path, rest: Path, found: Found
) -> None:
    # Half the noise: the level alternates by some 5 standard errors, and no turn is seen.
    noise = NoiseModel(N=PAPER.N / 2.0)
    log = {"gyro_x": turned(EVERY_30, 600.0, peak=0.0, noise=noise)}
    folder = put(tmp_path / "a", log)
    doubted = by_method(briefly(folder, [rest])["earth_rate"])
    assert {doubted[name]["status"] for name in ("pairs", "filter")} == {"ambiguous"}
    assert "19 of 19 turns rest on the schedule" in "; ".join(doubted["filter"]["reasons"])
    assert "state 'trust_schedule: true'" in "; ".join(doubted["filter"]["reasons"])
    assert doubted["known_rate"]["status"] == "given"
    trusted = by_method(briefly(folder, [rest], trust_schedule=True)["earth_rate"])["filter"]
    assert trusted["status"] == "ok" and "19 of 19" in "; ".join(trusted["reasons"])
    seen = by_method(found["earth_rate"])["filter"]
    assert seen["status"] == "ok" and not seen["reasons"]


@pytest.mark.release
def test_the_column_with_the_position_decides(tmp_path: Path, rest: Path) -> None:
    log = turned_log(peak=0.0, first=-1)
    turns = np.searchsorted(EVERY_30, np.arange(len(log["gyro_x"])) / RATE)
    folder = put(tmp_path / "a", log | {"position": -((-1.0) ** turns)})
    found = briefly(folder, [rest], first=None)
    row = by_method(found["earth_rate"])["filter"]
    assert row["status"] == "ok" and abs(row["off_sigma"]) < 3.5
    turn = next(one for one in found["turning"] if one["what"] == "turn")
    assert turn["found_by"] == "column"
    assert next(one for one in found["turning"] if one["what"] == "dwell")["sense"] == -1


@pytest.mark.release
def test_times_count_from_the_first_sample_of_the_recording(tmp_path: Path, rest: Path) -> None:
    log = {"gyro_x": turned_log()["gyro_x"][: round(120 * RATE)]}
    plain = briefly(put(tmp_path / "a", log), [rest])
    later = briefly(put(tmp_path / "b", log, begins=60.0), [rest])
    for table in ("turning", "earth_rate_series"):
        for one, other in zip(plain[table], later[table], strict=True):
            times = [name for name in ("start", "stop", "time") if one.get(name) is not None]
            assert times or one["what"] == "doubt"
            for name in times:
                assert other[name] == one[name] + 60.0
    assert [row.get("value") for row in plain["earth_rate"]] == [
        row.get("value") for row in later["earth_rate"]
    ]


def test_a_log_without_turns_says_so(tmp_path: Path, rest: Path) -> None:
    found = briefly(put(tmp_path / "a", {"gyro_x": turned([], 600.0)}), [rest])
    assert {row["status"] for row in found["earth_rate"]} == {"no_turns"}
    assert "nothing shows that the log was turned every 30 s" in "; ".join(
        found["earth_rate"][0]["reasons"]
    )
    assert "check 'dwell' and 'channel'" in "; ".join(found["earth_rate"][0]["reasons"])
    assert found["earth_rate_series"] == [] and found["earth_rate_prediction"]


@pytest.mark.release
def test_a_position_that_never_changes_says_so(tmp_path: Path, rest: Path) -> None:
    log = turned_log()
    found = briefly(put(tmp_path / "a", log | {"position": np.ones(len(log["gyro_x"]))}), [rest])
    assert "the log never turns" in "; ".join(found["earth_rate"][0]["reasons"])


@pytest.mark.release
def test_a_log_that_is_too_short_says_so(tmp_path: Path, rest: Path) -> None:
    short = {"gyro_x": turned_log()["gyro_x"][: round(40 * RATE)]}
    found = briefly(put(tmp_path / "a", short), [rest])
    assert "less than two dwells of 30 s" in "; ".join(found["earth_rate"][0]["reasons"])


def test_segments_of_unknown_distance_are_refused(tmp_path: Path, rest: Path) -> None:
    log = turned_log()
    half = len(log["gyro_x"]) // 2
    folder = put(tmp_path / "a", log, segments=[[0, half], [half, 2 * half]])
    assert "2 segments" in briefly(folder, [rest])["earth_rate"][0]["reasons"][0]


def test_a_position_on_another_clock_is_refused(tmp_path: Path, rest: Path) -> None:
    folder = put(tmp_path / "a", turned_log())
    (folder / "log.parquet").rename(folder / "log.gyro.parquet")
    other = put(tmp_path / "b", {"position": np.ones(9)})
    (other / "log.parquet").rename(folder / "log.position.parquet")
    path = folder / "quality.json"
    replace(Quality.read(path), kept=identify_files(list_log_files(folder))).write(path)
    assert "a clock of its own" in briefly(folder, [rest])["earth_rate"][0]["reasons"][0]


@pytest.mark.parametrize("stated", [{"channel": "gyro_x"}, {}])
def test_a_gyro_that_cannot_be_used_is_said_beside_what_can(
    tmp_path: Path, rest: Path, stated: dict[str, str]
) -> None:
    log = {"accel_x": np.zeros(1000)}
    found = briefly(put(tmp_path / "a", log, unusable=["gyro_x"]), [rest], **stated)
    assert {row["status"] for row in found["earth_rate"]} == {"not_shown"}
    assert all("gyro_x cannot be used" in "; ".join(row["reasons"]) for row in found["earth_rate"])
    build("earth_rate", found["earth_rate"])


def test_a_rejected_recording_leaves_nothing(tmp_path: Path, rest: Path) -> None:
    (tmp_path / "a").mkdir()
    (rejected,) = typed(RecordingRow, [{"status": "rejected"}])
    Quality(rejected, [], {}, {}).write(tmp_path / "a/quality.json")
    assert set(map(len, briefly(tmp_path / "a", [rest]).values())) == {0}


def test_without_a_static_recording_the_turns_are_found_and_nothing_is_estimated(
    tmp_path: Path,
) -> None:
    found = briefly(put(tmp_path / "a", turned_log()), [])
    assert {row["status"] for row in found["earth_rate"]} == {"no_model"}
    assert "Add a static log of this sensor" in "; ".join(found["earth_rate"][0]["reasons"])
    assert sum(row["what"] == "turn" for row in found["turning"]) == 19
    assert found["earth_rate_prediction"] == []


def test_the_datasheet_answers_where_no_static_recording_does(tmp_path: Path) -> None:
    sensor = SENSOR | {"datasheet": PRINTED | {"document": "sheet 1"}}
    found = briefly(put(tmp_path / "a", turned_log()), [], sensor=sensor)
    row = by_method(found["earth_rate"])["filter"]
    assert row["status"] == "ok" and row["model"] == "N"
    assert row["model_from"].startswith("typical figures (the datasheet of s: sheet 1)")
    assert by_method(found["earth_rate"])["known_rate"]["status"] == "given"


def test_the_device_itself_answers_before_others_and_long_logs_before_short(
    tmp_path: Path,
) -> None:
    def put_one(name: str, N: float, **about: Any) -> Path:
        return put_at_rest(tmp_path / name, NoiseModel(N=N), **about)

    other = put_one("other", 1e-4, device="8", duration=9e5)
    short = put_one("short", 2e-4, duration=10.0)
    long = put_one("long", 3e-4, duration=20.0)
    made = put_one("sim_x", 4e-4, simulated=True, duration=9e9)
    bad = put_one("bad", 5e-4, status="rejected", duration=9e9)
    accel = put_at_rest(tmp_path / "accel", NoiseModel(N=6e-4), channel="accel_x", duration=9e9)
    axis = put_at_rest(tmp_path / "axis", NoiseModel(N=7e-4), channel="gyro_y", device="9")

    def chosen(*folders: Path) -> tuple[float, str]:
        found = take_static_noise(folders, OWN, "gyro_x")
        assert found is not None
        return found.model.N, found.words

    assert chosen(other, short, long, made, bad, accel)[0] == 3e-4
    assert chosen(other, made) == (
        1e-4,
        "static recording other, of another specimen, 8; method likelihood",
    )
    assert chosen(made)[1] == "static recording sim_x, simulated; method likelihood"
    assert "of its gyro y, as gyro x has no estimate there" in chosen(axis, bad)[1]
    assert take_static_noise([bad, accel], OWN, "gyro_x") is None


def test_what_it_takes(found: Found) -> None:
    rows = found["earth_rate_prediction"]
    goals = {row["goal"]: row for row in rows if row["of"] == "goal"}
    assert list(goals) == [1.0, 0.1, 0.01]
    # N / sqrt(T) / cos(latitude) alone takes (0.0122 / 0.1 / 0.00418)^2 s for 10 %.
    white = (PAPER.N / (0.1 * EARTH)) ** 2
    assert white < goals[0.1]["time"] < 1.5 * white
    assert goals[0.01]["time"] == pytest.approx(100 * goals[0.1]["time"], rel=0.15)
    for goal, row in goals.items():
        # One turn less would not do.
        assert row["heading"] == row["relative"] == pytest.approx(row["sigma"] / EARTH, rel=1e-4)
        assert goal * (1.0 - 1.0 / row["turns"]) <= row["relative"] <= goal * (1.0 + 1e-9)
    assert goals[0.1]["dwell"] == 28.5
    course = [row["sigma"] for row in rows if row["of"] == "time"]
    assert course == sorted(course, reverse=True) and len(course) > 30
    curve = [row for row in rows if row["of"] == "dwell"]
    (best,) = (row for row in curve if row["best"])
    assert best["sigma"] == min(row["sigma"] for row in curve) and best["nearly_best"]
    assert best["sigma"] < min(curve[0]["sigma"], curve[-1]["sigma"])
