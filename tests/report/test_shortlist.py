"""The page of what datasheets alone say, and the bias repeatability on the page of a sensor."""

from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.model.verdicts import Shortfall
from imubench_pipeline.report.publish import publish
from imubench_pipeline.tables.files import build
from tests.report.pages import Read, sound_pages
from tests.report.tables import HOUR, ROBOT, joined, recording_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

HOSTILE = "<b>grades</b> & more"
ROW = {"requirement": "robot", "sensor": "one", "price_class": "consumer", "best_margin": 2.0,
       "worst_margin": 0.25, "decides": "heading within 5 deg", "verdict": "worth_logging",
       "measured_margin_of": "simulated logs", "measured_margin": 1.234,
       "measured_verdict": "likely_meets", "assumed": (HOSTILE, "T_B: not known")}  # fmt: skip
OTHERS: list[dict[str, Any]] = [
    {
        "requirement": "robot",
        "sensor": "unlogged",
        "best_margin": 0.5,
        "verdict": "cannot_meet",
        "shortfalls": (Shortfall("mass", "", "15 g", (0.02,)),),
    },
    {"requirement": "robot", "sensor": "silent", "verdict": "not_judged", "reasons": ["no gyro"]},
]
REPEATED = {"sensor": "one", "device": "unit 7", "channel": "gyro_x", "recordings": 3,
            "power_cycled": "unknown", "printed": 4.0, "unit": "deg/h", "kind": "typ",
            "comparable": 4 * HOUR, "measured": 2 * HOUR, "lower": HOUR, "upper": 12 * HOUR,
            "delta": -0.5, "verdict": "not sure", "reasons": ["the power"]}  # fmt: skip


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Read]:
    tables = joined(recording_rows("one", "day"), requirements={"robot": ROBOT}) | {
        "shortlist": build("shortlist", [ROW, *OTHERS]),
        "repeatability": build("repeatability", [REPEATED]),
    }
    folder: Path = tmp_path_factory.mktemp("report")
    publish(site(tables, requirements={"robot": ROBOT}), folder)
    return sound_pages(folder, {f"figures/allan_gyro_x.{kind}" for kind in ("svg", "pdf")})


def test_best_worst_and_measured_stand_side_by_side(read: dict[str, Read]) -> None:
    page = read["shortlist.html"]
    (line,) = page.naming("one", "tr")
    for text in ("worth logging", "0.25", "1.23 (simulated)", "likely meets", HOSTILE):
        assert text in line.text
    (line,) = page.naming("unlogged", "tr")
    assert "cannot meet the limits" in line.text and "0.5" in line.text
    assert "mass 20 g, required 15 g" in line.text
    (line,) = page.naming("silent", "tr")
    assert "not judged" in line.text and "no gyro" in line.text


def test_sensor_page_shows_turn_on_spread(read: dict[str, Read]) -> None:
    page = read["sensors/one.html"]
    assert "Repeatability of the turn-on bias" in page.text
    assert any("not sure" in one.text and "the power" in one.text
               for one in page.naming("unit 7", "tr"))  # fmt: skip
