"""The page of sensors side by side, as it is written."""

from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.report.compare import COMPARE, KEPT
from imubench_pipeline.report.publish import publish
from imubench_pipeline.tables.files import build, write
from tests.report.browser.made import publish_some
from tests.report.pages import read_pages
from tests.report.tables import ROBOT, joined, recording_rows, rejected_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

ROWS = {
    "drawn_deviations": [
        {"channel": "gyro_x", "tau": tau, "adev": size / tau, "draw": draw}
        for tau in (1.0, 10**0.5)
        for draw, size in enumerate((2e-5, 1e-5, 3e-5), start=-1)
    ],
    "error_growth": [
        {"axis": "worst", "gyro": "gyro_x", "window": 60.0, "error": "heading", "time": time,
         "source": source, "quantity": quantity, "sigma": sigma,
         "lower": 0.9 * sigma, "upper": 1.1 * sigma, "unit": "rad"}
        for time in (1.0, 10.0)
        for source, quantity, sigma in (
            ("total", None, 5e-3), ("N", "gyro", 4e-3), ("K", "gyro", 3e-3)
        )
    ],
}  # fmt: skip


def put(results: Path, sensor: str, recording: str) -> None:
    names = {"sensor": sensor, "recording": recording}
    for table in KEPT:
        rows = [names | row for row in ROWS[table]]
        if table == "drawn_deviations":
            rows = [row | {"draw": None if row["draw"] < 0 else row["draw"]} for row in rows]
        folder = results / "recordings" / sensor / recording
        folder.mkdir(parents=True, exist_ok=True)
        write(table, rows, folder / f"{table}.parquet")


def test_what_is_kept_of_a_recording_is_in_the_page(tmp_path: Path) -> None:
    asked = {"robot": ROBOT}
    rows = recording_rows("one", "day1"), recording_rows("two", "day1"), rejected_rows("two", "no")
    standing = {"requirement": "robot", "sensor": "one", "decides": True, "verdict": "meets_if",
                "error": "heading", "time": 100.0, "unit": "rad", "limit_verdict": "meets_if",
                "margin": 0.25, "likely_margin": 0.9}  # fmt: skip
    others = standing | {"decides": False, "error": "position", "unit": "m", "margin": 3.0}
    tables = joined(*rows, requirements=asked) | {"ranking": build("ranking", [standing, others])}
    made = site(tables, tmp_path, requirements=asked)
    put(tmp_path, "one", "day1")
    page = COMPARE.context(made)["page"]
    first, second = page["recordings"]
    assert (first["sensor"], second["sensor"]) == ("one", "two")
    assert second["growth"] is None and first["growth"]["errors"].keys() == {"heading"}
    growth = first["growth"]["errors"]["heading"]
    assert growth["sources"].keys() == {"gyro N", "gyro K"} and growth["gyro"] == ["gyro_x"]
    assert first["growth"]["axes"] == {"x": "worst"}  # the only one
    drawn = {
        (one["sensor"], one["channel"]): one["drawn"] for one in page["channels"] if one["drawn"]
    }
    assert drawn.keys() == {("one", "gyro_x")}
    assert page["window"] == 10.0  # of the requirement
    (robot,) = page["requirements"]
    assert robot == {
        "title": "a robot",
        "sensors": {"one": "meets if …, margin in use 0.25, likely margin 0.9"},
    }


def test_the_page_is_written_again_when_what_is_kept_changes(tmp_path: Path) -> None:
    tables = joined(recording_rows("one", "day1"), recording_rows("two", "day1"))
    made = site(tables, tmp_path)
    publish(made, tmp_path / "report")
    put(tmp_path, "one", "day1")
    assert publish(site(tables, tmp_path), tmp_path / "report") == ["compare.html"]
    assert publish(site(tables, tmp_path), tmp_path / "report") == []


def test_of_many_recordings_the_longest_and_the_latest_are_compared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nights = [
        recording_rows(
            sensor,
            f"night{night}",
            started=f"2026-01-0{night}",
            duration=99999.0 if night == 2 else 7200.0,
        )
        for sensor in ("one", "two")
        for night in range(1, 8)
    ]
    made = site(joined(*nights), tmp_path)
    monkeypatch.setattr("imubench_pipeline.report.site._MAX_COMPARED", 8)
    chosen = [(view.sensor, view.name) for view in made.select_compared(made.views)]
    expected = ("night2", "night5", "night6", "night7")
    assert chosen == [(sensor, night) for sensor in ("one", "two") for night in expected]
    page = COMPARE.context(made)["page"]
    assert [(one["sensor"], one["recording"]) for one in page["recordings"]] == chosen
    start = made.existing[0].context(made)
    assert start["latest"] and {one["recording"] for one in start["page"]["channels"]} == {
        *expected
    }


def test_one_recording_is_not_compared(tmp_path: Path) -> None:
    made = site(joined(recording_rows("one", "day1")), tmp_path)
    publish_some(made, tmp_path / "report", ["compare.html"])
    page = read_pages(tmp_path / "report")["compare.html"]
    assert "A comparison needs two recordings." in page.text
    assert np.ndim(page.data["recordings"]) == 1
