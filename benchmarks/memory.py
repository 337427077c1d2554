"""Resident memory while a log of 100 million samples is ingested and analysed.

python benchmarks/memory.py [--samples 100000000]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import yaml

PROJECT = Path(__file__).parents[1]
SENSOR = {
    "vendor": "benchmark",
    "model": "one axis",
    "log": {"rate": "1000 Hz", "channels": {"gyro_x": {"column": 1, "unit": "deg/s"}}},
}


def write_log(path: Path, samples: int) -> None:
    """Write white noise as text."""
    rng = np.random.default_rng(1)
    options = pacsv.WriteOptions(include_header=False)
    path.parent.mkdir(parents=True)
    with path.open("wb") as file:
        for start in range(0, samples, 1 << 20):
            block = rng.standard_normal(min(1 << 20, samples - start)).astype(np.float32)
            pacsv.write_csv(pa.table({"x": np.round(block, 3)}), file, options)


def main() -> None:
    """Print the peak resident memory of each step, which is a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=100_000_000)
    samples = parser.parse_args().samples
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "sensors").mkdir()
        (folder / "sensors/one.yaml").write_text(yaml.safe_dump(SENSOR))
        write_log(folder / "logs/one/long.csv", samples)
        config = [f"{key}={folder / key}" for key in ("logs", "sensors", "results")]
        for step in ("quality.json", "allan.parquet", "parameters.parquet", "scores.parquet"):
            target = folder / "results/recordings/one/long" / step
            command = [sys.executable, "-m", "snakemake", "-c1", str(target), "--quiet", "all"]
            process = subprocess.Popen(
                [*command, "--config", *config, "simulated=false"], cwd=PROJECT
            )
            _, status, usage = os.wait4(process.pid, 0)
            if status:
                raise SystemExit(f"{step}: exit status {os.waitstatus_to_exitcode(status)}")
            # The largest of Snakemake and of the jobs that it waited for, in KiB on Linux.
            print(f"{step:20} peak resident {usage.ru_maxrss / 1024:7.0f} MiB")


if __name__ == "__main__":
    main()
