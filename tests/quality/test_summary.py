import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from imubench_pipeline.quality.summary import BLOCK, ColumnSummary

VALUES = st.sampled_from([-1.0, 0.0, 0.5, 2.0, np.nan, np.inf, -np.inf])


@given(arrays(np.float64, st.integers(0, 700), elements=VALUES), st.integers(1, 9))
def test_counts_are_those_of_the_whole_column(log: np.ndarray, pieces: int) -> None:
    column = ColumnSummary()
    back = [column.add(piece) for piece in np.array_split(log, pieces)]
    finite = log[np.isfinite(log)]
    np.testing.assert_array_equal(np.concatenate(back), np.where(np.isfinite(log), log, np.nan))
    assert column.present == len(finite)
    assert column.missing == np.isnan(log).sum()
    assert column.not_finite == np.isinf(log).sum()
    if len(finite) == 0:
        return
    assert (column.low, column.high) == (finite.min(), finite.max())
    assert column.at_extremes == ((finite == finite.min()).sum(), (finite == finite.max()).sum())
    assert column.repeats == (np.diff(finite) == 0).sum()
    changes = np.flatnonzero(np.diff(finite)) + 1
    runs = np.diff(np.concatenate(([0], changes, [len(finite)])))
    assert column.longest_run[0] == runs.max()
    steps = np.abs(np.diff(finite))
    assert column.step == np.min(steps[steps > 0], initial=np.inf)
    assert column.mean == pytest.approx(finite.mean(), abs=1e-12)


def test_blocks_are_those_of_the_records(rng: np.random.Generator) -> None:
    log = 9.81 + 1e-6 * rng.standard_normal(10 * BLOCK + 17)
    log[rng.random(len(log)) < 0.2] = np.nan
    log[3 * BLOCK : 4 * BLOCK] = np.nan
    column = ColumnSummary()
    for piece in np.array_split(log, 13):
        column.add(piece)
    blocks = column.blocks()
    assert len(blocks.mean) == 11
    for k in range(11):
        part = log[k * BLOCK : (k + 1) * BLOCK]
        part = part[np.isfinite(part)]
        assert blocks.count[k] == len(part)
        if len(part) == 0:
            assert np.isnan(blocks.mean[k])
            continue
        assert blocks.mean[k] == pytest.approx(part.mean(), abs=1e-14)
        assert blocks.spread[k] == pytest.approx(part.std(), rel=1e-6)
        assert (blocks.low[k], blocks.high[k]) == (part.min(), part.max())
