"""Each doubt about a recording is a sentence without a code."""

import pytest

from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.recordings.fitness import BESIDE_MEASURED
from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.verdicts import doubt_text, doubts_text

DECLARED = {code for code, kind in FINDINGS.items() if kind.affects or kind.unfit}
CODES = sorted({*DECLARED, BESIDE_MEASURED, "not_sold",
                "not_explained", "doubtful"})  # fmt: skip


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("channels", [(), ("gyro_z",), ("gyro_x", "gyro_y", "accel_z")])
def test_a_doubt_is_a_sentence(code: str, channels: tuple[str, ...]) -> None:
    text = doubt_text(code, channels)
    assert len(text.split()) > 2
    assert "_" not in text and "{" not in text and "()" not in text
    # A code without its own sentence would be its words, and the channels in brackets.
    assert "(" not in text and text != code.replace("_", " ")


@pytest.mark.parametrize(
    ("code", "channels", "text"),
    [
        ("suspicious_unit", ("gyro_z",), "the unit of measurement of gyro z looks wrong"),
        ("suspicious_unit", (), "the unit of measurement of the data looks wrong"),
        ("motion", ("gyro_x",), "the sensor was moved"),
        ("truncated", ("gyro_x",), "truncated samples of gyro x"),
        ("channel_twice", ("gyro_x",), "gyro x is a copy of another channel"),
        ("channel_twice", ("gyro_x", "gyro_y"), "gyro x and y are a copy of another channel"),
    ],
)
def test_a_doubt_names_its_channels(code: str, channels: tuple[str, ...], text: str) -> None:
    assert doubt_text(code, channels) == text


def test_doubts_that_recordings_share_are_said_once_unless_they_are_named() -> None:
    doubts = [DoubtMark("a", "motion"), DoubtMark("b", "motion"), DoubtMark("b", "stuck")]
    assert doubts_text(doubts) == "the sensor was moved; the data did not change"
    assert doubts_text(doubts, named=True) == (
        "a: the sensor was moved; b: the sensor was moved; b: the data did not change"
    )
    assert doubts_text(doubts, named=True, most=1) == "a: the sensor was moved; and 2 more"
    assert doubts_text([]) == ""
