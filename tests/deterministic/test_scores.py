"""The matched filter at every place at once is the plain least-squares gain at each."""

import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.estimators.deterministic.means import means_of
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from imubench_pipeline.estimators.deterministic.scores import FALSE_ALARM, Gain, best_scores
from tests.deterministic.logs import RATE, SIGMA, static_log, times


def test_the_best_step_of_the_transform_gains_what_least_squares_say() -> None:
    log = static_log(1, hours=0.5)
    log += 4.0 * SIGMA * (times(log) > 700.0)
    ordinates = Ordinates(means_of([log], len(log), RATE))
    fit = ordinates.fit([Regressor("exponential", 0, 150.0)])
    step = next(
        score
        for score in best_scores(ordinates, fit, fit.density)
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
    ordinates = Ordinates(means_of([log], len(log), RATE))
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
    ordinates = Ordinates(means_of([log], len(log), RATE))
    regressors = [Regressor("step", 0, 300.0), Regressor("sinusoid", 0, 0.004)]
    assert ordinates.fit(regressors).leverage.sum() == pytest.approx(3.0)


def test_the_threshold_of_a_step_counts_the_places_that_noise_tells_apart() -> None:
    log = static_log(3, hours=0.5)
    ordinates = Ordinates(means_of([log], len(log), RATE))
    fit = ordinates.fit([])
    scores = best_scores(ordinates, fit, fit.density)
    step = next(score for score in scores if score.regressor.kind == "step")
    n = ordinates.sizes[0]
    # The matched filter of noise at all places, and how alike it is at neighbouring ones.
    scale = np.sqrt(ordinates.weights(fit.density))
    rows = np.concatenate([ordinates.columns(Regressor("step", 0, float(p))) for p in range(1, n)])
    rows *= scale
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    alike = np.sum(rows[1:] * rows[:-1], axis=1)[n // 4 : -n // 4].mean()
    apart = (n - 1) * np.sqrt(2.0 * (1.0 - alike))
    # Rice: a normal process crosses a level so often; and it begins above it with a chance.
    chance = stats.chi2(1).sf(step.threshold) + apart / np.pi * np.exp(-0.5 * step.threshold)
    assert chance == pytest.approx(FALSE_ALARM["step"], rel=0.1)
