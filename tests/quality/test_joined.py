"""Logs of two sensors in one, samples that are held in regular turn, registers behind digits."""

from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.recordings.quality.columns import find_regular_repeats
from imubench_pipeline.recordings.quality.joined import find_interleaved_samples
from imubench_pipeline.recordings.quality.levels import detect_quantisation, find_hidden_step
from imubench_pipeline.recordings.quality.summary import (
    MAX_PIECES,
    PIECE_SIZE,
    ColumnSummary,
    Excerpts,
    pair_common_samples,
)
from tests.conftest import few
from tests.quality.real import Log, adis16405, findings, warnings


def fine(log: Log) -> None:
    """Fill the steps of a register with noise."""
    rng = np.random.default_rng(11)
    for name, values in log.items():
        step = np.radians(0.05) if name.startswith("gyro") else 3.33e-3 * 9.80665
        values += step * (rng.random(len(values)) - 0.5)


def another(values: np.ndarray, step: float, times: float, offset: float) -> np.ndarray:
    """Return the log of a sensor with another register, noise and bias."""
    moved = values.mean() + times * (values - values.mean()) + offset
    return np.round(moved / step) * step


@pytest.mark.release
def test_halves_of_two_sensors(shared: Path) -> None:
    log = adis16405(shared)
    half = 70_000
    for name, values in log.items():
        offset = 0.01 if name.startswith("gyro") else 0.2
        values[half:] = another(values[half:], 1e-4, 1.5, offset)
    found = {f.channel: f for f in findings(log) if f.finding == "joined"}
    assert set(found) == set(log)
    for finding in found.values():
        assert finding.start == pytest.approx(half / 100.0, abs=5.0)
        assert finding.value == pytest.approx(1.5, rel=0.1)


@pytest.mark.release
def test_halves_of_two_registers_and_levels(shared: Path) -> None:
    log = adis16405(shared)
    other = adis16405(shared)
    fine(other)
    log["gyro_x"][50_000:] = another(other["gyro_x"][50_000:], 1e-4, 1.0, 0.01)
    (found,) = [f for f in findings(log) if f.finding == "joined"]
    assert found.detail.startswith("The level and resolution of gyro x change at once at ")
    assert found.start == pytest.approx(500.0, abs=3.0)


def test_a_step_or_a_change_of_noise_alone_joins_nothing(shared: Path) -> None:
    log = adis16405(shared)
    # By whole steps of the register, as of a sensor that was moved.
    log["gyro_x"][50_000:] += 20 * np.radians(0.05)
    noise = np.random.default_rng(3).standard_normal(50_000)
    log["gyro_y"][70_000:] += np.round(8.0 * noise) * np.radians(0.05)
    assert {name for name, _ in warnings(log)} == {"step", "not_stationary"}


def test_samples_of_two_sensors_in_turn(shared: Path) -> None:
    log = adis16405(shared)
    for values in log.values():
        spread = values.std()
        values[1::2] = another(np.roll(values, 777)[1::2], 0.13 * spread, 1.4, spread)
    found = {f.channel: f for f in findings(log) if f.finding == "interleaved"}
    assert set(found) == set(log)


@pytest.mark.release
def test_two_sensors_of_one_make_in_turn_differ_in_level(shared: Path) -> None:
    log = adis16405(shared)
    log["gyro_z"][1::2] += 80 * np.radians(0.05)
    assert ("interleaved", "gyro_z") in warnings(log)


@pytest.mark.parametrize("frequency", few([24.97], [50.0, 49.9, 25.0, 12.5]))
def test_a_line_is_no_second_sensor(shared: Path, frequency: float) -> None:
    log = adis16405(shared)
    fine(log)
    for values in log.values():
        line = np.sin(2 * np.pi * frequency * np.arange(len(values)) / 100.0 + 0.3)
        values[:] = np.round((values + 0.7 * values.std() * line) / 1e-3) * 1e-3
    assert "interleaved" not in {name for name, _ in warnings(log)}


def test_a_knock_makes_no_second_sensor(rng: np.random.Generator) -> None:
    log = rng.standard_normal(6000)
    log[3000] = 1e9
    log[rng.random(6000) < 0.1] = np.nan
    log[4200:5400] = np.nan
    column = ColumnSummary()
    column.add(log)
    assert list(find_interleaved_samples("gyro_x", column)) == []


@pytest.mark.release
@pytest.mark.parametrize("every", few([10], [3, 100]))
def test_samples_of_a_real_log_that_are_held_in_turn(shared: Path, every: int) -> None:
    log = adis16405(shared)
    for values in log.values():
        values[every::every] = values[every - 1 : -1 : every]
    found = {f.channel: f for f in findings(log) if f.finding == "held_samples"}
    assert set(found) == set(log)
    assert {f.value for f in found.values()} == {float(every)}
    assert "repeated_samples" not in {name for name, _ in warnings(log)}


@pytest.mark.parametrize("step", [0.0, 0.3, 1.0, 3.0, 8.0])
def test_no_sample_is_held_by_chance(rng: np.random.Generator, step: float) -> None:
    log = rng.standard_normal(50_000)
    log = np.round(log / step) if step else log
    assert find_regular_repeats(pieces(log)) is None
    line = np.sin(2 * np.pi * np.arange(len(log)) / 10.0)
    assert find_regular_repeats(pieces(np.round((log + line) / (step or 1.0)))) is None


def pieces(log: np.ndarray):
    kept = Excerpts()
    for some in np.array_split(log, 11):
        kept.add(some)
    return kept.pieces()


@pytest.mark.parametrize("samples", [10, PIECE_SIZE, 5 * PIECE_SIZE + 7, 200 * PIECE_SIZE + 1])
def test_excerpts_are_evenly_over_the_log(samples: int) -> None:
    log = np.arange(float(samples))
    log[::10] = np.nan
    kept = pieces(log)
    assert len(kept) <= MAX_PIECES
    assert [len(piece.values) for piece in kept[:-1]] == [PIECE_SIZE] * (len(kept) - 1)
    distances = np.diff([piece.first for piece in kept])
    assert len(set(distances.tolist())) <= 1 and kept[0].first == 0
    assert samples - kept[-1].first <= (distances[0] if len(distances) else samples)
    for piece in kept:
        np.testing.assert_array_equal(
            piece.values, log[piece.first : piece.first + len(piece.values)]
        )
    shifted = pieces(np.where(np.arange(samples) % 7 == 0, np.nan, log))
    for one, other in pair_common_samples(kept, shifted):
        np.testing.assert_array_equal(one, other)
        assert np.isfinite(one).all()


@pytest.mark.parametrize("step", few([0.03, 0.3], [0.1]))
@pytest.mark.parametrize("digits", few([1.7, 2.44, 7.63], [3.3]))
def test_a_register_behind_rounded_figures(
    rng: np.random.Generator, step: float, digits: float
) -> None:
    """The step in standard deviations of the noise, and in digits of the figures."""
    log = rng.standard_normal(40_000) + 1e-3 * np.cumsum(rng.standard_normal(40_000)) + 9.8
    digit = step / digits
    rounded = np.round(np.round(log / step) * step / digit) * digit
    assert find_hidden_step(pieces(rounded)) == pytest.approx(step, rel=0.015)
    scattered = np.round(log / step) * step + 0.04 * step * rng.standard_normal(len(log))
    assert find_hidden_step(pieces(scattered)) == pytest.approx(step, rel=0.005)


def test_noise_hides_no_register(rng: np.random.Generator) -> None:
    log = rng.standard_normal(30_000)
    late = np.arange(len(log)) > 13_000
    swinging = 5.0 * np.sin(np.arange(len(log)) / 900)
    for other in (log, np.round(log, 1), np.round(log), np.round(log / 4), np.round(log, 4)):
        for drift in (0.0, 50.0 * late, np.linspace(0, 40, len(log)), swinging):
            assert find_hidden_step(pieces(other + drift)) is None


def test_a_real_register_behind_rounded_figures(shared: Path) -> None:
    log = np.degrees(adis16405(shared)["gyro_x"])
    # 0.05 °/s in rad/s with four decimals: 8.7 digits a step.
    column = ColumnSummary()
    column.add(np.round(np.radians(log), 4))
    steps = detect_quantisation(column)
    assert steps is not None and steps.hidden
    assert steps.step == pytest.approx(np.radians(0.05), rel=0.005)
    assert column.step == pytest.approx(8e-4)
    (found,) = findings({"gyro_x": np.round(np.radians(log), 4)})
    assert found.finding == "quantised"
    assert found.detail.endswith("The values were rounded again afterwards")
