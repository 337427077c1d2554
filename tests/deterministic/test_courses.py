"""Steps, warm-ups and periodic drift of known size are found, and nothing in a log without."""

import numpy as np
import pytest
from numpy.typing import NDArray

from imubench_pipeline.estimators.deterministic.courses import (
    DeterministicSignals,
    find_deterministic_signals,
)
from tests.conftest import few
from tests.deterministic.logs import RATE, SIGMA, K, static_log, times

Array = NDArray[np.float64]


def signals_in(
    log: Array, segments: tuple[tuple[int, int], ...] | None = None
) -> DeterministicSignals:
    return find_deterministic_signals(
        lambda: [log[:70_000], log[70_000:]], len(log), RATE, segments=segments
    )


@pytest.mark.release
@pytest.mark.parametrize("walk", few([K], [0.0, 3e-5]))
def test_a_log_of_noise_alone_has_none(walk: float) -> None:
    log = static_log(3, walk=walk)
    found = signals_in(log)
    assert found.signals == ()
    assert not found.telegraph
    assert np.concatenate(list(found.subtract_from([log]))) == pytest.approx(log, abs=0.0)


def test_flicker_noise_has_none() -> None:
    rng = np.random.default_rng(4)
    frequency = np.fft.rfftfreq(400_000, 1.0 / RATE)
    density = (5e-5) ** 2 / (2.0 * np.pi * np.maximum(frequency, frequency[1]))
    normal = rng.standard_normal((2, len(frequency)))
    scale = np.sqrt(0.5 * density * 400_000 * RATE)
    log = np.fft.irfft(scale * (normal[0] + 1j * normal[1]))[:200_000]
    assert signals_in(log + 1e-5 * rng.standard_normal(len(log))).signals == ()


@pytest.mark.release
def test_steps_are_found_with_their_sizes_and_places() -> None:
    log = static_log(5)
    truth = [(2500.0, 4.0 * SIGMA), (6000.0, -5.0 * SIGMA)]
    stepped = log + sum(size * (times(log) >= place) for place, size in truth)
    found = signals_in(stepped)
    assert [signal.kind for signal in found.signals] == ["bias_step"] * 2
    for signal, (place, size) in zip(
        sorted(found.signals, key=lambda one: one.start), truth, strict=True
    ):
        assert signal.size_lower < size < signal.size_upper
        assert signal.start == pytest.approx(place, abs=10.0)
        assert signal.place_error is not None and 0.0 < signal.place_error < 30.0
    left = np.concatenate(list(found.subtract_from([stepped]))) - log
    assert np.std(left) < 0.3 * SIGMA


def test_a_step_far_beyond_the_noise_is_placed_to_the_sample() -> None:
    log = static_log(6)
    found = signals_in(log + 0.1 * (times(log) >= 4000.35))
    (step,) = found.signals
    assert step.size == pytest.approx(0.1, rel=0.01)
    left = np.concatenate(list(found.subtract_from([log + 0.1 * (times(log) >= 4000.35)]))) - log
    assert np.ptp(left) < 3.0 * SIGMA


def test_a_warm_up_is_found_with_its_time_constant() -> None:
    log = static_log(7)
    (warm,) = signals_in(log + 20.0 * SIGMA * np.exp(-times(log) / 600.0)).signals
    assert warm.kind == "warm_up_drift"
    assert warm.size_lower < 20.0 * SIGMA < warm.size_upper
    assert warm.time_lower is not None
    assert warm.time_upper is not None
    assert warm.time_lower < 600.0 < warm.time_upper


def test_periodic_drift_is_found_with_its_period() -> None:
    log = static_log(8)
    (drift,) = signals_in(
        log + 3.0 * SIGMA * np.sin(2.0 * np.pi * times(log) / 1200.0 + 1.0)
    ).signals
    assert drift.kind == "periodic_drift"
    assert drift.size_lower < 3.0 * SIGMA < drift.size_upper
    assert drift.time == pytest.approx(1200.0, rel=0.01)


@pytest.mark.release
def test_telegraph_noise_is_named_and_left() -> None:
    log = static_log(9, hours=1.5)
    flips = np.cumsum(np.random.default_rng(1).random(len(log)) < 1.0 / 300.0 / RATE) % 2
    found = signals_in(log + 8.0 * SIGMA * flips)
    assert found.telegraph
    assert found.signals == ()


def test_a_step_between_segments_is_none_and_one_inside_is_found() -> None:
    log = static_log(10)
    half = len(log) // 2
    log[half:] += 1.0
    log += 5.0 * SIGMA * (times(log) >= 3000.0)
    (step,) = signals_in(log, ((0, half), (half, len(log)))).signals
    assert step.start == pytest.approx(3000.0, abs=10.0)
    assert step.size_lower < 5.0 * SIGMA < step.size_upper


def test_steps_are_found_among_missing_samples() -> None:
    log = static_log(11)
    log += 5.0 * SIGMA * (times(log) >= 3000.0)
    rng = np.random.default_rng(2)
    log[rng.random(len(log)) < 0.05] = np.nan
    log[90_000:110_000] = np.nan
    (step,) = signals_in(log).signals
    assert step.size_lower < 5.0 * SIGMA < step.size_upper


def test_a_log_too_short_to_be_searched_has_none() -> None:
    assert signals_in(np.random.default_rng(3).standard_normal(100)).signals == ()


def test_a_part_of_a_cycle_is_found_though_a_walk_would_hide_it() -> None:
    log = static_log(12, walk=0.0)
    (drift,) = signals_in(log + 40.0 * SIGMA * np.sin(2.0 * np.pi * times(log) / 15_000.0)).signals
    assert drift.kind == "periodic_drift"
    assert drift.time_lower is not None
    assert drift.time_upper is not None
    assert drift.time_lower < 15_000.0 < drift.time_upper
    assert drift.size_lower < 40.0 * SIGMA < drift.size_upper


def with_pauses(log: Array, size: float) -> Array:
    """Leave out 60 s at six places; the bias after each is another, by six draws of a size."""
    rng = np.random.default_rng(6)
    for place in np.linspace(0.1, 0.9, 6):
        start = int(place * len(log))
        log[start : start + int(60.0 * RATE)] = np.nan
        log[start:] += size * rng.standard_normal()
    return log


@pytest.mark.parametrize("seed", few([30], [31, 32, 33]))
def test_another_bias_after_each_pause_is_no_random_walk(seed: int) -> None:
    found = signals_in(with_pauses(static_log(seed, walk=0.0), 20.0 * SIGMA))
    assert found.searched is not None
    K_left = found.searched.fit.noise.parameter("K")
    # Steps of 20 sigma look like 3.5e-5; a log of noise alone may show a little.
    alone = signals_in(static_log(seed, walk=0.0)).searched
    assert alone is not None
    assert K_left < 2.0 * alone.fit.noise.parameter("K") + 2e-6
    assert {signal.kind for signal in found.signals} == {"bias_step"}
    inside = [round((signal.start / 10_800 - 0.1) / 0.16, 1) % 1 for signal in found.signals]
    assert inside == [0.0] * len(inside)


def test_a_walk_through_pauses_stays_one() -> None:
    for seed in (21, 22):
        found = signals_in(with_pauses(static_log(seed, walk=2e-5), 0.0))
        assert found.signals == ()
        assert found.searched is not None
        assert found.searched.fit.noise.parameter("K") > 1e-5
