"""Rest and motion: signals of a hand and of a turntable, and static logs in any unit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from imubench_pipeline.recordings.quality.rest import find_motion, find_still_spans
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.typing import Array

DEGREE = math.pi / 180.0
TIMES = 4.0  # the default of quality.motion


def summarise(samples: Array) -> ColumnSummary:
    column = ColumnSummary()
    column.add(samples)
    return column


def hand(rng: np.random.Generator, samples: int, rate: float, size: float) -> Array:
    """Signals below 2 Hz with a standard deviation, as of a sensor in a hand."""
    b, a = butter(2, 2.0, fs=rate)
    slow: Array = lfilter(b, a, rng.standard_normal(samples + 2000))[2000:]
    return size * slow / slow.std()


@pytest.mark.parametrize("rate", [50.0, 100.0, 400.0])
@pytest.mark.parametrize("unit", [1.0, 1.0 / DEGREE, DEGREE])
def test_a_sensor_in_a_hand_moves_throughout_and_one_at_rest_does_not(
    rate: float, unit: float
) -> None:
    rng = np.random.default_rng(1)
    n = int(60 * rate)
    still = 0.01 * DEGREE * math.sqrt(rate) * rng.standard_normal(n)
    assert find_motion(summarise(unit * still), "gyro", rate, TIMES) == []
    moved = still + hand(rng, n, rate, 30.0 * DEGREE)
    if unit >= 1.0:  # a rate of 30 deg/s that is 57 times too small is no longer beyond any gyro
        assert find_motion(summarise(unit * moved), "gyro", rate, TIMES) == [(0, n)]


@pytest.mark.parametrize("rate", [10.0, 25.0, 50.0])
@pytest.mark.parametrize("share", [0.5, 0.8])
def test_motion_in_a_part_of_a_short_log_is_found(rate: float, share: float) -> None:
    rng = np.random.default_rng(4)
    n = int(60 * rate)  # 2 to 12 blocks
    log = 0.005 * DEGREE * math.sqrt(rate) * rng.standard_normal(n)
    moving = np.arange(n) < share * n
    log += moving * 7.0 * DEGREE * np.sin(2.0 * np.pi * 0.8 * np.arange(n) / rate)
    spans = find_motion(summarise(log), "gyro", rate, TIMES)
    assert sum(stop - start for start, stop in spans) >= 0.9 * share * n


@pytest.mark.parametrize("rate", [10.0, 25.0, 50.0, 100.0, 400.0])
def test_noise_behind_a_narrow_filter_is_no_motion_in_any_unit(rate: float) -> None:
    rng = np.random.default_rng(5)
    n = int(120 * rate)
    pole = math.exp(-2.0 * math.pi * 5.0 / rate)  # 5 Hz, the narrowest of usual sensors
    noise = 0.01 * DEGREE * math.sqrt(rate) * rng.standard_normal(n)
    log = np.degrees(lfilter([1.0 - pole], [1.0, -pole], noise))  # in degrees called radians
    assert find_motion(summarise(log), "gyro", rate, TIMES) == []


def test_a_sensor_that_is_turned_for_a_while_has_rests_before_and_after() -> None:
    rng = np.random.default_rng(2)
    rate, n = 100.0, 12_000
    log = 0.1 * DEGREE * rng.standard_normal(n)
    log[4000:7000] += 50.0 * DEGREE  # a turntable: steady, and quiet but for its ends
    spans = [(a / rate, b / rate) for a, b in find_motion(summarise(log), "gyro", rate, TIMES)]
    rests = find_still_spans(spans, 0.0, n / rate)
    (first, last) = rests
    assert first[0] == 0.0 and 35.0 < first[1] <= 40.0
    assert 70.0 <= last[0] < 75.0 and last[1] == 120.0


@pytest.mark.parametrize("quantity", ["gyro", "accel"])
def test_drift_lines_and_filters_are_no_motion(quantity: str) -> None:
    rng = np.random.default_rng(3)
    rate, n = 200.0, 80_000
    sigma = {"gyro": 0.05 * DEGREE, "accel": 0.02}[quantity]
    t = np.arange(n) / rate
    white = rng.standard_normal(n)
    filtered = lfilter([0.05], [1.0, -0.95], white)
    logs = [
        sigma * white + 5.0 * sigma * np.sin(2.0 * np.pi * 0.5 * t),
        sigma * white + 20.0 * sigma * np.exp(-t / 100.0),
        sigma * filtered / filtered.std(),
        sigma * white + 0.02 * sigma * np.cumsum(rng.standard_normal(n)),
    ]
    for log in logs:
        assert find_motion(summarise(log), quantity, rate, TIMES) == []


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 90.0), st.floats(0.0, 20.0)), max_size=6))
def test_rests_are_what_no_motion_covers(moved: list[tuple[float, float]]) -> None:
    spans = [(start, start + length) for start, length in moved]
    rests = find_still_spans(spans, 0.0, 100.0)
    for x in np.linspace(0.05, 99.95, 500):
        inside = any(start <= x <= stop for start, stop in spans)
        at_rest = any(start < x < stop for start, stop in rests)
        assert inside or at_rest
        edges = [edge for span in (*spans, *rests) for edge in span]
        if min((abs(x - edge) for edge in edges), default=1.0) > 1e-6:
            assert inside != at_rest
