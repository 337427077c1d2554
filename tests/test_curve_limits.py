from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.allan import FITTED, POWER_LAW, AllanCurve, allan_variance
from imubench_pipeline.allan.phase import count_presence
from imubench_pipeline.estimators.curve_limits import add_fitted_limits
from imubench_pipeline.estimators.likelihood import Likelihood, fit
from imubench_pipeline.noise.spectral_degrees import compute_degrees_of_freedom


def gauss_markov(samples: int, time: float, rng: np.random.Generator) -> np.ndarray:
    """Of unit variance, by its recursion."""
    p = np.exp(-1.0 / time)
    x = np.sqrt(1.0 - p * p) * rng.standard_normal(samples)
    for i in range(1, samples):
        x[i] += p * x[i - 1]
    return x


LOG = gauss_markov(20_000, 50.0, np.random.default_rng(5))
LOG += 0.5 * np.random.default_rng(6).standard_normal(20_000)


@pytest.fixture(scope="module")
def found() -> Likelihood:
    return fit(LOG, 1.0)


@pytest.mark.release
def test_the_degrees_are_those_of_the_fitted_model(found: Likelihood) -> None:
    curve = allan_variance(LOG, 1.0)
    limited = add_fitted_limits(curve, found)
    assert set(limited.edf_source) == {FITTED}
    model = found.estimates[0].model
    expected = compute_degrees_of_freedom(model, 1.0, curve.cluster_size, len(LOG))
    np.testing.assert_allclose(limited.edf, expected[0], rtol=0.1)
    # Near the hump there are fewer than the power law there has.
    hump = np.argmax(limited.variance * (limited.tau > 20.0))
    assert limited.edf[hump] < 0.9 * curve.edf[hump]


def test_a_model_that_does_not_explain_the_log_only_widens_limits(found: Likelihood) -> None:
    chosen = found.candidates[0]
    poor = replace(chosen, goodness=replace(chosen.goodness, verdict="not explained"))
    doubted = replace(found, candidates=[poor, *found.candidates[1:]])
    curve = allan_variance(LOG, 1.0)
    limited = add_fitted_limits(curve, doubted)
    np.testing.assert_array_equal(
        limited.edf, np.minimum(curve.edf, add_fitted_limits(curve, found).edf)
    )
    assert set(limited.edf_source) == {FITTED, POWER_LAW}


def test_where_few_clusters_are_left_a_walk_may_be_larger_than_its_estimate(
    found: Likelihood,
) -> None:
    curve = allan_variance(LOG, 1.0)
    limited = add_fitted_limits(curve, found)
    model = found.estimates[0].model
    upper = found.estimates[0].parameters["K"].upper
    assert upper is not None and upper > model.K
    few = curve.cluster_size * 100 > curve.samples
    larger = compute_degrees_of_freedom(
        replace(model, K=(model.K + upper) / 2.0), 1.0, curve.cluster_size[few], len(LOG)
    )
    assert limited.edf_upper is not None
    np.testing.assert_allclose(limited.edf_upper[few], larger[1], rtol=0.05)
    unknown = replace(found.estimates[0], parameters={})
    alone = add_fitted_limits(curve, replace(found, estimates=[unknown, *found.estimates[1:]]))
    assert alone.edf_upper is not None
    np.testing.assert_array_equal(limited.edf_upper[~few], alone.edf_upper[~few])
    assert (limited.edf_upper[few] < 0.9 * alone.edf_upper[few]).any()


def test_a_log_without_a_fit_keeps_its_limits(found: Likelihood) -> None:
    curve = allan_variance(LOG, 1.0)
    assert add_fitted_limits(curve, replace(found, candidates=())) is curve


def test_holes_count(found: Likelihood) -> None:
    log = LOG.copy()
    log[8_000:12_000] = np.nan
    curve = allan_variance(log, 1.0)
    whole: AllanCurve = add_fitted_limits(allan_variance(LOG, 1.0), found)
    limited = add_fitted_limits(curve, found, None, count_presence([log], len(log)))
    short = limited.tau < 1_000.0
    same = np.isin(whole.tau, limited.tau[short])
    np.testing.assert_allclose(limited.edf[short] / whole.edf[same], 0.8, atol=0.1)
