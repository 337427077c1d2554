from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.fft
from scipy import optimize, stats

from imubench_pipeline.estimators.spectrum import SINGLE, Spectrum, compute_spectra
from imubench_pipeline.estimators.whittle import (
    SHAPES,
    Maximum,
    Shapes,
    Terms,
    Whittle,
    make_whittle,
)
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 10.0

VARIANCE = np.log(2) / (np.pi * 0.4365**2)
"""Of a Gauss-Markov process of B = 1: S_B T_B / 2."""

PAPERS = Terms("NK", 1)
MODEL = NoiseModel(N=1e-3, B=1.5e-3, T_B=20.0, K=1e-4)


def spectrum_of(log: np.ndarray, rate: float = RATE) -> Spectrum:
    return compute_spectra([log], len(log), rate)[0]


def whittle_to(spectrum: Spectrum, shapes: int = SHAPES) -> Whittle:
    """The likelihood of all bins of a spectrum; few shapes are enough without a process."""
    return make_whittle(spectrum, 0.5 * spectrum.rate, shapes)


def whittle_for(
    model: NoiseModel, samples: int, rng: np.random.Generator, shapes: int = SHAPES
) -> Whittle:
    return whittle_to(spectrum_of(simulate(model, RATE, samples, rng)), shapes)


def without_ramp(spectrum: Spectrum, R: float) -> np.ndarray:
    return spectrum.density - 2 * R * spectrum.cross + R**2 * spectrum.ramp


def gamma_cost(spectrum: Spectrum, density: np.ndarray) -> float:
    """-log L: a mean of nu squared normal variates of variance S has a gamma distribution."""
    shape = spectrum.ordinates / 2
    return -float(np.sum(stats.gamma.logpdf(spectrum.density, shape, scale=density / shape)))


def expected(model: NoiseModel, samples: int, rate: float = RATE) -> np.ndarray:
    """Mean squares of the DCT-II ordinates, as densities, from the covariance of the samples."""
    i = np.arange(samples)
    lag = np.abs(i[:, None] - i[None, :])
    covariance = model.N**2 * rate * (lag == 0)
    covariance = covariance + model.K**2 / rate * (np.minimum(i[:, None], i[None, :]) + 1)
    processes = [GaussMarkov(model.B, model.T_B)] if model.T_B else []
    for process in [*processes, *model.further]:
        decay = np.exp(-lag / rate / process.T_B)
        covariance = covariance + VARIANCE * process.B**2 * decay
    transform = scipy.fft.dct(np.eye(samples), type=2, norm="ortho", axis=0)
    return np.sum((transform @ covariance) * transform, axis=1)[1:] / rate


def noiseless(model: NoiseModel, samples: int) -> Whittle:
    """The likelihood of a log whose every ordinate has its mean square."""
    spectrum = spectrum_of(np.random.default_rng(0).standard_normal(samples))
    first = np.concatenate(([0.0], np.cumsum(spectrum.ordinates)[:-1])).astype(int)
    density = np.add.reduceat(expected(model, samples), first) / spectrum.ordinates
    return whittle_to(replace(spectrum, density=density, cross=np.zeros(len(density))))


def contrasts(log: np.ndarray, rate: float = RATE) -> Callable[[float, float, float], float]:
    """-log L(N, K, R) of the steps of a log: its likelihood without its mean, no transform."""
    steps, n = np.diff(log), len(log) - 1
    white = rate * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))

    def cost(N: float, K: float, R: float = 0.0) -> float:
        covariance = N**2 * white + K**2 / rate * np.eye(n)
        residual = steps - R / rate
        _, logarithm = np.linalg.slogdet(covariance)
        return 0.5 * float(logarithm + residual @ np.linalg.solve(covariance, residual))

    return cost


def information_of(whittle: Whittle, maximum: Maximum) -> np.ndarray:
    sensitivity = whittle.sensitivity(maximum)
    return np.asarray(sensitivity @ sensitivity.T)


def test_costs_of_models_differ_as_gamma_likelihoods_do(rng) -> None:
    for samples in (500, 40_000):
        whittle = whittle_for(MODEL, samples, rng)
        models = [Terms("N"), Terms("NK"), Terms("NF"), Terms("QNFK"), PAPERS, Terms("N", 2)]
        found = [whittle.maximum(terms) for terms in models]
        costs = [gamma_cost(whittle.spectrum, whittle.density(one)) for one in found]
        np.testing.assert_allclose(
            np.diff([one.cost for one in found]), np.diff(costs), rtol=1e-8, atol=1e-8
        )


@pytest.mark.parametrize("K", [0.0, 2e-4, 5e-3])
def test_costs_of_a_short_log_differ_as_exact_likelihoods_do(rng, K: float) -> None:
    # White noise, random walk and ramp are diagonal without approximation, in single ordinates.
    log = simulate(NoiseModel(N=1e-3, K=K, R=2e-4), RATE, SINGLE + 1, rng)
    whittle, exact = whittle_to(spectrum_of(log)), contrasts(log)
    found = [whittle.maximum(terms) for terms in (Terms("N"), Terms("NK"), Terms("NK", 0, True))]
    white, walk, ramp = found
    costs = [
        exact(white.parameter("N"), 0.0),
        exact(walk.parameter("N"), walk.parameter("K")),
        exact(ramp.parameter("N"), ramp.parameter("K"), ramp.ramp),
    ]
    np.testing.assert_allclose(np.diff([one.cost for one in found]), np.diff(costs), atol=1e-8)


@pytest.mark.parametrize("R", few([0.0, -3e-3], [3e-3]))
@pytest.mark.parametrize("K", few([0.0, 5e-3], [5e-4]))
def test_the_fit_of_a_short_log_is_that_of_its_exact_likelihood(rng, K: float, R: float) -> None:
    for _ in range(2):
        log = 9.81 + simulate(NoiseModel(N=1e-3, K=K, R=R), RATE, SINGLE + 1, rng)
        found = whittle_to(spectrum_of(log)).maximum(Terms("NK", 0, True))
        exact = contrasts(log)

        def cost(x: np.ndarray, exact: Callable[..., float] = exact) -> float:
            return exact(x[0] * 1e-3, x[1] * 1e-3, x[2] * 1e-3)

        options = {"xatol": 1e-7, "fatol": 1e-10, "maxiter": 4000}
        best = min(
            (
                optimize.minimize(cost, start, method="Nelder-Mead", options=options)
                for start in ([1.0, 0.3, 0.0], [0.5, 4.0, 1.0])
            ),
            key=lambda result: result.fun,
        )
        there = exact(found.parameter("N"), found.parameter("K"), found.ramp)
        assert there == pytest.approx(best.fun, abs=1e-5)
        # Near their maximum a change of 1e-5 of the cost is 5e-3 of a standard error.
        np.testing.assert_allclose(
            [found.parameter("N"), found.parameter("K"), found.ramp],
            np.r_[np.abs(best.x[:2]), best.x[2]] * 1e-3,
            atol=1e-5,
        )


@pytest.mark.parametrize(
    ("terms", "model"),
    [
        (Terms("N"), NoiseModel(N=2e-3)),
        (Terms("NK"), NoiseModel(N=2e-3, K=3e-4)),
        (Terms("K"), NoiseModel(K=3e-4)),
        (Terms("N", 1), NoiseModel(N=1e-3, B=2e-3, T_B=7.0)),
        (PAPERS, NoiseModel(N=1e-3, B=2e-3, T_B=4.0, K=3e-4)),
        # A correlation time of a sixth of the log, where the ends of the log matter most.
        (Terms("N", 1), NoiseModel(N=1e-3, B=2e-3, T_B=20.0)),
    ],
)
def test_the_exact_density_of_a_model_gives_its_parameters_back(
    terms: Terms, model: NoiseModel
) -> None:
    found = noiseless(model, 1200).maximum(terms)
    for letter in terms.linear:
        assert found.parameter(letter) == pytest.approx(getattr(model, letter), rel=5e-3)
    if model.T_B:
        assert found.biases[0] == pytest.approx(model.B, rel=5e-3)
        assert found.times[0] == pytest.approx(model.T_B, rel=1e-2)


@pytest.mark.release
def test_the_exact_density_of_two_processes_gives_both_back() -> None:
    model = NoiseModel(N=1e-3, B=3e-3, T_B=2.5, further=[GaussMarkov(4e-3, 25.0)])
    found = noiseless(model, 1500).maximum(Terms("N", 2))
    np.testing.assert_allclose(found.times, [2.5, 25.0], rtol=0.03)
    np.testing.assert_allclose(found.biases, [3e-3, 4e-3], rtol=0.02)
    assert found.parameter("N") == pytest.approx(1e-3, rel=5e-3)


@pytest.mark.parametrize("seed", few([0], [1, 2, 3]))
def test_a_sharp_process_does_not_hide_another_beside_a_walk(seed: int) -> None:
    # A process a hundred times as dense as the white noise has a sharp time, beside which no pair
    # of a coarse grid shows what else is there.
    model = NoiseModel(N=5e-4, B=5e-3, T_B=0.6, K=4e-4, further=[GaussMarkov(3e-3, 20.0)])
    log = simulate(model, 50.0, 72_000, np.random.default_rng(seed))
    whittle = whittle_to(spectrum_of(log, 50.0))
    wider = whittle.maximum(Terms("NK", 2))
    truth = model.N**2, model.K**2, model.B**2, model.further[0].B ** 2
    times = np.array([0.6, 20.0])
    density = whittle.matrix(Terms("NK", 2), times) @ np.array(truth)
    data, nu = whittle.spectrum.density, whittle.spectrum.ordinates
    at_truth = 0.5 * float(np.sum(nu * (np.log(density / whittle.scale) + data / density)))
    assert wider.cost < at_truth
    assert wider.cost < whittle.maximum(Terms("N", 2)).cost
    assert wider.cost < whittle.maximum(Terms("NK", 1)).cost
    assert wider.times[0] == pytest.approx(0.6, rel=0.15)


def test_the_exact_density_of_flicker_and_quantization_gives_them_back() -> None:
    n = 8000
    spectrum = spectrum_of(np.random.default_rng(0).standard_normal(n))
    gap = 2 - 2 * np.cos(np.pi * np.arange(1, n) / n)
    density = 5e-5**2 * RATE * gap + 1e-3**2 + 8e-3**2 / RATE / np.sqrt(gap)
    first = np.concatenate(([0.0], np.cumsum(spectrum.ordinates)[:-1])).astype(int)
    density = np.add.reduceat(density, first) / spectrum.ordinates
    # The ends of the log bend flicker noise in the lowest ordinates.
    later = replace(spectrum, density=density).select(np.arange(len(density)) >= SINGLE)
    found = whittle_to(later, 8).maximum(Terms("QNFK"))
    assert found.parameter("F") == pytest.approx(8e-3, rel=5e-3)
    assert found.parameter("N") == pytest.approx(1e-3, rel=5e-3)
    assert found.parameter("Q") == pytest.approx(5e-5, rel=5e-3)
    assert found.parameter("K") < 1e-4


@pytest.mark.parametrize("terms", few([PAPERS], [Terms("NK"), Terms("NFK")]))
def test_a_term_that_is_absent_is_fitted_at_nothing(terms: Terms) -> None:
    found = noiseless(NoiseModel(N=2e-3), 1200).maximum(terms)
    assert found.parameter("N") == pytest.approx(2e-3, rel=1e-3)
    assert (found.powers >= 0).all()
    # 1e-3 of what would show in the lowest ordinate, or in all.
    assert found.parameter("K") < 1e-3 * 2e-3 * np.pi / 120
    assert (np.sqrt(found.powers) < 2e-3 * (1 + 1e-3)).all()
    assert found.cost == pytest.approx(
        noiseless(NoiseModel(N=2e-3), 1200).maximum(Terms("N")).cost, abs=1e-3
    )


def searched(whittle: Whittle, terms: Terms, rng: np.random.Generator, starts: int) -> float:
    """The lowest -log L that general minimisers find, from several random starts."""
    spectrum = whittle.spectrum
    p, g = len(terms.linear) + terms.gauss_markov, terms.gauss_markov
    columns = [whittle.column(letter) for letter in terms.linear]
    norm = [column.mean() / whittle.scale for column in columns]

    def cost(x: np.ndarray) -> float:
        density = np.zeros(len(spectrum.density))
        for j, column in enumerate(columns):
            density += np.exp(x[j]) * column / norm[j]
        for j in range(g):
            shape = whittle.gauss_markov(float(np.exp(x[p + j])))
            density += np.exp(x[len(columns) + j]) * shape / shape.mean() * whittle.scale
        R = 0.0
        if terms.ramp:
            weight = spectrum.ordinates / density
            R = np.sum(weight * spectrum.cross) / np.sum(weight * spectrum.ramp)
        ratio = without_ramp(spectrum, R) / density
        return 0.5 * float(np.sum(spectrum.ordinates * (np.log(density / whittle.scale) + ratio)))

    ends = np.log([whittle.shortest, whittle.longest])
    bounds = [(-25.0, 25.0)] * p + [tuple(ends)] * g
    lowest = np.inf
    for _ in range(starts):
        start = np.concatenate([rng.uniform(-8, 5, p), rng.uniform(*ends, g)])
        rough = optimize.minimize(cost, start, method="L-BFGS-B", bounds=bounds)
        options = {"maxiter": 400 * p, "xatol": 1e-5, "fatol": 1e-7}
        fine = optimize.minimize(
            cost, rough.x, method="Nelder-Mead", bounds=bounds, options=options
        )
        lowest = min(lowest, float(fine.fun))
    return lowest


@pytest.mark.parametrize(
    "terms",
    few(
        [Terms("NK", 1, True)],
        [PAPERS, Terms("NFK"), Terms("K"), Terms("QNF"), Terms("NK", 0, True), Terms("N", 1)],
    ),
)
def test_no_general_minimiser_finds_a_better_fit(rng, terms: Terms) -> None:
    for _ in range(3):
        model = NoiseModel(
            N=10 ** rng.uniform(-3.5, -2.5),
            B=10 ** rng.uniform(-4, -2),
            T_B=10 ** rng.uniform(0.5, 1.7),
            K=10 ** rng.uniform(-5, -2.5),
            R=rng.choice([0.0, -1.0, 1.0]) * 10 ** rng.uniform(-6, -3),
        )
        samples = int(rng.choice([300, 2000, 20_000]))
        whittle = whittle_for(model, samples, rng, SHAPES if terms.gauss_markov else 8)
        found = whittle.maximum(terms)
        assert (found.powers >= 0).all()
        assert np.isfinite(found.powers).all()
        assert ((found.times >= whittle.shortest) & (found.times <= whittle.longest)).all()
        # 0.02 of log L is a fifth of a standard error at most; most are equal to 1e-5.
        assert found.cost < searched(whittle, terms, rng, 2) + 0.02


@pytest.mark.release
def test_two_processes_are_not_fitted_worse_than_by_a_general_minimiser(rng) -> None:
    model = NoiseModel(N=1e-3, B=3e-3, T_B=3.0, further=[GaussMarkov(3e-3, 100.0)])
    whittle = whittle_for(model, 20_000, rng)
    found = whittle.maximum(Terms("N", 2))
    assert found.times[0] < found.times[1]
    assert found.cost < searched(whittle, Terms("N", 2), rng, 4) + 0.05


@pytest.mark.release
@pytest.mark.parametrize("logs", few([15], [40]))
def test_the_fit_is_never_less_likely_than_the_truth(rng, logs: int) -> None:
    ordinates = []
    for _ in range(logs):
        whittle = whittle_for(MODEL, 5000, rng)
        truth = np.array([MODEL.N, MODEL.K, MODEL.B]) ** 2
        true = Maximum(PAPERS, truth, np.array([MODEL.T_B or 0.0]), 0.0, 0.0)
        found = whittle.maximum(PAPERS)
        gain = gamma_cost(whittle.spectrum, whittle.density(true)) - gamma_cost(
            whittle.spectrum, whittle.density(found)
        )
        assert gain > -1e-3
        ordinates.append(2 * gain)
    # Wilks: twice the gain is chi-squared, with one degree of freedom for each parameter.
    assert np.mean(ordinates) == pytest.approx(4.0, abs=4 * np.sqrt(8 / logs))


def raw_likelihood(log: np.ndarray, rate: float) -> Callable[[np.ndarray], float]:
    """-log L of every DCT-II ordinate, from the closed forms of the spectra of samples."""
    n = len(log)
    power = scipy.fft.dct(log - log.mean(), type=2, norm="ortho")[1:] ** 2
    gap = 2 - 2 * np.cos(np.pi * np.arange(1, n) / n)

    def cost(x: np.ndarray) -> float:
        N, K, B, T_B = np.exp(x)
        p = np.exp(-1 / rate / T_B)
        variance = N**2 * rate + K**2 / rate / gap
        variance += VARIANCE * B**2 * (1 - p**2) / ((1 - p) ** 2 + p * gap)
        return 0.5 * float(np.sum(np.log(variance) + power / variance))

    return cost


@pytest.mark.parametrize("samples", few([20_000], [300_000]))
def test_nothing_is_lost_by_bins_and_by_two_resolutions(rng, samples: int) -> None:
    # Correlation times far below the length of the log: its ends do not matter.
    model = NoiseModel(N=1e-3, B=2e-3, T_B=5.0, K=1e-4)
    log = simulate(model, RATE, samples, rng)
    whittle = whittle_to(spectrum_of(log))
    assert (whittle.spectrum.block > 1).any() == (samples > 1 << 18)
    found = whittle.maximum(PAPERS)
    here = np.log([found.parameter("N"), found.parameter("K"), found.biases[0], found.times[0]])
    options = {"xatol": 1e-4, "fatol": 1e-4, "initial_simplex": here + 0.1 * np.eye(5, 4)}
    best = optimize.minimize(raw_likelihood(log, RATE), here, method="Nelder-Mead", options=options)
    error = np.sqrt(np.diag(np.linalg.inv(information_of(whittle, found))))[[0, 1, 2, 3]]
    assert np.abs((here - best.x) / error).max() < 0.25


@pytest.mark.parametrize(
    "found",
    [
        Maximum(PAPERS, np.array([1e-6, 4e-8, 4e-6]), np.array([8.0]), 0.0, 0.0),
        Maximum(Terms("QNFK"), np.array([1e-9, 1e-6, 1e-6, 4e-8]), np.empty(0), 0.0, 0.0),
        Maximum(Terms("N", 2), np.array([1e-6, 4e-6, 9e-6]), np.array([3.0, 60.0]), 0.0, 0.0),
        Maximum(Terms("NK", 1, True), np.array([1e-6, 4e-8, 4e-6]), np.array([8.0]), 2e-4, 0.0),
    ],
    ids=lambda found: found.terms.name,
)
def test_the_information_is_the_curvature_of_the_mean_cost(found: Maximum) -> None:
    spectrum = spectrum_of(np.random.default_rng(0).standard_normal(4000))
    shapes = Shapes(spectrum)
    unit = {
        "Q": shapes.quantization(),
        "N": shapes.white(),
        "F": shapes.flicker(),
        "K": shapes.random_walk(),
    }
    p, g = len(found.powers), len(found.times)

    def density(x: np.ndarray) -> np.ndarray:
        columns = [unit[letter] for letter in found.terms.linear]
        columns += [shapes.gauss_markov(float(time)) for time in np.exp(x[p : p + g])]
        return np.column_stack(columns) @ np.exp(2 * x[:p])

    at = np.concatenate([0.5 * np.log(found.powers), np.log(found.times)])
    if found.terms.ramp:
        at = np.append(at, found.ramp)
    true, R = density(at), found.ramp
    mean = replace(spectrum, density=true + R**2 * spectrum.ramp, cross=R * spectrum.ramp)

    def cost(x: np.ndarray) -> float:
        data = without_ramp(mean, float(x[-1])) if found.terms.ramp else mean.density
        return 0.5 * float(np.sum(mean.ordinates * (np.log(density(x)) + data / density(x))))

    m = len(at)
    steps = np.full(m, 0.02)
    if found.terms.ramp:
        steps[-1] = 0.02 * abs(R)
    curvature = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            a, b = steps[i] * np.eye(m)[i], steps[j] * np.eye(m)[j]
            corners = cost(at + a + b) - cost(at + a - b) - cost(at - a + b) + cost(at - a - b)
            curvature[i, j] = corners / (4 * steps[i] * steps[j])
    size = np.sqrt(np.diag(curvature))
    information = information_of(whittle_to(mean), found)
    np.testing.assert_allclose(
        information / np.outer(size, size), curvature / np.outer(size, size), atol=5e-3
    )


@pytest.mark.parametrize("logs", few([120], [300]))
def test_estimates_scatter_as_their_information_says(rng, logs: int) -> None:
    model = NoiseModel(N=1e-3, K=5e-4)
    estimates = []
    for _ in range(logs):
        whittle = whittle_for(model, 2000, rng, 8)
        found = whittle.maximum(Terms("NK"))
        estimates.append(np.sqrt(found.powers))
    true = Maximum(Terms("NK"), np.array([1e-6, 25e-8]), np.empty(0), 0.0, 0.0)
    covariance = np.linalg.inv(information_of(whittle, true))
    wrong = np.log(estimates / np.array([1e-3, 5e-4]))
    scatter = np.cov(wrong.T)
    for i in range(2):
        error = np.sqrt(covariance[i, i])
        assert wrong[:, i].mean() == pytest.approx(-(error**2) / 2, abs=4 * error / np.sqrt(logs))
        assert scatter[i, i] == pytest.approx(covariance[i, i], rel=4 * np.sqrt(2 / logs))
    between = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert np.corrcoef(wrong.T)[0, 1] == pytest.approx(between, abs=4 / np.sqrt(logs))


@pytest.mark.parametrize("R", [1e-5, -1e-5])
@pytest.mark.parametrize("samples", [3000, 300_000])
def test_a_ramp_that_is_added_to_a_log_is_found_and_changes_nothing_else(
    rng, samples: int, R: float
) -> None:
    log = simulate(NoiseModel(N=1e-3, K=1e-4), RATE, samples, rng)
    terms = Terms("NK", 0, True)
    plain = whittle_to(spectrum_of(log)).maximum(terms)
    bent_whittle = whittle_to(spectrum_of(log + R * np.arange(samples) / RATE))
    bent = bent_whittle.maximum(terms)
    error = 1e-4 / np.sqrt(samples / RATE)  # of the slope of a random walk
    assert bent.ramp - plain.ramp == pytest.approx(R, abs=0.02 * error)
    assert abs(plain.ramp) < 5 * error
    np.testing.assert_allclose(bent.powers, plain.powers, rtol=5e-3)
    # What is left of the log is what the model explains.
    data = bent_whittle.data(bent)
    density = bent_whittle.density(bent)
    mean = np.average(data / density, weights=bent_whittle.spectrum.ordinates)
    assert mean == pytest.approx(1.0, abs=1e-3)


def test_a_ramp_that_is_not_in_the_model_is_taken_for_a_random_walk(rng) -> None:
    # Three times as far as the random walk goes.
    K, time = 2e-5, np.arange(20_000) / RATE
    ratios = []
    for _ in range(20):
        log = simulate(NoiseModel(N=1e-3, K=K), RATE, len(time), rng)
        whittle = whittle_to(spectrum_of(log + 3 * K / np.sqrt(time[-1]) * time), 8)
        without, with_ramp = whittle.maximum(Terms("NK")), whittle.maximum(Terms("NK", 0, True))
        assert with_ramp.cost < without.cost
        ratios.append(np.array([without.parameter("K"), with_ramp.parameter("K")]) / K)
    without_it, with_it = np.median(ratios, axis=0)
    assert without_it > 1.2
    assert with_it == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("terms", [Terms("NFK"), PAPERS, Terms("NK", 1, True)])
def test_units_of_the_signal_and_of_time_do_not_matter(rng, terms: Terms) -> None:
    log = simulate(MODEL, RATE, 20_000, rng)
    found = whittle_to(spectrum_of(log)).maximum(terms)
    scaled = whittle_to(spectrum_of(1e6 * log)).maximum(terms)
    np.testing.assert_allclose(scaled.powers, 1e12 * found.powers, rtol=1e-3)
    np.testing.assert_allclose(scaled.times, found.times, rtol=1e-3)
    assert scaled.ramp == pytest.approx(1e6 * found.ramp, rel=1e-3)
    assert scaled.cost == pytest.approx(found.cost, abs=1e-4)
    # In minutes N^2 is a sixtieth, K^2 sixty times as much, and B is what it was.
    minutes = whittle_to(spectrum_of(log, 60 * RATE)).maximum(terms)
    factor = {"N": 1 / 60, "F": 1.0, "K": 60.0}
    powers = [factor[letter] for letter in terms.linear] + [1.0] * terms.gauss_markov
    np.testing.assert_allclose(minutes.powers, found.powers * powers, rtol=1e-3)
    np.testing.assert_allclose(60 * minutes.times, found.times, rtol=1e-3)
    assert minutes.ramp == pytest.approx(60 * found.ramp, rel=1e-3)


def test_parameters_have_the_names_of_their_terms() -> None:
    found = Maximum(
        Terms("QNFK", 2, True), np.array([1.0, 4, 9, 16, 25, 36]), np.array([2.0, 9]), -0.5, 0.0
    )
    assert [found.parameter(letter) for letter in "QNFK"] == [1, 2, 3, 4]
    np.testing.assert_array_equal(found.biases, [5, 6])
    assert found.terms.name == "Q+N+F+GM+GM+K+R"
    assert found.terms.parameters == 4 + 4 + 1
