"""A row of the table ``ranking`` says what is doubted of all recordings that it rests on."""

import pytest

from tests.verdicts.budgets import HEADING, about, gyro, judge

FIVE = ("a", "b", "c", "d", "e")


@pytest.mark.parametrize(
    ("doubts", "said"),
    [
        ({}, ""),
        ({"c": "knocks"}, "c: knocks"),
        ({"a": "x", "b": "y"}, "a: x; b: y"),
        (dict.fromkeys(FIVE, "x"), "a: x; b: x; c: x; and 2 more"),
    ],
)
def test_doubts_are_those_of_all_recordings(doubts: dict[str, str], said: str) -> None:
    logs = {name: gyro(2.0) for name in FIVE}
    recordings = [about("s", name, doubts=doubts.get(name, "")) for name in FIVE]
    ((row,), _) = judge({"s": logs}, {"heading": HEADING}, recordings)
    assert row["recordings"] == 5
    assert row["doubts"] == said


def test_doubts_of_one_recording_need_no_name_and_those_left_out_are_not_said() -> None:
    logs = {"a": gyro(2.0), "b": gyro(9.0)}
    recordings = [
        about("s", "a", doubts="knocks"),
        about("s", "b", doubts="turning", decides=False),
    ]
    ((row,), _) = judge({"s": logs}, {"heading": HEADING}, recordings)
    assert row["doubts"] == "knocks"
    assert row["left_out"] == "b does not decide: turning"
