"""Regressors: their means in blocks, their cosine transform, their values."""

import numpy as np
import pytest
import scipy.fft

from imubench_pipeline.estimators.deterministic.regressors import Regressor

EVERY = [
    Regressor("step", 0, 20.25),
    Regressor("exponential", 0, 11.0),
    Regressor("sinusoid", 0, 0.03),
    Regressor("ramp", 0),
    Regressor("pulse", 0, 7.0),
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


@pytest.mark.parametrize("n", [64, 251])
@pytest.mark.parametrize("where", [0.25, 1.0, 3.37, 8.5])
def test_the_closed_forms_are_the_cosine_transforms(n: int, where: float) -> None:
    for regressor in (
        Regressor("sinusoid", 0, where / n),
        Regressor("exponential", 0, 4.0 * where),
    ):
        expected = scipy.fft.dct(regressor.means(n), type=2, norm="ortho", axis=1)[:, 1:]
        assert regressor.coefficients(n) == pytest.approx(expected, abs=1e-12)


def test_a_step_begins_at_its_place_and_a_pulse_lasts_a_block() -> None:
    blocks = np.array([6.99, 7.0, 7.99, 8.0])
    for kind, expected in (
        ("step", [0, 1, 1, 1]),
        ("restart", [0, 1, 1, 1]),
        ("pulse", [0, 1, 1, 0]),
    ):
        assert Regressor(kind, 0, 7.0).at(blocks).tolist() == [expected]


def test_a_restart_is_a_line_over_its_pause() -> None:
    # Blocks 5 to 8 are missing, and interpolated between 4 and 9.
    found = Regressor("restart", 0, 7.0, 4.0).means(12)[0]
    assert found == pytest.approx([0, 0, 0, 0, 0, 0.2, 0.4, 0.6, 0.8, 1, 1, 1])
