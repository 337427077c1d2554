"""The errors of sizes, over the random walks that the log allows."""

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.means import average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates, average_covariance
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from tests.deterministic.logs import RATE, static_log


def fitted(seed: int, walk: float) -> tuple[Ordinates, Fit]:
    log = static_log(seed, walk=walk)
    ordinates = Ordinates(average_blocks([log], len(log), RATE))
    return ordinates, ordinates.fit([Regressor("step", 0, 0.4 * ordinates.sizes[0])])


def test_a_walk_that_is_well_known_leaves_the_error_as_it_is() -> None:
    ordinates, fit = fitted(1, 1e-4)
    wider = average_covariance(ordinates, fit)
    assert np.sqrt(wider / fit.covariance) == pytest.approx(1.0, abs=0.05)


def test_a_walk_that_is_fitted_as_none_leaves_the_error_larger() -> None:
    ordinates, fit = fitted(3, 0.0)
    assert fit.noise.parameter("K") == 0.0
    wider = average_covariance(ordinates, fit)
    assert 1.1 < np.sqrt(wider / fit.covariance) < 4.0


def test_two_amplitudes_that_are_one_do_no_harm() -> None:
    ordinates, _ = fitted(3, 0.0)
    twice = [Regressor("step", 0, 300.0), Regressor("step", 0, 300.0 + 1e-9)]
    assert np.isfinite(average_covariance(ordinates, ordinates.fit(twice))).all()
