"""Without its doubts a log is judged as before: they change what is said, and no figure."""

from typing import Any

import pytest

from tests.verdicts.budgets import HEADING, about, doubt, gyro, judge, marked, requirement

SAID = {
    "doubts", "evidence", "evidence_reasons", "left_out", "corrected_units",
    "corrected_verdict", "corrected_margin", "corrected_reasons", "logged_verdict", "logged_margin",
}  # fmt: skip
"""Columns of the table ``ranking`` that doubts may change."""

SENSORS = {"s": {"r": gyro(3.0), "q": gyro(2.0)}, "t": {"r": gyro(1.2)}}
ASKED = {"robot": HEADING, "other": requirement(("heading", "50 s", "0.1 deg"))}


def figures(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{name: one for name, one in row.items() if name not in SAID} for row in rows]


@pytest.mark.parametrize("code", ["truncated", "not_explained", "backtest_contradicts"])
def test_a_doubt_leaves_every_figure(code: str) -> None:
    clean, _ = judge(SENSORS, ASKED)
    marks = marked("r", code, channels=("gyro_x",))
    recordings = [about("s", "r", doubts=marks), about("s", "q"), about("t", "r", doubts=marks)]
    told = [doubt("s", "r", code), doubt("t", "r", code)]
    doubted, _ = judge(SENSORS, ASKED, recordings, told)
    assert all([one["code"] for one in row["doubts"]] == [code] for row in doubted)
    assert figures(doubted) == figures(clean)


def test_included_unfit_recording_keeps_its_figures() -> None:
    clean, _ = judge(SENSORS, ASKED)
    recordings = [about("s", "r", doubts=marked("r", "motion")), about("s", "q"), about("t", "r")]
    let_in, _ = judge(SENSORS, ASKED, recordings, [doubt("s", "r", "motion")])
    assert figures(let_in) == figures(clean)
    recordings[0] |= {"decides": False}
    left_out, _ = judge(SENSORS, ASKED, recordings, [doubt("s", "r", "motion")])
    alone, _ = judge({"s": {"q": gyro(2.0)}, "t": {"r": gyro(1.2)}}, ASKED)
    assert figures(left_out) == figures(alone)
