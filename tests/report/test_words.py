import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words.estimates import estimate_text, model_text, precision_text
from imubench_pipeline.words.numbers import (
    Unit,
    counted,
    requirement_verdict,
    requirement_words,
    sentence,
    started_text,
    verdict_words,
)

UNIT = Unit("°/h", 2.0)
HOUR = 3600.0


def row(status: str = "ok", **values: Any) -> ParameterRow:
    return ParameterRow(sensor="s", recording="r", channel="gyro_x", method="likelihood",
                        recommended=True, model="N+K", component=1, parameter="K", unit="rad/s^1.5",
                        status=status, **values)  # fmt: skip


def test_a_value_that_is_known_needs_no_words() -> None:
    assert estimate_text(row(value=1.0), UNIT, HOUR) == ""


@pytest.mark.parametrize(
    ("given_", "sentence"),
    [
        (row("absent"), "The data do not ask for K."),
        (row("absent", upper=1.234), "The data do not ask for K: it is below 2.5 °/h."),
        (row("absent", lower=0.0, upper=1.0), "The data do not ask for K: it is below 2 °/h."),
        (row("not_identified"), "K cannot be told from 3 h of data."),
        (
            row("not_identified", lower=1.0, upper=50.0),
            "K cannot be told from 3 h of data (it lies between 2 and 100 °/h).",
        ),
        (row("not_identified", upper=50.0), "K cannot be told from 3 h of data."),
        (
            row("not_identified", lower=1.0, upper=50.0, duration_needed=30 * HOUR),
            "K cannot be told from 3 h of data (it lies between 2 and 100 °/h); "
            "30 h would do for 10 %.",
        ),
        (
            # The log is long enough for one like it: that it does not tell has another reason.
            row("not_identified", duration_needed=3 * HOUR),
            "K cannot be told from 3 h of data.",
        ),
        (row("not_shown", reason="the curve does not rise."), "K: the curve does not rise."),
        (row("not_shown"), "K: not shown."),
        (row("at_bound"), "K: at bound."),
        (
            row("at_bound", reason="beyond the log", duration_needed=40 * HOUR),
            "K: beyond the log; 40 h would do for 10 %.",
        ),
    ],
)
def test_why_a_parameter_has_no_plain_value(given_: ParameterRow, sentence: str) -> None:
    assert estimate_text(given_, UNIT, 3 * HOUR) == sentence


def test_a_log_of_unknown_length_is_not_spoken_of() -> None:
    given_ = row("not_identified", duration_needed=HOUR)
    assert estimate_text(given_, UNIT, None) == "K cannot be told; 60 min would do for 10 %."
    assert estimate_text(row("not_identified"), UNIT, None) == "K cannot be told."


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        (row(value=10.0, lower=9.6, upper=10.4), "± 4 %"),
        (row(value=10.0, lower=9.9, upper=10.3), "± 2 %"),
        (row(value=10.0, lower=9.876, upper=10.124), "± 1.2 %"),
        (row(value=-10.0, lower=-10.4, upper=-9.6), "± 4 %"),
        (row(value=1.0, lower=0.75, upper=1.25), "± 25 %"),
        (row(value=10.0, lower=6.0, upper=20.0), "12 to 40"),
        (row(value=10.0), ""),
        (row(value=10.0, lower=9.0), ""),
        (row(value=10.0, upper=11.0), ""),
        (row(value=0.0, lower=-1.0, upper=1.0), ""),
        (row(lower=1.0, upper=2.0), ""),
    ],
)
def test_how_well_a_value_is_known(given_: ParameterRow, words: str) -> None:
    assert precision_text(given_, UNIT) == words


@given(st.floats(1e-9, 1e3), st.floats(0.001, 0.9), st.floats(0.001, 3.0))
def test_a_percentage_never_hides_that_an_interval_is_wide(
    value: float, below: float, above: float
) -> None:
    lower, upper = value * (1 - below), value * (1 + above)
    words = precision_text(row(value=value, lower=lower, upper=upper), UNIT)
    half = (below + above) / 2
    if not math.isclose(half, 0.3, rel_tol=1e-9):
        assert words.startswith("±") == (half < 0.3)
    if words.startswith("±"):
        assert float(words[2:-2]) == pytest.approx(100 * half, rel=0.051)


def group(sensor: str, verdict: str, rank: int | str = "–", **values: Any) -> dict[str, Any]:
    reason = values.pop("reason", "")
    limits = [
        {"limit": "heading, 60 s", "sigma": "0.5 °", "interval": "0.4 to 0.6",
         "allowed": "1 °", "decides": False, "reason": "not that"},
        {"limit": "position, 2 min", "sigma": "3 m", "interval": "2 to 4",
         "allowed": "5 m", "decides": True, "reason": reason},
    ]  # fmt: skip
    made = {"sensor": sensor, "verdict": verdict, "rank": rank, "limits": limits}
    return (
        made
        | {"tied_with": None, "simulated": False, "conditions": None, "weak": "", "unless": None}
        | values
    )


NAMES = {name: name.upper() for name in "abcdefgh"}
BASIS = {name: f"Data of {name}." for name in NAMES}
FIGURES = "The limit that decides is position, 2 min: 3 m expected (2 to 4), 5 m allowed (1σ)."


def verdict(*groups: dict[str, Any]) -> str:
    return " ".join(requirement_verdict(groups, NAMES, BASIS))


def test_the_best_sensor_is_named_with_the_figure_that_decides_and_its_data() -> None:
    said = verdict(group("a", "passes", 1))
    assert said == f"A, the only one, passes. {FIGURES} Data of a."


@pytest.mark.parametrize("how", ["probably passes", "probably fails", "surely fails"])
def test_a_best_sensor_that_may_fail_is_not_said_to_pass(how: str) -> None:
    said = verdict(group("a", how, 1), group("b", "surely fails", 2))
    begin = f"No sensor surely passes. The best of 2, A, {how}. {FIGURES} Data of a."
    if how != "probably passes":
        begin = f"No sensor passes. Of 2 the nearest is A, which {how}. {FIGURES} Data of a."
    assert said == f"{begin} Surely fail: B."


def test_weak_evidence_and_what_a_unit_would_turn_stand_with_the_verdict() -> None:
    turned = "as logged it surely fails (margin 0.1); if the gyro is in °/s, it passes (margin 7)"
    said = verdict(
        group("a", "passes", 1, weak="one log of 11 min; spectrum not explained"),
        group("b", "not enough data", unless=turned),
        group("c", "surely fails", 2),
    )
    assert said.startswith(
        "A is the best of 2 that could be judged and passes, on weak evidence (one log of 11 min; "
        f"spectrum not explained). {FIGURES}"
    )
    assert said.endswith(f"Surely fail: C. Cannot be judged: B. B: {turned}.")


def weak(reasons: str | None, **values: Any) -> str:
    about = {"evidence_reasons": reasons, "recordings": 1, "specimens": 1, "longest_log": 660.0}
    stands = RankingRow(requirement="robot", sensor="s", verdict="passes", decides=True,
                        error="heading", time=60.0, unit="rad", limit_verdict="passes",
                        evidence="weak" if reasons else "strong", **about | values)  # fmt: skip
    return verdict_words(stands)


def test_what_makes_evidence_weak_is_said_in_words() -> None:
    assert weak(None) == "passes"
    assert weak("one_specimen, short_log, few_axes") == (
        "passes, on weak evidence (one specimen; one log of 11 min; fewer than three axes)"
    )
    assert weak("one_specimen, periodic_drift, not_explained", spread_of="other sensors") == (
        "passes, on weak evidence (one specimen, with the spread of other sensors; periodic drift; "
        "spectrum not explained)"
    )
    assert weak("short_log, wide_interval", specimens=2, recordings=2, spread_of="specimens") == (
        "passes, on weak evidence (no log beyond 11 min; wide interval from 2 specimens)"
    )


def test_a_simulated_best_sensor_is_called_so() -> None:
    assert verdict(group("a", "passes", 1, simulated=True)).startswith(
        "A (simulated), the only one, passes"
    )
    said = verdict(group("a", "probably fails", 1, simulated=True))
    assert said.startswith("No sensor surely passes. A (simulated), the only one, probably fails.")


def test_what_the_decisive_figure_leaves_out_is_said() -> None:
    said = verdict(group("a", "passes", 1, reason="K of gyro_x is not identified"))
    assert said.endswith("allowed (1σ). Not counted: K of gyro_x is not identified. Data of a.")


def test_ties_are_named() -> None:
    said = verdict(
        group("a", "passes", 1, tied_with="b, c"),
        group("b", "passes", 1, tied_with="a, c"),
        group("c", "probably passes", 1, tied_with="a, b"),
    )
    assert said == (
        f"A is the best of 3 and passes. {FIGURES} Data of a. "
        "It cannot be told apart from B, C. Pass too: B. Probably pass: C."
    )


def test_the_others_are_told_by_their_verdicts_in_the_order_of_merit() -> None:
    said = verdict(
        group("a", "passes", 1),
        group("b", "surely fails", 2),
        group("c", "probably fails", 3),
        group("d", "not enough data", reason="no accelerometer"),
        group("e", "probably passes", 4),
        group("f", "outside the price class"),
        group("g", "price class not stated"),
        group("h", "passes", 5),
    )
    assert said.partition("Data of a. ")[2] == (
        "Pass too: H. Probably pass: E. Probably fail: C. Surely fail: B. "
        "Cannot be judged (no accelerometer): D. "
        "Outside the price class: F. Price class not stated: G."
    )


def test_sensors_that_cannot_be_judged_stand_by_their_reasons() -> None:
    said = verdict(
        group("a", "not enough data", reason="no gyro"),
        group("b", "not enough data"),
        group("c", "not enough data", reason="no gyro"),
    )
    assert said == (
        "No sensor can be ranked for it. Cannot be judged: B. Cannot be judged (no gyro): A, C."
    )


def test_many_sensors_of_one_verdict_are_counted() -> None:
    best = group("a", "passes", 1)
    said = verdict(best, *(group(name, "surely fails", 2) for name in "bcdef"))
    assert said.endswith(" Surely fail: 5 sensors.")
    said = verdict(best, *(group(name, "surely fails", 2) for name in "bcde"))
    assert said.endswith(" Surely fail: B, C, D, E.")


def test_where_no_sensor_can_be_ranked_none_is_the_best() -> None:
    assert verdict(group("a", "outside the price class")) == (
        "No sensor can be ranked for it. Outside the price class: A."
    )
    assert verdict() == "No recording answers it."


def test_a_ranked_sensor_stands_before_one_that_cannot_be_judged() -> None:
    said = verdict(group("b", "not enough data"), group("a", "passes", 1))
    assert said.startswith("A, the only one of 2 that could be judged, passes. ")
    said = verdict(group("b", "not enough data"), *(group(one, "passes", 1) for one in "ac"))
    assert said.startswith("A is the best of 2 that could be judged and passes. ")


def asked(**changes: Any) -> str:
    given_ = {
        "title": "t",
        "static_window": "10 s",
        "limits": [{"error": "heading", "after": "60 s", "at_most": "1 deg"}],
    }
    return requirement_words(Requirement.model_validate(given_ | changes))


def test_a_requirement_says_what_it_asks_for() -> None:
    assert asked() == (
        "Asked: heading within 1 deg after 60 s, in 95 % of runs, by the worst axis; "
        "biases and tilt from 10 s at rest right before."
    )
    said = asked(example=True, note="Only indoors.", axis="median", confidence=0.997)
    assert said.startswith("An example, made up. Asked: ") and said.endswith(". Only indoors.")
    assert "in 99.7 % of runs, by the median axis" in said
    turn_on = {"gyro": "0.2 deg/s", "accel": "20 mg"}
    said = asked(static_window=None, turn_on=turn_on)
    assert said.endswith("; turn-on biases of 0.2 deg/s and 20 mg that nothing has taken off.")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("N+GM+K", "N+GM+K"),
        ("N", "N"),
        ("N+F+S", "N+F + 1 line"),
        ("N+F+S+S+S", "N+F + 3 lines"),
    ],
)
def test_lines_of_a_model_are_counted(name: str, text: str) -> None:
    assert model_text(name) == text


def test_notes_become_sentences() -> None:
    assert sentence("the band ends at 3 Hz") == "The band ends at 3 Hz."
    assert sentence("AIC says N+F.") == "AIC says N+F."
    assert sentence("") == ""


@pytest.mark.parametrize(
    ("started", "text"),
    [
        (None, ""),
        ("", ""),
        ("2024-01-02", "2024-01-02"),
        ("2024-01-02T03:04:05.000", "2024-01-02 03:04:05"),
        ("2024-01-02T03:04:05.678", "2024-01-02 03:04:05.678"),
        ("Tue Feb 3", "Tue Feb 3"),
    ],
)
def test_date_and_time_are_easily_read(started: str | None, text: str) -> None:
    assert started_text(started) == text


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 recordings"), (1, "1 recording"), (2, "2 recordings")]
)
def test_nouns_are_counted(number: int, words: str) -> None:
    assert counted(number, "recording") == words


def test_irregular_nouns_are_counted() -> None:
    assert (counted(1, "axis", "axes"), counted(3, "axis", "axes")) == ("1 axis", "3 axes")


def test_several_conditions_are_counted_in_the_answer_and_listed_beside_it() -> None:
    conditions = "its gyro scale factor error is below 1200 ppm (1 sigma); it has what it must"
    best = group("a", "probably passes if", 1, conditions=conditions)
    answer, _, listed = requirement_verdict([best], NAMES, BASIS)
    assert answer == "No sensor surely passes. A, the only one, probably passes on 2 conditions."
    assert listed == f"Conditions: {conditions}."
    best = group("a", "passes if", 1, conditions="its file says more")
    answer, *rest = requirement_verdict([best, group("b", "surely fails", 2)], NAMES, BASIS)
    assert answer.endswith("The best of 2, A, passes if its file says more.")
    assert not any(line.startswith("Conditions") for line in rest)
