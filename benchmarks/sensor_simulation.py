"""Time, CPU time and peak memory of `imubench simulate`: six axes, by default 10 h at 500 Hz.

python benchmarks/sensor_simulation.py [--hours 10] [--rate 500] [--suffix .parquet]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml

from imubench_pipeline.run.cli import main as imubench
from resident import peak_memory

_LOW_PASS = {"cutoff": "60 Hz", "order": 1}
_AXES: dict[str, dict[str, Any]] = {
    "gyro": {
        "N": "0.2 deg/sqrt(h)",
        "K": "2 deg/h/sqrt(h)",
        "bias": "0.1 deg/s",
        "drift": {"sensitivity": "0.01 deg/s/K", "lag": "5 min"},
        "low_pass": _LOW_PASS,
        "resolution": "0.001 deg/s",
        "full_scale": "250 deg/s",
    },
    "accel": {
        "N": "0.1 m/s/sqrt(h)",
        "K": "10 ug/sqrt(h)",
        "bias": "5 mg",
        "drift": {"sensitivity": "0.1 mg/K", "lag": "5 min"},
        "low_pass": _LOW_PASS,
        "resolution": "0.01 mg",
        "full_scale": "16 g",
    },
}
_FLOORS = {
    "Gauss-Markov": {
        "gyro": {"B": "10 deg/h", "T_B": "200 s"},
        "accel": {"B": "50 ug", "T_B": "200 s"},
    },
    "flicker": {"gyro": {"B": "10 deg/h"}, "accel": {"B": "50 ug"}},
}
_WARM = {"form": "day_cycle", "mean": "25 degC", "amplitude": "10 K"}


def write_settings(folder: Path, floor: str) -> None:
    """Write the model of a sensor with one kind of bias instability, and its surroundings."""
    axes = {
        f"{quantity}_{axis}": settings | _FLOORS[floor][quantity]
        for quantity, settings in _AXES.items()
        for axis in "xyz"
    }
    misalignment = {q: [[1.0, 0.01, 0.0], [0.0, 1.0, 0.01], [0.01, 0.0, 1.0]] for q in _AXES}
    model = {"axes": axes, "misalignment": misalignment, "temperature_step": "1 K"}
    (folder / "model.yaml").write_text(yaml.safe_dump(model))
    (folder / "warm.yaml").write_text(yaml.safe_dump(_WARM))
    turn = {"form": "steps", "times": ["0 s", "60 s"], "values": ["0 deg/s", "10 deg/s"]}
    (folder / "motion.yaml").write_text(yaml.safe_dump({"gyro_z": turn, "accel_z": "1 g"}))


def simulate(folder: Path, out: str, duration: float, rate: float) -> None:
    """Simulate one log."""
    settings = ["--temperature", folder / "warm.yaml", "--motion", folder / "motion.yaml"]
    length = ["--duration", f"{duration} s", "--rate", f"{rate} Hz"]
    arguments = ["simulate", folder / "model.yaml", *settings, *length, "--out", folder / out]
    if status := imubench([str(argument) for argument in arguments]):
        raise SystemExit(status)


def measure(floor: str, hours: float, rate: float, suffix: str) -> None:
    """Print what one log costs this process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_settings(folder, floor)
        with Path(os.devnull).open("w") as nowhere:
            kept, sys.stdout = sys.stdout, nowhere
            simulate(folder, f"compiled{suffix}", 1.0, rate)  # the kernels are compiled once
            wall, cpu = time.perf_counter(), time.process_time()
            simulate(folder, f"log{suffix}", hours * 3600.0, rate)
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            sys.stdout = kept
        size = (folder / f"log{suffix}").stat().st_size / 1e6
        print(
            f"{floor:14}{wall:9.1f} s{cpu:9.1f} s CPU{peak_memory():9.0f} MB peak{size:9.0f} MB",
            flush=True,
        )


def main() -> None:
    """Print a line for each kind of bias instability, each from a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=10.0)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--suffix", choices=(".parquet", ".csv"), default=".parquet")
    parser.add_argument("--floor", choices=_FLOORS, help="of this process")
    given = parser.parse_args()
    if given.floor:
        measure(given.floor, given.hours, given.rate, given.suffix)
        return
    samples = round(given.hours * 3600 * given.rate)
    print(f"{samples:,} samples of 6 axes and temperature, written as {given.suffix}")
    for floor in _FLOORS:
        subprocess.run([sys.executable, __file__, *sys.argv[1:], "--floor", floor], check=True)


if __name__ == "__main__":
    main()
