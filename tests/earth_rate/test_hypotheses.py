"""What each cause does to the mean over pairs, held against means of dwells made with it."""

import math

import numpy as np
import pytest

from imubench_pipeline.extensions.calibration.experiment import Blocks, Experiment
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs
from imubench_pipeline.extensions.earth_rate.published import (
    PrintedRun,
    compute_needed_angle,
    compute_needed_drift,
    compute_needed_heading,
    compute_separation,
    compute_wrong_share,
    fit_clock_error,
    fit_single_miscount,
    fit_warm_up,
)
from imubench_pipeline.noise import NoiseModel

RATE, LATITUDE = 7.292115e-5, math.radians(-23.3)
RUN = Experiment.regular(dwell=28.0, turning=2.0, dwells=120, rate=32.0, latitude=LATITUDE)
BLOCKS: Blocks = RUN.blocks(28 * 32)
SEEN = BLOCKS.sense * RATE * math.cos(LATITUDE)


def estimate(means: np.ndarray) -> float:
    """Return the mean over pairs as the paper takes it (003 eq. 14)."""
    return float(by_pairs(means[None], BLOCKS, NoiseModel(N=1e-4)).rate[0, -1])


def test_a_drift_is_taken_for_rotation() -> None:
    drift = 3e-8
    off = estimate(SEEN + drift * BLOCKS.middle) - RATE
    assert compute_needed_drift(off, 30.0, LATITUDE) == pytest.approx(drift, rel=1e-9)


def test_an_angle_left_in_each_dwell() -> None:
    left = math.radians(0.1) / 28.0
    off = estimate(SEEN + BLOCKS.sense * left) - RATE
    assert compute_needed_angle(off, 28.0, LATITUDE) == pytest.approx(math.radians(0.1), rel=1e-9)


@pytest.mark.parametrize("part", [0.0, 0.25, 0.8])
def test_senses_that_are_wrong_from_a_turn_on(part: float) -> None:
    wrong = np.arange(120) >= round(120 * (1.0 - part))
    assert compute_wrong_share(estimate(np.where(wrong, -SEEN, SEEN)), RATE) == pytest.approx(part)


def test_nothing_beyond_the_rate_is_of_a_miscount_or_of_a_heading() -> None:
    assert (
        compute_wrong_share(1.1 * RATE, RATE) is None
        and compute_needed_heading(-1.1 * RATE, RATE) is None
    )
    assert compute_needed_heading(estimate(math.cos(1.2) * SEEN), RATE) == pytest.approx(1.2)


def slipped_share(slip: np.ndarray) -> np.ndarray:
    """The share of the rate that is left if dwells begin so many dwells late."""
    return np.abs(2.0 * np.mod(slip, 2.0) - 2.0) - 1.0


@pytest.mark.parametrize("slip", [0.3, 1.4, 2.75])
def test_dwells_that_are_cut_too_late(slip: float) -> None:
    # A square wave of the rate, cut in samples of a thousandth of a dwell.
    time = (np.arange(130_000) + 0.5) / 1000.0
    wave = RATE * math.cos(LATITUDE) * (1.0 - 2.0 * (np.floor(time) % 2))
    start = round(1000 * slip)
    means = wave[start : start + 120_000].reshape(120, 1000).mean(axis=1)
    assert float(slipped_share(np.array(slip))) == pytest.approx(estimate(means) / RATE, abs=1e-9)


def test_a_clock_that_is_off_is_found_again() -> None:
    error, sigma = 0.0123, 0.01 * RATE
    slips = error * np.arange(0.0, 3600.0, 0.1) / 30.0
    values = slipped_share(slips) * RATE
    parts = [
        PrintedRun(2820.0, values[:28200].mean(), sigma),
        PrintedRun(780.0, values[28200:].mean(), sigma),
    ]
    found, misfit = fit_clock_error(parts, 30.0, RATE)
    assert found == pytest.approx(error, rel=1e-3) and misfit < 0.1


def test_a_warm_up_is_found_from_its_drift_in_two_parts() -> None:
    bias = 0.02 * (1.0 - np.exp(-np.array([0.0, 2820.0, 3600.0]) / 1500.0))
    first, last = np.diff(bias) / [2820.0, 780.0]
    found = fit_warm_up(first, last, 3600.0, 780.0)
    assert found is not None
    assert found.time_constant == pytest.approx(1500.0, rel=1e-6)
    assert found.total == pytest.approx(bias[-1])
    assert (
        fit_warm_up(1.0, 1.2, 3600.0, 780.0) is None
        and fit_warm_up(1.0, -0.2, 3600.0, 780.0) is None
    )


def test_one_miscount_is_told_from_two() -> None:
    sigma = 0.05 * RATE
    once = np.where(np.arange(60) < 20, 1.0, -1.0) * RATE
    twice = np.where(abs(np.arange(60) - 37.0) < 17, -1.0, 1.0) * RATE

    def printed(senses: np.ndarray) -> tuple[PrintedRun, PrintedRun]:
        return (
            PrintedRun(3600.0, senses.mean(), sigma),
            PrintedRun(780.0, senses[47:].mean(), sigma * math.sqrt(60 / 13)),
        )

    assert fit_single_miscount(*printed(once), RATE) < 0.1
    assert fit_single_miscount(*printed(twice), RATE) > 5.0


def test_the_rest_of_a_run_is_what_its_last_part_leaves() -> None:
    rng = np.random.default_rng(1)
    pairs = rng.standard_normal((20_000, 60))
    whole, last = (
        PrintedRun(60.0, pairs[0].mean(), 60**-0.5),
        PrintedRun(13.0, pairs[0, 47:].mean(), 13**-0.5),
    )
    rest = whole.without(last)
    assert rest.value == pytest.approx(pairs[0, :47].mean())
    assert rest.sigma == pytest.approx(pairs[:, :47].mean(axis=1).std(), rel=0.02)
    spread = np.std(pairs[:, 47:].mean(axis=1) - pairs[:, :47].mean(axis=1))
    assert compute_separation(last, rest) == pytest.approx(
        (last.value - rest.value) / spread, rel=0.02
    )
