"""The matched filter at every place at once is the plain least-squares gain at each."""

import numpy as np
import pytest

from imubench_pipeline.deterministic.means import means_of
from imubench_pipeline.deterministic.ordinates import Ordinates
from imubench_pipeline.deterministic.regressors import Regressor
from imubench_pipeline.deterministic.scores import Gain, best_scores
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


def test_leverages_sum_up_to_the_number_of_amplitudes() -> None:
    log = static_log(2, hours=0.5)
    ordinates = Ordinates(means_of([log], len(log), RATE))
    regressors = [Regressor("step", 0, 300.0), Regressor("sinusoid", 0, 0.004)]
    assert ordinates.fit(regressors).leverage.sum() == pytest.approx(3.0)
