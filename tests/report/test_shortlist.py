"""The page of the whole catalogue, and the bias repeatability on the page of a sensor."""

from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.model.verdicts import Condition, Share, Shortfall
from imubench_pipeline.report.publish import publish
from imubench_pipeline.tables.files import build
from tests.report.pages import Read, sound_pages
from tests.report.tables import HOUR, ROBOT, joined, recording_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

HOSTILE = "<b>grades</b> & more"
ROW = {"requirement": "robot", "sensor": "one", "price_class": "consumer", "rank": 1,
       "margin": 0.25, "noise_margin": 2.0, "likely_margin": 1.234, "best_margin": 1.5,
       "decides": "heading within 5 deg", "verdict": "meets_if", "basis": "simulated logs",
       "conditions": (Condition("scale_factor", None, "gyro", 1.2e-3, 3, 20),),
       "parts": (Share("scale_factor", "gyro", share=0.9, origin="class limit"),
                 Share("N", "gyro", share=0.1, origin="measured")),
       "assumed": (HOSTILE,)}  # fmt: skip
PRINTED = {"requirement": "robot", "basis": "printed"}
OTHERS: list[dict[str, Any]] = [
    PRINTED | {"sensor": "weak", "rank": 2, "margin": 0.5, "verdict": "cannot_meet"},
    PRINTED | {"sensor": "heavy", "margin": 7.0, "verdict": "excluded",
               "shortfalls": (Shortfall("mass", "", "15 g", (0.02,)),)},
    PRINTED | {"sensor": "silent", "rank": 3, "margin": 0.4, "verdict": "not_enough_data",
               "reasons": ["a log decides"]},
]  # fmt: skip
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


def test_all_sensors_have_their_margins_and_sources(read: dict[str, Read]) -> None:
    page = read["shortlist.html"]
    (line,) = page.naming("meets if", "tr")
    for text in (
        *("meets if …", "0.25", "1.23", "simulated logs", HOSTILE),
        "its gyro scale factor error is below 1200 ppm (1σ; met by 3 of 20 datasheets ",
        "90 % unknown figures (assumed worst), 10 % noise",
        "gyro scale factor (assumed worst value) 90 %",
    ):
        assert text in line.text
    (line,) = page.naming("weak", "tr")
    assert "cannot meet" in line.text and "0.5" in line.text
    (line,) = page.naming("heavy", "tr")
    assert "excluded" in line.text and "mass 20 g, required 15 g" in line.text
    (line,) = page.naming("silent", "tr")
    assert "not enough data" in line.text and "a log decides" in line.text


def test_sensor_page_shows_turn_on_spread(read: dict[str, Read]) -> None:
    page = read["sensors/one.html"]
    assert "Repeatability of the turn-on bias" in page.text
    assert any("not sure" in one.text and "the power" in one.text
               for one in page.naming("unit 7", "tr"))  # fmt: skip
