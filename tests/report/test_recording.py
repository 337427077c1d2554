"""What the page of a recording says of its parameters, in words."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.report.publish import publish
from tests.report.pages import read_pages
from tests.report.tables import KNOWN, MODEL, joined, recording_rows, site

pytestmark = pytest.mark.usefixtures("small_report")


def text_of(folder: Path, parameters: Mapping[str, Parameter]) -> str:
    publish(site(joined(recording_rows(parameters=parameters))), folder)
    return read_pages(folder)["recordings/imu/day1.html"].text


def test_a_doubtful_value_is_never_given_without_that_word(tmp_path: Path) -> None:
    doubtful = Parameter(
        MODEL.B, "doubtful", "the log has steps", KNOWN["B"].lower, KNOWN["B"].upper
    )
    plain = text_of(tmp_path / "plain", KNOWN)
    assert "B 10 °/h (± 25 %); T_B" in plain and "doubtful);" not in plain
    text = text_of(tmp_path / "doubtful", KNOWN | {"B": doubtful})
    assert "N 0.333 °/√h (± 10 %); B 10 °/h (± 25 %, doubtful); T_B" in text
    assert "B: the log has steps." in text
