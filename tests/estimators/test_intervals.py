"""Intervals over models: what a log says of a term that the chosen model has, or has not."""

import numpy as np
import pytest

from imubench_pipeline.estimators.likelihood import Likelihood, fit
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 10.0
SAMPLES = 72_000


def fitted(model: NoiseModel, seed: int) -> Likelihood:
    return fit(simulate(model, RATE, SAMPLES, np.random.default_rng(seed)), RATE)


@pytest.mark.release
@pytest.mark.parametrize("seed", few([0], [1, 3]))
def test_a_process_that_is_taken_for_a_walk_is_within_the_limits(seed: int) -> None:
    # Two hours of a correlation time of five minutes: BIC with its unit root takes the walk.
    truth = NoiseModel(N=4.7e-4, B=7.8e-4, T_B=300.0)
    found = fitted(truth, seed)
    assert found.candidates[0].terms.name == "N+K"
    B, K = (found.estimates[0].parameters[name] for name in ("B", "K"))
    # The process is about as good, and BIC alone is no reason to say that it is not there.
    assert (B.status, B.value) == ("not_identified", None)
    assert "N+GM" in (B.reason or "")
    assert B.upper is not None
    assert B.upper > truth.B
    # Nor is there a walk in truth: its limits, over all models, reach down to nothing.
    assert (K.value, K.status, K.lower) == (None, "not_identified", 0.0)
    assert K.upper is not None and K.fitted is not None
    assert K.upper > K.fitted


def test_the_limits_of_what_is_absent_are_those_of_white_noise_alone() -> None:
    found = fitted(NoiseModel(N=1e-3), 4).estimates[0]
    for name in ("B", "K"):
        parameter = found.parameters[name]
        assert parameter.status == "absent"
        assert parameter.lower == 0.0
        assert parameter.upper is not None
    # A process of B and T_B has at most a part of the density of the white noise: B^2 T_B < N^2.
    B = found.parameters["B"].upper
    assert B is not None
    assert B < 1e-3
    # White noise alone is told to N / sqrt(2 L), the Cramér-Rao bound.
    N = found.parameters["N"]
    assert N.status == "ok" and N.value is not None and N.lower is not None and N.upper is not None
    bound = 1e-3 / np.sqrt(2 * SAMPLES)
    assert abs(N.value - 1e-3) < 4 * bound
    assert (N.upper - N.lower) / (2 * 1.96) == pytest.approx(bound, rel=0.25)
