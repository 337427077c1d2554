import numpy as np
import pytest

from imubench_pipeline.estimators.score import score


def test_scores_by_hand() -> None:
    measured = np.array([1.0, 2.0, 4.0])
    found = score(
        measured, measured * [1.0, 10.0, 1.0], measured * 0.9, measured * [1.1, 1.1, 0.95]
    )
    assert found.rms == pytest.approx(18 / np.sqrt(3))
    assert found.rms_log10 == pytest.approx(1 / np.sqrt(3))
    assert found.inside_band == pytest.approx(2 / 3)


def test_a_perfect_reconstruction() -> None:
    measured = np.array([1.0, 2.0])
    found = score(measured, measured, measured, measured)
    assert (found.rms, found.rms_log10, found.inside_band) == (0.0, 0.0, 1.0)


def test_shapes_must_agree() -> None:
    with pytest.raises(ValueError, match="shapes differ"):
        score(np.ones(3), np.ones(2), np.ones(3), np.ones(3))
