"""What a comparison of any two recordings needs: equal to what is computed of the pair alone."""

from functools import cache

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, JointDraws, Parameter
from imubench_pipeline.model.estimates import ErrorGrowthRow
from imubench_pipeline.navigation.error_budget.in_use import Figure, Figures
from imubench_pipeline.navigation.expected_errors import (
    AxisErrors,
    draw_axis_errors,
    list_error_rows,
    list_growth_rows,
    list_requirement_questions,
    list_standard_questions,
)
from imubench_pipeline.navigation.ratios import (
    ComparedChannel,
    compare_deviations,
    list_deviation_rows,
)
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words.verdicts import source_text

NAMES = {"sensor": "alpha", "recording": "night"}
DRAWS = 9


def estimate(level: float, seed: int) -> Estimate:
    """Return an estimate with joint draws; a third of them have no walk, others two processes."""
    sizes = {"Q": 0.0, "N": 1e-4, "B": 2e-5, "T_B": 90.0, "K": 2e-7, "R": 0.0}
    sizes = {name: v if name == "T_B" else v * level for name, v in sizes.items()}
    first = np.array(list(sizes.values())) * np.exp(
        0.1 * np.random.default_rng(seed).standard_normal((DRAWS, 6))
    )
    first[::3, 4] = 0.0
    further = np.tile([0.0, np.nan], (DRAWS, 1, 1))
    further[::2, 0] = 1e-5 * level, 1500.0
    known = {name: Parameter(v, lower=0.8 * v, upper=1.2 * v) for name, v in sizes.items() if v}
    return Estimate("likelihood", known, draws=JointDraws(first, further))


ESTIMATES = {
    "gyro_x": estimate(1.0, 1),
    "gyro_y": estimate(2.0, 2),
    "accel_x": estimate(30.0, 3),
    "accel_z": Estimate("curve", {"N": Parameter(5e-3, lower=4e-3, upper=6e-3)}),
}
HOW = {"draws": DRAWS, "seed": 7}


FIGURES: Figures = {
    "temperature": Figure(sigma=0.0, spread=2e-6),
    "scale_factor": Figure(sigma=1e-3),
    "misalignment": Figure(sigma=1e-3),
    "turn_on_bias": Figure(sigma=3e-5, spread=1e-5),
}
USES = [
    {"static_window": "2 min", "turns": "360 deg", "speed": "3 m/s"},
    {"static_window": "5 s", "speed_change": "4 m/s", "confidence": 0.9},
    {"turn_on": {"on_time": "1 h"}, "axis": "median"},
    {"turn_on": {"on_time": "1 h", "gyro": "4 deg/h"}, "turns": "90 deg", "speed": "20 m/s"},
]


@pytest.mark.parametrize("use", USES)
def test_limits_follow_from_the_budget_of_each_draw(use: dict[str, object]) -> None:
    """The totals of all draws at once are equal to those of one budget after another."""
    environment = {key: use[key] for key in ("turns", "speed", "speed_change") if key in use}
    stated = {key: value for key, value in use.items() if key not in environment}
    limits = [
        {"error": "attitude", "after": "50 s", "at_most": "0.1 deg"},
        {"error": "velocity", "after": "20 s", "at_most": "0.5 m/s"},
        {"error": "position", "after": "20 s", "at_most": "5 m"},
        {"error": "heading", "after": "100 s", "at_most": "1 deg"},
    ]
    if "speed" in environment:
        limits.append({"error": "cross_track", "after": "30 s", "at_most": "1 m"})
    environment |= {"temperature_change": "7 K"}
    asked = Requirement.model_validate(
        {"title": "t", "limits": limits, "environment": environment} | stated
    )
    questions = list(list_requirement_questions("asked", asked))
    figures = dict.fromkeys(ESTIMATES, FIGURES)
    drawn = {
        channel: draw_axis_errors(channel, estimate, FIGURES, DRAWS, HOW["seed"])
        for channel, estimate in ESTIMATES.items()
    }
    rows = list_error_rows(NAMES, ESTIMATES, questions, figures=figures, **HOW)
    totals = [row for row in rows if row.source == "total"]
    assert len(totals) == len(questions)
    for question, row in zip(questions, totals, strict=True):
        assert row.gyro is not None and row.sigma is not None
        accel = drawn[row.accel] if row.accel else [AxisErrors()] * DRAWS
        each = [question.answer(*pair).total for pair in zip(drawn[row.gyro], accel, strict=True)]
        lower, upper = np.quantile(each, [0.025, 0.975])
        assert row.lower == pytest.approx(min(lower, row.sigma), rel=1e-12)
        assert row.upper == pytest.approx(max(upper, row.sigma), rel=1e-12)
        assert row.upper > row.sigma


@cache
def grown() -> list[ErrorGrowthRow]:
    return list(list_growth_rows(NAMES, ESTIMATES, times=[10.0, 45.0], window=90.0, **HOW))


@pytest.mark.release
def test_errors_that_grow_are_those_of_the_budget() -> None:
    questions = list(list_standard_questions([10.0, 45.0], 90.0, 0.8, ["worst"]))
    asked = {
        (row.error, row.time, source_text(row)): row
        for row in list_error_rows(NAMES, ESTIMATES, questions, **HOW)
        if row["error"] != "north"
    }
    of_table = [
        row
        for row in grown()
        if row["axis"] == "worst" and row["window"] == 90.0 and row["time"] in (10.0, 45.0)
    ]
    assert len(of_table) == len(asked) > 40
    for row in of_table:
        of_budget = asked[row.error, row.time, source_text(row)]
        for name in ("gyro", "accel", "unit"):
            assert row[name] == of_budget[name]
        for name in ("sigma", "lower", "upper"):
            assert row[name] == pytest.approx(of_budget[name], rel=1e-12)


@pytest.mark.release
@pytest.mark.parametrize("letters", ["y", "xy"])
def test_an_axis_alone_is_as_if_its_log_had_no_other(letters: str) -> None:
    how = HOW | {"times": [10.0, 45.0], "window": 90.0}
    rows = grown()
    assert {row["axis"] for row in rows} == {"worst", "x", "y"}  # z has no gyro
    for letter in letters:
        alone = {channel: one for channel, one in ESTIMATES.items() if channel.endswith(letter)}
        expected = [row | {"axis": letter} for row in list_growth_rows(NAMES, alone, **how)]
        assert [row for row in rows if row["axis"] == letter] == expected


def test_errors_grow_with_time_and_shrink_with_the_window() -> None:
    rows = [
        row
        for row in grown()
        if row["axis"] == "worst" and row["source"] == "total" and row["error"] == "heading"
    ]
    by_window = {w: [r["sigma"] for r in rows if r["window"] == w] for w in (10.0, 60.0)}
    assert by_window[10.0] == sorted(by_window[10.0])
    assert all(a > b for a, b in zip(*by_window.values(), strict=True))
    assert {row["time"] for row in rows} >= {1.0, 600.0}


def test_a_ratio_follows_from_what_is_kept_of_each_channel() -> None:
    a, b = (
        ComparedChannel("s", f"r{n}", "gyro_x", True, 3600.0, estimate(1.0 + n / 3, n))
        for n in (1, 2)
    )
    how = {"longest": 1 / 9, "draws": DRAWS, "seed": 3}
    kept = [list(list_deviation_rows(one, 100.0, **how)) for one in (a, b)]
    taus = sorted({row["tau"] for row in kept[0]})
    np.testing.assert_allclose(np.log10(taus), np.arange(-2.0, 2.6, 0.5), atol=1e-12)
    for tau in taus:
        own, other = (
            np.array([r["adev"] for r in rows if r["tau"] == tau and r.draw is not None])
            for rows in kept
        )
        assert len(own) == DRAWS and (np.diff(own) >= 0).all()
        ratio = compare_deviations(a, b, tau, **how)
        limits = np.quantile(own[:, None] / other, [0.025, 0.975], method="inverted_cdf")
        np.testing.assert_allclose([ratio.lower, ratio.upper], limits, rtol=1e-12)
        values = [r["adev"] for rows in kept for r in rows if r["tau"] == tau and r.draw is None]
        assert ratio.value == pytest.approx(values[0] / values[1], rel=1e-12)


def test_nothing_is_kept_of_a_channel_without_noise() -> None:
    nothing = Estimate("likelihood", {"N": Parameter(None, "not_identified")})
    channel = ComparedChannel("s", "r", "gyro_x", True, 3600.0, nothing)
    assert [*list_deviation_rows(channel, 100.0, longest=1 / 9, draws=9, seed=1)] == []
    assert [*list_growth_rows(NAMES, {"gyro_x": nothing}, times=(), window=60.0, **HOW)] == []
