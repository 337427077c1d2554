import numpy as np
import pytest
from scipy.stats import chi2

from imubench_pipeline.allan import cluster_sizes
from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.allan.phase import count_presence
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.spectral_degrees import compute_degrees_of_freedom
from tests.conftest import few
from tests.test_variance_covariance import SHORT_LOG, exact, sample_covariance

SAMPLES = 900
SIZES = np.array([1, 2, 5, 10, 20, 50, 75, 100, 225, 300, 400, 450])


@pytest.mark.parametrize("model", SHORT_LOG)
def test_the_degrees_are_those_of_the_exact_double_sum(model: NoiseModel) -> None:
    variance = [exact(model, SAMPLES, np.array([n])).item() for n in SIZES]
    mean = model.allan_variance(SIZES, 1.0)
    found = compute_degrees_of_freedom(model, 1.0, SIZES, SAMPLES)
    np.testing.assert_allclose(found[0], 2.0 * mean**2 / variance, rtol=0.01)
    assert found[0][-1] == found[1][-1] == 1.0  # one difference is left


@pytest.mark.parametrize(
    ("model", "exponent"), [(NoiseModel(Q=1.0), 2), (NoiseModel(N=1.0), 0), (NoiseModel(B=1.0), -1)]
)
def test_power_laws_agree_with_greenhall_and_riley(model: NoiseModel, exponent: int) -> None:
    samples = 100_000
    sizes = cluster_sizes(samples)
    sizes = sizes[sizes > 20]  # flicker noise is sampled here, and continuous there
    expected = [equivalent_degrees(exponent, int(n), samples - 2 * int(n) + 1) for n in sizes]
    found = compute_degrees_of_freedom(model, 1.0, sizes, samples)[0]
    np.testing.assert_allclose(found, expected, rtol=0.015)


def test_the_unit_of_the_log_changes_no_degrees() -> None:
    one, other = (
        compute_degrees_of_freedom(
            NoiseModel(Q=3.0 * unit, N=unit, B=0.5 * unit, T_B=30.0, K=0.1 * unit),
            1.0,
            SIZES,
            SAMPLES,
        )
        for unit in (1.0, 1e-3)
    )
    np.testing.assert_allclose(other[0], one[0], rtol=1e-6)
    np.testing.assert_allclose(other[1], one[1], rtol=1e-6)


def masked_quadratic_form(
    model: NoiseModel, n: int, there: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of the covariance of the differences that are there, from the definition."""
    samples = len(there) + 2 * n - 1
    theta = np.zeros((samples + 1, samples + 1))
    theta[1:, 1:] = sample_covariance(model, samples).cumsum(axis=0).cumsum(axis=1)
    rows = theta[2 * n :] - 2 * theta[n:-n] + theta[: -2 * n]
    both = rows[:, 2 * n :] - 2 * rows[:, n:-n] + rows[:, : -2 * n]
    return np.linalg.eigvalsh(both[np.ix_(there, there)]), both


@pytest.mark.parametrize("model", SHORT_LOG[:4])
@pytest.mark.parametrize("n", few([20, 180], [100]))
def test_with_a_hole_the_differences_that_are_left_count(model: NoiseModel, n: int) -> None:
    log = np.zeros(SAMPLES)
    log[420:500] = np.nan
    where = count_presence([log], SAMPLES)
    begin = np.arange(SAMPLES - 2 * n + 1)
    missing = np.concatenate(([0], np.cumsum(np.isnan(log))))
    there = np.ones(len(begin), dtype=bool)
    for first in (begin, begin + n):
        there &= missing[first + n] - missing[first] <= n - np.ceil(0.9 * n)
    weights, _ = masked_quadratic_form(model, n, there)
    found = compute_degrees_of_freedom(
        model, 1.0, np.array([n]), SAMPLES, None, where, np.array([there.mean()])
    )
    expected = weights.sum() ** 2 / (weights @ weights)
    assert found[0][0] == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("model", SHORT_LOG[:4])
@pytest.mark.parametrize("part", few([2.3, 5.0], [3.0, 8.0]))
def test_upper_limits_hold_where_few_differences_are_left(model: NoiseModel, part: float) -> None:
    """The quadratic form itself is drawn, from its exact eigenvalues."""
    n = round(400 / part)
    there = np.ones(400 - 2 * n + 1, dtype=bool)
    weights, _ = masked_quadratic_form(model, n, there)
    weights = np.maximum(weights, 0.0) / weights.sum()
    rng = np.random.default_rng(n)
    drawn = np.zeros(40_000)
    for weight in weights[weights > 1e-7]:
        drawn += weight * rng.standard_normal(len(drawn)) ** 2
    degrees = compute_degrees_of_freedom(model, 1.0, np.array([n]), 400)
    edf, upper = degrees[0][0], degrees[1][0]
    below = np.mean(drawn < chi2.ppf(0.025, upper) / upper)
    above = np.mean(drawn > chi2.ppf(0.975, edf) / edf)
    assert 0.020 < below < 0.030
    assert 0.021 < above < 0.032


def test_a_ramp_and_a_line_leave_only_their_products_with_the_noise() -> None:
    """Their squares do not vary: over many drawn logs the spread of the Allan variance agrees."""
    n, samples = 40, 600
    model = NoiseModel(N=1.0, R=0.02)
    rng = np.random.default_rng(1)
    drawn = rng.standard_normal((4000, samples)) + 0.02 * np.arange(samples)
    sums = np.concatenate((np.zeros((4000, 1)), drawn.cumsum(axis=1)), axis=1)
    variance = np.mean((sums[:, 2 * n :] - 2 * sums[:, n:-n] + sums[:, : -2 * n]) ** 2, axis=1)
    expected = 2.0 * variance.mean() ** 2 / variance.var()
    found = compute_degrees_of_freedom(model, 1.0, np.array([n]), samples)[0][0]
    assert found == pytest.approx(expected, rel=0.08)
    assert (
        found
        > 2.0 * compute_degrees_of_freedom(NoiseModel(N=1.0), 1.0, np.array([n]), samples)[0][0]
    )


def test_segments_add_up() -> None:
    model = NoiseModel(N=1.0, B=0.3, T_B=20.0, further=[GaussMarkov(0.2, 100.0)])
    sizes = np.array([1, 10, 50])
    one = compute_degrees_of_freedom(model, 1.0, sizes, 500)[0]
    two = compute_degrees_of_freedom(model, 1.0, sizes, 1000, ((0, 500), (500, 1000)))[0]
    np.testing.assert_allclose(two, 2.0 * one, rtol=1e-9)
