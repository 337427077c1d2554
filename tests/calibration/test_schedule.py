import numpy as np
import pytest

from imubench_pipeline.extensions.calibration.experiment import Dwell
from imubench_pipeline.extensions.calibration.schedule import Schedule


def table(rate, steps, ramp):
    """Return a column of steady rates (rate, seconds) with ramps of so many seconds between."""
    parts, edges, at = [], [], 0
    for i, (level, seconds) in enumerate(steps):
        if i:
            rise = np.linspace(steps[i - 1][0], level, round(ramp * rate) + 2)[1:-1]
            parts.append(rise)
            at += len(rise)
        parts.append(np.full(round(seconds * rate), float(level)))
        edges.append((at, at + len(parts[-1])))
        at += len(parts[-1])
    return np.concatenate(parts), edges


def test_steps_are_whole_samples_after_settling():
    found = Schedule.from_steps([(0.0, 10.0, 0.5), (12.0, 20.0, -0.5)], 10.0, settling=1.5)
    assert [(one.start, one.stop) for one in found.stretches] == [(15, 100), (135, 200)]
    blocks = found.experiment.blocks(40)
    np.testing.assert_array_equal(found.of_blocks(blocks), [0.5, 0.5, 0.5, -0.5, -0.5])


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_column_gives_the_steady_rates_and_no_ramp(noise):
    steps = [(0.0, 20.0), (1.0, 30.0), (-1.0, 25.0), (0.5, 2.0), (0.2, 20.0)]
    column, edges = table(20.0, steps, ramp=8.0)
    column += noise * np.random.default_rng(1).uniform(-1, 1, len(column))
    column[edges[1][0] + 300] = np.nan
    found = Schedule.from_column(column, 20.0, tolerance=5e-3, shortest=8.0, settling=1.0)
    # The one of 2 s is too short; a sample that is missing divides the second.
    np.testing.assert_allclose(found.table_rates, [0.0, 1.0, 1.0, -1.0, 0.2], atol=1e-3)
    starts = [stretch.start for stretch in found.stretches]
    whole = [edges[0], (edges[1][0], edges[1][0] + 300), (edges[1][0] + 301, edges[1][1])]
    whole += [edges[2], edges[4]]
    for stretch, (start, stop) in zip(found.stretches, whole, strict=True):
        # Within the tolerance are some samples of the gentler ramps, too.
        assert start + 16 <= stretch.start <= start + 20
        assert stop <= stretch.stop <= stop + 4
    assert len(set(starts)) == 5


def test_a_slow_ramp_is_not_steady():
    column = np.concatenate([np.zeros(400), 0.05 + np.arange(2000) * 1e-5, np.full(400, 0.1)])
    found = Schedule.from_column(column, 20.0, tolerance=1e-3, shortest=8.0)
    assert [(one.start, one.stop) for one in found.stretches] == [(0, 400), (2400, 2800)]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Schedule.from_steps([(0.0, 1.0, 0.1)], 10.0, settling=2.0), "has no sample"),
        (lambda: Schedule.from_steps([(0, 2, 0.1), (1, 3, 0.2)], 10.0), "expected 20 or later"),
        (lambda: Schedule((Dwell(0, 9, 1),), np.zeros(2), 10.0), "found 2 table rates, expected 1"),
        (lambda: Schedule((Dwell(0, 9, 1),), np.array([np.nan]), 10.0), "not finite"),
        (lambda: Schedule((), np.zeros(0), 10.0), "expected at least one"),
        (
            lambda: Schedule.from_column(np.arange(99.0), 10.0, tolerance=0.1, shortest=2.0),
            "nowhere steady",
        ),
        (
            lambda: Schedule.from_column(np.zeros(99), 10.0, tolerance=-1.0, shortest=2.0),
            "tolerance",
        ),
        (
            lambda: Schedule.from_column(
                np.zeros(99), 10.0, tolerance=0.1, shortest=2.0, settling=2.0
            ),
            "shortest",
        ),
    ],
)
def test_what_is_no_schedule_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()
