import re

import numpy as np
import pytest
from scipy import optimize, stats

from imubench_pipeline.estimators.model_choice import (
    MIN_FIT_CHANCE,
    Goodness,
    assess_goodness_of_fit,
)
from imubench_pipeline.estimators.spectrum import Spectrum, compute_spectra
from imubench_pipeline.estimators.whittle import Terms, make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 50.0
BINS = np.concatenate((np.ones(64), np.rint(np.geomspace(2, 2000, 140))))
"""Ordinates in the bins of a spectrum: the lowest stay single."""

FREQUENCY = np.geomspace(1e-3, 25.0, len(BINS))


def judged(data: np.ndarray, nu: np.ndarray = BINS, parameters: int = 0) -> Goodness:
    """Judge data that a model of density 1 is to explain."""
    frequency = np.geomspace(1e-3, 25.0, len(nu))
    return assess_goodness_of_fit(nu, data, np.ones(len(nu)), frequency, parameters)


def drawn(rng: np.random.Generator, nu: np.ndarray = BINS) -> np.ndarray:
    """Mean squares of normal variates, as many as there are ordinates in a bin."""
    return rng.chisquare(nu) / nu


def spectrum_of(model: NoiseModel, samples: int, rng: np.random.Generator) -> Spectrum:
    return compute_spectra([simulate(model, RATE, samples, rng)], samples, RATE)[0]


def of_fit(spectrum: Spectrum, terms: Terms) -> tuple[Goodness, np.ndarray]:
    whittle = make_whittle(spectrum, RATE / 2, 48)
    found = whittle.maximum(terms)
    density = whittle.density(found)
    judgement = assess_goodness_of_fit(
        spectrum.ordinates, whittle.data(found), density, spectrum.frequency, terms.parameters
    )
    return judgement, density


def place(text: str) -> tuple[float, float, int, float]:
    """Frequencies between which a spectrum is furthest from its model, side and distance."""
    match = re.search(r"at (\S+) to (\S+) Hz, (\S+) standard errors (above|below) it", text)
    assert match, text
    side = 1 if match[4] == "above" else -1
    return float(match[1]), float(match[2]), side, float(match[3])


@pytest.mark.release
@pytest.mark.parametrize("logs", few([1000], [2000]))
@pytest.mark.parametrize(
    "nu",
    few([BINS], [(np.full(200, 50.0),), (np.ones(60),)]),
    ids=["bins of a spectrum", "equal bins", "single ordinates"],
)
def test_the_chance_of_the_right_model_is_uniform(rng, nu: np.ndarray, logs: int) -> None:
    chance = np.array([judged(drawn(rng, nu), nu).chance for _ in range(logs)])
    assert chance.min() > 0
    assert chance.max() == 1
    for limit in (0.02, 0.05, 0.1, 0.2, 0.5, 0.9):
        # Twice the lower of two independent chances is below x with the chance 1 - (1 - x/2)^2.
        expected = 1 - (1 - limit / 2) ** 2
        error = np.sqrt(expected * (1 - expected) / logs)
        assert np.mean(chance <= limit) == pytest.approx(expected, abs=4 * error + 0.1 * expected)
    # The sums are skew, so that a doubt is raised a few times as often as is said, not more.
    assert np.mean(chance < MIN_FIT_CHANCE) < 5 * MIN_FIT_CHANCE
    assert np.mean(chance < 0.01) < 2 * 0.01


def test_the_mean_deviance_of_the_right_model_is_one(rng) -> None:
    deviance = np.array([judged(drawn(rng)).deviance for _ in range(500)])
    assert deviance.mean() == pytest.approx(1.0, abs=4 * deviance.std() / np.sqrt(500))
    assert deviance.std() == pytest.approx(np.sqrt(2 / len(BINS)), rel=0.15)


def test_the_deviance_is_that_of_the_likelihood() -> None:
    # nu (log S + I / S) is least at S = I; of bins of one ordinate the mean deviance is 1.27.
    nu, data, density = np.ones(3), np.array([0.2, 1.0, 4.0]), np.array([1.0, 2.0, 3.0])
    least = [
        optimize.minimize_scalar(
            lambda s, i=i: np.log(s) + i / s, bounds=(1e-3, 50), method="bounded"
        ).fun
        for i in data
    ]
    expected = np.sum(np.log(density) + data / density - least)
    # E[r - 1 - log r] of a squared normal variate, by numerical integration.
    one = stats.chi2(1).expect(lambda r: r - 1 - np.log(r), epsabs=1e-10, limit=200)
    assert one == pytest.approx(1.2704, abs=1e-3)
    found = assess_goodness_of_fit(nu, data, density, np.array([1.0, 2.0, 3.0]), 0).deviance
    assert found == pytest.approx(expected / (3 * one), rel=1e-4)


@pytest.mark.parametrize("nu", few([2.0], [30.0]))
def test_parameters_that_were_fitted_are_taken_off(rng, nu: float) -> None:
    # Ten bins and their own mean: a tenth of the deviance goes into the fit.
    bins, logs = np.full(10, nu), 800
    taken, kept = [], []
    for _ in range(logs):
        data = drawn(rng, bins)
        data /= data.mean()
        taken.append(judged(data, bins, parameters=1).deviance)
        kept.append(judged(data, bins, parameters=0).deviance)
    assert np.mean(taken) == pytest.approx(1.0, abs=4 * np.std(taken) / np.sqrt(logs) + 0.02)
    assert np.mean(kept) == pytest.approx(0.9, abs=4 * np.std(kept) / np.sqrt(logs) + 0.02)


@pytest.mark.release
@pytest.mark.parametrize(
    ("model", "terms"),
    few(
        [(NoiseModel(N=1e-3, B=2e-3, T_B=20.0, K=3e-4), Terms("NK", 1))],
        [
            (NoiseModel(N=1e-3), Terms("N")),
            (NoiseModel(N=1e-3, K=3e-4), Terms("NK")),
            (NoiseModel(Q=2e-5, N=1e-3, B=2e-3), Terms("QNF")),
        ],
    ),
    ids=lambda value: value.name,
)
def test_the_right_model_explains_a_log(rng, model: NoiseModel, terms: Terms) -> None:
    logs = 45
    judgements = [of_fit(spectrum_of(model, 8000, rng), terms)[0] for _ in range(logs)]
    assert sum(judgement.verdict == "explained" for judgement in judgements) >= logs - 1
    chance = np.array([judgement.chance for judgement in judgements])
    assert np.mean(chance < 0.05) < 0.17
    assert 0.2 < np.mean(chance < 0.5) < 0.67
    deviance = np.array([judgement.deviance for judgement in judgements])
    assert deviance.mean() == pytest.approx(1.0, abs=4.5 * deviance.std() / np.sqrt(logs))


@pytest.mark.parametrize(
    ("model", "terms"),
    [
        (NoiseModel(N=1e-3, K=3e-4), Terms("N")),
        (NoiseModel(N=1e-3), Terms("K")),
        (NoiseModel(N=1e-3, B=4e-3, T_B=5.0), Terms("NK")),
        (NoiseModel(Q=1e-4, N=1e-3), Terms("NK")),
        (NoiseModel(N=1e-3, B=5e-3), Terms("N", 1)),
    ],
    ids=lambda value: value.name,
)
def test_a_wrong_model_is_told_with_the_place(rng, model: NoiseModel, terms: Terms) -> None:
    for _ in range(3):
        spectrum = spectrum_of(model, 100_000, rng)
        judgement, fitted = of_fit(spectrum, terms)
        assert judgement.verdict == "not explained"
        assert judgement.chance < 1e-6
        assert judgement.deviance > 1.2
        low, high, side, distance = place(judgement.where)
        assert distance > 2.5
        # The place and the side are true of the density from which the log was drawn.
        near = (spectrum.frequency > 0.99 * low) & (spectrum.frequency < 1.01 * high)
        omega = 2 * np.pi * spectrum.frequency[near] / RATE
        truth = model.sampled_spectrum(omega, RATE) / RATE
        assert side * np.mean(np.log(truth / fitted[near])) > 0.02


@pytest.mark.parametrize("change", [1.4, 0.6])
def test_the_place_is_where_the_spectrum_was_changed(rng, change: float) -> None:
    for _ in range(5):
        data = drawn(rng)
        inside = (FREQUENCY > 2.16) & (FREQUENCY < 3.15)  # a sixth of a decade
        data[inside] *= change
        judgement = judged(data)
        assert judgement.verdict == "not explained"
        low, high, side, distance = place(judgement.where)
        assert low == pytest.approx(FREQUENCY[inside][0], rel=0.01)
        assert high == pytest.approx(FREQUENCY[inside][-1], rel=0.01)
        assert side == np.sign(change - 1)
        # The normal score of the summed power of these bins.
        nu = BINS[inside].sum()
        power = (BINS * data)[inside].sum()
        score = abs(stats.norm.isf(stats.chi2(nu).sf(power) if side > 0 else 0.5))
        rough = abs(power / nu - 1) * np.sqrt(nu / 2)
        assert distance == pytest.approx(score if 0 < score < 30 else rough, rel=0.3)


def test_the_order_of_the_bins_tells_a_wrong_shape_that_their_deviance_does_not(rng) -> None:
    nu = np.full(200, 100.0)
    for _ in range(5):
        data = drawn(rng, nu)
        risen = np.sort(data)
        assert judged(data, nu).verdict == "explained"
        assert judged(risen, nu).verdict == "not explained"
        assert judged(risen, nu).deviance == pytest.approx(judged(data, nu).deviance)


def test_a_single_wild_bin_is_no_explained_spectrum(rng) -> None:
    for where, height in ((0, 250.0), (70, 100.0), (203, 1.6)):
        data = drawn(rng)
        assert judged(data).verdict == "explained"
        data[where] = height
        judgement = judged(data)
        assert judgement.verdict == "not explained"
        low, high, side, _ = place(judgement.where)
        assert side == 1
        assert 0.99 * low <= FREQUENCY[where] <= 1.01 * high


def test_units_make_no_difference(rng) -> None:
    data = drawn(rng)
    small = assess_goodness_of_fit(BINS, 1e-14 * data, np.full(len(BINS), 1e-14), FREQUENCY, 2)
    assert small.chance == pytest.approx(judged(data, parameters=2).chance, rel=1e-9)
    assert small.where == judged(data, parameters=2).where


def test_an_empty_bin_does_not_break_the_judgement(rng) -> None:
    # A ramp that is taken out may leave nothing in an ordinate.
    data = drawn(rng)
    data[3] = 0.0
    judgement = judged(data)
    assert np.isfinite(judgement.deviance)
    assert 0 <= judgement.chance <= 1


@pytest.mark.parametrize("size", [0.17, 0.2, 0.215])
def test_the_chance_is_that_of_the_deviance_of_residuals_that_alternate(size: float) -> None:
    nu = np.full(200, 50.0)
    ratio = 1.0 + size * (-1.0) ** np.arange(len(nu))
    # Chi-squared over its degrees of freedom, from its density.
    x = stats.chi2(50.0)
    mean, square = (
        x.expect(lambda x, power=power: (x / 50.0 - 1.0 - np.log(x / 50.0)) ** power)
        for power in (1, 2)
    )
    far = (ratio - 1.0 - np.log(ratio) - mean).sum() / np.sqrt(len(nu) * (square - mean**2))
    expected = min(1.0, 2.0 * stats.norm.sf(far))
    assert judged(ratio, nu).chance == pytest.approx(expected, rel=1e-3)
