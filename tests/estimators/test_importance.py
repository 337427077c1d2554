import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.estimators.posterior import Mixture, Weighted, sample_adaptively

LEVELS = np.array([0.025, 0.5, 0.975])
ERROR = np.array([0.008, 0.03, 0.008])
WIDE = Mixture(np.ones(1), np.zeros((1, 2)), 4.0 * np.eye(2)[None])


def quantiles(found: Weighted, rng: np.random.Generator) -> np.ndarray:
    return np.quantile(found.points[found.drawn(20_000, rng)], LEVELS, axis=0)


def test_a_correlated_normal_distribution_far_from_the_first_mixture_is_found(rng) -> None:
    mean, covariance = np.array([3.0, -2.0]), np.array([[0.5, 0.45], [0.45, 0.5]])
    target = stats.multivariate_normal(mean, covariance)
    found = sample_adaptively(target.logpdf, WIDE, rng, size=1024, wanted=2000, most=12_288)
    assert found.effective >= 2000
    chance = stats.norm(mean, np.sqrt(np.diag(covariance))).cdf(quantiles(found, rng))
    assert (np.abs(chance - LEVELS[:, None]) < ERROR[:, None]).all(), chance
    draws = found.points[found.drawn(20_000, rng)]
    assert np.corrcoef(draws.T)[0, 1] == pytest.approx(0.9, abs=0.02)


def test_a_curved_ridge_and_an_end_keep_their_quantiles(rng) -> None:
    # y about x^2, and x above -1 only: its margin is a truncated normal distribution.
    def logarithm(points: np.ndarray) -> np.ndarray:
        x, y = points.T
        return np.where(x > -1.0, -0.5 * x**2 - 0.5 * ((y - x**2) / 0.3) ** 2, -np.inf)

    first = Mixture(
        np.array([0.5, 0.25, 0.25]),
        np.array([[0.0, 0.0], [-0.7, 0.5], [1.5, 2.0]]),
        np.array([np.eye(2), 0.3 * np.eye(2), 4.0 * np.eye(2)]),
    )
    found = sample_adaptively(logarithm, first, rng, size=2048, wanted=4000, most=40_960)
    assert found.effective >= 4000
    x = stats.truncnorm(-1.0, np.inf)
    chance = x.cdf(quantiles(found, rng)[:, 0])
    assert (np.abs(chance - LEVELS) < ERROR).all(), chance
    y = x.rvs(200_000, random_state=rng) ** 2 + 0.3 * rng.standard_normal(200_000)
    chance = np.searchsorted(np.sort(y), quantiles(found, rng)[:, 1]) / len(y)
    assert (np.abs(chance - LEVELS) < ERROR).all(), chance


def test_two_modes_keep_their_shares(rng) -> None:
    def logarithm(points: np.ndarray) -> np.ndarray:
        left = stats.multivariate_normal([-3.0, 0.0], 0.01 * np.eye(2)).logpdf(points)
        right = stats.multivariate_normal([3.0, 1.0], 0.09 * np.eye(2)).logpdf(points)
        return np.logaddexp(np.log(0.2) + left, np.log(0.8) + right)

    first = Mixture(
        np.array([0.5, 0.5]), np.array([[-2.0, 0.0], [2.0, 0.0]]), np.array([np.eye(2)] * 2)
    )
    found = sample_adaptively(logarithm, first, rng, size=2048, wanted=2000, most=20_480)
    assert found.effective >= 2000
    assert found.weights[found.points[:, 0] < 0].sum() == pytest.approx(0.2, abs=0.03)


def test_the_number_of_effective_points_is_that_of_equal_ones() -> None:
    points = np.zeros((8, 2))
    assert Weighted(points, np.full(8, 1 / 8)).effective == pytest.approx(8.0)
    assert Weighted(points, np.array([0.5, 0.5, *np.zeros(6)])).effective == pytest.approx(2.0)


def test_points_are_drawn_as_often_as_they_weigh(rng) -> None:
    weights = np.array([0.1, 0.0, 0.6, 0.3])
    which = Weighted(np.arange(8.0).reshape(4, 2), weights).drawn(1000, rng)
    assert np.abs(np.bincount(which, minlength=4) - 1000 * weights).max() <= 1
    # In random order: any part of them is a sample too.
    assert np.abs(np.bincount(which[:250], minlength=4) / 250 - weights).max() < 0.12


def test_too_few_points_are_returned_as_they_are(rng) -> None:
    narrow = stats.multivariate_normal([40.0, 40.0], 1e-6 * np.eye(2))
    found = sample_adaptively(narrow.logpdf, WIDE, rng, size=256, wanted=1000, most=512)
    assert len(found.points) == 512
    assert found.effective < 100


def test_draws_of_a_mixture_have_its_density(rng) -> None:
    mixture = Mixture(
        np.array([0.3, 0.7]),
        np.array([[0.0, 0.0], [6.0, 1.0]]),
        np.array([np.eye(2), [[1.0, 0.8], [0.8, 1.0]]]),
    )
    points = mixture.draw(16_384, rng)
    assert np.mean(points[:, 0] < 3.0) == pytest.approx(0.3, abs=0.02)
    # Up to a constant that both components share.
    x = np.linspace(-60.0, 66.0, 1500)
    grid = np.array(np.meshgrid(x, x, indexing="ij")).reshape(2, -1).T
    mass = mixture.densities(grid).sum(axis=0)
    assert mass[0] / mass.sum() == pytest.approx(0.3, abs=2e-3)


def test_a_step_towards_points_is_that_of_expectation_and_maximisation(rng) -> None:
    points = np.concatenate(
        [rng.standard_normal((60, 2)), [5.0, 2.0] + 0.5 * rng.standard_normal((140, 2))]
    )
    mixture = Mixture(
        np.array([0.5, 0.3, 0.2]),
        np.array([[0.5, 0.0], [4.0, 2.0], [90.0, 90.0]]),
        np.array([np.eye(2), [[1.0, 0.3], [0.3, 0.5]], np.eye(2)]),
    )
    found = mixture.fitted(points)
    # Of six degrees of freedom, which with two dimensions are even.
    parts = np.column_stack(
        [
            weight * stats.multivariate_t(mean, scale, df=6).pdf(points)
            for weight, mean, scale in zip(
                mixture.weights, mixture.means, mixture.scales, strict=True
            )
        ]
    )
    parts /= parts.sum(axis=1, keepdims=True) * len(points)
    mass = parts.sum(axis=0)
    # The third has next to nothing, and is left out.
    assert found.weights == pytest.approx(mass[:2] / mass[:2].sum())
    for k in range(2):
        away = points - mixture.means[k]
        square = np.einsum("ni,ij,nj->n", away, np.linalg.inv(mixture.scales[k]), away)
        near = parts[:, k] * (6 + 2) / (6 + square)
        mean = near @ points / near.sum()
        away = points - mean
        scale = np.einsum("n,ni,nj->ij", near, away, away) / mass[k]
        # As few points are too narrow in some direction.
        scale[np.diag_indices(2)] *= 1.0 + 2 * np.sum(parts[:, k] ** 2) / mass[k] ** 2
        assert found.means[k] == pytest.approx(mean)
        assert found.scales[k] == pytest.approx(scale)
    far = Mixture(np.ones(1), np.array([[500.0, 500.0]]), 1e-6 * np.eye(2)[None])
    alone = far.fitted(points[:5])
    assert alone is far
