"""Resident memory of long logs: of the whole workflow, or of the Allan variance as a stream.

python benchmarks/memory.py [--samples 100000000]
python benchmarks/memory.py --stream [--samples 300000000]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import yaml

from imubench_pipeline.allan import of_blocks
from imubench_pipeline.recordings.recording import ROW_GROUP, ChannelLog, LogWriter
from resident import peak_memory

PROJECT = Path(__file__).parents[1]
SENSOR = {
    "vendor": "benchmark",
    "model": "one axis",
    "log": {"rate": "1000 Hz", "channels": {"gyro_x": {"column": 1, "unit": "deg/s"}}},
}


def write_text(path: Path, samples: int) -> None:
    """Write white noise as text."""
    rng = np.random.default_rng(1)
    options = pacsv.WriteOptions(include_header=False)
    path.parent.mkdir(parents=True)
    with path.open("wb") as file:
        for start in range(0, samples, 1 << 20):
            block = rng.standard_normal(min(1 << 20, samples - start)).astype(np.float32)
            pacsv.write_csv(pa.table({"x": np.round(block, 3)}), file, options)


def write_parquet(path: Path, samples: int) -> None:
    """Write white noise as a kept recording."""
    rng = np.random.default_rng(1)
    with LogWriter(path, {"gyro_x": pa.float32()}) as writer:
        for start in range(0, samples, ROW_GROUP):
            block = rng.standard_normal(min(ROW_GROUP, samples - start), dtype=np.float32)
            writer.write({"gyro_x": block})
        writer.finish({})


def workflow(samples: int) -> None:
    """Print the peak resident memory of each step, which is a process of its own."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "sensors").mkdir()
        (folder / "sensors/one.yaml").write_text(yaml.safe_dump(SENSOR))
        write_text(folder / "logs/one/long.csv", samples)
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


def stream(samples: int) -> None:
    """Print time and peak memory of the multi-octave Allan variance of a kept recording."""
    print(f"{samples:,} float32 samples in row groups of {ROW_GROUP:,}, multi-octave, all tau")
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "log.parquet"
        write_parquet(path, samples)
        for threads in (1, 2):
            arguments = ["--stream", "--samples", samples, "--threads", threads, "--log", path]
            subprocess.run([sys.executable, __file__, *map(str, arguments)], check=True)


def analyse(path: Path, samples: int, threads: int) -> None:
    """Print time and peak memory of this process."""
    log = ChannelLog(path, "gyro_x", 1000.0, samples, ((0, samples),), holes=False)
    start = time.perf_counter()
    curve = of_blocks(
        log.blocks(), log.grid, log.rate, holes=log.holes, segments=log.segments, threads=threads
    )
    taken = time.perf_counter() - start
    print(
        f"{threads} thread{'s' if threads > 1 else ' '}  {len(curve.tau)} tau  {taken:6.1f} s  "
        f"peak resident {peak_memory():5.0f} MB"
    )


def main() -> None:
    """Run what the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int)
    parser.add_argument("--stream", action="store_true", help="the Allan variance only")
    parser.add_argument("--threads", type=int, default=1, help="with --log")
    parser.add_argument("--log", type=Path, help="analyse this log in this process")
    given = parser.parse_args()
    if given.log:
        analyse(given.log, given.samples, given.threads)
    elif given.stream:
        stream(given.samples or 300_000_000)
    else:
        workflow(given.samples or 100_000_000)


if __name__ == "__main__":
    main()
