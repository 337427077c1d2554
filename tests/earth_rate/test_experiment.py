import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment, block_means


@st.composite
def experiments(draw):
    at, dwells = 0, []
    for gap, length, sense in draw(
        st.lists(
            st.tuples(st.integers(0, 5), st.integers(1, 40), st.sampled_from([1, -1])),
            min_size=1,
            max_size=6,
        )
    ):
        dwells.append(Dwell(at + gap, at + gap + length, sense))
        at += gap + length
    return Experiment(tuple(dwells), 4.0, 0.5)


@pytest.mark.release
@given(experiments(), st.integers(1, 50))
@settings(max_examples=60, deadline=None)
def test_blocks_fill_their_dwells_and_no_turning(experiment, longest):
    blocks = experiment.blocks(longest)
    assert (blocks.stop - blocks.start).max() <= longest
    inside = [i for a, b in zip(blocks.start, blocks.stop, strict=True) for i in range(a, b)]
    assert inside == [i for dwell in experiment.dwells for i in range(dwell.start, dwell.stop)]
    for start, sense, dwell in zip(blocks.start, blocks.sense, blocks.dwell, strict=True):
        assert experiment.dwells[dwell].start <= start < experiment.dwells[dwell].stop
        assert sense == experiment.dwells[dwell].sense


@given(experiments(), st.integers(1, 50), st.integers(0, 2**32), st.integers(1, 30))
@settings(max_examples=60, deadline=None)
def test_every_sample_is_in_a_mean_or_counted(experiment, longest, seed, part):
    rng = np.random.default_rng(seed)
    log = rng.standard_normal(experiment.dwells[-1].stop + 3)
    log[rng.random(len(log)) < 0.3] = np.nan
    log[experiment.dwells[0].start] = 1.0
    parts = [log[i : i + part] for i in range(0, len(log), part)]
    try:
        found = block_means(parts, experiment, longest)
    except ValueError:
        return
    blocks = found.blocks
    for mean, start, stop, count in zip(
        found.means[0], blocks.start, blocks.stop, blocks.count, strict=True
    ):
        assert count == np.isfinite(log[start:stop]).sum() >= (stop - start) / 2
        assert mean == pytest.approx(np.nanmean(log[start:stop]))
    assert blocks.count.sum() + found.missing + found.left_out == experiment.samples_in_dwells


def test_a_schedule():
    design = Experiment.regular(
        dwell=28.0, turning=2.0, dwells=4, rate=32.0, latitude=-0.4, first=-1
    )
    assert [dwell.start for dwell in design.dwells] == [0, 960, 1920, 2880]
    assert {dwell.stop - dwell.start for dwell in design.dwells} == {896}
    assert [dwell.sense for dwell in design.dwells] == [-1, 1, -1, 1]
    blocks = design.blocks(224)
    assert len(blocks) == 16
    assert blocks.duration == blocks.end[-1] == 118.0
    assert blocks.time_in_blocks == 112.0
    assert blocks.middle[0] == pytest.approx(223 / 2 / 32)
    np.testing.assert_allclose(blocks.seen[:4], -math.cos(0.4))
    assert blocks.of_dwells().start.tolist() == [0, 960, 1920, 2880]


def test_means_of_dwells_weigh_the_samples_present():
    experiment = Experiment((Dwell(0, 8, 1), Dwell(9, 13, -1)), 1.0, 0.0)
    log = np.array([1.0, 2, 3, 4, 5, np.nan, np.nan, 8, 100, 1, 1, 3, 3])
    found = block_means([log], experiment, 4)
    assert found.blocks.count.tolist() == [4, 2, 4]
    np.testing.assert_allclose(
        found.blocks.means_of_dwells(found.means), [[(1 + 2 + 3 + 4 + 5 + 8) / 6, 2.0]]
    )


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Dwell(3, 3, 1), "has no sample"),
        (lambda: Dwell(0, 3, 0), "expected 1"),
        (lambda: Experiment((), 1.0, 0.0), "expected at least one"),
        (lambda: Experiment((Dwell(0, 3, 1), Dwell(2, 5, -1)), 1.0, 0.0), "expected 3 or later"),
        (lambda: Experiment((Dwell(0, 3, 1),), 0.0, 0.0), "the rate is"),
        (lambda: Experiment((Dwell(0, 3, 1),), 1.0, 1.6), "latitude"),
        (lambda: Experiment((Dwell(0, 3, 1),), 1.0, 0.0).blocks(0), "at least 1 sample"),
        (
            lambda: block_means([np.ones(4)], Experiment((Dwell(0, 5, 1),), 1.0, 0.0), 2),
            "the log has 4 samples",
        ),
        (
            lambda: block_means([np.full(5, np.nan)], Experiment((Dwell(0, 5, 1),), 1.0, 0.0), 2),
            "no block has enough",
        ),
    ],
)
def test_what_cannot_be_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()
