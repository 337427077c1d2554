"""Tables of samples with cells missing in every way, and the whole chain that analyses them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from imubench_pipeline.estimators.posterior_kernels import compile_kernels
from imubench_pipeline.run.analysis.chain import Analysis
from imubench_pipeline.run.analysis.compilation import Compilation
from imubench_pipeline.run.checking import check
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.config import EstimateSettings
from imubench_pipeline.typing import Array

CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
UNITS = {"gyro": "deg/s", "accel": "m/s^2"}
METHODS = tuple(EstimateSettings().methods)
WORDS = ("", "nan", "NaN", "null", "NULL", "inf", "-inf")


@dataclass
class Table:
    """A log: columns on common records, NaN where a cell is empty."""

    columns: dict[str, Array]
    rate: float
    times: Array | None = None
    word: str = ""
    good: tuple[str, ...] = field(default=())
    """Channels that have a sample in each record of their own regular clock."""

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values())))

    def sensor(self) -> dict[str, Any]:
        """Return the sensor file."""
        sources = {
            name: {"column": name, "unit": UNITS[name.split("_")[0]]}
            for name in self.columns
            if name != "temperature"
        }
        log: dict[str, Any] = {"reader": "csv", "channels": sources}
        if "temperature" in self.columns:
            log["temperature"] = {"column": "temperature", "unit": "degC"}
        if self.times is None:
            log["rate"] = f"{self.rate} Hz"
        else:
            log["time"] = {"column": "time", "unit": "s"}
        return {"vendor": "made", "model": "made", "log": log}

    def write(self, path: Path) -> None:
        times = {} if self.times is None else {"time": self.times}
        columns = {**times, **self.columns}
        cells = []
        for column in columns.values():
            cells.append([f"{cell:.9g}" for cell in column.tolist()])
            for row in np.flatnonzero(np.isnan(column)).tolist():
                cells[-1][row] = self.word
        rows = map(",".join, zip(*cells, strict=True))
        path.write_text("\n".join([",".join(columns), *rows]) + "\n")


def noise(name: str, rows: int, seed: int) -> Array:
    """Return samples of a sensor at rest, in the unit of `UNITS`."""
    rng = np.random.default_rng([seed, sum(map(ord, name))])
    white = rng.normal(size=rows)
    if name == "temperature":
        return 25.0 + np.cumsum(0.01 * white)
    if name.startswith("gyro"):
        return 0.1 + 0.1 * white
    return (9.81 if name == "accel_z" else 0.2) + 0.02 * white


PATTERNS = ("full", "slow", "random", "bursts", "half", "none", "one", "two", "few", "constant")


def present(pattern: str, rows: int, rng: np.random.Generator) -> np.ndarray[Any, Any]:
    """Return which records have a cell, of records that follow a pattern."""
    number = np.arange(rows)
    if pattern == "slow":
        every = int(rng.integers(2, 12))
        return number % every == int(rng.integers(every))
    if pattern == "random":
        return rng.random(rows) > rng.uniform(0.02, 0.98)
    if pattern == "bursts":
        length = int(rng.integers(2, 200))
        return number // length % 2 == 0
    if pattern == "half":
        return number < rows // 2
    few = {"none": 0, "one": 1, "two": 2, "few": 99}
    if pattern in few:
        return np.isin(number, rng.permutation(rows)[: few[pattern]])
    return np.ones(rows, dtype=bool)


@st.composite
def tables(draw: st.DrawFn, most: int = 1500) -> Table:
    """Draw a log."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    rows = draw(st.sampled_from([0, 1, 2, 3, 17, 99, 100, 101, 250, 600, most]))
    names = draw(st.lists(st.sampled_from(CHANNELS), min_size=1, max_size=3, unique=True))
    rate = draw(st.sampled_from([1.0, 10.0, 100.0, 400.0]))
    merged = draw(st.booleans())
    stamped = draw(st.booleans()) or merged
    table = Table({}, rate, word=draw(st.sampled_from(WORDS)))
    if stamped:
        scatter = draw(st.sampled_from([0.0, 0.0, 0.1, 0.8]))
        table.times = (np.arange(rows) + scatter * rng.uniform(-0.5, 0.5, rows)) / rate
    owner = np.zeros(rows, dtype=int)
    if merged:  # gyro and accelerometer have records of their own
        others = (np.arange(rows // 2) + rng.random()) * 2.0 / rate
        assert table.times is not None
        both = np.concatenate([table.times, others])
        order = np.argsort(both, kind="stable")
        owner = (order >= rows).astype(int)
        table.times, rows = both[order], len(both)
    good = []
    for name in names:
        values = noise(name, rows, int(rng.integers(1 << 30)))
        own = owner == int(name.startswith("accel")) if merged else np.ones(rows, dtype=bool)
        pattern = draw(st.sampled_from(PATTERNS))
        there = np.zeros(rows, dtype=bool)
        there[np.flatnonzero(own)] = present(pattern, int(own.sum()), rng)
        if pattern == "constant":
            values[:] = 1.0
        if pattern in ("full", "slow") and there.sum() >= 100:
            good.append(name)
        table.columns[name] = np.where(there, values, np.nan)
    if draw(st.booleans()):
        there = present(draw(st.sampled_from(PATTERNS)), rows, rng)
        table.columns["temperature"] = np.where(there, noise("temperature", rows, 1), np.nan)
    table.good = tuple(good)
    return table


def project(table: Table, folder: Path, methods: Sequence[str] = METHODS) -> Plan:
    """Write a log with its sensor file, and return the plan of a run of it."""
    logs = folder / "logs" / "made"
    logs.mkdir(parents=True)
    table.write(logs / "log.csv")
    (folder / "sensors").mkdir()
    (folder / "sensors" / "made.yaml").write_text(json.dumps(table.sensor()))
    paths = {
        "logs": str(folder / "logs"),
        "sensors": str(folder / "sensors"),
        "results": str(folder / "results"),
        "simulated": None,
        "requirements": None,
    }
    return Plan({**paths, "estimate": {"methods": list(methods)}})


class Compiled(Compilation):
    """Kernels that this process has compiled before: its forks have them."""

    def __init__(self) -> None:
        compile_kernels()

    def expected(self) -> None: ...

    def finish(self) -> None: ...


def analysed(plan: Plan, *, pages: bool = True) -> Mapping[str, list[dict[str, Any]]]:
    """Run every step of a plan, or those that come before pages; return the joined tables."""
    analysis = Analysis(plan, Compiled(), 1, lambda _: None)
    joined = analysis.estimates()
    joined = analysis.for_pages() if pages else joined
    return {name: table.to_pylist() for name, table in joined.items()}


def checked(plan: Plan) -> tuple[str, str | None, set[str]]:
    """Return status and reason by `imubench check`, and the names of findings."""
    ((_, _, quality),) = check(plan)
    names = {str(row["finding"]) for row in quality.findings}
    return quality.recording.status, quality.recording.reason, names
