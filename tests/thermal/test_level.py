import pytest

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.thermal.uncertainty import add_likely_walk
from imubench_pipeline.noise import NoiseModel


def test_a_walk_that_does_not_show_is_as_strong_as_it_may_be():
    model = NoiseModel(N=1e-4, B=1e-5, T_B=100.0)
    absent = Parameter(None, "absent", "the data do not ask for it", 0.0, 1.96e-6)
    # Of |normal| variates 97.5 % are below 2.241 standard deviations.
    assert add_likely_walk(model, absent).K == pytest.approx(1.96e-6 / 2.2414, rel=1e-3)
    assert add_likely_walk(NoiseModel(N=1e-4, K=1e-5), absent).K == 1e-5


def test_a_walk_that_shows_is_kept():
    model = NoiseModel(N=1e-4, K=1e-6)
    assert add_likely_walk(model, Parameter(1e-6, lower=5e-7, upper=4e-6)) == model
