from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
import scipy.fft
from scipy import optimize

from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.estimators.model_choice import (
    CANDIDATE_MODELS,
    PAPERS_MODEL,
    Candidate,
    assess_goodness_of_fit,
    compare_models,
)
from imubench_pipeline.estimators.spectrum import Spectrum, compute_spectra
from imubench_pipeline.estimators.whittle import Terms, make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 50.0
N = 1e-3
SHORT = 65
"""Samples of a log whose 64 ordinates all stay single."""

VARIANCE = np.log(2) / (np.pi * 0.4365**2)
"""Of a Gauss-Markov process of B = 1."""


def spectrum_of(log: np.ndarray) -> Spectrum:
    return compute_spectra([log], len(log), RATE)[0]


def candidates_of(log: np.ndarray, quantization: bool = True) -> list[Candidate]:
    return compare_models(make_whittle(spectrum_of(log), RATE / 2), quantization=quantization)


def flicker(B: float, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Half-order integrated white noise (Kasdin 1995): of density B^2 / sqrt(2 - 2 cos w)."""
    k = np.arange(1, samples)
    response = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))
    length = scipy.fft.next_fast_len(2 * samples)
    drive = scipy.fft.rfft(rng.standard_normal(samples), length)
    shaped = scipy.fft.irfft(scipy.fft.rfft(response, length) * drive, length)
    return B * np.asarray(shaped[:samples])


def chosen(make: Callable[[], np.ndarray], logs: int) -> Counter[str]:
    """How often each model is the best."""
    return Counter(candidates_of(make())[0].terms.name for _ in range(logs))


def by_name(candidates: list[Candidate]) -> dict[str, Candidate]:
    return {candidate.terms.name: candidate for candidate in candidates}


def transform(samples: int) -> np.ndarray:
    """The DCT-II of a log as a matrix, without its mean."""
    i, k = np.arange(samples), np.arange(1, samples)
    return np.sqrt(2 / samples) * np.cos(np.pi * k[:, None] * (2 * i + 1) / (2 * samples))


def minus_log_likelihood(density: np.ndarray, log: np.ndarray) -> float:
    """Of the coefficients of a log, independent and normal, without its constant."""
    squares = (transform(len(log)) @ log) ** 2 / RATE
    return 0.5 * float(np.sum(np.log(density) + squares / density))


def walk_density(K: float, samples: int) -> np.ndarray:
    """Of a random walk: 1 / (2 sin(w/2))^2 at w = pi k / L, whose diagonal it is exactly."""
    return K**2 / RATE**2 / (2 * np.sin(np.pi * np.arange(1, samples) / (2 * samples))) ** 2


def process_density(B: float, T_B: float, samples: int) -> np.ndarray:
    """Of a Gauss-Markov process: the variances of its coefficients, from its covariance."""
    i = np.arange(samples)
    covariance = B**2 * VARIANCE * np.exp(-np.abs(np.subtract.outer(i, i)) / RATE / T_B)
    matrix = transform(samples)
    return np.einsum("ki,ij,kj->k", matrix, covariance, matrix) / RATE


def best_of(
    density: Callable[[np.ndarray], np.ndarray], log: np.ndarray, starts: list[list[float]]
) -> float:
    """Least -log L over the logarithms of parameters, by a simplex."""
    squares = (transform(len(log)) @ log) ** 2 / RATE

    def cost(x: np.ndarray) -> float:
        model = density(np.exp(x))
        return 0.5 * float(np.sum(np.log(model) + squares / model))

    options = {"xatol": 1e-6, "fatol": 1e-9, "maxiter": 4000, "maxfev": 4000}
    found = [
        optimize.minimize(cost, np.log(x), method="Nelder-Mead", options=options) for x in starts
    ]
    return float(min(result.fun for result in found))


@pytest.fixture
def short_log(rng: np.random.Generator) -> np.ndarray:
    return simulate(NoiseModel(N=N, K=2e-2), RATE, SHORT, rng)


def in_place_of_a_walk(candidate: Candidate, duration: float) -> float:
    """What is added to the BIC: of a process that lasts for a fiftieth of the log, of R and Q."""
    found = candidate.maximum
    added = 6.0 * (found.terms.ramp + ("Q" in found.terms.linear))
    if found.terms.ramp and found.parameter("K") == 0.0:
        return added + 4.0
    slow = len(found.times) and found.times[-1] > duration / 50
    return added + 4.0 if slow and "K" not in found.terms.linear else added


def test_bic_and_aic_differ_as_by_hand(short_log: np.ndarray) -> None:
    candidates = by_name(candidates_of(short_log, quantization=False))
    white = ((transform(SHORT) @ short_log) ** 2).mean() / RATE
    costs = {
        "N": minus_log_likelihood(np.full(SHORT - 1, white), short_log),
        "N+K": best_of(
            lambda x: x[0] ** 2 + walk_density(x[1], SHORT),
            short_log,
            [[N, 1e-2], [0.5 * N, 3e-2], [2 * N, 1e-3]],
        ),
    }
    # Without a process the best fit is found anew; with one its density is.
    for name in ("N+GM", "N+GM+K"):
        found = candidates[name].maximum
        density = found.parameter("N") ** 2 + process_density(
            float(found.biases[0]), float(found.times[0]), SHORT
        )
        if "K" in name:
            density = density + walk_density(found.parameter("K"), SHORT)
        costs[name] = minus_log_likelihood(density, short_log)
    parameters = {"N": 1, "N+K": 2, "N+GM": 3, "N+GM+K": 4}
    first = candidates["N"]
    for name, number in parameters.items():
        change = 2 * (costs[name] - costs["N"])
        bic = change + (number - 1) * np.log(SHORT - 1)
        bic += in_place_of_a_walk(candidates[name], SHORT / RATE)
        aic = change + (number - 1) * 2
        assert candidates[name].bic - first.bic == pytest.approx(bic, abs=2e-3)
        assert candidates[name].aic - first.aic == pytest.approx(aic, abs=2e-3)


def test_no_better_process_is_missed(rng) -> None:
    log = simulate(NoiseModel(N=N, B=1e-2, T_B=1.5), RATE, 10_000, rng)
    whittle = make_whittle(spectrum_of(log), RATE / 2)
    spectrum, found = whittle.spectrum, whittle.maximum(Terms("N", 1))
    inside = (np.arange(4)[:, None] + 0.5) / 4
    frequency = spectrum.lower + (spectrum.upper - spectrum.lower) * inside
    frequency[:, spectrum.ordinates == 1] = spectrum.frequency[spectrum.ordinates == 1]

    def cost(x: np.ndarray) -> float:
        n, b, time = np.exp(x)
        model = NoiseModel(N=n, B=b, T_B=time)
        density = model.sampled_spectrum(2 * np.pi * frequency / RATE, RATE).mean(axis=0) / RATE
        terms = spectrum.ordinates * (np.log(density) + spectrum.density / density)
        return 0.5 * float(terms.sum())

    here = [found.parameter("N"), float(found.biases[0]), float(found.times[0])]
    starts = [here, *([N, 1e-2, time] for time in (0.5, 3.0, 15.0))]
    tried = [optimize.minimize(cost, np.log(x), method="Nelder-Mead") for x in starts]
    best = min(tried, key=lambda result: result.fun)
    # The ends of the log, which bend a process at the lowest ordinates, are in the one only.
    assert cost(np.log(here)) < best.fun + 0.1
    np.testing.assert_allclose(here, np.exp(best.x), rtol=0.03)


def test_scores_follow_from_the_costs(rng) -> None:
    log = simulate(NoiseModel(N=N, B=3e-3, T_B=8.0, K=2e-4), RATE, 30_000, rng)
    spectrum = spectrum_of(log)
    candidates = compare_models(make_whittle(spectrum, RATE / 2), quantization=True)
    parameters = {
        "N": 1, "N+K": 2, "N+GM": 3, "N+GM+K": 4, "N+F": 2, "N+F+K": 3, "N+F+GM": 4,
        "N+F+GM+K": 5, "N+GM+GM": 5, "N+GM+GM+K": 6,
    }  # fmt: skip
    names = by_name(candidates)
    assert set(parameters) <= set(names)
    assert len(names) == len(candidates) == len(parameters) + 2
    penalty = np.log(len(spectrum.density))
    for name, candidate in names.items():
        number = parameters.get(name, name.count("+") + 1 + name.count("GM"))
        added = in_place_of_a_walk(candidate, 30_000 / RATE)
        assert candidate.bic == pytest.approx(2 * candidate.maximum.cost + number * penalty + added)
        assert candidate.aic == pytest.approx(2 * candidate.maximum.cost + number * 2)
    for scores, weights in (
        ([c.bic for c in candidates], [c.weight for c in candidates]),
        ([c.aic for c in candidates], [c.akaike_weight for c in candidates]),
    ):
        assert sum(weights) == pytest.approx(1.0, rel=1e-12)
        # The odds of two models are e to the power of half the difference of their scores.
        for one in range(len(candidates)):
            odds = weights[one] / weights[0]
            assert odds == pytest.approx(np.exp(0.5 * (scores[0] - scores[one])), rel=1e-6)
    assert [c.bic for c in candidates] == sorted(c.bic for c in candidates)


def test_each_candidate_is_judged_by_its_own_fit(rng) -> None:
    log = simulate(NoiseModel(N=N, K=3e-4, R=2e-5), RATE, 30_000, rng)
    spectrum = spectrum_of(log)
    whittle = make_whittle(spectrum, RATE / 2)
    candidates = by_name(compare_models(whittle, quantization=False))
    assert candidates["N+K+R"].goodness.verdict == "explained"
    assert candidates["N"].goodness.verdict == "not explained"
    for name, candidate in candidates.items():
        number = name.count("+") + 1 + name.count("GM")
        found = candidate.maximum
        # The ramp is taken out of the data, not added to the density.
        ramp = found.ramp * (np.arange(len(log)) / RATE) if "R" in name else 0.0
        data = spectrum_of(log - ramp).density
        again = assess_goodness_of_fit(
            spectrum.ordinates, data, whittle.density(found), spectrum.frequency, number
        )
        assert candidate.goodness.chance == pytest.approx(again.chance, rel=1e-6)


def test_a_model_with_more_terms_is_never_further_from_the_data(rng) -> None:
    def contains(more: Terms, fewer: Terms) -> bool:
        return (
            set(fewer.linear) <= set(more.linear)
            and fewer.gauss_markov <= more.gauss_markov
            and fewer.ramp <= more.ramp
        )

    for model in (
        NoiseModel(N=N),
        NoiseModel(N=N, B=3e-3, T_B=8.0, K=2e-4),
        NoiseModel(N=N, B=3e-3),
        NoiseModel(K=1e-3),
    ):
        found = [c.maximum for c in candidates_of(simulate(model, RATE, 30_000, rng))]
        for more in found:
            for fewer in found:
                if contains(more.terms, fewer.terms):
                    assert more.cost < fewer.cost + 0.3  # two processes are a local search


@pytest.mark.parametrize(("logs", "least"), few([(1, 1)], [(6, 5), (12, 10)]))
def test_white_noise_is_white_noise(rng, logs: int, least: int) -> None:
    names = chosen(lambda: simulate(NoiseModel(N=N), RATE, 50_000, rng), logs)
    assert names["N"] >= least


@pytest.mark.parametrize(("logs", "least"), few([(1, 1)], [(6, 5), (12, 10)]))
def test_a_random_walk_shows_no_bias_instability(rng, logs: int, least: int) -> None:
    names = chosen(lambda: simulate(NoiseModel(N=N, K=3e-4), RATE, 50_000, rng), logs)
    assert names["N+K"] >= least
    # Nor a ramp.
    assert sum(number for name, number in names.items() if {*"FR"} & {*name} or "GM" in name) <= 1


@pytest.mark.release  # the next test has one beside a walk every day
def test_a_strong_process_is_a_process(rng) -> None:
    def process() -> np.ndarray:
        return simulate(NoiseModel(N=N, B=4e-3, T_B=4.0), RATE, 50_000, rng)

    names = chosen(process, 10)
    assert names["N+GM"] >= 8


@pytest.mark.parametrize(("logs", "least"), few([(1, 1)], [(5, 4), (10, 8)]))
def test_all_three_of_the_papers_are_told_where_they_are_strong(rng, logs: int, least: int) -> None:
    model = NoiseModel(N=N, B=6e-3, T_B=3.0, K=6e-4)
    times, levels, names = [], [], Counter[str]()
    for _ in range(logs):
        candidates = candidates_of(simulate(model, RATE, 100_000, rng))
        names[candidates[0].terms.name] += 1
        found = by_name(candidates)[PAPERS_MODEL.name].maximum
        times.append(float(found.times[0]))
        levels.append(float(found.biases[0]))
    assert names["N+GM+K"] >= least
    assert all("GM" in name for name in names)
    assert np.mean(levels) == pytest.approx(6e-3, rel=0.06 * np.sqrt(10 / logs))
    assert np.median(times) == pytest.approx(3.0, rel=0.15 * np.sqrt(10 / logs))


@pytest.mark.parametrize(("logs", "least"), few([(2, 2)], [(5, 4), (10, 8)]))
def test_flicker_noise_is_flicker_noise_and_no_process(rng, logs: int, least: int) -> None:
    B, samples = 2e-3, 100_000
    names, levels, lead = Counter[str](), [], []
    for _ in range(logs):
        log = N * np.sqrt(RATE) * rng.standard_normal(samples) + flicker(B, samples, rng)
        candidates = candidates_of(log)
        names[candidates[0].terms.name] += 1
        candidate = by_name(candidates)
        levels.append(candidate["N+F"].maximum.parameter("F"))
        lead.append(candidate["N+GM"].bic - candidate["N+F"].bic)
    assert names["N+F"] >= least
    assert min(lead) > 6
    # B means the same here as in the filter.
    error = (np.std(levels) if logs > 2 else 0.02 * B) / np.sqrt(logs)
    assert np.mean(levels) == pytest.approx(B, abs=4 * error)
    assert np.std(levels) < 0.1 * B


@pytest.mark.parametrize(("logs", "least"), few([(1, 1)], [(3, 2), (8, 6)]))
def test_flicker_beside_a_random_walk_is_told(rng, logs: int, least: int) -> None:
    samples = 200_000

    def both() -> np.ndarray:
        log = simulate(NoiseModel(N=N, K=5e-4), RATE, samples, rng)
        return log + flicker(4e-3, samples, rng)

    assert chosen(both, logs)["N+F+K"] >= least


def test_two_processes_far_apart_are_told(rng) -> None:
    def two() -> np.ndarray:
        fast = simulate(NoiseModel(N=N, B=8e-3, T_B=1.0), RATE, 100_000, rng)
        return fast + simulate(NoiseModel(B=2e-2, T_B=100.0), RATE, 100_000, rng)

    candidates = candidates_of(two())
    pair = by_name(candidates)["N+GM+GM"]
    np.testing.assert_allclose(pair.maximum.times, [1.0, 100.0], rtol=0.6)
    assert pair.bic < by_name(candidates)["N+GM"].bic - 10
    assert pair.bic < by_name(candidates)["N+F"].bic - 10


def test_a_ramp_is_tried_beside_a_random_walk_only(rng) -> None:
    for model in (
        NoiseModel(N=N),
        NoiseModel(N=N, R=1e-5),
        NoiseModel(N=N, B=4e-3, T_B=4.0),
        NoiseModel(N=N, B=3e-3),
    ):
        candidates = candidates_of(simulate(model, RATE, 50_000, rng))
        ramps = [c.terms for c in candidates if c.terms.ramp]
        assert len(ramps) == 1
        assert "K" in ramps[0].linear
        assert all(c.maximum.ramp == 0 for c in candidates if not c.terms.ramp)


@pytest.mark.parametrize("logs", few([1], [3, 5]))
def test_a_ramp_far_beyond_the_random_walk_is_found(rng, logs: int) -> None:
    K, R = 3e-5, -1e-5  # over the log the ramp goes ten times as far as the walk
    with_ramp, without = [], []
    for _ in range(logs):
        candidates = candidates_of(simulate(NoiseModel(N=N, K=K, R=R), RATE, 50_000, rng))
        best = candidates[0].maximum
        assert best.terms.ramp
        # The slope of a walk between the ends of D s is known to K / sqrt(D).
        assert best.ramp == pytest.approx(R, abs=4 * K / np.sqrt(1000))
        with_ramp.append(best.parameter("K"))
        without.append(by_name(candidates)["N+K"].maximum.parameter("K"))
    # Some twenty ordinates show K; a ramp that is not a term of the model makes it larger.
    assert np.mean(with_ramp) == pytest.approx(K, rel=0.3 * np.sqrt(5 / logs))
    assert np.mean(without) > 1.6 * np.mean(with_ramp)


@pytest.mark.release  # test_a_random_walk_shows_no_bias_instability has no ramp every day
def test_a_random_walk_is_no_ramp(rng) -> None:
    names = chosen(lambda: simulate(NoiseModel(N=N, K=1e-3), RATE, 20_000, rng), 15)
    assert sum(number for name, number in names.items() if "R" in name) <= 1


def test_quantization_is_tried_where_it_is_asked_for_only(rng) -> None:
    log = simulate(NoiseModel(Q=1e-4, N=N), RATE, 50_000, rng)
    best = candidates_of(log)[0].maximum
    assert best.terms.name == "Q+N"
    assert best.parameter("Q") == pytest.approx(1e-4, rel=0.02)
    assert best.parameter("N") == pytest.approx(N, rel=0.02)
    assert not any("Q" in c.terms.linear for c in candidates_of(log, quantization=False))


@pytest.mark.parametrize(("part", "tried"), few([(0.09, False), (0.11, True)], [(0.5, True)]))
def test_quantization_is_tried_where_the_band_shows_it(rng, part: float, tried: bool) -> None:
    log = simulate(NoiseModel(Q=2e-5, N=N), RATE, 20_000, rng)
    names = [c.terms.name for c in fit(log, RATE, band=part * RATE).candidates]
    assert any(name.startswith("Q+") for name in names) == tried


@pytest.mark.parametrize("bins", [16, 20, 30])
def test_models_of_more_parameters_than_a_quarter_of_the_bins_are_left_out(rng, bins: int) -> None:
    log = simulate(NoiseModel(N=N, K=1e-2), RATE, bins + 1, rng)
    candidates = candidates_of(log)
    assert len(candidates[0].terms.name) > 0
    for terms in CANDIDATE_MODELS:
        there = any(c.terms == terms for c in candidates)
        assert there == (terms.parameters < bins // 4)
    assert max(c.terms.parameters for c in candidates) < bins // 4
    assert sum(c.weight for c in candidates) == pytest.approx(1.0)


def test_a_ramp_must_be_the_better_and_more_so_in_place_of_a_walk() -> None:
    """It pays 6; beside a walk that is left at 0 what a slow process pays, too."""
    seen = set()
    for seed, K in enumerate((0.0, 0.0, 1e-3, 1e-3)):
        rng = np.random.default_rng(seed)
        log = simulate(NoiseModel(N=1e-3, K=K, R=1e-5), 5.0, 3000, rng)
        whittle = make_whittle(compute_spectra([log], len(log), 5.0)[0], 2.5)
        penalty = np.log(len(whittle.spectrum.density))
        for candidate in compare_models(whittle, quantization=False):
            found = candidate.maximum
            if found.terms.ramp:
                alone = found.parameter("K") == 0.0
                seen.add(alone)
                plain = 2.0 * found.cost + found.terms.parameters * penalty
                assert candidate.bic - plain == pytest.approx(10.0 if alone else 6.0, abs=1e-6)
    assert seen == {True, False}
