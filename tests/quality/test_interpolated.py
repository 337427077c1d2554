"""Losses that were filled by straight lines, and logs that only look like them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import imubench_pipeline as imu
from imubench_pipeline.recordings.quality.knocks import (
    detect_interpolation,
    mark_straight_lines,
)
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.typing import Array

SAMPLES = 40_000


def fill_losses(log: Array, share: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return a log with runs of 2 to 50 samples interpolated by pandas, and which they are."""
    lost = np.zeros(len(log), dtype=np.bool_)
    while lost.mean() < share:
        start = rng.integers(100, len(log) - 200)
        lost[start : start + rng.integers(2, 51)] = True
    return pd.Series(np.where(lost, np.nan, log)).interpolate().to_numpy(), lost


def mark(log: Array) -> Array:
    column = ColumnSummary()
    column.add(log)
    return mark_straight_lines(log, detect_interpolation(column.excerpts(), len(log)))


def make_noise(rng: np.random.Generator) -> Array:
    return rng.standard_normal(SAMPLES) + 0.003 * np.cumsum(rng.standard_normal(SAMPLES))


@pytest.mark.parametrize("digits", [None, 3])
@pytest.mark.parametrize("share", [0.01, 0.05])
def test_filled_losses_are_marked(
    share: float, digits: int | None, rng: np.random.Generator
) -> None:
    log, lost = fill_losses(make_noise(rng), share, rng)
    if digits is not None:
        log = log.round(digits)
    marked = mark(log)
    assert (marked & ~lost).sum() <= 0.02 * lost.sum()  # ends of lines that meet noise
    assert (marked & lost).sum() >= 0.85 * lost.sum()


@pytest.mark.parametrize("step", [0.0, 0.1, 0.5, 1.0, 3.0])
def test_clean_logs_have_none(step: float, rng: np.random.Generator) -> None:
    log = make_noise(rng)
    if step:
        log = np.round(log / step) * step
    assert not mark(log).any()


def test_smooth_and_upsampled_logs_have_none(rng: np.random.Generator) -> None:
    smooth = np.convolve(make_noise(rng), np.ones(8) / 8.0, "valid")
    assert not mark(smooth).any()
    slow = make_noise(rng)[: SAMPLES // 4]
    upsampled = np.interp(np.arange(SAMPLES) / 4.0, np.arange(len(slow)), slow)
    assert not mark(upsampled).any()
    assert not mark(np.repeat(slow, 4)).any()


def test_filled_losses_give_no_bias_instability(rng: np.random.Generator) -> None:
    gyro = imu.NoiseModel(N=1e-3, K=1e-5)
    clean = imu.simulate(gyro, 100.0, duration=SAMPLES / 100.0, seed=3)
    log, _ = fill_losses(np.asarray(clean).ravel(), 0.05, rng)
    found = imu.estimate(log, 100.0, channels="gyro_x")
    finding = next(each for each in found.findings if each.finding == "interpolated")
    assert finding.severity == "warning" and "straight lines" in finding.detail
    N = found["gyro_x"]["N"]
    assert N.value == pytest.approx(1e-3, rel=0.01)
    assert found["gyro_x"]["B_curve"].value is None


def test_every_sample_is_counted(tmp_path: Path, rng: np.random.Generator) -> None:
    log, lost = fill_losses(make_noise(rng) * 1e-3, 0.02, rng)
    estimates = imu.estimate({"gyro_x": log}, 100.0)
    (finding,) = [each for each in estimates.findings if each.finding == "interpolated"]
    assert finding.value == pytest.approx(lost.sum(), rel=0.15)
