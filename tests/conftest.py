from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

# The first example may have to wait for a compiler; how fast the code is, benchmarks/ tells.
# A fourth of the examples: they are others in each run. All of them: HYPOTHESIS_PROFILE=all.
settings.register_profile("all", deadline=None, database=None)
settings.register_profile("quick", settings.get_profile("all"), max_examples=25)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))

PROJECT = Path(__file__).parents[1]
SHARED = PROJECT.parent / "shared"


def few(chosen: Iterable[Any], others: Iterable[Any]) -> list[Any]:
    """The values of a parametrised test: few that tell, and others that the release has too."""

    def left(value: Any) -> Any:
        values = value if isinstance(value, tuple) else (value,)
        return pytest.param(*values, marks=pytest.mark.release)

    return [*chosen, *map(left, others)]


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
