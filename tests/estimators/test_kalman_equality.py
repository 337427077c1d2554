"""The Whittle likelihood against the exact one, that of a Kalman filter on means of 10 s."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from scipy import optimize
from scipy.integrate import quad

from imubench_pipeline.estimators.intervals import compute_cramer_rao_bounds
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import block_sums, simulate
from tests.conftest import few
from tests.estimators.test_least_squares import C102, MTI_7

H = 10.0
"""Length of a block, s."""

HOURS_10 = 36_000.0
PAPERS = Terms("NK", 1)
NAMES = ("N", "K", "B", "T_B")

VARIANCE = np.log(2) / (np.pi * 0.4365**2)
"""Of a Gauss-Markov process of B = 1: S_B T_B / 2."""


@njit
def filtered(means: np.ndarray, h: float, N: float, K: float, B: float, T_B: float) -> float:
    """-log L of the means of adjacent blocks, of a level that is not known.

    States are the two processes at the beginning of a block. Its mean and its end are integrals
    of the same driving noise over the block, in continuous time.
    """
    x = h / T_B
    a, b = np.exp(-x), -np.expm1(-x)
    variance = VARIANCE * B * B
    seen = b / x
    end_g, end_w = variance * b * (1 + a), K * K * h
    both_g, both_w = variance * b * b / x, K * K * h / 2
    own = variance * (2 * x - 3 + 4 * a - a * a) / (x * x) + K * K * h / 3 + N * N / h
    g, w = 0.0, means[0]
    # The level of the log: a spread far beyond all else.
    gg, gw, ww = variance, 0.0, 1e8 * (N * N / h + variance + K * K * h)
    cost = -0.5 * np.log(ww)
    for mean in means:
        to_g, to_w = seen * gg + gw, seen * gw + ww
        spread = seen * to_g + to_w + own
        error = mean - seen * g - w
        cost += 0.5 * (np.log(spread) + error * error / spread)
        gain_g, gain_w = a * to_g + both_g, to_w + both_w
        g = a * g + gain_g / spread * error
        w = w + gain_w / spread * error
        gg = a * a * gg + end_g - gain_g * gain_g / spread
        gw = a * gw - gain_g * gain_w / spread
        ww = ww + end_w - gain_w * gain_w / spread
    return cost


def dense(means: np.ndarray, h: float, N: float, K: float, B: float, T_B: float) -> float:
    """The same from the covariance of the steps between the means."""
    n = len(means)
    lag = np.array(
        [
            quad(lambda u, d=d: (1 - abs(u)) * np.exp(-abs(d + u) * h / T_B), -1, 1, points=[0])[0]
            for d in range(n)
        ]
    )
    i = np.arange(n)
    covariance = VARIANCE * B**2 * lag[np.abs(i[:, None] - i)]
    covariance += K**2 * h * (np.minimum(i[:, None], i) + 0.5) - K**2 * h / 6 * np.eye(n)
    covariance += N**2 / h * np.eye(n)
    of_steps = np.diff(np.diff(covariance, axis=0), axis=1)
    steps = np.diff(means)
    logarithm = np.linalg.slogdet(of_steps)[1]
    return 0.5 * float(logarithm + steps @ np.linalg.solve(of_steps, steps))


def test_the_filter_has_the_likelihood_of_the_covariance(rng) -> None:
    means = 9.81 + np.cumsum(rng.standard_normal(40)) + rng.standard_normal(40)
    parameters = [
        (2.0, 0.3, 1.0, 25.0),
        (3.0, 0.1, 1.0, 25.0),
        (2.0, 0.3, 2.0, 25.0),
        (2.0, 0.3, 1.0, 3.0),
        (1.0, 0.0, 2.0, 400.0),
    ]
    exact = [dense(means, H, *values) for values in parameters]
    found = [filtered(means, H, *values) for values in parameters]
    np.testing.assert_allclose(np.diff(found), np.diff(exact), atol=1e-5)


def values_of(found: Maximum) -> np.ndarray:
    """N, K, B and T_B."""
    K = found.parameter("K") if "K" in found.terms.linear else 0.0
    return np.array([found.parameter("N"), K, found.biases[0], found.times[0]])


def fitted(means: np.ndarray, rate: float, terms: Terms) -> np.ndarray:
    """What the Whittle likelihood says of the means of blocks of 10 s."""
    spectrum = compute_spectra([means], len(means), 1 / H)[0]
    blocks = np.full(len(spectrum.frequency), round(H * rate))
    spectrum = replace(spectrum, rate=rate, block=blocks)
    return values_of(make_whittle(spectrum, 0.5 / H).maximum(terms))


def most_likely(means: np.ndarray, starts: list[np.ndarray], free: np.ndarray) -> np.ndarray:
    """N, K, B and T_B that the filter likes best; what is not free stays as at the first start."""

    def parameters(x: np.ndarray) -> np.ndarray:
        values = starts[0].copy()
        values[free] = np.exp(x)
        return values

    def cost(x: np.ndarray) -> float:
        return filtered(means, H, *parameters(x))

    results = []
    for start in starts:
        at = np.log(np.maximum(start[free], 0.1 * starts[-1][free]))
        simplex = at + 0.2 * np.eye(len(at) + 1, len(at))
        options = {"xatol": 1e-4, "fatol": 1e-5, "maxiter": 1500, "initial_simplex": simplex}
        results.append(optimize.minimize(cost, at, method="Nelder-Mead", options=options))
    return parameters(min(results, key=lambda result: result.fun).x)


def truth_of(model: NoiseModel) -> np.ndarray:
    return np.array([model.N, model.K, model.B, model.T_B])


def estimates(
    model: NoiseModel, rate: float, logs: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """N, K, B and T_B of simulated means of 10 s by both likelihoods, shape (4, logs)."""
    truth, width = truth_of(model), round(H * rate)
    terms = PAPERS if model.K > 0 else Terms("N", 1)
    pairs = []
    for _ in range(logs):
        means = block_sums(model, rate, round(HOURS_10 / H), width, rng) / width
        found = fitted(means, rate, terms)
        pairs.append((found, most_likely(means, [found, truth], truth > 0)))
    found, exact = np.array(pairs).transpose(1, 2, 0)
    return found, exact


@pytest.mark.parametrize(
    ("model", "rate", "logs"),
    few([(C102, 50.0, 10)], [(C102, 50.0, 25), (MTI_7, 100.0, 25)]),
    ids=["C102", "C102 in more logs", "MTi-7"],
)
def test_estimates_are_those_of_an_exact_likelihood(
    rng, model: NoiseModel, rate: float, logs: int
) -> None:
    truth = truth_of(model)
    found, exact = estimates(model, rate, logs, rng)
    bounds = compute_cramer_rao_bounds(model, rate, HOURS_10, 0.5 / H)
    for i, name in enumerate(NAMES):
        # All are identified in 10 h.
        assert bounds[name] < 0.3
        assert np.median(np.abs(found[i] / exact[i] - 1)) < 0.01, name
        # They are off by the same, not just each near its own mean.
        wrong, exactly = np.log(found[i] / truth[i]), np.log(exact[i] / truth[i])
        assert np.corrcoef(wrong, exactly)[0, 1] > 0.99
        assert np.mean(wrong - exactly) == pytest.approx(0.0, abs=0.05 * bounds[name])
        assert np.std(wrong) == pytest.approx(np.std(exactly), rel=0.05)


@pytest.mark.parametrize("logs", few([4], [25]))
def test_a_correlation_far_longer_than_a_fiftieth_of_the_log_is_estimated_as_well(
    rng, logs: int
) -> None:
    # Here the transform is only nearly diagonal; what that costs is far below the scatter.
    model = NoiseModel(N=1e-3, B=7e-4, T_B=HOURS_10 / 25)
    found, exact = estimates(model, 50.0, logs, rng)
    bounds = compute_cramer_rao_bounds(model, 50.0, HOURS_10, 0.5 / H)
    for i, name in enumerate(NAMES):
        if name in bounds:
            apart = np.log(found[i] / exact[i]) / bounds[name]
            assert np.median(np.abs(apart)) < 0.15, name
            assert np.mean(apart) == pytest.approx(0.0, abs=0.5 / np.sqrt(logs)), name


@pytest.mark.release
def test_all_samples_tell_what_an_exact_likelihood_of_means_tells_once_n_is_known(rng) -> None:
    truth, rate = truth_of(MTI_7), 100.0
    pairs = []
    for _ in range(12):
        log = simulate(MTI_7, rate, round(HOURS_10 * rate), rng)
        spectrum = compute_spectra([log], len(log), rate)[0]
        assert len(np.unique(spectrum.block)) == 2
        found = values_of(make_whittle(spectrum, 0.5 * rate).maximum(PAPERS))
        means = log.reshape(-1, round(H * rate)).mean(axis=1)
        free = np.array([False, True, True, True])
        pairs.append((found, most_likely(means, [found, truth], free)))
    found, exact = np.array(pairs).transpose(1, 2, 0)
    np.testing.assert_allclose(found[0], MTI_7.N, rtol=5 * 3.7e-4)
    for i, name in enumerate(NAMES[1:], start=1):
        assert np.median(np.abs(found[i] / exact[i] - 1)) < 0.01, name
