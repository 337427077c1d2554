"""Ordinates, their bins, and sizes of signals, against plain least squares and integrals."""

import numpy as np
import pytest
import scipy.fft

from imubench_pipeline.estimators.deterministic.means import Means, Part
from imubench_pipeline.estimators.deterministic.ordinates import (
    Ordinates,
    _compute_log_determinant,
    average_covariance,
)
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from imubench_pipeline.estimators.deterministic.verdict import compare_halves
from imubench_pipeline.estimators.whittle import Maximum, Terms

RATE, BLOCK = 100.0, 50
INTERVAL = BLOCK / RATE


def of(*values: np.ndarray, highest: float | None = None) -> Ordinates:
    parts = tuple(Part(1000 * i, x, np.ones(len(x)), 0.0) for i, x in enumerate(values))
    return Ordinates(Means(BLOCK, RATE, parts), highest)


def dct(values: np.ndarray) -> np.ndarray:
    return np.asarray(scipy.fft.dct(values, type=2, norm="ortho", axis=-1)[..., 1:])


def test_amplitudes_are_those_of_weighted_least_squares_in_each_part(rng) -> None:
    first, second = rng.standard_normal(100).cumsum(), rng.standard_normal(150)
    ordinates = of(first, second, highest=0.8)
    k = np.concatenate([np.arange(1, 100) / 200.0, np.arange(1, 150) / 300.0]) / INTERVAL
    np.testing.assert_allclose(ordinates.frequency, k)
    assert ordinates.used.tolist() == (k <= 0.8).tolist()
    np.testing.assert_allclose(ordinates.length, np.repeat([50.0, 75.0], [99, 149]))
    density = 1.0 + 0.1 / k
    steps = [Regressor("step", 0, 30.0), Regressor("sinusoid", 0, 0.02), Regressor("step", 1, 70.5)]
    sizes, covariance, residual, leverage = ordinates.solve(steps, density)
    X = np.zeros((4, 248))
    X[0, :99], X[1:3, :99] = dct(steps[0].means(100)[0]), dct(steps[1].means(100))
    X[3, 99:] = dct(steps[2].means(150)[0])
    y = np.concatenate([dct(first), dct(second)])
    root = np.sqrt(np.where(k <= 0.8, INTERVAL / density, 0.0))
    np.testing.assert_allclose(sizes, np.linalg.lstsq((X * root).T, y * root)[0])
    np.testing.assert_allclose(covariance, np.linalg.inv((X * root**2) @ X.T), atol=1e-9)
    np.testing.assert_allclose(residual, y - sizes @ X, atol=1e-12)
    expected = np.einsum("ik,ij,jk->k", X * root, covariance, X * root)
    np.testing.assert_allclose(leverage, expected, atol=1e-9)
    used = k <= 0.8
    variance = density[used] / INTERVAL
    likelihood = -0.5 * np.sum(np.log(variance) + residual[used] ** 2 / variance)
    assert ordinates.log_likelihood(residual, density) == pytest.approx(likelihood)


def test_bins_are_means_of_ordinates_by_what_they_count(rng) -> None:
    ordinates = of(rng.standard_normal(3000))
    weight = rng.uniform(0.1, 1.0, 2999)
    residual = rng.standard_normal(2999)
    found = ordinates.spectrum(residual, weight)
    assert found.ordinates.sum() == pytest.approx(weight.sum())
    np.testing.assert_allclose(found.ordinates[:64], weight[:64])
    power = residual**2 * INTERVAL
    np.testing.assert_allclose(found.density[:64], power[:64] / weight[:64])
    assert (found.density * found.ordinates).sum() == pytest.approx(power.sum())
    f = ordinates.frequency
    last = np.flatnonzero(f <= found.upper[-1])
    inside = (f > found.lower[-1]) & (f < found.upper[-1])
    assert found.frequency[-1] == pytest.approx(f[inside].mean())
    assert found.ordinates[-1] == pytest.approx(weight[inside].sum())
    step = f[1] - f[0]
    assert found.upper[-1] == pytest.approx(f[last[-1]] + 0.5 * step)
    np.testing.assert_allclose(found.lower[1:], found.upper[:-1])
    assert (found.duration, found.rate) == (1500.0, RATE)


def test_a_log_of_few_ordinates_or_of_one_value_is_not_usable(rng) -> None:
    assert of(rng.standard_normal(65)).is_usable and not of(rng.standard_normal(64)).is_usable
    assert not of(np.ones(100)).is_usable


def test_errors_are_averaged_over_the_walks_that_the_log_allows(rng) -> None:
    values = np.cumsum(0.05 * rng.standard_normal(300)) + rng.standard_normal(300)
    ordinates = of(values)
    step = Regressor("step", 0, 120.0)
    fit = ordinates.fit([step])
    walk = 1.0 / (2.0 * np.pi * ordinates.frequency) ** 2
    K = fit.noise.parameter("K")
    rest = np.maximum(fit.density - K**2 * walk, 1e-3 * fit.density)
    row, y = dct(step.means(300)[0]), dct(values)
    unit = walk * rest[0] / walk[0]

    def at(x: float) -> tuple[float, float, float]:
        """Restricted likelihood, size and variance for a walk of x at the lowest frequency."""
        weight = INTERVAL / (rest + x**2 * unit)
        variance = 1.0 / np.sum(weight * row**2)
        size = variance * np.sum(weight * row * y)
        left = np.sum(-np.log(weight) + weight * (y - size * row) ** 2)
        return float(0.5 * np.log(variance) - 0.5 * left), float(size), float(variance)

    x = np.concatenate([np.linspace(0.0, 2.0, 200), np.geomspace(2.0, 100.0, 200)[1:]])
    likelihood, size, variance = np.array([at(one) for one in x]).T
    weight = np.exp(likelihood - likelihood.max())
    mass = np.trapezoid(weight, x)
    mean = np.trapezoid(weight * size, x) / mass
    expected = np.trapezoid(weight * (variance + (size - mean) ** 2), x) / mass
    # A sum over two dozen walks stands for the integral.
    assert average_covariance(ordinates, fit)[0, 0] == pytest.approx(expected, rel=0.05)


def test_two_halves_have_each_their_slow_noise(rng) -> None:
    # Of expected power in both halves: a walk that is twice as strong in the second.
    n, N, K = 1200, 0.1, 0.3
    white = N / np.sqrt(INTERVAL) * rng.standard_normal(n)
    steps = K * np.sqrt(INTERVAL) * rng.standard_normal(n) * np.repeat([1.0, 3.0], n // 2)
    means = Means(BLOCK, RATE, (Part(500, white + np.cumsum(steps), np.ones(n), 0.0),))
    noise = Maximum(Terms("NFK", 1), np.array([N**2, 0.0, K**2, 0.0]), np.array([9.0]), 0.0, 0.0)
    found = {one.of: one for one in compare_halves(means, noise)}
    for one in found.values():
        assert one.first == pytest.approx(1.0, rel=0.1)
        assert one.second == pytest.approx(3.0, rel=0.1)
        # As it is expected, of a walk of one strength and white noise of any up to ten times.
        walk = K**2 * INTERVAL**2 / (4.0 * np.sin(np.pi * np.arange(1, 600) / 1200.0) ** 2)
        strengths, whites = np.linspace(1.0, 9.0, 41), np.geomspace(0.1, 10.0, 21)
        both = N**2 * whites[:, None] + (strengths[:, None] * walk)[:, None]
        costs = [
            (np.log(both) + half / both - np.log(half) - 1.0).sum(axis=-1).min(axis=1)
            for half in (N**2 + walk, N**2 + 9.0 * walk)
        ]
        expected = float(np.sum(costs, axis=0).min())
        assert one.ratio == pytest.approx(expected, rel=0.25) and one.differ
        assert (one.begin, one.middle, one.end) == (5.0, 305.0, 605.0)
    assert set(found) == {"K", "slow noise"}
    # Without a walk the slow noise alone is compared; a short log has no halves.
    slow = Maximum(Terms("NFK", 1), np.array([N**2, K**2, 0.0, 0.0]), np.array([9.0]), 0.0, 0.0)
    assert [one.of for one in compare_halves(means, slow)] == ["slow noise"]
    for blocks, number in ((256, 2), (255, 0)):
        short = Means(BLOCK, RATE, (Part(0, means.parts[0].mean[:blocks], np.ones(blocks), 0.0),))
        assert len(list(compare_halves(short, noise))) == number


def test_the_determinant_of_amplitudes_of_any_unit(rng) -> None:
    root = rng.standard_normal((3, 3)) * np.array([1e-6, 1.0, 1e3])
    covariance = root.T @ root
    assert _compute_log_determinant(covariance) == pytest.approx(
        np.linalg.slogdet(covariance)[1], abs=1e-3
    )
