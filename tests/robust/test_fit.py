"""The robust fit on simulated logs of known noise, and on logs that change."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from imubench_pipeline.allan import of_blocks
from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.least_squares import UnfitCurveError
from imubench_pipeline.estimators.robust.active_sets import TERMS, TermSearch
from imubench_pipeline.estimators.robust.fit import fit
from imubench_pipeline.estimators.robust.parts import PARTS, compute_part_variances
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.typing import Array

RATE = 20.0
SAMPLES = 100_000
GYRO = NoiseModel(N=7e-5, B=3e-5, K=5e-7)


def estimate(
    samples: Array,
    lines: tuple[Sinusoid, ...] = (),
    segments: tuple[Span, ...] | None = None,
) -> Estimate:
    holes = bool(np.isnan(samples).any())
    curve = of_blocks([samples], len(samples), RATE, holes=holes, segments=segments)
    parts = compute_part_variances([samples], curve, holes=holes, segments=segments)
    return fit(curve, parts, lines, rng=np.random.default_rng(0))


def simulate_gyro(seed: int, model: NoiseModel = GYRO, samples: int = SAMPLES) -> Array:
    return simulate(model, RATE, samples, np.random.default_rng(seed))


def test_limits_contain_the_truth_of_stationary_logs() -> None:
    found = [estimate(simulate_gyro(seed)) for seed in range(8)]
    truth = {"N": GYRO.N, "B_curve": GYRO.B}
    for name, true in truth.items():
        parameters = [{**one.parameters, **one.curve}[name] for one in found]
        limits = [(one.lower, one.upper) for one in parameters]
        inside = sum(low is not None and low <= true <= (high or 0.0) for low, high in limits)
        assert inside >= 5  # of 8 at 95 %: fewer has a probability of 0.04 %
    # Two thirds of the information on N of white noise alone, 1/sqrt(2 L), remain.
    errors = [one.parameters["N"].in_model / GYRO.N - 1.0 for one in found]  # type: ignore[operator]  # a number
    assert np.sqrt(np.mean(np.square(errors))) < 1.6 / math.sqrt(2.0 * SAMPLES)


def test_the_draws_are_joint_and_as_wide_as_the_limits() -> None:
    found = estimate(simulate_gyro(1))
    assert found.draws is not None
    N = found.draws.first[:, 1]
    lower, upper = np.quantile(N, (0.025, 0.975), method="nearest")
    assert (found.parameters["N"].lower, found.parameters["N"].upper) == (lower, upper)
    model = found.draws.model(0)
    assert model.N == N[0]


def test_a_change_of_the_noise_widens_the_limits_of_n() -> None:
    steady = simulate_gyro(2)
    changing = steady * np.repeat((0.93, 1.07), SAMPLES // 2)
    before, after = (estimate(log).parameters["N"] for log in (steady, changing))
    assert before.upper is not None and before.lower is not None
    assert after.upper is not None and after.lower is not None
    assert before.upper / before.lower < 1.02
    assert after.reason is not None and "parts of the log differ" in after.reason
    assert after.lower < 0.93 * GYRO.N * 1.02 and after.upper > 1.07 * GYRO.N * 0.98


def test_missing_samples_and_segments_leave_the_values() -> None:
    log = simulate_gyro(3)
    whole = estimate(log).parameters["N"]
    missing = log.copy()
    missing[np.random.default_rng(0).random(SAMPLES) < 0.02] = np.nan
    assert whole.lower is not None and whole.upper is not None
    for other in (estimate(missing), estimate(log, segments=((0, 45_000), (45_000, SAMPLES)))):
        value = other.parameters["N"].value
        assert value is not None and whole.lower < value < whole.upper


def test_a_line_is_not_noise() -> None:
    line = Sinusoid(2e-4, 1.7)
    model = NoiseModel(N=GYRO.N, B=GYRO.B, K=GYRO.K, sinusoids=[line])
    N = estimate(simulate_gyro(4, model), (line,)).parameters["N"]
    assert N.lower is not None and N.upper is not None
    assert N.lower < GYRO.N < N.upper


def test_white_noise_has_bounds_for_the_other_terms() -> None:
    found = estimate(simulate_gyro(5, NoiseModel(N=GYRO.N)))
    assert found.parameters["K"].value is None and found.curve["B_curve"].value is None
    K, B = found.parameters["K"].upper, found.curve["B_curve"].upper
    assert K is not None and B is not None
    tau = SAMPLES / RATE / 9.0
    assert K * math.sqrt(tau / 3.0) < 3.0 * GYRO.N / math.sqrt(tau)
    assert B < 0.3 * GYRO.N  # a process below the white noise at its correlation time


def test_unfit_curves_are_refused() -> None:
    with pytest.raises(UnfitCurveError, match="points"):
        estimate(simulate_gyro(6, samples=20))
    with pytest.raises(UnfitCurveError, match="repeat"):
        estimate(np.tile((1.0, -1.0), 5000))


@settings(max_examples=12, deadline=None)
@given(
    st.lists(st.floats(0.01, 10.0), min_size=TERMS, max_size=TERMS),
    st.sets(st.integers(0, TERMS - 1), min_size=1),
)
def test_an_exact_curve_gives_its_terms(amplitudes: list[float], present: set[int]) -> None:
    tau = np.geomspace(0.1, 1000.0, 40)
    times = np.geomspace(2.0, 400.0, 20)
    search = TermSearch(tau, 10.0, tau * 10.0, times)
    columns = search.design(float(times[8]))
    squares = np.zeros(TERMS)
    for term in present:
        # Each is visible at some tau.
        squares[term] = amplitudes[term] / columns[:, term].max()
    exact = columns @ squares
    found = search.solve(exact[None], np.diag(1e4 / exact))
    design = search.design(float(found.times[0]))
    np.testing.assert_allclose(design @ found.squares[0], exact, rtol=5e-3)


def test_parts_of_a_log_sum_to_its_short_clusters() -> None:
    log = simulate_gyro(7)
    curve = of_blocks([log], SAMPLES, RATE, holes=False)
    parts = compute_part_variances([log[:33_333], log[33_333:]], curve, holes=False)
    assert parts.squares.shape == (PARTS, len(curve.tau))
    few = curve.cluster_size <= 15
    np.testing.assert_allclose(parts.divide(1)[0, few], curve.variance[few], rtol=2e-3)
    halves = parts.divide(2)[:, few]
    first = of_blocks([log[: SAMPLES // 2]], SAMPLES // 2, RATE, curve.cluster_size, holes=False)
    np.testing.assert_allclose(halves[0], first.variance[: few.sum()], rtol=5e-3)


def test_filters_and_rounding_leave_n_and_the_bias_instability() -> None:
    """A first-order low-pass at 1/15 of the rate; rounding of the angle to 2 sigma of its noise."""
    model = NoiseModel(N=1e-4, B=5e-5, T_B=30.0)
    log = simulate_gyro(11, model)
    filtered = lfilter([1.0 - math.exp(-0.42)], [1.0, -math.exp(-0.42)], log)
    step = 5e-5
    rounded = np.diff(np.round(np.cumsum(log) / RATE / step), prepend=0.0) * step * RATE
    for samples in (filtered, rounded):
        found = estimate(samples)
        for name, true, error in (("N", model.N, 0.05), ("B_curve", None, 0.0)):
            parameter = {**found.parameters, **found.curve}[name]
            assert parameter.status == "ok"
            assert parameter.lower is not None and parameter.upper is not None
            if true is not None:
                assert parameter.value == pytest.approx(true, rel=error)
                assert parameter.lower <= 1.01 * true and parameter.upper >= 0.99 * true
        assert found.parameters["B"].value == pytest.approx(model.B, rel=0.4)


def test_a_ramp_is_not_taken_from_a_walk() -> None:
    walks = [simulate_gyro(seed, NoiseModel(N=1e-4, K=1e-5)) for seed in range(6)]
    assert all(estimate(walk).parameters["R"].status == "absent" for walk in walks)
    ramp = simulate_gyro(0, NoiseModel(N=1e-4)) + 2e-7 * np.arange(SAMPLES) / RATE
    assert estimate(ramp).parameters["R"].value == pytest.approx(2e-7, rel=0.05)


def test_k_of_some_minutes_is_not_identified_but_bounded() -> None:
    model = NoiseModel(N=1e-3, B=2e-3, T_B=5.0, K=2e-4)
    for seed in range(4):
        K = estimate(simulate_gyro(seed, model, samples=5_000)).parameters["K"]
        assert K.value is None and K.upper is not None and K.upper > 2e-4


def test_the_lowest_point_is_the_lowest_within_a_sixth_of_the_log() -> None:
    model = NoiseModel(N=1e-4, B=2.5e-5)
    tau = np.geomspace(1.0, SAMPLES / RATE / 6.0, 500)
    true = float(np.sqrt(model.allan_variance(tau, RATE).min()))
    found = [estimate(simulate_gyro(seed, model)).curve["sigma_min"] for seed in range(8)]
    limits = [(each.lower, each.upper) for each in found if each.value is not None]
    assert len(limits) >= 7  # the curve is flat from a twelfth of this time on
    inside = sum(low is not None and low <= true <= (high or 0.0) for low, high in limits)
    assert inside >= 5  # of 7 at 95 %: fewer has a probability of 0.4 %
    falling = estimate(simulate_gyro(1, NoiseModel(N=1e-4))).curve["sigma_min"]
    assert falling.value is None and falling.upper is not None
    assert 0.8e-4 / math.sqrt(tau[-1]) < falling.upper < 3e-4 / math.sqrt(tau[-1])


def test_a_change_of_the_noise_widens_the_limits_of_the_lowest_point() -> None:
    steady = simulate_gyro(2)
    changing = steady * np.repeat((0.5, 1.5), SAMPLES // 2)
    before, after = (estimate(log).curve["sigma_min"] for log in (steady, changing))
    assert before.upper is not None and before.lower is not None
    assert after.upper is not None and after.lower is not None
    assert before.upper / before.lower < 2.0
    assert after.upper / after.lower > 1.5 * before.upper / before.lower


def test_hidden_white_noise_has_an_upper_limit() -> None:
    found = estimate(simulate_gyro(5, NoiseModel(N=1e-6, K=1e-3))).parameters["N"]
    assert (found.value, found.status) == (None, "not_identified")
    assert found.upper is not None and found.upper > 1e-6


@pytest.mark.parametrize("seed", [42, 54])
def test_k_lies_within_its_limits_where_it_exceeds_what_the_end_of_the_curve_allows(
    seed: int,
) -> None:
    model = NoiseModel(N=7e-5, B=3e-5, T_B=85.0, K=3e-6)
    log = simulate(model, 4.0, SAMPLES, np.random.default_rng(seed))
    curve = of_blocks([log], len(log), 4.0, holes=False)
    parts = compute_part_variances([log], curve, holes=False)
    K = fit(curve, parts, (), rng=np.random.default_rng(0)).parameters["K"]
    assert K.value is not None and K.lower is not None and K.upper is not None
    assert K.lower < K.value <= K.upper
