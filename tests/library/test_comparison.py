"""Ratios of the noise of two logs."""

import math

import numpy as np
import pytest

import imubench_pipeline as imu
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.library.estimates import Estimates
from imubench_pipeline.navigation.ratios import Ratio, compare_parameters
from tests.library.conftest import GYRO, RATE

LOUD = imu.NoiseModel(N=1.5 * GYRO.N, K=GYRO.K)


@pytest.fixture(scope="module")
def loud():
    samples = imu.simulate({"gyro_x": LOUD}, RATE, duration="1 h", seed=2)
    return imu.estimate(samples, RATE, name="loud")


@pytest.fixture(scope="module")
def comparison(estimates, loud):
    return imu.compare(estimates, loud, tau=["1 s", 10, "1 h"])


@pytest.mark.release
def test_the_ratio_of_two_logs_is_in_its_interval(comparison) -> None:
    rows = {each.label: each for each in comparison}
    assert rows["N"].ratio.lower < 1.0 / 1.5 < rows["N"].ratio.upper
    assert rows["N"].verdict == "run lower"
    assert rows["K"].ratio.lower < 1.0 < rows["K"].ratio.upper
    assert rows["K"].verdict == "not significant"
    for tau in (1.0, 10.0):
        ratio = rows[f"σ({tau:g} s)"].ratio
        truth = math.sqrt(GYRO.allan_variance(tau) / LOUD.allan_variance(tau))
        assert ratio.lower < truth < ratio.upper
        if ratio.value is None:  # a part below its limit may matter: the reason names it
            assert ratio.reasons == ("in recording sensor_1/run, B of gyro x is not determined",)
        else:
            assert ratio.lower <= ratio.value <= ratio.upper
    assert "σ(3600 s)" not in rows  # beyond a ninth of the logs
    assert {each.channel for each in comparison} == {"gyro_x"}


@pytest.mark.release
def test_the_other_way_round_is_the_inverse(comparison, estimates, loud) -> None:
    back = imu.compare(loud, estimates, tau=["1 s"])
    for one, other in zip(comparison, back, strict=False):
        assert one.label == other.label
        if one.ratio.value:
            assert one.ratio.value == pytest.approx(1.0 / other.ratio.value)
            assert one.ratio.lower == pytest.approx(1.0 / other.ratio.upper, rel=0.02)  # of draws
    assert one.label == "σ(1 s)"
    assert back[0].verdict == "run lower"


def test_limits_of_a_ratio_are_those_of_log_normal_values() -> None:
    """Of log-normal values the ratio is log-normal: its variance is the sum of both."""
    spread, other = 0.1, 0.2
    first = Parameter(
        2.0, lower=2.0 * math.exp(-1.96 * spread), upper=2.0 * math.exp(1.96 * spread)
    )
    second = Parameter(1.0, lower=math.exp(-1.96 * other), upper=math.exp(1.96 * other))
    ratio = compare_parameters(first, second)
    width = 1.96 * math.hypot(spread, other)
    assert ratio.value == 2.0 and ratio.verdict == "higher"
    assert (ratio.lower, ratio.upper) == pytest.approx(
        (2.0 * math.exp(-width), 2.0 * math.exp(width))
    )
    draws = np.random.default_rng(1).normal(size=(2, 200_000))
    sampled = 2.0 * np.exp(spread * draws[0] - other * draws[1])
    assert np.mean((sampled > ratio.lower) & (sampled < ratio.upper)) == pytest.approx(
        0.95, abs=2e-3
    )


ABSENT = Parameter(None, "absent", "no such term", 0.0, 1.0)
OPEN = Parameter(None, "not_shown", "the log is too short")


@pytest.mark.parametrize(
    ("first", "second", "limits", "verdict"),
    [
        (ABSENT, Parameter(3.0, lower=2.0, upper=4.0), (0.0, 0.5), "lower"),
        (ABSENT, Parameter(1.0, lower=0.5, upper=2.0), (0.0, 2.0), "not significant"),
        (Parameter(3.0, lower=2.0, upper=4.0), ABSENT, (2.0, None), "higher"),
        (ABSENT, ABSENT, (None, None), "not determined"),
        (OPEN, Parameter(3.0, lower=2.0, upper=4.0), (None, None), "not determined"),
        (Parameter(3.0), Parameter(2.0), (None, None), "not determined"),
        (Parameter(1.0, lower=0.0, upper=2.0), Parameter(3.0, lower=3.0, upper=3.0),
         (0.0, 2.0 / 3.0), "lower"),
    ],
)  # fmt: skip
def test_what_has_no_value_is_compared_by_its_limits(
    first: Parameter, second: Parameter, limits: tuple, verdict: str
) -> None:
    ratio = compare_parameters(first, second)
    assert (ratio.lower, ratio.upper) == pytest.approx(limits)
    assert ratio.verdict == verdict
    if first.status != "ok":
        assert ratio.value is None and "the first value is" in ratio.reasons[0]


def test_an_interval_alone_says_which_is_lower() -> None:
    assert Ratio(0.9, 0.8, 1.1).verdict == "not significant"
    assert Ratio(0.9, 0.8, 0.99).verdict == "lower"
    assert Ratio(None, 1.01, None).verdict == "higher"


@pytest.mark.usefixtures("no_screen")
def test_a_comparison_is_shown_drawn_and_given_as_a_table(comparison, loud) -> None:
    assert "run lower" in repr(comparison) and repr(comparison).startswith("Comparison of run (a)")
    table = comparison.to_pandas().set_index("parameter")
    assert table.loc["N", "unit"] == "rad/s/sqrt(Hz)" and table.loc["N", "verdict"] == "run lower"
    axes = comparison.plot()
    assert axes.get_xlabel() == "ratio run / loud"
    assert axes.get_yticklabels()[0].get_text() == "gyro_x N"
    three = imu.compare(loud, loud, loud, names=["A", "B", "C"])
    assert {(each.names) for each in three} == {("A", "B"), ("A", "C"), ("B", "C")}
    assert all(each.verdict != "A lower" for each in three)


def test_what_cannot_be_compared_says_why(estimates, loud) -> None:
    with pytest.raises(ValueError, match="1 given; expected two or more"):
        imu.compare(estimates)
    with pytest.raises(ValueError, match="found ndarray; expected what read_log or estimate"):
        imu.compare(estimates, np.zeros(5))
    with pytest.raises(ValueError, match="names are a, a; expected 2 of them, all distinct"):
        imu.compare(estimates, loud, names=["a", "a"])
    with pytest.raises(ValueError, match="expected one channel or more that both have"):
        imu.compare(
            loud,
            Estimates(
                [estimates["accel_z"]], estimates.log, "likelihood", [], [], {}, estimates.rows
            ),
        )
    with pytest.raises(ValueError, match="tau: 'm' is no unit of time"):
        imu.compare(estimates, loud, tau=["3 m"])
