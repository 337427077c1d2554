"""Verdicts, conditions, shortfalls, evidence and the answer to a requirement, in words."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import product
from typing import Any, get_args

import pytest

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.states import Cause, Origin, SourceCode, SpreadOf, Verdict
from imubench_pipeline.model.verdicts import (
    Condition,
    DoubtMark,
    Property,
    Share,
    Shortfall,
    UnitFactor,
)
from imubench_pipeline.navigation.verdicts.judgement import WEAKNESS_REASONS
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    VERDICT_MEANINGS,
    VERDICT_WORDS,
    answer_text,
    class_limit_text,
    condition_text,
    corrected_text,
    evidence_summary_text,
    evidence_text,
    list_others,
    origins_text,
    other_margins_text,
    share_text,
    shortfall_text,
    source_name,
    spread_text,
    stated_verdict,
    subject_text,
    summary_text,
    verdict_text,
)

SCALE = Condition("scale_factor", None, "gyro", 1.2e-3)
MASS = Condition(None, "mass", "")
SUBJECTS = {"quantity": "gyro", "axis": "gyro_x", "full_scale": "gyro", "bandwidth": "accel",
            "price_class": "tactical"}  # fmt: skip
DEGREE = 0.017453292519943295


def row(sensor: str = "a", verdict: Verdict = "meets", **values: Any) -> RankingRow:
    plain = {"requirement": "robot", "decides": True, "error": "heading", "time": 60.0,
             "unit": "rad", "limit_verdict": verdict, "evidence": "strong"}  # fmt: skip
    return RankingRow(sensor=sensor, verdict=verdict, **(plain | values))


def is_plain(text: str) -> bool:
    """Tell whether a text has no code, and no gap where a word should be."""
    return bool(text) and not any(part in text for part in ("_", "  ", "{", "()", "None"))


@pytest.mark.parametrize("verdict", get_args(Verdict))
def test_every_verdict_has_words(verdict: Verdict) -> None:
    for words in (VERDICT_WORDS, SHORT_VERDICTS, VERDICT_MEANINGS):
        assert words.keys() == set(get_args(Verdict)) and is_plain(words[verdict])
    assert verdict_text(verdict) == VERDICT_WORDS[verdict]
    shortfalls = (Shortfall("quantity", "gyro", "gyro_x"),) if verdict == "excluded" else ()
    assert is_plain(stated_verdict(row(verdict=verdict, shortfalls=shortfalls)))


@pytest.mark.parametrize("source", get_args(SourceCode))
def test_every_source_of_errors_has_a_name(source: SourceCode) -> None:
    assert is_plain(source_name(source))


@pytest.mark.parametrize(
    ("figure", "quantity"),
    [
        (figure, quantity)
        for figure, quantity in product(get_args(Cause), ("gyro", "accel"))
        # An accelerometer has no g-sensitivity, and no datasheet prints the square.
        if (figure, quantity) != ("g_sensitivity", "accel") and figure != "temperature_squared"
    ],
)
def test_every_unknown_figure_has_words_and_a_unit(figure: Cause, quantity: str) -> None:
    text = condition_text(Condition(figure, None, quantity, 1.2345e-3))
    assert text.startswith(f"its {'gyro' if quantity == 'gyro' else 'accelerometer'} ")
    assert is_plain(text) and " is below " in text and text.endswith(" (1σ)")


@pytest.mark.parametrize(
    ("condition", "text"),
    [
        (SCALE, "its gyro scale factor error is below 1200 ppm (1σ)"),
        # Rounded down, so that the limit is met.
        (replace(SCALE, largest=1.2399e-3), "its gyro scale factor error is below 1230 ppm (1σ)"),
        (replace(SCALE, largest=None), "its gyro scale factor error is below 0 ppm (1σ)"),
        (
            Condition("turn_on_bias", None, "accel", 0.0412),
            "its accelerometer turn-on bias is below 4.2 mg (1σ)",
        ),
        (
            Condition("temperature", None, "gyro", 0.1 * DEGREE),
            "its gyro temperature coefficient is below 0.1 deg/s/K (1σ)",
        ),
        (
            Condition("g_sensitivity", None, "gyro", 0.1001 * DEGREE / 9.80665, 3, 21),
            "its gyro g-sensitivity is below 0.1 deg/s/g "
            "(1σ; met by 3 of 21 datasheets that print it)",
        ),
        (
            replace(SCALE, within=1, printing=1),
            "its gyro scale factor error is below 1200 ppm "
            "(1σ; met by 1 of 1 datasheet that prints it)",
        ),
        (MASS, "its mass meets the requirement"),
        (Condition(None, "axis", "gyro_x"), "it has a gyro x axis"),
        (
            Condition(None, "full_scale", "accel"),
            "its accelerometer full scale meets the requirement",
        ),
    ],
)  # fmt: skip
def test_a_condition_says_what_must_hold(condition: Condition, text: str) -> None:
    assert condition_text(condition) == text


@pytest.mark.parametrize("of", get_args(Property))
def test_every_property_has_words(of: Property) -> None:
    subject = SUBJECTS.get(of, "")
    assert is_plain(condition_text(Condition(None, of, subject)))
    assert is_plain(subject_text(Condition(None, of, subject)))
    without = Shortfall(of, subject, "5 g")
    assert is_plain(shortfall_text(without))
    if of not in ("quantity", "axis"):
        assert shortfall_text(replace(without, has=(1.0,))).endswith(
            (", required 5 g", ", required: a class with the word 5 g")
        )


@pytest.mark.parametrize(
    ("shortfall", "text"),
    [
        (Shortfall("quantity", "accel", "accel_x"), "the sensor has no accelerometer"),
        (Shortfall("axis", "gyro_z", "gyro_xyz"), "the sensor has no gyro z axis"),
        (Shortfall("mass", "", "15 g", (0.02,)), "mass 20 g, required 15 g"),
        (
            Shortfall("temperature", "", "-55 degC to 60 degC", (-40.0, 85.0)),
            "temperature range -40 to 85 degC, required -55 degC to 60 degC",
        ),
        (
            Shortfall("full_scale", "gyro", "300 deg/s", (250 * DEGREE,)),
            "gyro full scale 250 deg/s, required 300 deg/s",
        ),
        (
            Shortfall("price_class", "consumer", "tactical or chip"),
            "price class consumer, required: a class with the word tactical or chip",
        ),
        (
            Shortfall("price_class", "", "tactical"),
            "price class not stated, required: a class with the word tactical",
        ),
    ],
)  # fmt: skip
def test_a_shortfall_says_what_is_missing(shortfall: Shortfall, text: str) -> None:
    assert shortfall_text(shortfall) == text


def test_a_verdict_has_its_conditions() -> None:
    one = "its gyro scale factor error is below 1200 ppm (1σ)"
    mass = "its mass meets the requirement"
    stated = stated_verdict(row(verdict="meets_if", conditions=(SCALE,)))
    assert stated == f"meets the limits if {one}"
    several = row(verdict="meets_if", conditions=(SCALE, MASS, Condition(None, "power", "")))
    assert stated_verdict(several) == (
        f"meets the limits if {one}, {mass} and its power meets the requirement"
    )


def test_an_excluded_sensor_has_its_shortfalls() -> None:
    shortfalls = (Shortfall("quantity", "gyro", "x"), Shortfall("mass", "", "15 g", (0.02,)))
    excluded = row(verdict="excluded", shortfalls=shortfalls)
    assert stated_verdict(excluded) == "excluded: the sensor has no gyro; mass 20 g, required 15 g"


@pytest.mark.parametrize(
    ("origin", "words"),
    [
        ("measured", " (measured value)"),
        ("datasheet", " (datasheet value)"),
        ("class limit", " (assumed worst value)"),
        ("requirement", ""),
    ],
)
def test_a_share_has_its_source_and_its_origin(origin: Origin, words: str) -> None:
    assert share_text(Share("N", "gyro", share=0.404)) == "gyro N 40 %"
    share = Share("scale_factor", "gyro", "turn", share=0.1, origin=origin)
    assert share_text(share) == f"gyro scale factor in the turn{words} 10 %"


def test_the_origins_of_an_error_are_summed() -> None:
    shares = [
        Share("turn_on_bias", "gyro", share=0.5, origin="class limit"),
        Share("N", "accel", share=0.2, origin="measured"),
        Share("K", "gyro", share=0.15, origin="measured"),
        Share("misalignment", "gyro", share=0.1, origin="class limit"),
        Share("scale_factor", "gyro", share=0.05, origin="datasheet"),
    ]
    assert origins_text(shares) == (
        "60 % unknown figures (assumed worst), 35 % noise, 5 % datasheet figures except noise"
    )


@pytest.mark.parametrize(
    ("quantity", "source", "size", "named"),
    [
        ("gyro", "temperature", 0.0123 * DEGREE, "gyro temperature coefficient"),
        ("gyro", "N", None, "gyro white noise"),
        ("accel", "flicker", None, "accelerometer bias instability"),
        ("accel", "K", None, "accelerometer K"),
    ],
)
def test_a_class_limit_is_named(
    quantity: str, source: SourceCode, size: float | None, named: str
) -> None:
    figure = " (0.0123 deg/s/K)" if size else ""
    stated = class_limit_text(quantity, source, size)
    assert stated == f"{named}: not printed, worst of its class{figure}"


def test_margins_other_than_in_use() -> None:
    both = row(margin=0.5, noise_margin=4.234, likely_margin=0.9)
    assert other_margins_text(both) == "noise-only margin 4.23, likely margin 0.9"
    # Where every figure is known, the likely margin is the margin in use.
    assert other_margins_text(replace(both, likely_margin=0.5)) == "noise-only margin 4.23"
    assert other_margins_text(row()) == ""


def weak(*reasons: str, **values: Any) -> str:
    about = {"recordings": 1, "specimens": 1, "longest_log": 660.0}
    evidence = {"evidence_reasons": reasons, "evidence": "weak" if reasons else "strong"}
    return evidence_text(row(**(evidence | about | values)))


@pytest.mark.parametrize("reason", [*WEAKNESS_REASONS, "not_explained", "doubtful", "motion"])
def test_every_weakness_has_words(reason: str) -> None:
    assert is_plain(weak(reason)) and " " in weak(reason)


def test_evidence_is_weak_for_reasons() -> None:
    assert weak() == ""
    assert evidence_text(row(evidence=None)) == ""
    assert weak("one_specimen", "short_log", "few_axes") == (
        "only one specimen; one log of 11 min; fewer than three axes"
    )
    assert weak("one_specimen", "periodic_drift", "not_explained", spread_of="other sensors") == (
        "only one specimen, spread taken from other sensors; "
        "the bias of the data oscillates slowly; "
        "no model explains the spectrum of the data"
    )
    assert weak("short_log", "wide_interval", specimens=2, recordings=2, spread_of="specimens") == (
        "no log longer than 11 min; wide interval from 2 specimens"
    )
    assert weak("wide_interval") == "wide interval"
    marks = (DoubtMark("a", "motion", ("gyro_x",)), DoubtMark("a", "suspicious_unit", ("gyro_z",)))
    assert weak("suspicious_unit", doubts=marks) == "the unit of measurement of gyro z looks wrong"


@pytest.mark.parametrize("of", get_args(SpreadOf))
def test_every_spread_has_words(of: SpreadOf) -> None:
    text = spread_text(row(spread=0.123, spread_of=of))
    assert text.startswith("12 % between ") and is_plain(text)
    assert spread_text(row(spread_of=of)) == spread_text(row(spread=0.1)) == ""


# ------------------------------------------------------------ with a corrected unit, or as logged


def corrected(logged: Verdict | None, verdict: Verdict | None, *units: UnitFactor) -> str:
    values: dict[str, Any] = {"logged_verdict": logged, "logged_margin": 0.1}
    values |= {"corrected_verdict": verdict, "corrected_margin": 7.5, "corrected_units": units}
    return corrected_text(row(**values))


GYRO = UnitFactor("gyro", DEGREE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (corrected(None, None), ""),
        (corrected("meets", None), "meets the limits (margin 0.1) as logged"),
        (
            corrected(None, "meets", GYRO),
            "meets the limits (margin 7.5) with the gyro data read as °/s, not as rad/s",
        ),
        (
            corrected("fails", "fails", UnitFactor("gyro", 1 / 17.5)),
            "fails (margin 0.1) as logged; "
            "also fails (margin 7.5) with the gyro data divided by 17.5",
        ),
        (
            corrected("fails", "not_enough_data", GYRO, UnitFactor("accel", 2.0)),
            "fails (margin 0.1) as logged; cannot be judged with the gyro data read as °/s, "
            "not as rad/s, and the accelerometer data multiplied by 2",
        ),
    ],
)
def test_the_verdict_with_a_corrected_unit(text: str, expected: str) -> None:
    assert text == expected


def test_every_alternative_is_a_sentence() -> None:
    judged = [verdict for verdict in get_args(Verdict) if verdict != "excluded"]
    for logged, verdict in product(judged, judged):
        text = corrected(logged, verdict, GYRO)
        assert is_plain(text) and ("also" in text) == (logged == verdict)


# ------------------------------------------------------------------------------------ the answer


NAMES = {name: name.upper() for name in "abcdefgh"}


def answer(*rows: RankingRow, asked: int | None = None, excluded: int = 0) -> str:
    return answer_text(rows, NAMES, len(rows) if asked is None else asked, excluded)


def test_one_sentence_names_the_sensors_to_choose() -> None:
    unknown = Condition("turn_on_bias", None, "accel", 0.1)
    best = {
        "Rover": row(),
        "Boat": row("b", "likely_meets"),
        "Drone": row("b", "meets_if", conditions=(unknown, unknown)),
        "Car": row("a", "fails"),
        "Truck": row("c", "cannot_meet"),
        "Train": row("c", "likely_fails"),
        "Ship": None,
        "Bus": row(),
    }
    assert summary_text(best, NAMES) == (
        "Best for Rover and Bus: A (meets the limits). Best for Boat: B (likely meets the limits). "
        "Best for Drone: B (meets the limits if 2 unknown figures are good enough). "
        "No sensor meets the limits of Car or Truck. "
        "No sensor is shown to meet the limits of Train. No sensor can be judged for Ship."
    )


def test_the_most_common_reason_of_weak_evidence_is_named() -> None:
    one = row(evidence="weak", evidence_reasons=("one_specimen",), spread_of="this sensor")
    few = row("b", evidence="weak", evidence_reasons=("few_axes",))
    text = evidence_summary_text([one, few, one, row("c"), row("d", "excluded", evidence="weak")])
    assert text == "The evidence for 3 of 4 verdicts is weak: only one specimen."
    assert evidence_summary_text([row(), row("b", evidence=None)]) == ""


@pytest.mark.parametrize(
    ("verdict", "text"),
    [
        ("meets", "A meets the limits."),
        ("likely_meets", "A likely meets the limits."),
        (
            "not_enough_data",
            "No sensor is shown to meet the limits. A is closest, but there is not enough data.",
        ),
        (
            "likely_fails",
            "No sensor is shown to meet the limits. A is closest, but likely fails.",
        ),
        ("fails", "No sensor meets the limits. A is closest, but fails."),
    ],
)
def test_a_best_sensor_that_may_fail_is_not_said_to_meet_the_limits(
    verdict: Verdict, text: str
) -> None:
    first = row(verdict=verdict)
    assert answer(first) == f"{text} Only sensor with usable data."
    assert answer(first, row("b", "fails")) == f"{text} Best of 2 sensors."


def test_weak_evidence_stands_with_the_answer() -> None:
    weak = row(evidence="weak", evidence_reasons=("short_log", "one_specimen"), recordings=1,
               longest_log=660.0)  # fmt: skip
    assert answer(weak) == (
        "A meets the limits. Only sensor with usable data (weak evidence: one log of 11 min; "
        "only one specimen)."
    )


def test_unknown_figures_are_counted_in_the_answer() -> None:
    unknown = "No sensor is shown to meet the limits. A meets them if"
    one = answer(row(verdict="meets_if", conditions=(SCALE,)))
    assert one.startswith(f"{unknown} {condition_text(SCALE)}. ")
    two = answer(row(verdict="meets_if", conditions=(SCALE, replace(SCALE, subject="accel"))))
    assert two.startswith(f"{unknown} 2 unknown figures and properties are as required. ")


def test_sensors_that_cannot_be_judged_are_told_from_those_that_can() -> None:
    assert answer(row(), asked=2).endswith(" Only sensor with usable data.")
    assert answer(row(), row("c"), asked=3).endswith(" Best of 2 sensors with usable data.")
    both = "the required properties and usable data"
    assert answer(row(), asked=2, excluded=1).endswith(f" Only sensor with {both}.")
    assert answer(asked=2) == "No sensor has usable data."
    assert answer(asked=2, excluded=2) == f"No sensor has {both}."
    assert answer() == "No recording answers it."


def others(rows: Iterable[RankingRow]) -> str:
    return " ".join(list_others(rows, NAMES))


def test_the_others_are_listed_by_their_verdicts_in_the_order_of_merit() -> None:
    rows = [
        row("b", "fails"),
        row("c", "likely_fails"),
        row("d", "not_enough_data", reasons=("no accelerometer",)),
        row("e", "likely_meets"),
        row("f", "excluded", shortfalls=(Shortfall("price_class", "chip", "tactical"),)),
        row("h", "meets"),
        row("g", "meets_if", conditions=(SCALE,)),
    ]
    assert others(rows) == (
        "Also meets the limits: H. Likely meets the limits: E. Meets the limits under conditions: "
        "G. "
        "Not enough data: D (no accelerometer). Likely fails: C. "
        "Fails: B. Excluded: F (price class chip, required: a class with the word tactical)."
    )


def test_sensors_without_enough_data_stand_by_their_reasons() -> None:
    rows = [
        row("a", "not_enough_data", reasons=("no gyro",)),
        row("b", "not_enough_data"),
        row("c", "not_enough_data", reasons=("no gyro",)),
    ]
    assert others(rows) == "Not enough data: A (no gyro), B, C (no gyro)."


def test_many_sensors_of_one_verdict_are_counted() -> None:
    assert others(row(name, "fails") for name in "bcdef") == "Fail: 5 sensors."
    assert others(row(name, "fails") for name in "bcde") == "Fail: B, C, D, E."
    assert others([]) == ""
