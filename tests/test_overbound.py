import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import brentq

from imubench_pipeline.allan import AllanCurve, allan_variance, cluster_sizes
from imubench_pipeline.extensions.exports.overbound import (
    FAMILIES,
    Family,
    Overbound,
    find_smallest,
    growth,
    limits_of,
    overbound,
    simultaneous_upper,
)
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.typing import Array
from imubench_pipeline.words.numbers import number_text
from tests.conftest import few

GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
RATE = 5.0
SAMPLES = 180_000


def measured(model: NoiseModel, edf: float | None = None) -> AllanCurve:
    """Return the curve of a model as if measured; of so many degrees of freedom, or as sure."""
    n = cluster_sizes(SAMPLES)
    degrees = SAMPLES / n / 2.0 if edf is None else np.full(len(n), edf)
    return AllanCurve(n / RATE, n, model.allan_variance(n / RATE, RATE), degrees, SAMPLES)


@cache
def of_gyro(family: Family = "N+K") -> Overbound:
    return overbound(measured(GYRO), GYRO, RATE, family=family)


def above(model: NoiseModel, other: NoiseModel, longest: float, horizon: float) -> list[float]:
    """Return the least ratios of Allan variance, density, and the two integrals."""
    n = np.unique(np.rint(np.geomspace(1.0, longest * RATE, 300)))
    frequency = np.geomspace(0.1 / horizon, RATE / 2.0, 200)
    time = np.geomspace(1.0 / RATE, horizon, 100)
    own, theirs = growth(model, time, RATE), growth(other, time, RATE)
    variance = model.allan_variance(n / RATE, RATE) / other.allan_variance(n / RATE, RATE)
    return [
        float(np.min(variance)),
        float(np.min(model.psd(frequency) / other.psd(frequency))),
        float(np.min(own[0] / theirs[0])),
        float(np.min(own[1] / theirs[1])),
    ]


@pytest.mark.parametrize(
    ("family", "model"),
    few(
        [("N+GM+K", NoiseModel(N=1e-4, B=2e-4, T_B=5.0, K=3e-5))],
        [
            ("N+K", NoiseModel(N=1e-4, K=1e-5)),
            ("N+GM", NoiseModel(N=1e-4, B=2e-4, T_B=15.0)),
        ],
    ),
)
def test_without_uncertainty_the_smallest_is_the_model_itself(
    family: Family, model: NoiseModel
) -> None:
    found = overbound(measured(model, 1e9), model, RATE, family=family, longest=300.0).model
    assert pytest.approx(model.N, rel=2e-3) == found.N
    assert found.B == pytest.approx(model.B, rel=2e-2)
    assert pytest.approx(model.K, rel=2e-2) == found.K
    if model.T_B:
        assert found.T_B == pytest.approx(model.T_B, rel=3e-2)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    "model", few([GYRO], [NoiseModel(N=1e-4, B=6e-5, K=1e-6), NoiseModel(N=1e-4)])
)
def test_it_lies_above_everything_that_was_measured_and_fitted(
    family: Family, model: NoiseModel
) -> None:
    curve = measured(model)
    found = of_gyro(family) if model == GYRO else overbound(curve, model, RATE, family=family)
    assert min(above(found.model, model, 60.0, 60.0)) >= 1.0
    within = curve.tau <= 60.0
    upper = curve.limits(0.95)[1] ** 2
    assert np.all(found.model.allan_variance(curve.tau, RATE)[within] > upper[within])


@pytest.mark.release
@pytest.mark.parametrize("family", few(["N+GM+K"], ["N+K", "N+GM"]))
def test_no_term_of_it_can_be_smaller(family: Family) -> None:
    limits = limits_of(measured(GYRO), GYRO, RATE, 60.0, (1 / RATE, 60.0), (1 / 600, RATE / 2))
    model = find_smallest(limits, family, (0.4, 1800.0))

    def inside(trial: NoiseModel) -> bool:
        return all(
            np.all(np.sum([limit.of_term(t) for t in trial.terms], axis=0) >= limit.value)
            for limit in limits
        )

    assert inside(model)
    for name in ("N", "B", "K"):
        if getattr(model, name):
            assert not inside(replace(model, **{name: 0.99 * getattr(model, name)}))


def ratio_at_minimum(found: Overbound) -> float:
    """Return the bound of the gyro over its Allan variance, at the minimum up to 60 s."""
    curve = measured(GYRO)
    place = int(np.argmin(np.where(curve.tau <= 60.0, curve.variance, np.inf)))
    return float(found.model.allan_variance(curve.tau, RATE)[place] / curve.variance[place])


def test_it_is_close_to_the_truth_where_the_curve_is_lowest() -> None:
    for family, most in (("N+K", 1.25), ("N+GM", 1.2), ("N+GM+K", 1.2)):
        assert 1.0 < ratio_at_minimum(of_gyro(family)) < most


@pytest.mark.release
def test_a_longer_tau_asks_for_more() -> None:
    short = of_gyro("N+GM")
    long = overbound(measured(GYRO), GYRO, RATE, family="N+GM", longest=1000.0)
    tau = np.array([1000.0])
    truth = GYRO.allan_variance(tau)
    assert short.model.allan_variance(tau) < long.model.allan_variance(tau)
    assert long.model.allan_variance(tau) > truth


def test_where_a_walk_must_be_far_too_large_white_noise_does_not_make_room() -> None:
    found = overbound(measured(GYRO), GYRO, RATE, longest=4000.0, most_excess=math.inf).model
    assert found.K > 5.0 * GYRO.K
    assert found.N < 1.35 * GYRO.N


PROCESS = NoiseModel(N=1e-5, B=2e-4, T_B=20.0)


@pytest.mark.release
def test_a_random_walk_beyond_two_correlation_times_is_warned_of() -> None:
    curve = measured(PROCESS, 1e9)
    assert overbound(curve, PROCESS, RATE, horizon=38.0).warning is None
    found = overbound(curve, PROCESS, RATE, horizon=60.0)
    # Its limits are the curve itself.
    tau = np.append(curve.tau[curve.tau < 60.0], 60.0)
    walk = found.model.K**2 * tau / 3.0 + found.model.N**2 / tau
    ratio = np.sqrt(walk / PROCESS.allan_variance(tau, RATE))
    assert found.excess[0] == pytest.approx(float(ratio.max()), rel=0.05)
    # K^2 = S_B, what drives the process: K^2 tau / 3 over the closed form of a process at 3 T_B.
    shape = 1.0 - (3.0 - 4.0 * math.exp(-3.0) + math.exp(-6.0)) / 6.0
    assert found.excess[0] == pytest.approx(math.sqrt(3.0**2 / 3.0 / shape), rel=0.02)
    assert found.warning is not None
    assert "T_B = 20 s beyond 40 s" in found.warning
    assert "N+GM 1 times" in found.warning
    assert overbound(curve, PROCESS, RATE, horizon=60.0, family="N+GM").warning is None


@pytest.mark.release
def test_a_random_walk_far_too_large_is_refused_with_what_to_take() -> None:
    curve = measured(PROCESS, 1e9)
    with pytest.raises(ValueError, match=r"N\+GM 1 times.*At most 3 times is allowed") as error:
        overbound(curve, PROCESS, RATE, horizon=150.0)
    assert "T_B = 20 s beyond 40 s" in str(error.value)


def test_a_random_walk_far_too_large_is_given_where_it_is_allowed() -> None:
    curve = measured(PROCESS, 1e9)
    allowed = overbound(curve, PROCESS, RATE, horizon=150.0, most_excess=20.0)
    assert allowed.excess[0] > 3.0
    assert allowed.warning is not None


@pytest.mark.release
def test_a_log_too_short_for_a_horizon_is_told_from_a_family_that_does_not_suit() -> None:
    with pytest.raises(ValueError, match="No family is closer than"):
        overbound(measured(GYRO), GYRO, RATE, horizon=2000.0)


@pytest.mark.release
def test_the_density_is_bounded_above_the_band_s_lowest_frequency_only() -> None:
    walk = NoiseModel(N=1e-4, K=1e-5)
    found = overbound(measured(walk, 1e9), walk, RATE, family="N+GM")
    low = found.band[0]
    frequency = np.geomspace(low, RATE / 2.0, 300)
    assert np.all(found.model.psd(frequency) >= walk.psd(frequency))
    # A process is flat below 1 / (2 pi T_B), a walk is not: there they cross.
    crossing = brentq(
        lambda f: float(found.model.psd(f) - walk.psd(f)), 1e-3 * low, low, xtol=1e-12
    )
    assert f"bounded above {low:.3g} Hz only" in found.words[1]
    (passed,) = re.findall(r"exceeds the bound below (\S+) Hz", found.words[1])
    assert float(passed) == pytest.approx(crossing, rel=0.03)
    same = overbound(measured(walk, 1e9), walk, RATE)
    assert "does not exceed the bound" in same.words[1]


@pytest.mark.parametrize(("logs", "least"), few([(25, 0.83)], [(75, 0.89), (150, 0.91)]))
def test_limits_for_all_tau_together_hold_in_so_many_logs(logs: int, least: float) -> None:
    """Pointwise limits leave out the true curve in a quarter of the logs and more."""
    rng = np.random.default_rng(7)
    model = NoiseModel(N=1.0, K=0.03)
    pointwise = together = 0
    for _ in range(logs):
        curve = allan_variance(simulate(model, 1.0, 20_000, rng), 1.0, overlap="octave")
        within = curve.tau <= 1000.0
        truth = model.allan_variance(curve.tau, 1.0)[within]
        pointwise += bool(np.all(curve.limits(0.95)[1][within] ** 2 > truth))
        together += bool(np.all(simultaneous_upper(curve, 1000.0)[within] > truth))
    assert pointwise / logs < 0.85
    assert together / logs > least  # 95 % less two standard errors and more


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ({"family": "N+F"}, "family 'N\\+F' is not known"),
        ({"horizon": 0.3}, "shorter than two samples"),
        ({"longest": 1e9}, "the curve ends at"),
    ],
)
def test_what_cannot_be_done_is_refused(found: dict[str, object], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        overbound(measured(GYRO), GYRO, RATE, **found)  # type: ignore[arg-type]  # wrong on purpose


def joined(*parts: float | Array) -> Array:
    return np.asarray(block_diag(*(np.atleast_2d(part) for part in parts)))


def expected_over_true(model: NoiseModel, truth: NoiseModel, start: float) -> float:
    """Return the least ratio of the variance a filter expects to its true one as it coasts.

    It measures its angle every second for ten minutes, and then goes without for one.
    """
    own, real = model.state_space(1.0), truth.state_space(1.0)
    m, r = len(own.output), len(real.output)
    step, true_step = joined(1.0, own.transition), joined(1.0, real.transition)
    step[0, 1:], true_step[0, 1:] = own.output, real.output
    covariance = joined(0.0, np.eye(m) * start)
    truth_and_filter = joined(0.0, real.initial_variance, np.zeros((1 + m, 1 + m)))
    drive = joined(own.measurement_noise, own.process_noise)
    true_drive = joined(real.measurement_noise, real.process_noise, np.zeros((1 + m, 1 + m)))
    see = np.eye(1 + m)[0]
    error = np.concatenate(([1.0], np.zeros(r), -see))
    noise = (10.0 * truth.N) ** 2
    least = math.inf
    for k in range(660):
        covariance = step @ covariance @ step.T + drive
        truth_and_filter = (
            joined(true_step, step) @ truth_and_filter @ joined(true_step, step).T + true_drive
        )
        if k >= 600:
            least = min(least, covariance[0, 0] / float(error @ truth_and_filter @ error))
            continue
        gain = covariance @ see / (see @ covariance @ see + noise)
        covariance = (np.eye(1 + m) - np.outer(gain, see)) @ covariance
        update = np.eye(2 + r + m)
        update[1 + r :, 0] = gain
        update[1 + r :, 1 + r] -= gain
        truth_and_filter = update @ truth_and_filter @ update.T
        truth_and_filter[1 + r :, 1 + r :] += np.outer(gain, gain) * noise
    return least


@pytest.mark.release
def test_a_filter_that_loads_it_is_not_overconfident() -> None:
    start = GaussMarkov(GYRO.B, GYRO.T_B or 0.0).density * (GYRO.T_B or 0.0) / 2.0
    assert expected_over_true(GYRO, GYRO, start) == pytest.approx(1.0, abs=0.02)
    plain = NoiseModel(N=GYRO.N, K=0.5e-5)
    assert expected_over_true(plain, GYRO, start) < 0.9
    found = [of_gyro(family) for family in FAMILIES]
    ratios = [expected_over_true(one.model, GYRO, start) for one in found]
    assert min(ratios) >= 1.0
    assert max(ratios) < 1.8


def test_its_words_tell_how_large_it_is() -> None:
    found = of_gyro()
    size = number_text(math.sqrt(ratio_at_minimum(found)), 3)
    assert f"{size} times the measured one" in found.words[0]
    assert "from 0.00167 to 2.5 Hz" in found.words[0]


def test_draws_of_the_fit_widen_what_is_fitted_by_what_they_leave_open(rng) -> None:
    # Of white noise alone all limits scale with N^2: the 95 % point of N is where they all lie.
    model = NoiseModel(N=1e-4)
    spread = 0.02
    drawn = [NoiseModel(N=1e-4 * math.exp(spread * x)) for x in rng.standard_normal(4000)]
    curve = measured(model)
    wide = limits_of(curve, model, RATE, 60.0, (1 / RATE, 60.0), (1 / 600, RATE / 2))
    told = limits_of(curve, model, RATE, 60.0, (1 / RATE, 60.0), (1 / 600, RATE / 2), drawn=drawn)
    assert np.array_equal(told[0].value, wide[0].value)  # the measured curve is as sure as it was
    for limit in told[1:]:
        fitted = limit.of_term(model.terms[0])
        assert limit.value / fitted == pytest.approx(math.exp(2 * 1.645 * spread), rel=5e-3)


@pytest.mark.release
def test_limits_from_draws_lie_above_as_many_of_them_at_every_place_at_once(rng) -> None:
    steps = 0.3 * rng.standard_normal((400, 3))
    drawn = [
        replace(GYRO, N=GYRO.N * math.exp(0.1 * a), B=GYRO.B * math.exp(b), K=GYRO.K * math.exp(c))
        for a, b, c in steps
    ]
    band = (1 / 600, RATE / 2)
    limits = limits_of(measured(GYRO), GYRO, RATE, 60.0, (1 / RATE, 60.0), band, drawn=drawn)[1:]
    below = [
        all(
            np.all(sum(limit.of_term(term) for term in model.terms) <= limit.value)
            for limit in limits
        )
        for model in drawn
    ]
    assert np.mean(below) == pytest.approx(0.95, abs=0.01)
