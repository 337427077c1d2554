from __future__ import annotations

import gc
import os
import tempfile

# A worker of pytest-xdist has one processor: the threads of the linear algebra would wait for each
# other on it, which takes half as long again.
os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "NUMBA")}
# Some hundred processes are started: each would compile its imports, for 3 s.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

from collections.abc import Generator, Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

from tests.scheduling import ByUnit, place

if TYPE_CHECKING:  # the workers import them, and the process that waits for them does not
    from imubench_pipeline.settings.sensor import Sensor

# The first example may have to wait for a compiler; how fast the code is, benchmarks/ tells.
settings.register_profile("all", deadline=None, database=None)
# Every day a few of the examples, and the same in each run: what passes today passes tomorrow.
# All of them, and others in each run, before a release: HYPOTHESIS_PROFILE=all.
settings.register_profile("quick", settings.get_profile("all"), max_examples=10, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))

PROJECT = Path(__file__).parents[1]
SHARED = PROJECT.parent / "shared"

DAILY_DRAWS = 10_000
"""Draws from a posterior without the tests of a release: limits of two seeds agree within 9 %."""


def pytest_configure(config: pytest.Config) -> None:
    """Have one worker compile for all, and each begin to collect elsewhere, where all are run.

    On a fresh checkout the first who imports a module of tests rewrites it and keeps that, for a
    minute in all: so they share it.
    """
    own = getattr(config, "workerinput", None)
    if own is None and config.option.dist != "no":
        return  # it only waits for the workers: imports would delay their start
    if "not release" in config.option.markexpr:
        from imubench_pipeline.estimators import posterior

        # To draw takes two thirds of the time of an estimate.
        posterior.sample.__defaults__ = (DAILY_DRAWS,)
    read_catalogue_once()
    if own is None:
        return
    from imubench_pipeline.run.step_server import compile_once

    compile_once(_locks(own).open("a+b"))
    if [Path(argument).name for argument in config.args] != ["tests"]:
        return
    parts = [str(path) for path in sorted((PROJECT / "tests").iterdir())
             if (path / "__init__.py").is_file() or path.match("test_*.py")]  # fmt: skip
    first = int(own["workerid"].removeprefix("gw")) * len(parts) // own["workercount"]
    config.args = parts[first:] + parts[:first]


def read_catalogue_once() -> None:
    """Let a process parse each settings file of the project, and its copies, once.

    Most commands read the 35 sensors of the catalogue, for a third of a second.
    """
    from imubench_pipeline.settings import yaml_files

    read = yaml_files.read_settings
    shipped = {path.read_bytes() for path in (PROJECT / "config").rglob("*.yaml")}
    known: dict[tuple[type[Any], bytes], Any] = {}

    def read_or_recall(model: type[Any], path: Path) -> Any:
        data = path.read_bytes() if path.is_file() and os.access(path, os.R_OK) else b""
        if data not in shipped:
            return read(model, path)
        if (model, data) not in known:
            known[model, data] = read(model, path)
        return known[model, data]

    yaml_files.read_settings = read_or_recall


def pytest_unconfigure(config: pytest.Config) -> None:
    if own := getattr(config, "workerinput", None):
        _locks(own).unlink(missing_ok=True)


def _locks(own: dict[str, Any]) -> Path:
    """The file that the workers of a run have in common."""
    return Path(tempfile.gettempdir(), f"imubench-kernels-{own['testrunuid']}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    # In one order, wherever a worker began; those of a file stay as they are.
    items.sort(key=lambda item: (place(item.nodeid), item.nodeid.partition("::")[0]))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect without looking for garbage, and never look for it in what was collected.

    Modules and tests are millions of objects, which live as long as the worker: to look through
    them takes half of the time of their collection, and half a second each time after it.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000)  # what a test makes is gone with it
        gc.enable()


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    return ByUnit(config, log)


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Name a long text by its length: names go between the workers with every report."""
    return f"{argname} of {len(val)}" if isinstance(val, str | bytes) and len(val) > 60 else None


@cache
def catalogue() -> dict[str, Sensor]:
    """Return the sensors that come with the project: 35 files, which are read once a worker."""
    from imubench_pipeline.settings.sensor import read_sensors

    return read_sensors(PROJECT / "config/sensors")


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
        # Only a checkout on its own lacks it; CI has it.
        pytest.skip("the folder with real logs and oracles is not beside the project")
    return SHARED
