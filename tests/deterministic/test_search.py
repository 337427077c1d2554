"""The parts of the search, each by what it should come to."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.estimators.deterministic.means import Means, Part, average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from imubench_pipeline.estimators.deterministic.scores import Gain, Score
from imubench_pipeline.estimators.deterministic.search import (
    Rival,
    find_candidates,
    find_walk_rival,
    fit_steps_at_pauses,
    fit_with_candidate,
    is_at_pause,
    list_restarts,
    polish,
    search_signals,
)
from imubench_pipeline.estimators.whittle import Terms
from tests.deterministic.logs import RATE, SIGMA, static_log, times


@pytest.fixture(scope="module")
def log() -> np.ndarray:
    return static_log(1, hours=0.5)


def of(log: np.ndarray) -> Ordinates:
    return Ordinates(average_blocks([log], len(log), RATE))


def with_pauses(log: np.ndarray, pauses: tuple[tuple[float, float], ...]) -> Ordinates:
    means = average_blocks([log], len(log), RATE)
    part = replace(means.parts[0], pauses=pauses)
    return Ordinates(replace(means, parts=(part,)))


def test_a_step_within_two_blocks_of_a_pause_may_be_in_it() -> None:
    pause = Regressor("restart", 0, 100.0, 20.0)
    places = (87.9, 88.1, 100.0, 111.9, 112.1)
    found = [is_at_pause(Regressor("step", 0, place), pause) for place in places]
    assert found == [False, True, True, True, False]
    assert not is_at_pause(Regressor("step", 1, 100.0), pause)
    part = Part(0, np.zeros(99), np.zeros(99), 0.0, ((10.0, 4.0), (50.5, 9.0)))
    means = Means(10, 1.0, (replace(part, pauses=()), part))
    ordinates = Ordinates(means)
    expected = (Regressor("restart", 1, 10.0, 4.0), Regressor("restart", 1, 50.5, 9.0))
    assert list_restarts(ordinates) == expected


def test_a_step_in_a_pause_is_put_at_the_pause(log: np.ndarray) -> None:
    stepped = log + 5.0 * SIGMA * (times(log) >= 700.0)
    for pauses, kind in ((((1401.0, 6.0),), "restart"), (((1380.0, 6.0),), "step"), ((), "step")):
        ordinates = with_pauses(stepped, pauses)
        fit = ordinates.fit([])
        kinds = [score.regressor for score, _ in find_candidates(ordinates, fit)]
        best = [x for x in kinds if x.kind in ("step", "restart")]
        assert [x.kind for x in best] == [kind]
        assert best[0].where == (1401.0 if kind == "restart" else pytest.approx(1400.0, abs=2.0))


@pytest.mark.parametrize(
    ("right", "off"),
    [
        (Regressor("step", 0, 1400.3), 0.75),
        (Regressor("exponential", 0, 300.0), 40.0),
        (Regressor("sinusoid", 0, 0.0031), 3e-5),
    ],
)
def test_a_place_is_moved_to_where_it_fits_best(right: Regressor, off: float) -> None:
    n = 3600
    signal = 50.0 * (np.array([1.0, 0.7])[: right.columns] @ right.means(n))
    values = signal + np.random.default_rng(4).standard_normal(n)
    ordinates = Ordinates(Means(10, RATE, (Part(0, values, np.ones(n), 0.0),)))
    density = np.full(n - 1, ordinates.means.interval)
    beside = Regressor("ramp", 0)
    start = replace(right, where=right.where - off)
    first, moved = polish(ordinates, (beside, start), 1, density)
    assert first == beside
    # Steps are halved five times.
    fine = {"step": 1 / 32, "exponential": 0.12 * start.where / 16, "sinusoid": 0.125 / n / 16}
    assert abs(moved.where - right.where) < 2.0 * fine[right.kind]
    gain = Gain(ordinates, (beside,), density, 0)
    near = [gain.of(replace(moved, where=moved.where + s * fine[right.kind])) for s in (-1, 1)]
    assert gain.of(moved) >= max(near)
    assert polish(ordinates, (beside, start), 0, density) == (beside, start)


def test_a_sinusoid_in_a_hump_of_the_spectrum_counts_for_less(log: np.ndarray) -> None:
    t = times(log)
    swinging = log + 3.0 * SIGMA * np.sin(2.0 * np.pi * t / 120.0)
    ordinates = of(swinging)
    fit = ordinates.fit([])
    sinusoid = Regressor("sinusoid", 0, 15.0 / ordinates.sizes[0])
    tried, gain = fit_with_candidate(ordinates, fit, Score(sinusoid, 99.0, 10.0), fit.density)
    plain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    # Ordinates 3 to 16 away from the thirtieth, over what the noise has there.
    ratio = tried.residual**2 * ordinates.weights(tried.density)
    away = np.abs(np.arange(1, len(ratio) + 1) - 30)
    beside = ratio[(away >= 3) & (away <= 16)]
    level = max(beside.mean() - 2.0 * np.sqrt(2.0 / 28), 1.0)
    assert gain == pytest.approx(plain / level)
    # Beside a weak model of the noise the hump is taken off.
    loud = replace(ordinates.means.parts[0])
    hump = np.random.default_rng(2).standard_normal(len(loud.mean))
    spectrum = np.fft.rfft(hump)
    cycles = np.arange(len(spectrum))
    spectrum[np.abs(cycles - 15) > 8] = 0.0
    humped = loud.mean + 20.0 * SIGMA * np.fft.irfft(spectrum, len(hump))
    other = Ordinates(replace(ordinates.means, parts=(replace(loud, mean=humped),)))
    fit = other.fit([])
    tried, gain = fit_with_candidate(other, fit, Score(sinusoid, 99.0, 10.0), fit.density)
    ratio = tried.residual**2 * other.weights(tried.density)
    beside = ratio[(away >= 3) & (away <= 16)]
    level = beside.mean() - 2.0 * np.sqrt(2.0 / 28)
    assert level > 1.5
    plain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    assert gain == pytest.approx(plain / level)


def test_steps_at_pauses_are_judged_by_their_number(log: np.ndarray) -> None:
    pauses = ((700.0, 6.0), (1500.0, 6.0), (2500.0, 6.0))
    ordinates = with_pauses(log, pauses)
    fit = ordinates.fit([])
    found = fit_steps_at_pauses(ordinates, fit, 2.0)
    assert found is not None
    assert [x.where for x in found.signals] == [700.0, 1500.0, 2500.0]
    gain = 2.0 * (found.fit.log_likelihood - fit.log_likelihood)
    threshold = stats.chi2(3).isf(0.001)
    assert found.beyond == pytest.approx(gain - 2.0 - threshold)
    # As good by AIC: three places that are known for one random walk, and a half.
    assert found.near == pytest.approx(threshold - 4.0 + 0.5)
    assert fit_steps_at_pauses(of(log), fit) is None
    one = ordinates.fit([Regressor("step", 0, 702.0), Regressor("restart", 0, 1500.0, 6.0)])
    rest = fit_steps_at_pauses(ordinates, one)
    assert rest is not None and [x.where for x in rest.signals] == [2500.0]
    gain = 2.0 * (rest.fit.log_likelihood - one.log_likelihood)
    assert rest.beyond == pytest.approx(gain - stats.chi2(1).isf(0.001))


def test_a_rival_is_better_above_and_as_good_a_little_below() -> None:
    fit = search_of_nothing()
    for beyond, better, as_good in ((0.1, True, True), (-3.9, False, True), (-4.1, False, False)):
        rival = Rival(fit, (), beyond)
        assert (rival.better, rival.as_good) == (better, as_good)


def search_of_nothing() -> Fit:
    nothing = np.empty(0)
    # No noise is fitted: the search does not ask this fit for it.
    return Fit((), nothing, np.empty((0, 0)), None, nothing, nothing, nothing, 0.0)  # type: ignore[arg-type]  # no noise


def test_each_regressor_that_is_kept_is_needed_beside_the_others(log: np.ndarray) -> None:
    t = times(log)
    spoilt = log + 6.0 * SIGMA * (t >= 700.0) + 12.0 * SIGMA * np.exp(-t / 100.0)
    ordinates = of(spoilt)
    found = search_signals(ordinates)
    kinds = sorted(x.kind for x in found.fit.regressors)
    assert kinds == ["exponential", "step"]
    for which, gain in enumerate(found.gains):
        others = tuple(x for i, x in enumerate(found.fit.regressors) if i != which)
        without = ordinates.fit(others, found.fit.density)
        lost = 2.0 * (found.fit.log_likelihood - without.log_likelihood)
        assert gain == pytest.approx(lost)
    assert not found.many


def test_a_rival_is_judged_over_the_walk_and_its_own_threshold() -> None:
    log = static_log(1, hours=0.5, walk=0.0)
    log += 2.0 * SIGMA * np.sin(2.0 * np.pi * times(log) / 2400.0 + 0.5)
    ordinates = of(log)
    fit = ordinates.fit([])
    found = find_walk_rival(ordinates, fit)
    assert found is not None
    bare = ordinates.fit([], fit.density, Terms("NF", 1))
    walk = 2.0 * (fit.log_likelihood - bare.log_likelihood)
    beyond = {}
    for score, density in find_candidates(ordinates, bare):
        kind = score.regressor.kind
        if kind not in ("ramp", "pulse"):
            gain = fit_with_candidate(ordinates, bare, score, density)[1]
            factor = 1.0 if kind == "step" else 1.15
            beyond[gain - walk - factor * score.threshold] = kind
    best = max(beyond)
    assert (found.signals[0].kind, found.beyond) == (beyond[best], pytest.approx(best))
    # Nothing stands against a walk that is not there.
    none = replace(fit, noise=replace(fit.noise, powers=fit.noise.powers * [1, 1, 0, 1]))
    assert find_walk_rival(ordinates, none) is None
