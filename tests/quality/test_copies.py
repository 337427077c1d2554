"""Samples that are there twice: channels of one column, stretches, logs appended to themselves."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.recordings.quality.repeats import WINDOW, Repeats
from tests.conftest import few
from tests.quality.real import adis16405, findings, warnings


def stretches(values: np.ndarray, pieces: int = 5) -> list[tuple[int, int, int]]:
    repeats = Repeats()
    for piece in np.array_split(values, pieces):
        repeats.add(piece)
    return [(s.first, s.last, s.lag) for s in repeats.stretches()]


@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 3000),
    st.integers(0, 3000),
    st.integers(100, 900),
    st.sampled_from([0.0, 0.1, 0.5]),
    st.integers(1, 6),
)
def test_a_copy_is_found_at_any_offset(
    seed: int, source: int, gap: int, length: int, step: float, pieces: int
) -> None:
    log = np.random.default_rng(seed).standard_normal(8000)
    if step:
        log = np.round(log / step) * step
    assert stretches(log, pieces) == []
    place = source + length + gap
    log[place : place + length] = log[source : source + length]
    (found,) = stretches(log, pieces)
    assert found[2] == length + gap
    # A run of one value at either end may belong to it.
    assert abs(found[0] - place) < 10 and abs(found[1] - place - length) < 10


def test_long_logs_keep_a_sample_of_their_windows(rng: np.random.Generator) -> None:
    log = rng.standard_normal(2_000_000)
    log[1_500_000:1_505_000] = log[123_456:128_456]
    ((first, last, lag),) = stretches(log)
    assert lag == 1_500_000 - 123_456
    assert 1_500_000 <= first < 1_501_500 and 1_503_500 < last <= 1_505_000


@pytest.mark.parametrize(
    "log",
    [
        np.zeros(50_000),
        np.tile([0.0, 1.0], 20_000),
        np.tile(np.arange(40.0), 1000),
        np.full(10_000, np.nan),
        np.arange(50_000.0),
    ],
    ids=["zeros", "toggling", "short pattern", "missing", "ramp"],
)
def test_what_tells_nothing_repeats_nothing(log: np.ndarray) -> None:
    assert stretches(log) == []


@pytest.mark.parametrize("step", [0.3, 1.0, 3.0, 6.0, 8.0])
@pytest.mark.parametrize("memory", [0.0, 0.95])
def test_chance_repeats_of_coarse_registers_are_none(
    rng: np.random.Generator, step: float, memory: float
) -> None:
    """White or slow noise in steps: windows of few changes come again, those of 64 do not."""
    noise = rng.standard_normal(100_000)
    if memory:
        noise = noise + np.convolve(noise, memory ** np.arange(200))[: len(noise)]
        noise /= noise.std()
    coarse = np.round(noise / step + 0.37)
    words = np.lib.stride_tricks.sliding_window_view(coarse, 8)[:20_000]
    assert len(np.unique(words, axis=0)) < (1.0 if step > 0.5 or memory else 1.01) * len(words)
    assert stretches(coarse) == []


@pytest.mark.release
def test_a_real_log_is_free_of_copies(shared: Path) -> None:
    assert warnings(adis16405(shared)) == []


@pytest.mark.parametrize("factor", few([-1.0], [1.0, 9.80665, np.degrees(1.0)]))
def test_a_gyro_that_is_another_one_in_another_unit(shared: Path, factor: float) -> None:
    log = adis16405(shared)
    log["gyro_y"] = factor * log["gyro_x"]
    found = {f.channel: f for f in findings(log) if f.finding == "channel_twice"}
    assert set(found) == {"gyro_x", "gyro_y"}
    assert found["gyro_y"].value == pytest.approx(factor, rel=1e-9)
    assert found["gyro_x"].value == pytest.approx(1.0 / factor, rel=1e-9)
    assert "gyro y has the samples of gyro x" in found["gyro_y"].detail


def test_gyros_that_are_the_accelerometers_columns(shared: Path) -> None:
    log = adis16405(shared)
    for axis in "xyz":
        # As read from the same columns, in °/s instead of g, and rounded by a converter.
        log[f"gyro_{axis}"] = np.round(np.radians(log[f"accel_{axis}"] / 9.80665), 6)
    told = [channel for name, channel in warnings(log) if name == "channel_twice"]
    assert sorted(filter(None, told)) == sorted(log)


@pytest.mark.release
def test_axes_that_feel_one_vibration_are_two(rng: np.random.Generator, shared: Path) -> None:
    log = adis16405(shared)
    shaking = 0.5 * np.sin(2 * np.pi * 17.3 * np.arange(len(log["accel_x"])) / 100.0)
    log["accel_x"] += shaking
    log["accel_y"] += 1.4 * shaking
    assert "channel_twice" not in {name for name, _ in warnings(log)}


def test_a_real_log_that_was_appended_to_itself(shared: Path) -> None:
    log = {name: np.tile(values[:60_000], 2) for name, values in adis16405(shared).items()}
    (found,) = [f for f in findings(log) if f.severity != "note"]
    assert (found.finding, found.channel) == ("log_twice", None)
    assert found.start == pytest.approx(600.0, abs=1.0)
    assert found.end == pytest.approx(1200.0, abs=1.0)


def test_a_stretch_that_was_pasted_into_a_real_log(shared: Path) -> None:
    log = adis16405(shared)
    for values in log.values():
        values[100_000:101_000] = values[40_010:41_010]
    (found,) = [f for f in findings(log) if f.finding in ("log_twice", "repeated_stretch")]
    assert (found.finding, found.channel) == ("repeated_stretch", None)
    assert found.start == pytest.approx(1000.0, abs=1.0)
    assert found.end == pytest.approx(1010.0, abs=1.0)
    assert "from 400." in found.detail
    assert found.value == pytest.approx(1000, abs=2 * WINDOW)


@pytest.mark.release
def test_a_stretch_of_one_channel(shared: Path) -> None:
    log = adis16405(shared)
    log["accel_y"][100_000:102_000] = log["accel_y"][3000:5000]
    assert warnings(log) == [("repeated_stretch", "accel_y")]
