from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# The first example may have to wait for a compiler; how fast the code is, benchmarks/ tells.
settings.register_profile("imubench", deadline=None)
settings.load_profile("imubench")

PROJECT = Path(__file__).parents[1]
SHARED = PROJECT.parent / "shared"


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260101)


@pytest.fixture
def shared() -> Path:
    """Real logs and the results of other programs, where the project stands beside them."""
    if not SHARED.is_dir():
        # They are not part of the project.
        pytest.skip("the folder with real logs and oracles is not beside the project")
    return SHARED
