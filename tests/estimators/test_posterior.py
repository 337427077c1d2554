import numpy as np
import pytest
from scipy import stats
from scipy.interpolate import PchipInterpolator

from imubench_pipeline.estimators.posterior import MAX_DRAWS, sample
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import SHAPES, Maximum, Terms, Whittle, make_whittle
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few
from tests.estimators.test_least_squares import MTI_7

RATE = 10.0
MANY = 200_000
"""Draws of which a few per cent are independent, and tell a chance to better than 0.01."""

LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
ERROR = np.array([0.006, 0.013, 0.016, 0.013, 0.006])
PAPERS = Terms("NK", 1)


def whittle_for(
    model: NoiseModel, samples: int, rng: np.random.Generator, shapes: int = 8
) -> Whittle:
    log = simulate(model, RATE, samples, rng)
    return make_whittle(compute_spectra([log], samples, RATE)[0], RATE / 2, shapes)


def log_likelihood(whittle: Whittle, density: np.ndarray) -> np.ndarray:
    """Of densities of shape (..., b), each bin a mean of nu squared normal variates."""
    nu, data = whittle.spectrum.ordinates, whittle.spectrum.density
    return -0.5 * np.sum(nu * (np.log(density) + data / density), axis=-1)


def cells(end: float, number: int) -> np.ndarray:
    """Middles of equal cells from 0."""
    return end * (np.arange(number) + 0.5) / number


def chances(values: np.ndarray, grid: np.ndarray, weight: np.ndarray, axis: int) -> np.ndarray:
    """Chance of less than each value, from weights at the middles of equal cells of a grid."""
    total = weight.sum(axis=tuple(i for i in range(weight.ndim) if i != axis))
    inside = np.flatnonzero(total > 1e-12 * total.max())
    inside = np.arange(inside[0], inside[-1] + 1)
    half, sums = (grid[1] - grid[0]) / 2, np.cumsum(total[inside])
    edges = np.append(grid[inside] - half, grid[inside[-1]] + half)
    return PchipInterpolator(edges, np.append(0.0, sums / sums[-1]))(values)


def check(draws: np.ndarray, grid: np.ndarray, weight: np.ndarray, axis: int) -> None:
    """Quantiles of draws have the chances that a grid of equal steps gives to them."""
    half = (grid[1] - grid[0]) / 2
    assert grid[0] - half <= draws.min()
    assert draws.max() <= grid[-1] + half
    found = chances(np.quantile(draws, LEVELS), grid, weight, axis)
    assert (np.abs(found - LEVELS) < ERROR).all(), found


def test_white_noise_alone_has_its_closed_form(rng) -> None:
    # p(N) dN ~ N^-n exp(-s / (2 N^2)) dN: s / N^2 is chi-squared with n - 1 degrees.
    for samples in (17, 60, 1000):
        whittle = whittle_for(NoiseModel(N=2e-3), samples, rng)
        posterior = sample(whittle, whittle.maximum(Terms("N")), rng, MANY)
        total = np.sum(whittle.spectrum.ordinates * whittle.spectrum.density)
        chance = stats.chi2(samples - 2).sf(total / np.quantile(posterior.parameters, LEVELS) ** 2)
        assert (np.abs(chance - LEVELS) < ERROR).all()


def test_a_random_walk_alone_is_flat_in_its_amplitude(rng) -> None:
    # p(K) dK ~ K^-n exp(-s / (2 K^2)) dK: s / K^2 is chi-squared with n - 1 degrees.
    samples = 24
    whittle = whittle_for(NoiseModel(K=2e-3), samples, rng)
    posterior = sample(whittle, whittle.maximum(Terms("K")), rng, MANY)
    unit = whittle.column("K")
    total = np.sum(whittle.spectrum.ordinates * whittle.spectrum.density / unit)
    chance = stats.chi2(samples - 2).sf(total / np.quantile(posterior.parameters, LEVELS) ** 2)
    assert (np.abs(chance - LEVELS) < ERROR).all()


@pytest.mark.parametrize(
    ("letters", "model"),
    few(
        [
            ("NK", NoiseModel(N=1e-3, K=2e-3)),
            ("NK", NoiseModel(N=1e-3)),
            ("NF", NoiseModel(N=1e-3, B=1e-3)),
        ],
        [
            ("NK", NoiseModel(N=1e-3, K=1e-4)),
            ("NF", NoiseModel(N=1e-3)),
            ("QN", NoiseModel(N=1e-3, Q=3e-5)),
        ],
    ),
    ids=["strong walk", "no walk", "flicker", "weak walk", "no flicker", "quantization"],
)
def test_two_terms_have_the_posterior_of_a_grid(rng, letters: str, model: NoiseModel) -> None:
    whittle = whittle_for(model, 300, rng)
    found = whittle.maximum(Terms(letters))
    posterior = sample(whittle, found, rng, MANY)
    log_N = np.log(1e-3) + np.linspace(-2.5, 0.5, 180)
    other = letters.replace("N", "")
    # Flat in the amplitudes, from 0.
    amplitude = cells(1.2 * posterior.parameters[:, letters.index(other)].max(), 200)
    white, unit = whittle.column("N"), whittle.column(other)
    density = np.exp(2 * log_N)[:, None, None] * white + amplitude[:, None] ** 2 * unit
    logarithm = log_likelihood(whittle, density) + log_N[:, None]
    weight = np.exp(logarithm - logarithm.max())
    draws = posterior.parameters
    check(np.log(draws[:, letters.index("N")]), log_N, weight, 0)
    check(draws[:, letters.index(other)], amplitude, weight, 1)
    # They hang together as on the grid.
    p = weight / weight.sum()
    x, y = log_N[:, None], amplitude[None, :]
    x, y = x - np.sum(p * x), y - np.sum(p * y)
    together = np.sum(p * x * y) / np.sqrt(np.sum(p * x**2) * np.sum(p * y**2))
    columns = np.log(draws[:, letters.index("N")]), draws[:, letters.index(other)]
    assert np.corrcoef(*columns)[0, 1] == pytest.approx(together, abs=0.03)


@pytest.mark.parametrize("R", few([-1e-3], [0.0]))
def test_a_ramp_has_the_posterior_of_a_grid(rng, R: float) -> None:
    whittle = whittle_for(NoiseModel(N=1e-3, K=5e-4, R=R), 300, rng)
    terms = Terms("NK", 0, True)
    posterior = sample(whittle, whittle.maximum(terms), rng, MANY)
    spectrum = whittle.spectrum
    log_N = np.log(1e-3) + np.linspace(-0.6, 0.4, 80)
    K = cells(1.2 * posterior.parameters[:, 1].max(), 120)
    white, unit = whittle.column("N"), whittle.column("K")
    density = np.exp(2 * log_N)[:, None, None] * white + K[:, None] ** 2 * unit
    # Given N and K, R is normal; what it takes from the likelihood is known.
    nu = spectrum.ordinates
    below = np.sum(nu * spectrum.ramp / density, axis=-1)
    best = np.sum(nu * spectrum.cross / density, axis=-1) / below
    misfit = np.sum(nu * (np.log(density) + spectrum.density / density), axis=-1)
    logarithm = log_N[:, None] - 0.5 * (misfit - best**2 * below + np.log(below))
    weight = np.exp(logarithm - logarithm.max())
    check(np.log(posterior.parameters[:, 0]), log_N, weight, 0)
    check(posterior.parameters[:, 1], K, weight, 1)
    p = weight / weight.sum()
    cuts = np.quantile(posterior.ramps, LEVELS)
    chance = [np.sum(p * stats.norm.cdf((cut - best) * np.sqrt(below))) for cut in cuts]
    assert (np.abs(np.array(chance) - LEVELS) < ERROR).all()


@pytest.mark.parametrize("B", few([5e-4], [4e-3]), ids=["hardly there", "strong"])
def test_a_gauss_markov_process_has_the_posterior_of_a_grid(rng, B: float) -> None:
    whittle = whittle_for(NoiseModel(N=1e-3, B=B, T_B=8.0), 1500, rng, SHAPES)
    posterior = sample(whittle, whittle.maximum(Terms("N", 1)), rng, MANY)
    # Flat in N, in B, and in log T_B between its limits.
    log_N = np.log(1e-3) + np.linspace(-0.16, 0.16, 41)
    amplitude = cells(1.1 * posterior.parameters[:, 1].max(), 80)
    log_T = np.log(whittle.shortest) + cells(np.log(whittle.longest / whittle.shortest), 60)
    logarithm = np.empty((len(log_N), len(amplitude), len(log_T)))
    for k, place in enumerate(log_T):
        process = amplitude[:, None] ** 2 * whittle.shape_of.gauss_markov(float(np.exp(place)))
        for i, x in enumerate(log_N):
            logarithm[i, :, k] = x + log_likelihood(whittle, np.exp(2 * x) + process)
    weight = np.exp(logarithm - logarithm.max())
    check(np.log(posterior.parameters[:, 0]), log_N, weight, 0)
    check(posterior.parameters[:, 1], amplitude, weight, 1)
    check(np.log(posterior.times[:, 0]), log_T, weight, 2)


def test_draws_are_positive_and_as_many_as_asked_for(rng) -> None:
    whittle = whittle_for(NoiseModel(N=1e-3, B=1e-3, T_B=8.0), 4000, rng, SHAPES)
    for terms in (Terms("N"), PAPERS, Terms("QNFK"), Terms("NK", 2), Terms("NK", 1, True)):
        found = whittle.maximum(terms)
        for draws in (500, MAX_DRAWS):
            posterior = sample(whittle, found, rng, draws)
            assert posterior.parameters.shape == (draws, len(terms.linear) + terms.gauss_markov)
            assert posterior.times.shape == (draws, terms.gauss_markov)
            assert posterior.ramps.shape == (draws,)
        assert np.isfinite(posterior.parameters).all()
        assert (posterior.parameters > 0).all()
        assert ((posterior.times >= whittle.shortest * (1 - 1e-9)).all()) and (
            posterior.times <= whittle.longest * (1 + 1e-9)
        ).all()
        assert posterior.effective > 0.05 * draws
        # A ramp has both signs here, since there is none.
        spread = posterior.ramps.std()
        assert (spread > 0) == terms.ramp
        assert abs(posterior.ramps.mean()) <= 5 * spread


def test_the_same_stream_gives_the_same_draws(rng) -> None:
    whittle = whittle_for(NoiseModel(N=1e-3, B=1e-3, T_B=8.0), 4000, rng, SHAPES)
    found = whittle.maximum(PAPERS)
    one, same, other = (sample(whittle, found, np.random.default_rng(i), 2000) for i in (1, 1, 2))
    np.testing.assert_array_equal(one.parameters, same.parameters)
    np.testing.assert_array_equal(one.times, same.times)
    assert one.effective == same.effective
    assert (one.parameters != other.parameters).any()
    # Another stream, the same distribution.
    middle = np.median(one.parameters, axis=0), np.median(other.parameters, axis=0)
    spread = one.parameters.std(axis=0)
    assert (np.abs(middle[0] - middle[1]) < 0.35 * spread).all()


def test_where_the_draws_start_does_not_matter(rng) -> None:
    whittle = whittle_for(NoiseModel(N=1e-3, K=1e-3), 2000, rng)
    found = whittle.maximum(Terms("NK"))
    far = Maximum(found.terms, found.powers * np.array([1.3, 0.2]), found.times, 0.0, 0.0)
    near = sample(whittle, found, rng, 50_000).parameters
    other = sample(whittle, far, rng, 50_000).parameters
    for column in range(2):
        assert stats.ks_2samp(near[::50, column], other[::50, column]).pvalue > 1e-3


def test_two_processes_keep_their_own_b(rng) -> None:
    model = NoiseModel(N=1e-3, B=3e-3, T_B=3.0, further=[GaussMarkov(9e-3, 150.0)])
    whittle = whittle_for(model, 60_000, rng, SHAPES)
    posterior = sample(whittle, whittle.maximum(Terms("N", 2)), rng)
    assert (np.diff(posterior.times, axis=1) > 0).all()
    low, high = np.quantile(
        np.column_stack([posterior.parameters, posterior.times]), [0.0005, 0.9995], axis=0
    )
    truth = np.array([1e-3, 3e-3, 9e-3, 3.0, 150.0])
    assert ((low < truth) & (truth < high)).all()
    # The two B are told apart.
    assert high[1] < low[2]


@pytest.mark.release
def test_intervals_hold_the_truth_as_often_as_they_say(rng) -> None:
    # 10 h, sampled every second: white noise is known less well than at 100 Hz, the rest as well.
    truth, logs = np.array([MTI_7.N, MTI_7.K, MTI_7.B, MTI_7.T_B]), 100
    inside = np.zeros(4)
    for number in range(logs):
        log = simulate(MTI_7, 1.0, 36_000, np.random.default_rng(number))
        whittle = make_whittle(compute_spectra([log], len(log), 1.0)[0], 0.5, 48)
        posterior = sample(whittle, whittle.maximum(PAPERS), rng, 2500)
        draws = np.column_stack([posterior.parameters, posterior.times])
        low, high = np.quantile(draws, [0.025, 0.975], axis=0)
        inside += (low < truth) & (truth < high)
    # Measured at 94 to 98 %; the standard error of 100 logs is 2 %.
    assert (inside / logs > 0.90).all(), inside / logs
    assert inside.mean() / logs == pytest.approx(0.96, abs=0.025), inside / logs


@pytest.mark.release  # likelihood and grids have such limits every day
@pytest.mark.parametrize("K", [1e-1, 4e-2])
def test_white_noise_that_hardly_shows_has_an_upper_limit_above_it(rng, K: float) -> None:
    # Under a strong random walk N is known to 20 % here, or not at all: its limit must say so.
    above, logs = 0, 20
    for _ in range(logs):
        whittle = whittle_for(NoiseModel(N=1e-3, K=K), 2000, rng)
        N = sample(whittle, whittle.maximum(Terms("NK")), rng).parameters[:, 0]
        assert (N > 0).all()
        above += np.quantile(N, 0.975) < 1e-3
    # 2.5 % are expected.
    assert above <= 3
