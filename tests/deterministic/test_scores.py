"""The matched filter at every place at once is the plain least-squares gain at each."""

import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.estimators.deterministic.means import average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates, Regressor
from imubench_pipeline.estimators.deterministic.search import (
    FALSE_ALARM_PROBABILITY,
    Gain,
    find_best_scores,
)
from tests.deterministic.logs import RATE, SIGMA, static_log, times


def test_the_best_step_of_the_transform_gains_what_least_squares_say() -> None:
    log = static_log(1, hours=0.5)
    log += 4.0 * SIGMA * (times(log) > 700.0)
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    fit = ordinates.fit([Regressor("exponential", 0, 150.0)])
    step = next(
        score
        for score in find_best_scores(ordinates, fit, fit.density)
        if score.regressor.kind == "step"
    )
    gain = Gain(ordinates, fit.regressors, fit.density, 0)
    assert step.gain == pytest.approx(gain.of(step.regressor), rel=1e-6)
    n = ordinates.sizes[0]
    others = [gain.of(Regressor("step", 0, float(place))) for place in range(3, n - 3, 7)]
    assert step.gain >= max(others)
    weight = ordinates.weights(fit.density)
    rows = np.concatenate([ordinates.columns(x) for x in (*fit.regressors, step.regressor)])
    scaled = rows * np.sqrt(weight)
    data = ordinates.coefficient * np.sqrt(weight)
    left = [float(np.linalg.lstsq(scaled[:p].T, data)[1][0]) for p in (1, 2)]
    assert step.gain == pytest.approx(left[0] - left[1], rel=1e-6)


@pytest.mark.parametrize("cycles", [0.3, 0.7, 2.4])
def test_a_sinusoid_gains_what_least_squares_of_both_amplitudes_say(cycles: float) -> None:
    log = static_log(4, hours=0.5)
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    fit = ordinates.fit([Regressor("step", 0, 100.0)])
    sinusoid = Regressor("sinusoid", 0, cycles / ordinates.sizes[0])
    scale = np.sqrt(ordinates.weights(fit.density))
    rows = [ordinates.columns(x) * scale for x in (*fit.regressors, sinusoid)]
    data = ordinates.coefficient * scale
    left = [float(np.linalg.lstsq(np.concatenate(part).T, data)[1][0]) for part in (rows[:1], rows)]
    gain = Gain(ordinates, fit.regressors, fit.density, 0).of(sinusoid)
    assert gain == pytest.approx(left[0] - left[1], rel=1e-6)


def test_leverages_sum_up_to_the_number_of_amplitudes() -> None:
    log = static_log(2, hours=0.5)
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    regressors = [Regressor("step", 0, 300.0), Regressor("sinusoid", 0, 0.004)]
    assert ordinates.fit(regressors).leverage.sum() == pytest.approx(3.0)


@pytest.mark.release
def test_the_threshold_of_a_step_counts_the_places_that_noise_tells_apart() -> None:
    log = static_log(3, hours=0.5)
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    fit = ordinates.fit([])
    scores = find_best_scores(ordinates, fit, fit.density)
    step = next(score for score in scores if score.regressor.kind == "step")
    n = ordinates.sizes[0]
    # The matched filter of noise at all places, and how alike it is at neighbouring ones.
    scale = np.sqrt(ordinates.weights(fit.density))
    rows = np.concatenate([ordinates.columns(Regressor("step", 0, float(p))) for p in range(1, n)])
    rows *= scale
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    alike = np.sum(rows[1:] * rows[:-1], axis=1)[n // 4 : -n // 4].mean()
    apart = (n - 1) * np.sqrt(2.0 * (1.0 - alike))
    # Rice: a normal process crosses a level so often.
    chance = apart / np.pi * np.exp(-0.5 * step.threshold)
    assert chance == pytest.approx(FALSE_ALARM_PROBABILITY, rel=0.1)


@pytest.mark.parametrize("kind", ["exponential", "sinusoid", "ramp"])
def test_the_best_of_each_kind_gains_what_least_squares_say(kind: str) -> None:
    log = static_log(5, hours=0.5)
    t = times(log)
    log += {
        "exponential": 6.0 * SIGMA * np.exp(-t / 200.0),
        "sinusoid": 3.0 * SIGMA * np.sin(2.0 * np.pi * t / 180.0),
        "ramp": 6.0 * SIGMA * t / 1800.0,
    }[kind]
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    fit = ordinates.fit([Regressor("step", 0, 2500.0)])
    (score,) = [
        x for x in find_best_scores(ordinates, fit, fit.density) if x.regressor.kind == kind
    ]
    n, interval = ordinates.sizes[0], ordinates.means.interval
    scale = np.sqrt(ordinates.weights(fit.density))
    data = ordinates.coefficient * scale

    def gain(regressor: Regressor) -> float:
        beside = ordinates.columns(fit.regressors[0]) * scale
        rows = np.concatenate([beside, ordinates.columns(regressor) * scale])
        left = [float(np.linalg.lstsq(part.T, data)[1][0]) for part in (beside, rows)]
        return left[0] - left[1]

    # Of slow signals the lowest ordinates alone are looked at.
    assert score.gain == pytest.approx(gain(score.regressor), rel=0.02)
    if kind == "exponential":
        assert score.regressor.where * interval == pytest.approx(200.0, rel=0.25)
        tried = np.geomspace(n / 200, n / 2, 24)
        assert np.abs(np.log(tried / score.regressor.where)).min() < 1e-9
        assert score.gain >= 0.98 * max(gain(Regressor("exponential", 0, x)) for x in tried)
    elif kind == "sinusoid":
        assert score.regressor.where * n == pytest.approx(10.0)
        others = [gain(Regressor("sinusoid", 0, 0.25 * k / n)) for k in range(1, 257)]
        assert score.gain >= 0.98 * max(others)


def test_thresholds_count_what_was_tried() -> None:
    log = static_log(3, hours=0.5)
    halves = [(0, len(log) // 2), (len(log) // 2, len(log))]
    for spans, parts in (([(0, len(log))], 1), (halves, 2)):
        ordinates = Ordinates(average_blocks([log], len(log), RATE, spans))
        fit = ordinates.fit([])
        found = list(find_best_scores(ordinates, fit, fit.density))
        assert len(found) == 4 * parts
        # Of 256 periods and 24 time constants half are independent.
        for kind, places in (("ramp", 1), ("sinusoid", 128), ("exponential", 12)):
            (threshold,) = {x.threshold for x in found if x.regressor.kind == kind}
            chance = places * stats.chi2(2).sf(threshold)
            assert chance == pytest.approx(FALSE_ALARM_PROBABILITY / parts, rel=1e-6)
        slow = [
            x.regressor.kind for x in find_best_scores(ordinates, fit, fit.density, smooth=True)
        ]
        assert sorted(slow) == sorted(["exponential", "sinusoid", "ramp"] * parts)


def test_what_others_explain_wholly_gains_nothing() -> None:
    log = static_log(3, hours=0.5)
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    fit = ordinates.fit([Regressor("ramp", 0)])
    scores = {x.regressor.kind: x for x in find_best_scores(ordinates, fit, fit.density)}
    assert scores["ramp"].gain == 0.0
    # No step is placed at the ends.
    n = ordinates.sizes[0]
    for level, where in ((2, 3.0), (n - 2, n - 3.0)):
        jump = log + 1.0 * (np.arange(len(log)) >= level * ordinates.means.block)
        far = Ordinates(average_blocks([jump], len(jump), RATE))
        (step,) = [
            x for x in find_best_scores(far, far.fit([]), fit.density) if x.regressor.kind == "step"
        ]
        assert step.regressor.where == where
