"""Regressors: their means in blocks, their cosine transform, their values."""

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.ordinates import Regressor

EVERY = [
    Regressor("step", 0, 20.25),
    Regressor("exponential", 0, 11.0),
    Regressor("sinusoid", 0, 0.03),
    Regressor("ramp", 0),
]


@pytest.mark.parametrize("regressor", EVERY, ids=lambda one: one.kind)
def test_means_are_the_means_of_the_values(regressor: Regressor) -> None:
    fine = 400
    inside = (np.arange(64 * fine) + 0.5) / fine
    expected = regressor.at(inside).reshape(-1, 64, fine).mean(axis=2)
    assert regressor.means(64) == pytest.approx(expected, abs=1e-4)


def test_a_step_has_the_sines_of_its_place_as_coefficients() -> None:
    n, place = 50, 13
    k = np.arange(1, n)
    sines = np.sin(np.pi * k * place / n) / (2.0 * np.sin(np.pi * k / (2.0 * n)))
    found = Regressor("step", 0, float(place)).coefficients(n)[0]
    assert found == pytest.approx(-np.sqrt(2.0 / n) * sines, abs=1e-12)
