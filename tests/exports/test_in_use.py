"""The noise of a log in use against simulated vibration and motion."""

import math

import numpy as np
import pytest

from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.extensions.exports.in_use import measure_in_use
from imubench_pipeline.typing import Array

RATE, LENGTH, N = 200.0, 200 * 240, 3e-3


def simulate(lines: dict[float, float], motion: float = 0.0, seed: int = 5) -> Array:
    rng = np.random.default_rng(seed)
    time = np.arange(LENGTH) / RATE
    samples = N * math.sqrt(RATE) * rng.standard_normal(LENGTH)
    for frequency, rms in lines.items():
        samples += math.sqrt(2.0) * rms * np.sin(2 * np.pi * frequency * time + 0.3)
    for place in range(1, 8):  # turns and slopes up to 3.5 Hz
        samples += motion / place * np.sin(2 * np.pi * 0.5 * place * time + place**2)
    return samples


@pytest.mark.parametrize("motion", [0.0, 0.5, 20.0])
def test_motion_and_lines_do_not_change_the_broadband_noise(motion: float) -> None:
    found = measure_in_use(simulate({48.3: 0.05, 71.0: 0.02}, motion), RATE)
    assert pytest.approx(N, rel=0.02) == found.N
    assert [frequency for frequency, _ in found.lines] == pytest.approx([48.3, 71.0], abs=0.25)
    assert [rms for _, rms in found.lines] == pytest.approx([0.05, 0.02], rel=0.05)
    true = motion * math.sqrt(sum(0.5 / place**2 for place in range(1, 8)))
    assert found.motion == pytest.approx(math.hypot(true, N * math.sqrt(2 * 10)), rel=0.05)


def test_white_noise_has_no_lines() -> None:
    for seed in range(10):
        found = measure_in_use(simulate({}, seed=seed), RATE)
        assert not found.lines
        assert pytest.approx(N, rel=0.02) == found.N


def test_missing_samples_are_left_out() -> None:
    samples = simulate({48.3: 0.05}, 0.5)
    samples[10_000:12_000] = np.nan
    samples[::7001] = np.nan
    assert pytest.approx(N, rel=0.02) == measure_in_use(samples, RATE).N


@pytest.mark.parametrize(
    ("samples", "rate", "words"),
    [
        (np.zeros(1000), 100.0, "has 10 s .* expected 32 s"),
        (np.full(100_000, np.nan), 100.0, "has 0 s"),
        (np.random.default_rng(1).standard_normal(10_000), 20.0, "lower --motion"),
    ],
)
def test_a_log_without_vibration_is_refused(samples: Array, rate: float, words: str) -> None:
    with pytest.raises(ExportError, match=words):
        measure_in_use(samples, rate)
