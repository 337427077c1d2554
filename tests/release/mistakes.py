"""Mistakes that people make with logs, put into a real one: does a doubt go with what they change?

python -m tests.release.mistakes [--rows 240000] [--mistake NAME ...]

A log of the ADIS16405 is read through the public interface, and so is the same log with a mistake
in it, by the steps of the workflow at default settings. What decides is compared: the recommended
parameters, of which pools and exports are made, and the totals of the error budgets, of which the
ranking is. Where one of them changed by more than its intervals, there must be a doubt that the log
without the mistake does not have: on that channel or the whole recording, as a status of the value,
or the recording is rejected. The exit status is 1 where there is none.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import yaml

from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables.files import read

PROJECT = Path(__file__).parents[2]
LOG = Path("logs/adis16405/imu1.csv.gz")  # in the folder of real logs
SENSOR = PROJECT / "config/sensors/adis16405.yaml"

_CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
_RATE = 100.0  # Hz
_OF_LOG = ("N", "B_curve", "K")
_TABLES = ("parameters", "models", "findings", "recordings", "doubts", "error_budget")

Array = np.ndarray[Any, np.dtype[np.float64]]
Columns = dict[str, Array]
"""deg/s and g, as the log has them; ``t`` in s, where there are stamps."""


@dataclass(frozen=True)
class Made:
    """A log with a mistake, and what its sensor file says of it.

    Attributes
    ----------
    columns : dict of str to ndarray, shape (n,)
    units : dict of str to str
        Of channels whose unit is stated wrongly.
    rate : float
        Hz; where there are no stamps.
    """

    columns: Columns
    units: dict[str, str]
    rate: float = _RATE


def _of(columns: Columns, **units: str) -> Made:
    return Made(columns, units)


def _scaled(quantity: str, factor: float) -> Callable[[Columns], Made]:
    return lambda log: _of(
        {
            name: samples * factor if name.startswith(quantity) else samples
            for name, samples in log.items()
        }
    )


def _each(change: Callable[[Array], Array], *names: str) -> Callable[[Columns], Made]:
    """Return a mistake that changes some channels, each for itself."""
    return lambda log: _of(
        {name: change(s) if name in (names or _CHANNELS) else s for name, s in log.items()}
    )


def _rows(change: Callable[[Array], Array]) -> Callable[[Columns], Made]:
    """Return a mistake that takes rows of a log, given their numbers."""

    def made(log: Columns) -> Made:
        rows = change(np.arange(len(log["gyro_x"])))
        return _of({name: samples[rows] for name, samples in log.items()})

    return made


def _at(rate: float) -> Callable[[Columns], Made]:
    return lambda log: Made(dict(log), {}, rate)


def _stamped(stamps: Callable[[Array], Array]) -> Callable[[Columns], Made]:
    return lambda log: _of({"t": stamps(np.arange(len(log["gyro_x"])) / _RATE), **log})


def _copied(target: str, source: str) -> Callable[[Columns], Made]:
    return lambda log: _of({**log, target: log[source].copy()})


def _moved(log: Columns) -> Made:
    """Carry the sensor about for the third tenth of the log."""
    n = len(log["gyro_x"])
    rng = np.random.default_rng(1)
    there = slice(3 * n // 10, 4 * n // 10)
    time = np.arange(n // 10) / _RATE
    changed = {name: samples.copy() for name, samples in log.items()}
    for number, name in enumerate(_CHANNELS):
        size = 20.0 if name.startswith("gyro") else 0.2
        swing = np.sin(2 * np.pi * (0.3 + 0.1 * number) * time + rng.uniform(0, 6))
        changed[name][there] += size * swing[: len(changed[name][there])]
    return _of(changed)


def _turning(log: Columns) -> Made:
    return _of({**log, "gyro_z": log["gyro_z"] + 12.0})


def _tumbling(log: Columns) -> Made:
    """Turn about a horizontal axis, slowly and steadily: gravity turns through two axes."""
    time = np.arange(len(log["gyro_x"])) / _RATE
    angle = np.deg2rad(2.0) * time
    gravity = float(np.mean(log["accel_z"]))
    return _of(
        {
            **log,
            "gyro_x": log["gyro_x"] + 2.0,
            "accel_y": log["accel_y"] + gravity * np.sin(angle),
            "accel_z": log["accel_z"] + gravity * (np.cos(angle) - 1.0),
        }
    )


def _circling(log: Columns) -> Made:
    """Drive round and round: a rate that changes, and the acceleration of the turn."""
    time = np.arange(len(log["gyro_x"])) / _RATE
    rate = 10.0 + 3.0 * np.sin(2 * np.pi * time / 40.0)
    pull = 0.05 * np.sin(2 * np.pi * time / 36.0)
    return _of(
        {**log, "gyro_z": log["gyro_z"] + rate, "accel_x": log["accel_x"] + pull,
         "accel_y": log["accel_y"] + pull}
    )  # fmt: skip


def _pasted(log: Columns) -> Made:
    """Paste a tenth of the log again right behind itself, over what was there, three times."""
    n = len(log["gyro_x"])
    rows = np.arange(n)
    block = np.arange(n // 10)
    for place in (3, 5, 8):
        rows[place * n // 10 : place * n // 10 + len(block)] = block + n // 10
    return _of({name: samples[rows] for name, samples in log.items()})


def _joined(log: Columns) -> Made:
    """Append the second half by another sensor: another level, four times the noise."""
    return _each(lambda s: np.concatenate([s[: len(s) // 2], _other(s[len(s) // 2 :])]))(log)


def _interleaved(log: Columns) -> Made:
    def change(samples: Array) -> Array:
        mixed = samples.copy()
        mixed[1::2] = _other(samples)[1::2]
        return mixed

    return _each(change)(log)


def _other(samples: Array) -> Array:
    """Return samples as another sensor of a kind has them, on the same register."""
    mean = samples.mean()
    return mean + 4.0 * (samples - mean) + 0.35


def _lost(rows: Array) -> Array:
    kept = np.random.default_rng(3).random(len(rows)) > 0.2
    return rows[kept]


def _stuck(every: int) -> Callable[[Array], Array]:
    def change(rows: Array) -> Array:
        return rows - (rows % every == every - 1)

    return change


def _step(samples: Array) -> Array:
    return samples + 0.3 * (np.arange(len(samples)) > 0.6 * len(samples))


def _warming(samples: Array) -> Array:
    return samples + 1.0 * np.exp(-np.arange(len(samples)) / (0.15 * len(samples)))


def _swinging(samples: Array) -> Array:
    return samples + 0.3 * np.sin(2 * np.pi * 3.5 * np.arange(len(samples)) / len(samples))


def _spiked(samples: Array) -> Array:
    rng = np.random.default_rng(2)
    spikes = rng.random(len(samples)) < 1e-3
    return samples + 50.0 * spikes * rng.choice([-1.0, 1.0], len(samples))


def _shaken(samples: Array) -> Array:
    return samples + 2.0 * np.sin(2 * np.pi * 17.3 * np.arange(len(samples)) / _RATE)


def _clipped(samples: Array) -> Array:
    spread = samples.std()
    return np.clip(samples, samples.mean() - 0.8 * spread, samples.mean() + 0.8 * spread)


def _half_in_radians(samples: Array) -> Array:
    scale = np.where(np.arange(len(samples)) < len(samples) / 2, 1.0, np.pi / 180.0)
    return samples * scale


def _summed(log: Columns) -> Made:
    """Write what came of all gyros into the column of x."""
    others = [log[name] - log[name].mean() for name in ("gyro_y", "gyro_z")]
    return _of({**log, "gyro_x": log["gyro_x"] + others[0] + others[1]})


def _smoothed(samples: Array) -> Array:
    kernel = np.ones(20) / 20.0
    return np.convolve(samples, kernel, "same")


MISTAKES: Mapping[str, Callable[[Columns], Made]] = {
    "gyro in rad/s, stated in deg/s": _scaled("gyro", np.pi / 180.0),
    "gyro in deg/s, stated in rad/s": lambda log: _of(
        dict(log), **dict.fromkeys(_CHANNELS[:3], "rad/s")
    ),
    "gyro in mdeg/s, stated in deg/s": _scaled("gyro", 1e3),
    "gyro in deg/h, stated in deg/s": _scaled("gyro", 3600.0),
    "gyro in counts of 0.05 deg/s, stated in deg/s": _scaled("gyro", 20.0),
    "half of the gyro in rad/s": _each(_half_in_radians, *_CHANNELS[:3]),
    "accelerometer in m/s^2, stated in g": _scaled("accel", 9.80665),
    "accelerometer in g, stated in m/s^2": lambda log: _of(
        dict(log), **dict.fromkeys(_CHANNELS[3:], "m/s^2")
    ),
    "accelerometer in mg, stated in g": _scaled("accel", 1e3),
    "moved for a tenth": _moved,
    "turned steadily about the vertical": _turning,
    "tumbled slowly": _tumbling,
    "driven in circles": _circling,
    "gyro x in the column of y": _copied("gyro_y", "gyro_x"),
    "an accelerometer's column as gyro": _copied("gyro_x", "accel_x"),
    "accelerometers in the columns of gyros": lambda log: _of(
        log | {f"gyro_{axis}": log[f"accel_{axis}"].copy() for axis in "xyz"}
    ),
    "temperature as gyro": lambda log: _of(
        {**log, "gyro_x": np.round(25.0 + 2.0 * np.linspace(0, 1, len(log["gyro_x"])) ** 0.5, 1)}
    ),
    "blocks pasted again": _pasted,
    "appended to itself": _rows(lambda rows: np.concatenate([rows, rows])),
    "two sensors joined": _joined,
    "two sensors interleaved": _interleaved,
    "every tenth sample stuck": _rows(_stuck(10)),
    "every third sample stuck": _rows(_stuck(3)),
    "every sample twice": _rows(lambda rows: np.repeat(rows, 2)),
    "an axis stuck": _each(lambda s: np.full_like(s, s[0]), "gyro_y"),
    "an axis at zero": _each(np.zeros_like, "gyro_y"),
    "rate ten times too high": _at(1000.0),
    "rate ten times too low": _at(10.0),
    "stamps in ms, stated in s": _stamped(lambda time: 1e3 * time),
    "stamps in s that count ms": _stamped(lambda time: 1e-3 * time),
    "a minute only": _rows(lambda rows: rows[:6000]),
    "every fifth row lost": _rows(_lost),
    "a step of the bias": _each(_step, *_CHANNELS[:3]),
    "a warm-up": _each(_warming, *_CHANNELS[:3]),
    "a ventilation": _each(_swinging, *_CHANNELS[:3]),
    "spikes": _each(_spiked, *_CHANNELS[:3]),
    "vibration": _each(_shaken, *_CHANNELS[:3]),
    "clipped": _each(_clipped, *_CHANNELS[:3]),
    "smoothed": _each(_smoothed),
    "a gyro that is the sum of all": _summed,
}  # fmt: skip
"""What people do to logs."""


@dataclass(frozen=True)
class Analysed:
    """What the tables say of a log: values that decide, and doubts.

    Attributes
    ----------
    values : mapping
        Value, lower and upper limit by channel and name.
    doubts : mapping
        Channels (None: all of the recording) by code.
    left_out : str or None
        Why the recording does not decide or was rejected.
    """

    values: Mapping[tuple[str, str], tuple[float, float, float]]
    doubts: frozenset[tuple[str, str | None]]
    left_out: str | None

    def silent_changes(self, before: Analysed) -> Iterator[str]:
        """Yield what differs from a log without a mistake, and nothing says so."""
        if self.left_out is not None:
            return
        new = {channel for _, channel in self.doubts - before.doubts}
        for (channels, name), (value, low, high) in self.values.items():
            if (channels, name) not in before.values or new & {None, *channels.split()}:
                continue
            old, lower, upper = before.values[channels, name]
            if abs(value - old) > max(upper - lower, high - low):
                yield f"{name} of {channels}: {value:.3g} instead of {old:.3g}"


def analysed(made: Made, folder: Path) -> Analysed:
    """Run the steps of the workflow on a log in an empty folder."""
    sys.path.insert(0, str(PROJECT / "benchmarks"))
    from workflow_steps import OneRecording

    run = OneRecording(_written(made, folder))
    for step in ("ingest", "allan", "estimate", "error_budget"):
        run.run(step)
    joined = [folder / f"{name}.parquet" for name in _TABLES]
    run.run("sensor_tables", input=run.input("sensor_tables"), output=joined)
    tables = {path.stem: read(path.stem, [path]).to_pylist() for path in joined}
    (recording,) = tables["recordings"]
    reason = recording["reason"] if recording["status"] != "ok" else None
    if not Quality.read(run.folder / "quality.json").channels:
        return Analysed({}, frozenset(), reason or "rejected")
    apart = list(list_excluded([RecordingRow(**recording)]).values())
    doubts = {(row["code"], row["channel"]) for row in tables["doubts"]}
    return Analysed(dict(_values(tables)), frozenset(doubts), reason or (apart or [None])[0])


def _values(
    tables: Mapping[str, list[Any]],
) -> Iterator[tuple[tuple[str, str], tuple[float, float, float]]]:
    for row in tables["parameters"]:
        if row["recommended"] and row["status"] == "ok" and row["parameter"] in _OF_LOG:
            yield (row["channel"], row["parameter"]), (row["value"], row["lower"], row["upper"])
    for row in tables["error_budget"]:
        if row["source"] == "total" and row["sigma"] is not None:
            channels = " ".join(row[name] for name in ("gyro", "accel") if row[name])
            name = f"{row['requirement'] or ''} {row['error']} after {row['time']:g} s".strip()
            yield (channels, name), (row["sigma"], row["lower"], row["upper"])


def _written(made: Made, folder: Path) -> Plan:
    logs, sensors = folder / "logs/adis16405", folder / "sensors"
    logs.mkdir(parents=True)
    sensors.mkdir()
    pyarrow.csv.write_csv(pa.table(made.columns), logs / "log.csv")
    sensor = yaml.safe_load(SENSOR.read_text(encoding="utf-8"))
    layout = sensor["log"]
    if "t" in made.columns:
        del layout["rate"]
        layout["time"] = {"column": "t", "unit": "s"}
    else:
        layout["rate"] = f"{made.rate:g} Hz"
    for channel, unit in made.units.items():
        layout["channels"][channel]["unit"] = unit
    (sensors / "adis16405.yaml").write_text(yaml.safe_dump(sensor), encoding="utf-8")
    folders = {"logs": logs.parent, "sensors": sensors, "results": folder / "results"}
    given = {name: str(path) for name, path in folders.items()}
    return Plan(
        given | {"simulated": "false", "requirements": str(PROJECT / "config/requirements")}
    )


def real_log(path: Path, rows: int) -> Columns:
    """Return the first rows of a real log, in deg/s and g."""
    frame = pd.read_csv(path, nrows=rows)
    return {name: frame[name].to_numpy(dtype=float) for name in _CHANNELS}


def main() -> int:
    """Print what each mistake changes, and what says so."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=240_000)
    parser.add_argument("--mistake", nargs="+", choices=list(MISTAKES), default=list(MISTAKES))
    arguments = parser.parse_args()
    log = real_log(PROJECT.parent / "shared" / LOG, arguments.rows)
    silent = 0
    with tempfile.TemporaryDirectory() as folder:
        before = analysed(_of(log), Path(folder, "before"))
        print(f"without a mistake: {before.left_out or ''} {sorted(map(str, before.doubts))}")
        for number, name in enumerate(arguments.mistake):
            found = analysed(MISTAKES[name](log), Path(folder, str(number)))
            changes = list(found.silent_changes(before))
            silent += bool(changes)
            new = sorted({code for code, _ in found.doubts - before.doubts})
            said = found.left_out or ", ".join(new) or "-"
            print(f"{name}: {'SILENT ' + '; '.join(changes[:4]) if changes else 'said'} | {said}",
                  flush=True)  # fmt: skip
    print(f"{silent} of {len(arguments.mistake)} change something, and nothing says so")
    return int(silent > 0)


if __name__ == "__main__":
    sys.exit(main())
