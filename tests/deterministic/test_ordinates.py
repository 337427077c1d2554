"""Ordinates, their bins, and sizes of signals, against plain least squares and integrals."""

import numpy as np
import pytest
import scipy.fft

from imubench_pipeline.estimators.deterministic.means import Means, Part
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates, Regressor

RATE, BLOCK = 100.0, 50
INTERVAL = BLOCK / RATE


def of(*values: np.ndarray, highest: float | None = None) -> Ordinates:
    parts = tuple(Part(1000 * i, x, np.ones(len(x))) for i, x in enumerate(values))
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
