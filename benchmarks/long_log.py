"""One long log on one core: from the CSV to its tables, and on to the report.

python benchmarks/long_log.py [--hours 10] [--folder DIR]

100 Hz, three gyros and three accelerometers, simulated, in six decimals; all methods. The first run
of a fresh environment compiles kernels, so a short log goes before.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pyarrow as pa
import pyarrow.csv
import yaml

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.run.processes import COSTS

PROJECT = Path(__file__).parents[1]
RATE = 100.0
AXES = [f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz"]
MODELS = {
    "gyro": NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7),  # rad/s: 000, Table 2, MTi-7
    "accel": NoiseModel(N=9.6e-4, B=3.4e-4, T_B=38.3, K=1.7e-5),  # m/s²
}
UNITS = {"gyro": "rad/s", "accel": "m/s^2"}


def put_sensor(folder: Path) -> None:
    """Write the sensor file."""
    channels = {axis: {"column": axis, "unit": UNITS[axis.partition("_")[0]]} for axis in AXES}
    log = {"rate": f"{RATE:g} Hz", "channels": channels}
    path = folder / "sensors/long.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump({"vendor": "Benchmark", "model": "long", "log": log}))


def put_log(folder: Path, name: str, hours: float) -> Path:
    """Write a log of all axes."""
    samples = round(hours * 3600.0 * RATE)
    columns = {}
    for axis in AXES:
        model = MODELS[axis.partition("_")[0]]
        values = simulate(model, RATE, samples, channel_rng(1, name, axis))
        columns[axis] = (values + 9.80665 * (axis == "accel_z")).round(9)
    path = folder / f"logs/long/{name}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    pyarrow.csv.write_csv(pa.table(columns), path)
    return path


def run(folder: Path, *targets: str) -> float:
    """Run the workflow on one core and return the time it takes in s."""
    settings = [f"{name}={folder / name}" for name in ("logs", "sensors", "results")]
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "-c1", *targets, "--config", *settings,
         "simulated=false"],
        cwd=PROJECT, env=os.environ | {COSTS: str(folder / "costs")}, check=False,
        capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        sys.exit(done.stdout[-2000:] + done.stderr[-2000:])
    return time.perf_counter() - start


def main() -> None:
    """Make the logs, run, and print what each step takes."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--hours", type=float, default=10.0)
    parser.add_argument("--folder", type=Path, help="keep all here")
    given = parser.parse_args()
    folder = given.folder or Path(tempfile.mkdtemp(prefix="imubench.long."))
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    put_sensor(folder)
    put_log(folder, "short", 0.1)
    run(folder)
    path = put_log(folder, "log", given.hours)
    (folder / "costs").unlink()
    to_tables = run(folder, "tables")
    rest = run(folder)
    print(f"{given.hours:g} h, {RATE:g} Hz, {len(AXES)} axes: {path.stat().st_size / 1e6:.0f} MB")
    for line in (folder / "costs").read_text().splitlines():
        step = json.loads(line)
        print(f"  {step['step']:13} {step['cpu']:6.1f} s of CPU, {step['memory']:5.0f} MB")
    print(f"log to tables {to_tables:.1f} s, figures and report {rest:.1f} s more")


if __name__ == "__main__":
    main()
