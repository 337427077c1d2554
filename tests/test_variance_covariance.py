from functools import lru_cache

import numpy as np
import pytest

from imubench_pipeline.allan import allan_variance, cluster_sizes
from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance

MTI_7 = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)

SHORT_LOG = [
    NoiseModel(N=1.0),
    NoiseModel(K=1.0),
    NoiseModel(B=1.0, T_B=10.0),
    NoiseModel(B=1.0, T_B=50.0),
    NoiseModel(B=1.0, T_B=500.0),
    NoiseModel(N=10.0, B=1.0, T_B=50.0, K=0.02),
]


def sample_covariance(model: NoiseModel, samples: int) -> np.ndarray:
    """Covariance of the samples at 1 Hz, from the definitions of the processes."""
    t = np.arange(samples)
    found = model.N**2 * np.eye(samples) + model.K**2 * np.minimum.outer(t, t)
    if model.T_B is not None:
        driving = 2 * model.B**2 * np.log(2) / (np.pi * 0.4365**2 * model.T_B)
        found += driving * model.T_B / 2 * np.exp(-np.abs(np.subtract.outer(t, t)) / model.T_B)
    return found


@lru_cache(maxsize=1)
def phase_covariance(model: NoiseModel, samples: int) -> np.ndarray:
    """Covariance of the sums of the samples, from 0 of them on."""
    theta = np.zeros((samples + 1, samples + 1))
    theta[1:, 1:] = sample_covariance(model, samples).cumsum(axis=0).cumsum(axis=1)
    return theta


def exact(model: NoiseModel, samples: int, sizes: np.ndarray) -> np.ndarray:
    """Covariance of the Allan variances by the double sum over all second differences.

    For Gaussian x and y the covariance of x^2 and y^2 is 2 E(xy)^2.
    """
    theta = phase_covariance(model, samples)
    found = np.empty((len(sizes), len(sizes)))
    for i, n in enumerate(sizes):
        rows = theta[2 * n :] - 2 * theta[n:-n] + theta[: -2 * n]
        for j, m in enumerate(sizes[: i + 1]):
            both = rows[:, 2 * m :] - 2 * rows[:, m:-m] + rows[:, : -2 * m]
            found[i, j] = found[j, i] = 2 * np.mean(both**2) / (2.0 * n**2 * 2.0 * m**2)
    return found


@pytest.mark.parametrize("model", SHORT_LOG)
def test_the_covariance_is_the_exact_double_sum(model: NoiseModel) -> None:
    samples = 900
    sizes = np.array([1, 2, 5, 10, 20, 50, 75, 100, 225])
    expected = exact(model, samples, sizes)
    found = compute_variance_covariance(model, 1.0, samples, sizes)
    spread = np.sqrt(np.diag(expected))
    ratio = np.sqrt(np.diag(found)) / spread
    ninth = sizes <= samples / 9
    np.testing.assert_allclose(ratio[ninth], 1.0, atol=0.015)
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)
    difference = np.abs(found - expected) / np.outer(spread, spread)
    assert difference[np.ix_(ninth, ninth)].max() < 0.04
    assert difference.max() < 0.1


def test_the_differences_of_a_short_log_are_counted() -> None:
    sizes = np.array([1, 2, 4])
    expected = np.diag(exact(NoiseModel(N=1.0), 40, sizes))
    found = np.diag(compute_variance_covariance(NoiseModel(N=1.0), 1.0, 40, sizes))
    # within 0.0021; one difference more or less is 0.0125
    np.testing.assert_allclose(np.sqrt(found / expected), 1.0, atol=0.004)


def test_white_noise_has_the_degrees_of_freedom_of_greenhall_and_riley() -> None:
    samples = 3_600_000
    sizes = cluster_sizes(samples, longest=1 / 9)
    variance = 0.01 / sizes
    expected = [2 / equivalent_degrees(0, int(n), samples - 2 * int(n) + 1) for n in sizes]
    found = (
        np.diag(compute_variance_covariance(NoiseModel(N=0.1), 1.0, samples, sizes)) / variance**2
    )
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(expected), rtol=0.005)


def test_random_walk_has_the_degrees_of_freedom_of_greenhall_and_riley() -> None:
    # clusters of many samples: there the walk is continuous, as in their formula
    samples = 3_600_000
    sizes = cluster_sizes(samples, longest=1 / 9)[12:]
    variance = sizes / 3 * (1 + 0.5 / sizes**2)
    expected = [2 / equivalent_degrees(-2, int(n), samples - 2 * int(n) + 1) for n in sizes]
    found = (
        np.diag(compute_variance_covariance(NoiseModel(K=1.0), 1.0, samples, sizes)) / variance**2
    )
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(expected), rtol=0.015)


@pytest.mark.release  # the exact double sums of all of them are made every day
@pytest.mark.parametrize(
    "model",
    [NoiseModel(N=1.0, B=0.5, T_B=30.0), NoiseModel(N=1.0), NoiseModel(N=1.0, K=0.05)],
)
def test_the_covariance_is_that_of_simulated_logs(model: NoiseModel) -> None:
    samples, members = 9000, 500
    sizes = np.array([1, 4, 16, 64, 128, 256, 512, 1000])
    rng = channel_rng(20260102, model.name)
    logs = (simulate(model, 1.0, samples, rng) for _ in range(members))
    found = np.array([allan_variance(log, 1.0, cluster_sizes=sizes).variance for log in logs])
    expected = compute_variance_covariance(model, 1.0, samples, sizes)
    spread = np.sqrt(np.diag(expected))
    # A standard deviation from 500 logs is itself known to 3 or, where the tail is long, 6 %.
    np.testing.assert_allclose(found.std(axis=0) / spread, 1.0, atol=0.15)
    np.testing.assert_allclose(
        np.cov(found.T) / np.outer(spread, spread), expected / np.outer(spread, spread), atol=0.2
    )


def test_the_integral_is_that_on_a_fine_grid() -> None:
    # sizes without a common factor, and pairs far apart, where sin^4 turns fastest
    sizes = np.array([1, 3, 17, 101, 128, 997, 2000])
    samples, points = 10_000_000, 1 << 17
    omega = np.pi * (np.arange(points) + 0.5) / points
    gain = (
        4 * np.sin(np.outer(sizes, omega / 2)) ** 4 / np.sin(omega / 2) ** 2 / sizes[:, None] ** 2
    )
    shaped = gain * MTI_7.sampled_spectrum(omega, 100.0)
    expected = shaped @ shaped.T / points / (2 * (samples - 1.5 * np.minimum.outer(sizes, sizes)))
    spread = np.sqrt(np.diag(expected))
    found = compute_variance_covariance(MTI_7, 100.0, samples, sizes)
    np.testing.assert_allclose(
        found / np.outer(spread, spread), expected / np.outer(spread, spread), atol=1e-3
    )


def test_it_is_a_covariance_and_the_same_each_time() -> None:
    sizes = cluster_sizes(3_600_000)
    found = compute_variance_covariance(MTI_7, 100.0, 3_600_000, sizes)
    np.testing.assert_array_equal(
        found, compute_variance_covariance(MTI_7, 100.0, 3_600_000, sizes)
    )
    np.testing.assert_array_equal(found, found.T)
    correlation = found / np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert np.linalg.eigvalsh(correlation).min() > -1e-9
    assert np.abs(correlation).max() <= 1 + 1e-12
