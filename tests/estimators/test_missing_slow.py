"""Slow noise that was taken off before a log was written."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.estimators import likelihood
from imubench_pipeline.estimators.spectral_findings import find_missing_slow_noise
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate import simulate
from imubench_pipeline.tables.findings import Finding
from tests.conftest import few

RATE = 50.0
GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
SAMPLES = 30_000


def missing(log: np.ndarray) -> Finding | None:
    found = likelihood.fit(log, RATE)
    white = found.estimates[0].parameters["N"].lower
    return find_missing_slow_noise("gyro_x", found.spectrum, found.fitted, white)


def zeroed(log: np.ndarray) -> np.ndarray:
    parts = log.reshape(-1, 500)
    return np.asarray((parts - parts.mean(axis=1, keepdims=True)).ravel())


def high_pass(log: np.ndarray) -> np.ndarray:
    part = 1.0 / (3.0 * RATE)
    slow = lfilter([part], [1.0, part - 1.0], log - log.mean())
    return np.asarray((log - slow)[1000:])


@pytest.mark.release
@pytest.mark.parametrize("spoil", few([zeroed], [high_pass]))
def test_a_bias_that_is_zeroed_at_rest_is_told(
    rng: np.random.Generator, spoil: Callable[[np.ndarray], np.ndarray]
) -> None:
    finding = missing(spoil(simulate(GYRO, RATE, SAMPLES, rng)))
    assert finding is not None
    assert (finding.finding, finding.severity) == ("slow_noise_missing", "warning")
    assert finding.value < 0.5


@pytest.mark.release
@pytest.mark.parametrize("model", [NoiseModel(N=8.4e-5), GYRO, NoiseModel(N=8.4e-5, Q=1e-6)])
@pytest.mark.parametrize("logs", [3])
def test_noise_of_a_sensor_has_all_its_slow_part(
    rng: np.random.Generator, model: NoiseModel, logs: int
) -> None:
    for _ in range(logs):
        log = simulate(model, RATE, SAMPLES, rng)
        assert missing(log) is None
        assert missing(lfilter([0.3], [1.0, -0.7], log)) is None
