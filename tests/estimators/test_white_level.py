"""N includes the processes that are faster than a second."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.estimators.estimate import MAX_LIMIT_RATIO, Estimate, Parameter
from imubench_pipeline.estimators.likelihood import Likelihood, fit
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.white_level import (
    count_fast_processes,
    merge_fast_draws,
    merge_fast_processes,
)
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_noise_model
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE, SAMPLES = 100.0, 360_000
N, T_B = 1e-4, 0.05


def fast(times: float) -> NoiseModel:
    """White noise beside a fast process of so many times its density at low frequencies."""
    unit = NoiseModel(B=1.0, T_B=T_B).psd(np.array([1e-9]))[0]
    return NoiseModel(N=N, B=N * np.sqrt(times / unit), T_B=T_B)


def maximum(model: NoiseModel) -> Maximum:
    processes = [(model.B, model.T_B), *((p.B, p.T_B) for p in model.further_processes)]
    powers = [model.N**2, model.K**2, *(B**2 for B, _ in processes)]
    times = np.array([time for _, time in processes])
    return Maximum(Terms("NK", len(processes)), np.array(powers), times, 0.0, 0.0)


@pytest.mark.parametrize("folding", [1.0, 1.7])
def test_processes_faster_than_a_second_count_into_n(folding: float) -> None:
    model = replace(fast(3.0), K=1e-6, further=[GaussMarkov(1e-4, 30.0)])
    best = maximum(replace(model, N=model.N / np.sqrt(folding)))
    assert count_fast_processes(best) == 1
    merged = merge_fast_processes(best, 1, folding)
    assert merged.terms == Terms("NK", 1)
    in_the_log = replace(make_noise_model(merged), N=make_noise_model(merged).N * np.sqrt(folding))
    assert in_the_log.N == pytest.approx(2.0 * N, rel=1e-6)
    assert (in_the_log.B, in_the_log.T_B, in_the_log.K) == pytest.approx((1e-4, 30.0, 1e-6))
    # Beyond the process the curve is the same: nothing is lost, and nothing counts twice.
    late = np.geomspace(5.0, 1000.0, 20)
    assert in_the_log.allan_variance(late) == pytest.approx(model.allan_variance(late), rel=0.02)
    assert merge_fast_processes(best, 0, folding) is best


def test_draws_are_merged_one_by_one() -> None:
    model = fast(3.0)
    draws = np.array([[N, 0.0, model.B], [2.0 * N, 0.0, 0.0]])
    posterior = Posterior(draws, np.full((2, 1), T_B), np.zeros(2), 2.0)
    merged = merge_fast_draws(posterior, Terms("NK", 1), 1)
    assert merged.parameters[:, 0] == pytest.approx([2.0 * N, 2.0 * N], rel=1e-6)
    assert merged.parameters.shape == (2, 2) and merged.times.shape == (2, 0)


@pytest.fixture(scope="module")
def hour_beside_a_fast_process() -> Likelihood:
    return fit(simulate(fast(3.0), RATE, SAMPLES, np.random.default_rng(5)), RATE)


def test_white_noise_beside_a_fast_process_is_what_the_curve_shows(
    hour_beside_a_fast_process: Likelihood,
) -> None:
    estimate = hour_beside_a_fast_process.estimates[0]
    white = estimate.parameters["N"]
    assert white.value == pytest.approx(2.0 * N, rel=0.03)
    assert white.lower is not None and white.upper is not None
    assert white.lower < 2.0 * N < white.upper and white.upper < 1.1 * white.lower
    assert "correlation time of 0.05" in (white.reason or "")
    assert estimate.parameters["B"].value is None
    late = np.geomspace(5.0, 50.0, 8)
    assert estimate.model.allan_variance(late) == pytest.approx(
        fast(3.0).allan_variance(late), rel=0.06
    )
    assert estimate.draws is not None
    assert estimate.draws.first[:, 1] == pytest.approx(2.0 * N, rel=0.1)


def test_a_process_that_counts_into_n_is_in_the_limits_of_no_bias_instability(
    hour_beside_a_fast_process: Likelihood,
) -> None:
    # A model with a second, weak process is about as good; in a tenth of its draws that one is the
    # faster, and the strong one, which N has already, must not be left for B.
    for estimate in hour_beside_a_fast_process.estimates:
        for bias in (estimate.parameters["B"], estimate.curve["B_curve"]):
            assert bias.upper is None or bias.upper < 0.3 * fast(3.0).B


def test_beside_a_fast_process_no_limit_of_n_is_that_of_the_white_noise_alone(
    hour_beside_a_fast_process: Likelihood,
) -> None:
    # Over twenty such logs N of the fit has a standard deviation of 0.6 %.
    for estimate in hour_beside_a_fast_process.estimates:
        white = estimate.parameters["N"]
        assert white.lower is not None and white.upper is not None and white.value is not None
        assert white.lower > 0.97 * white.value and white.upper < 1.03 * white.value


numbers = st.one_of(st.none(), st.floats(-1e6, 1e6))


@given(numbers, numbers, numbers, st.sampled_from(["ok", "doubtful", "absent", "at_bound"]))
def test_no_ok_has_limits_more_than_four_times_apart(value, lower, upper, status) -> None:
    given_one = Parameter(value, status, None, lower, upper)
    (one,) = Estimate("any", {"N": given_one}).parameters.values()
    assert one.checked() == one
    if one.status == "ok" and one.lower is not None and one.upper is not None:
        near, far = sorted((abs(one.lower), abs(one.upper)))
        assert one.lower * one.upper > 0.0 or near > 0.0
        assert far <= MAX_LIMIT_RATIO * near
    if one == given_one:
        return
    assert (one.value, one.status, one.fitted) == (None, "not_identified", value)
    assert one.upper == upper and one.lower in (lower, 0.0) and one.reason


@given(
    st.floats(1e-12, 1e6),
    st.floats(1.0, 8.0),
    st.floats(0.0, 1.0),
    st.sampled_from([1.0, -1.0]),
    st.sampled_from(["parameters", "curve", "further", "lines"]),
)
def test_a_value_is_ok_up_to_limits_four_times_apart_whatever_its_sign(
    near: float, ratio: float, place: float, sign: float, group: str
) -> None:
    value = sign * near * ratio**place
    lower, upper = sorted((sign * near, sign * near * ratio))
    given_one = Parameter(value, "ok", None, lower, upper)
    groups = {"R": given_one}
    fields = {"parameters": {}} | {group: [groups] if group in ("further", "lines") else groups}
    estimate = Estimate("any", **fields)
    ((_, _, one),) = estimate.components()
    if ratio < 3.999:
        assert one == given_one
    elif ratio > 4.001:
        assert (one.value, one.status, one.fitted) == (None, "not_identified", value)
    assert one.in_model == value and (one.lower, one.upper) == (lower, upper)
    # Neither a second look nor a change of another field brings it back.
    assert replace(estimate, method="other").parameters == estimate.parameters
    assert one.checked() == one


@pytest.mark.parametrize("limits", [(-1.0, 2.0), (0.0, 2.0), (-2.0, 0.0), (1.0, np.inf)])
def test_an_interval_with_zero_or_without_an_end_is_no_value(limits: tuple[float, float]) -> None:
    one = Parameter(1.0, "ok", None, *limits).checked()
    assert (one.value, one.status, one.fitted) == (None, "not_identified", 1.0)


def test_limits_a_decade_apart_are_an_upper_limit() -> None:
    for lower, kept in ((0.3, 0.3), (0.11, 0.11), (0.09, 0.0), (-0.01, -0.01)):
        assert Parameter(0.5, lower=lower, upper=1.1).checked().lower == kept
    assert Parameter(-0.5, lower=-1.0, upper=-0.3).checked().status == "ok"
    assert Parameter(-0.5, lower=-1.0, upper=-0.2).checked().status == "not_identified"


@pytest.mark.parametrize("part", [0.2, 0.7])
def test_noise_of_which_the_low_frequencies_are_taken_has_an_estimate(part: float) -> None:
    # Far from the papers' model: its share is next to nothing.
    z = N * np.random.default_rng(1).standard_normal(60_001)
    white = fit(z[1:] - part * z[:-1], RATE).estimates[0].parameters["N"]
    assert white.value == pytest.approx((1.0 - part) * N / np.sqrt(RATE), rel=0.05)
