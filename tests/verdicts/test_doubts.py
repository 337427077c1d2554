"""A row of the table ``ranking`` has the doubts about all recordings that it is computed from."""

import pytest

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.tables.files import build
from imubench_pipeline.words.verdicts import doubts_text, used_doubts_text
from tests.verdicts.budgets import HEADING, Rows, about, gyro, judge, marked

FIVE = ("a", "b", "c", "d", "e")


def decisive(margins: dict[str, float], recordings: Rows) -> RankingRow:
    logs = {name: gyro(margin) for name, margin in margins.items()}
    rows, _ = judge({"s": logs}, {"heading": HEADING}, recordings)
    (row,) = RankingRow.rows_of(build("ranking", rows))
    return row


@pytest.mark.parametrize(
    ("doubts", "text"),
    [
        ({}, ""),
        ({"c": "motion"}, "c: the sensor was moved"),
        ({"a": "motion", "b": "stuck"}, "a: the sensor was moved; b: the data did not change"),
        (
            dict.fromkeys(FIVE, "motion"),
            "a: the sensor was moved; b: the sensor was moved; c: the sensor was moved; and 2 more",
        ),
    ],
)
def test_doubts_are_those_of_all_recordings(doubts: dict[str, str], text: str) -> None:
    own = {name: marked(name, code) for name, code in doubts.items()}
    recordings = [about("s", name, doubts=own.get(name, ())) for name in FIVE]
    row = decisive(dict.fromkeys(FIVE, 2.0), recordings)
    assert row.recordings == 5
    assert row.doubts == tuple(mark for marks in own.values() for mark in marks)
    assert used_doubts_text(row) == text


def test_doubts_of_one_recording_need_no_name_and_those_left_out_are_apart() -> None:
    recordings = [
        about("s", "a", doubts=marked("a", "knocks", channels=("gyro_x",))),
        about("s", "b", doubts=marked("b", "turning"), decides=False),
    ]
    row = decisive({"a": 2.0, "b": 9.0}, recordings)
    assert row.doubts == marked("a", "knocks", channels=("gyro_x",))
    assert used_doubts_text(row) == "knocks in gyro x"
    assert row.left_out == marked("b", "turning")
    assert doubts_text(row.left_out, named=True) == "b: the sensor was turning"
