import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from imubench_pipeline.recordings.quality import summary
from imubench_pipeline.recordings.quality.summary import (
    MAX_MEASUREMENT,
    MIN_BLOCK_SIZE,
    ColumnSummary,
)

VALUES = st.sampled_from([-1.0, 0.0, 0.5, 2.0, np.nan, np.inf, -np.inf, 1e300, -1e76])


@given(arrays(np.float64, st.integers(0, 700), elements=VALUES), st.integers(1, 9))
def test_counts_are_those_of_the_whole_column(log: np.ndarray, pieces: int) -> None:
    column = ColumnSummary()
    back = [column.add(piece) for piece in np.array_split(log, pieces)]
    beyond = np.abs(log) > MAX_MEASUREMENT
    finite = log[~np.isnan(log) & ~beyond]
    np.testing.assert_array_equal(np.concatenate(back), np.where(beyond, np.nan, log))
    assert column.present == len(finite)
    assert column.missing == np.isnan(log).sum()
    assert column.not_finite == beyond.sum()
    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.isnan(log) | beyond, [0]))))
    gaps = edges[1::2] - edges[::2]
    expected = (gaps.max(), edges[1::2][gaps.argmax()]) if len(gaps) else (0, 0)
    assert column.longest_gap == expected
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
    blocks = column.blocks()
    there = blocks.count > 0
    mean = np.average(blocks.mean[there], weights=blocks.count[there])
    assert mean == pytest.approx(finite.mean(), abs=1e-12)


@pytest.mark.parametrize(("many", "size"), [(1 << 15, 1), (8, 1), (4, 2), (3, 2), (2, 4)])
def test_blocks_are_those_of_the_records(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, many: int, size: int
) -> None:
    """However many there are: then blocks are made of several."""
    monkeypatch.setattr(summary, "_MAX_BLOCKS", many)
    log = 9.81 + 1e-6 * rng.standard_normal(10 * MIN_BLOCK_SIZE + 17)
    log[rng.random(len(log)) < 0.2] = np.nan
    log[3 * MIN_BLOCK_SIZE : 4 * MIN_BLOCK_SIZE] = np.nan
    column = ColumnSummary()
    for piece in np.array_split(log, 13):
        column.add(piece)
    blocks = column.blocks()
    assert blocks.size == size * MIN_BLOCK_SIZE
    assert len(blocks.mean) == -(-len(log) // blocks.size) <= max(2 * many, 2)
    for k in range(len(blocks.mean)):
        part = log[k * blocks.size : (k + 1) * blocks.size]
        part = part[np.isfinite(part)]
        assert blocks.count[k] == len(part)
        if len(part) == 0:
            assert np.isnan(blocks.mean[k])
            continue
        assert blocks.mean[k] == pytest.approx(part.mean(), abs=1e-14)
        assert blocks.spread[k] == pytest.approx(part.std(), rel=1e-6)
        assert (blocks.low[k], blocks.high[k]) == (part.min(), part.max())
