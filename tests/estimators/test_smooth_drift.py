"""A drift that passes for a random walk."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from imubench_pipeline.estimators.likelihood import fit
from tests.conftest import few

RATE, SAMPLES = 10.0, 40_000
WHITE = 1e-4 * np.sqrt(RATE)


def k_of(log: np.ndarray) -> tuple[str, str | None]:
    found = fit(log, RATE).estimates[0].parameters["K"]
    return found.status, found.reason


@pytest.mark.parametrize("seed", few([0], [1, 2, 3]))
def test_part_of_a_day_is_no_walk(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * (0.3 * np.arange(SAMPLES) / SAMPLES + rng.random())
    status, reason = k_of(WHITE * rng.standard_normal(SAMPLES) + 1e-4 * np.sin(angle))
    assert status != "ok"
    if status == "doubtful":
        assert reason is not None and "drift" in reason


@pytest.mark.parametrize("seed", few([0], range(1, 6)))
def test_a_drift_that_turns_a_few_times_is_no_walk(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = np.linspace(0.0, 1.0, 7)
    turning = make_interp_spline(places, rng.standard_normal(7))
    drift = 3e-4 * turning(np.arange(SAMPLES) / SAMPLES)
    status, _ = k_of(WHITE * rng.standard_normal(SAMPLES) + drift)
    assert status != "ok"


@pytest.mark.release  # test_walk_is_no_smooth_drift has one every day
@pytest.mark.parametrize(("logs", "most"), [(12, 4)])
def test_a_walk_is_seldom_a_drift(logs: int, most: int) -> None:
    # Known to 18 %: the walk is as dense as the white noise at the twentieth cosine.
    K = 2.0 * np.pi * 1e-4 * 20.0 / (2.0 * SAMPLES / RATE)
    doubted = 0
    for seed in range(logs):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(K / np.sqrt(RATE) * rng.standard_normal(SAMPLES))
        _, reason = k_of(WHITE * rng.standard_normal(SAMPLES) + walk)
        doubted += "drift with" in (reason or "")
    assert doubted <= most


@pytest.mark.parametrize("seed", few([0], [1, 2, 3]))
def test_walk_is_no_smooth_drift(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walk = np.cumsum(1e-5 / np.sqrt(RATE) * rng.standard_normal(SAMPLES))
    assert k_of(WHITE * rng.standard_normal(SAMPLES) + walk) == ("ok", None)
