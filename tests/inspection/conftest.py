from __future__ import annotations

import numpy as np
import pytest

from imubench_pipeline.settings.sensor import CHANNELS
from tests.inspection.drafts import ROWS, Columns


@pytest.fixture
def si(rng: np.random.Generator) -> Columns:
    """A static log of 100 Hz in SI, with six digits."""
    found = {"time": np.arange(ROWS) / 100}
    for name, mean in zip(CHANNELS, (0.003, -0.002, 0.001, 0.1, -0.2, 9.79), strict=True):
        found[name] = np.round(mean + 0.01 * rng.standard_normal(ROWS), 6)
    found["temperature"] = np.round(25 + 0.1 * rng.standard_normal(ROWS), 3)
    return found
