import numpy as np
import pytest

from imubench_pipeline.estimators.score import beats, rms, score, weights


def test_scores_by_hand() -> None:
    measured = np.array([1.0, 2.0, 4.0])
    same = np.full(3, 0.1)
    draws = np.array([measured * 0.9, measured, measured * [1.1, 1.1, 0.95]])
    found = score(measured, same, measured * [1.0, 10.0, 1.0], draws)
    assert found.rms == pytest.approx(18 / np.sqrt(3))
    assert found.rms_log10 == pytest.approx(1 / np.sqrt(3))
    # Of three draws the median is the middle one: 0, hypot(0.1, 0.2, 0.2), hypot(0.1, 0.2, 0.4).
    assert found.whole == pytest.approx(0.3 / np.sqrt(3))
    assert found.drawn == pytest.approx(found.whole)
    assert found.whole_lower == pytest.approx(0.1 * found.whole)
    assert found.inside_band == pytest.approx(2 / 3)


def test_a_tau_counts_by_how_sure_the_curve_is_there() -> None:
    weight = weights(np.array([1e-4, 0.02, 0.2]))
    assert weight.sum() == pytest.approx(1.0)
    assert weight / weight[0] == pytest.approx([1.0, 0.5, 1 / 101], rel=1e-4)
    measured, error = np.ones(3), np.array([1e-4, 1e-4, 1.0])
    at_the_end = score(measured, error, np.array([1.0, 1.0, 2.0]), np.ones((2, 3)))
    assert at_the_end.rms < 0.02 < 1.0 / np.sqrt(3)


def test_the_chance_that_one_draw_beats_another() -> None:
    assert beats(np.array([1.0, 3.0]), np.array([2.0, 4.0])) == pytest.approx(3 / 4)
    assert beats(np.array([1.0]), np.array([2.0])) == 1.0
    same = np.random.default_rng(1).standard_normal(2000)
    assert beats(same, same) == pytest.approx(0.5, abs=1e-3)


def test_a_perfect_reconstruction() -> None:
    measured = np.array([1.0, 2.0])
    found = score(measured, np.full(2, 0.1), measured, np.array([measured, measured]))
    assert (found.rms, found.drawn_log10_upper, found.inside_band) == (0.0, 0.0, 1.0)


def test_the_rms_of_many_curves_and_one() -> None:
    many = rms(np.array([[1.0, 2.0], [1.0, 5.0]]), np.array([1.0, 1.0]))
    assert many == pytest.approx([1 / np.sqrt(2), 4 / np.sqrt(2)])
