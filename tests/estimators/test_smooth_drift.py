"""A drift that passes for a random walk."""

import numpy as np
import pytest

from imubench_pipeline.estimators.likelihood import fit

RATE, SAMPLES = 10.0, 40_000
WHITE = 1e-4 * np.sqrt(RATE)


def k_of(log: np.ndarray) -> tuple[str, str | None]:
    found = fit(log, RATE).estimates[0].parameters["K"]
    return found.status, found.reason


@pytest.mark.parametrize("seed", range(4))
def test_part_of_a_day_is_no_walk(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = 2.0 * np.pi * (0.3 * np.arange(SAMPLES) / SAMPLES + rng.random())
    status, reason = k_of(WHITE * rng.standard_normal(SAMPLES) + 1e-4 * np.sin(angle))
    assert status != "ok"
    if status == "doubtful":
        assert reason is not None and "smooth drift" in reason


@pytest.mark.parametrize("seed", range(4))
def test_walk_is_no_smooth_drift(seed: int) -> None:
    rng = np.random.default_rng(seed)
    walk = np.cumsum(1e-5 / np.sqrt(RATE) * rng.standard_normal(SAMPLES))
    assert k_of(WHITE * rng.standard_normal(SAMPLES) + walk) == ("ok", None)
