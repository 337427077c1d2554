"""What the page of a recording says of its parameters, in words."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.report.publish import publish
from tests.report.browser.made import publish_some
from tests.report.pages import read_pages
from tests.report.tables import DEGREE, KNOWN, MODEL, ROBOT, joined, recording_rows, site

pytestmark = pytest.mark.usefixtures("small_report")


def text_of(folder: Path, parameters: Mapping[str, Parameter]) -> str:
    made = site(joined(recording_rows(parameters=parameters)))
    publish_some(made, folder, ["recordings/imu/day1.html"])
    return read_pages(folder)["recordings/imu/day1.html"].text


def test_a_doubtful_value_is_never_given_without_that_word(tmp_path: Path) -> None:
    doubtful = Parameter(
        MODEL.B, "doubtful", "the log has steps", KNOWN["B"].lower, KNOWN["B"].upper
    )
    plain = text_of(tmp_path / "plain", KNOWN)
    assert "B 10 °/h (± 25 %); T_B" in plain and "doubtful);" not in plain
    text = text_of(tmp_path / "doubtful", KNOWN | {"B": doubtful})
    assert "N 0.33 °/√h (± 10 %); B 10 °/h (± 25 %, doubtful); T_B" in text
    assert "B: the log has steps." in text


def test_a_back_test_stands_on_the_pages_of_recording_and_comparison(
    tmp_path: Path,
) -> None:
    asked = {"robot": ROBOT}
    rows = recording_rows(requirements=asked)
    place = {"sensor": "imu", "recording": "day1", "channel": "gyro_x", "requirement": "robot",
             "error": "heading", "time": 100.0, "window": 10.0, "unit": "rad"}  # fmt: skip
    done = {"windows": 712, "independent": 410.0, "measured": 0.5 * DEGREE,
            "predicted": 0.25 * DEGREE, "predicted_lower": 0.2 * DEGREE,
            "predicted_upper": 0.3 * DEGREE, "ratio": 2.0, "ratio_lower": 0.93,
            "ratio_upper": 1.08, "chance": 1e-9, "verdict": "more than predicted",
            "contradicted": True, "taken_out": ["warm_up_drift"]}  # fmt: skip
    short = {"reason": "log too short: it needs 6000 s", "time": 2000.0}
    rows["backtest"] = [place | done, place | short]
    publish(site(joined(rows, requirements=asked), requirements=asked), tmp_path)
    pages = read_pages(tmp_path)
    own = pages["recordings/imu/day1.html"]
    assert not own.faults
    for text in ("0.5 °", "0.25 °", "0.93 to 1.08", "712 (410 independent)", "more than predicted",
                 "contradicts the budget", "in the log, not in the model: warm up drift",
                 "log too short: it needs 6000 s"):  # fmt: skip
        assert text in own.text, text
    said = (
        "the observed heading of gyro x after 100 s is 2 of the predicted one "
        "(expected 0.93 to 1.08): outside"
    )
    assert said in pages["index.html"].text
