"""The judge of silent errors: what it must call so, what it must not, and some clean logs."""

import math

import numpy as np
import pytest

import silent_errors
from silent_cases import CASES, CLEAN, NOTHING, Log, Truth, exactly
from tests.conftest import few

pytestmark = pytest.mark.release  # as what they test is run

ROW = {"value": 1.0, "lower": 0.9, "upper": 1.1, "status": "ok", "reason": None}
NONE = {"value": None, "lower": None, "upper": None}


def judged(truth: Truth, *, warned: bool = False, **changes: object) -> str:
    return silent_errors.judgement({**ROW, **changes}, truth, warned=warned)


@pytest.mark.parametrize("truth", [2.1, 0.49, 1.51])
def test_value_that_is_twice_off_or_two_widths_outside_is_a_silent_error(truth):
    assert judged(exactly(truth)) == "silent"
    assert judged(exactly(truth), warned=True) == "loud"
    assert judged(exactly(truth), status="doubtful") == "loud"


@pytest.mark.parametrize("truth", [1.0, 1.49, 0.55])
def test_value_within_two_widths_is_right(truth):
    assert judged(exactly(truth)) == "right"
    assert judged(exactly(truth), warned=True) == "right"
    assert judged(exactly(truth), status="doubtful") == "doubted"


def test_without_limits_and_for_a_loose_truth_the_factor_of_two_counts_alone():
    assert judged(exactly(1.9), lower=None, upper=None) == "right"
    assert judged(exactly(2.1), lower=None, upper=None) == "silent"
    assert judged(Truth(1.9, 1.9, loose=True), lower=0.99, upper=1.01) == "right"


def test_value_anywhere_in_what_counts_as_the_truth_is_right():
    assert judged(Truth(0.8, 1.6), lower=0.9999, upper=1.0001) == "right"
    assert judged(Truth(1.2, 1.6), lower=0.9999, upper=1.0001) == "silent"


def test_value_of_nothing_is_a_silent_error_and_no_value_is_none():
    assert judged(NOTHING, value=1e-12) == "silent"
    assert judged(NOTHING, **NONE, status="absent") == "none"


def test_absent_below_a_limit_that_the_truth_is_twice_above_is_a_silent_error():
    below = NONE | {"upper": 0.4, "status": "absent"}
    assert judged(exactly(1.0), **below) == "silent"
    assert judged(exactly(0.7), **below) == "refused"
    assert judged(exactly(1.0), **NONE, status="absent") == "refused"
    assert judged(exactly(1.0), **(below | {"status": "not_identified"})) == "refused"


@pytest.mark.parametrize(
    ("finding", "severity", "warned_of"),
    [
        ("not_stationary", "warning", "NBK"),
        ("step", "warning", "BK"),
        ("knocks", "warning", "N"),
        ("missing_samples", "warning", ""),
        ("quantised", "note", ""),
        ("short_recording", "note", "BK"),
        ("band_limit", "note", ""),
        ("of another time", "warning", "NBK"),
        ("of another time", "note", ""),
    ],
)
def test_finding_bears_on_what_it_speaks_of(finding, severity, warned_of):
    row = {"finding": finding, "severity": severity}
    assert [name for name in "NBK" if silent_errors.bears(row, name)] == list(warned_of)


def test_limits_of_a_share_are_those_of_clopper_and_pearson():
    assert silent_errors.limits(0, 50) == pytest.approx((0.0, 1.0 - 0.025 ** (1 / 50)))
    low, high = silent_errors.limits(3, 50)
    assert (low, high) == pytest.approx((0.012549, 0.165482), abs=1e-5)  # their table
    assert silent_errors.limits(50, 50) == pytest.approx((0.025 ** (1 / 50), 1.0))


def small(samples: np.ndarray, rate: float = 20.0, **truth: Truth) -> Log:
    return Log(samples, rate, truth | {"Q": NOTHING, "R": NOTHING})


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """White noise and a walk, and the tables that the steps of the workflow make of them."""
    rng = np.random.default_rng(20260101)
    samples = 1e-3 * math.sqrt(20.0) * rng.standard_normal(60_000)
    samples += np.cumsum(1e-4 / math.sqrt(20.0) * rng.standard_normal(60_000))
    log = small(samples, N=exactly(1e-3), B=NOTHING, T_B=NOTHING, K=exactly(1e-4))
    return log, silent_errors.tables_of(log, tmp_path_factory.mktemp("log"))


def own(log: Log, tables: dict) -> dict[str, str]:
    rows = silent_errors.judge("planted", 0, log, tables)
    return {one.parameter: one.judgement for one in rows if one.recommended}


@pytest.mark.release
def test_right_values_of_the_workflow_are_right(walk):
    found = own(*walk)
    assert found == {"N": "right", "K": "right"} | dict.fromkeys(("B", "T_B", "Q", "R"), "none")


def test_planted_error_is_seen_and_is_loud_where_the_tables_warn_of_it(walk):
    log, tables = walk
    wrong = {**tables, "parameters": [dict(row) for row in tables["parameters"]]}
    for row in wrong["parameters"]:
        if row["parameter"] == "N":
            row["value"] *= 1.1
            row["lower"], row["upper"] = 0.999 * row["value"], 1.001 * row["value"]
    assert own(log, wrong)["N"] == "silent"
    finding = {"finding": "not_stationary", "severity": "warning"}
    assert own(log, wrong | {"findings": [finding]})["N"] == "loud"
    doubted = [row | {"verdict": "not explained"} for row in tables["models"]]
    assert own(log, wrong | {"models": doubted})["N"] == "loud"


def test_ramp_that_falls_is_judged_as_one_that_rises(walk):
    log, tables = walk
    row = ROW | {"method": "likelihood", "recommended": True, "model": "N+R", "component": 1}
    row |= {"parameter": "R", "value": -1.0, "lower": -1.1, "upper": -0.9}
    for truth, expected in ((1.0, "right"), (1.49, "right"), (1.51, "silent"), (0.4, "silent")):
        ramp = Log(log.samples, log.rate, {"R": exactly(truth)})
        found = silent_errors.judge("", 0, ramp, {**tables, "parameters": [row]})
        assert [one.judgement for one in found] == [expected]


def test_second_process_of_one_is_a_value_of_nothing(walk):
    log, tables = walk
    B, T_B = exactly(1e-3), exactly(10.0)
    rows = [
        ROW | {"method": "likelihood", "recommended": True, "model": "N+GM+GM", "value": value,
               "lower": 0.9 * value, "upper": 1.1 * value, "component": number, "parameter": "B"}
        for number, value in ((1, 2e-3), (2, 1.05e-3))
    ]  # fmt: skip
    made = {**tables, "parameters": rows}
    one = small(log.samples, B=B, T_B=T_B)
    assert [j.judgement for j in silent_errors.judge("", 0, one, made)] == ["silent", "right"]
    two = small(log.samples, B=Truth(1e-3, 2.1e-3), T_B=Truth(10.0, 100.0))
    assert [j.judgement for j in silent_errors.judge("", 0, two, made)] == ["right", "right"]


def test_what_is_known_behind_a_low_pass_is_said():
    values = {"value": 1.02, "lower": 1.01, "upper": 1.03, "judgement": "right"}
    about = {"case": "digital_1", "recommended": True, "component": 1}
    truth = {"truth_low": 1.0, "truth_high": 1.0}
    rows = [
        silent_errors.Judged(
            log=0, method="likelihood", parameter="N", **(about | truth | values)
        ),
        silent_errors.Judged(
            log=1, method="likelihood", parameter="N", **(about | truth | values | {"lower": 0.99})
        ),
        silent_errors.Judged(log=1, method="low_pass", parameter="cutoff", judgement="refused",
                             **(about | truth)),
    ]  # fmt: skip
    given, N, cutoff = silent_errors.filter_summary(rows)
    assert "N of likelihood: given in 2 of 2" in given
    assert "within 3 % 2 of 2" in N
    assert "covered 1 of 2" in N
    assert cutoff.startswith("behind a low-pass, cut-off told: 0 of 1")


def test_log_that_the_steps_cannot_use_is_a_failure(monkeypatch):
    short = small(np.arange(20.0), N=exactly(1.0), K=NOTHING)
    monkeypatch.setitem(CASES, "short", lambda rng: short)
    *_, found, _, error = silent_errors.of_log(("short", 0))
    assert error == "rejected"
    assert {one.judgement for one in found} == {"failed"}


LONG = (
    *("analogue_steep", "filtered_and_rounded", "filtered_walk", "mti_7_gyro"),
    *("analogue_2", "resonant_low_pass", "comb", "c102_accelerometer", "decimated_with_filter"),
)


@pytest.mark.parametrize("name", few([name for name in CASES if name not in LONG], LONG))
def test_case_has_a_log_of_its_own_with_a_truth(name):
    log = CASES[name](silent_errors.rng_of(name, 0))
    assert 1_000 <= len(log.samples) <= 4_000_000
    assert np.isfinite(log.samples).all()
    assert log.samples.std() > 0.0
    assert all(0.0 <= truth.low <= truth.high < np.inf for truth in log.truth.values())
    assert log.truth["N"].low > 0.0
    if log.stamps is not None:
        assert (np.diff(log.stamps) > 0.0).all()
        assert len(log.stamps) == len(log.samples)


# Every day the workflow has right values of a walk, above.
@pytest.mark.release
@pytest.mark.parametrize("name", ["papers_four", "lost_samples", "white", "white_walk"])
def test_clean_log_has_no_silent_error(name):
    *_, found, _, error = silent_errors.of_log((name, 0))
    assert not error
    assert not [one for one in found if one.recommended and one.judgement == "silent"]
    assert (
        next(one for one in found if one.parameter == "N" and one.recommended).judgement == "right"
    )


def test_tables_say_how_many_errors_there_are_and_where(walk):
    log, tables = walk
    rows = list(silent_errors.judge("white", 7, log, tables))
    planted = [
        silent_errors.Judged("steps", 3, "likelihood", True, 1, "K", "silent", 0.0, 0.0, 1e-5)
    ]
    text = "\n".join(silent_errors.summary([*rows, *planted]))
    assert "logs with a silent error, recommended method: 1 of 2, 50.00 %" in text
    assert "clean cases, N right and ok: 1 of 1" in text
    assert list(silent_errors.silent_list([*rows, *planted])) == [
        "--case steps --log 3: K 1e-05 (- to -), truth 0, model "
    ]
    assert set(CLEAN) <= set(CASES)
