"""Samples that were truncated towards 0, and registers that round."""

import numpy as np
import pytest

from imubench_pipeline.recordings.quality.levels import is_truncated
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.typing import Array


def judge(log: Array, step: float) -> bool:
    column = ColumnSummary()
    column.add(log)
    return is_truncated(column, step)


@pytest.mark.parametrize("sigma", [1.3, 2.0, 4.0])
@pytest.mark.parametrize("mean", [-0.4, 0.0, 0.6])
def test_truncation_is_found_and_rounding_is_not(
    sigma: float, mean: float, rng: np.random.Generator
) -> None:
    """In units of the step, with a mean that wanders by half a step."""
    log = mean + sigma * rng.standard_normal(60_000) + 0.5 * np.sin(np.linspace(0.0, 9.0, 60_000))
    step = 0.0013
    assert judge(np.trunc(log) * step, step)
    for rounded in (np.round(log), np.floor(log), np.ceil(log)):
        assert not judge(rounded * step, step)
    assert not judge((np.trunc(log) + 50.0) * step, step)  # truncated elsewhere: it cannot be seen


@pytest.mark.parametrize("freedom", [3.0, 5.0])
def test_heavy_tails_are_not_truncation(freedom: float, rng: np.random.Generator) -> None:
    assert not judge(np.round(rng.standard_t(freedom, 60_000) * 2.0), 1.0)
