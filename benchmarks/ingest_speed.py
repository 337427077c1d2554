"""Ingest of a CSV log with all checks, against a bare streaming conversion to Parquet by pyarrow.

python benchmarks/ingest_speed.py [--rows 10000000 30000000] [--runs 3]

Both read the same seven columns, write zstd level 1 with byte stream split in row groups of a
million rows, and run each in a process of its own, one after the other. The bare conversion parses
and writes in one thread, and reads ahead in another. Ours parses in one, checks and writes in
another, and takes the digest of the file in a third. So two ratios are printed: of the time, which
a second core shortens, and of the core time.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.recording import ROW_GROUP, LogNames
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat, RecordingNotes
from resident import peak_memory

RATE = 100.0
COLUMNS = ("t", "wx", "wy", "wz", "ax", "ay", "az")
LAYOUT = {
    "time": {"column": "t", "unit": "s"},
    "channels": {
        **{f"gyro_{axis}": {"column": f"w{axis}", "unit": "deg/s"} for axis in "xyz"},
        **{f"accel_{axis}": {"column": f"a{axis}", "unit": "g"} for axis in "xyz"},
    },
}


def write_log(path: Path, rows: int) -> None:
    """Write a simulated log: white noise, and gravity on one axis."""
    rng = np.random.default_rng(1)
    with path.open("wb") as file:
        for start in range(0, rows, 1 << 20):
            size = min(1 << 20, rows - start)
            block = {"t": np.round((start + np.arange(size)) / RATE, 2)}
            block |= {name: np.round(0.05 * rng.standard_normal(size), 6) for name in COLUMNS[1:4]}
            block |= {name: np.round(1e-3 * rng.standard_normal(size), 6) for name in COLUMNS[4:]}
            block["az"] = block["az"] + 1.0
            options = pacsv.WriteOptions(include_header=start == 0)
            pacsv.write_csv(pa.table(block), file, options)


def ours(source: Path, folder: Path) -> None:
    """Ingest the log."""
    layout = LogFormat.model_validate(LAYOUT)
    found = ingest(source, layout, RecordingNotes(), QualitySettings(), folder, LogNames())
    assert not [f for f in found.findings if f.severity != "note"], found.findings


def bare(source: Path, folder: Path) -> None:
    """Convert the log with pyarrow alone."""
    types = dict.fromkeys(COLUMNS, pa.float64())
    reader = pacsv.open_csv(
        source,
        read_options=pacsv.ReadOptions(use_threads=False, block_size=1 << 20),
        convert_options=pacsv.ConvertOptions(column_types=types),
    )
    writer = pq.ParquetWriter(
        folder / "bare.parquet",
        reader.schema,
        compression="zstd",
        compression_level=1,
        use_dictionary=False,
        use_byte_stream_split=list(COLUMNS),
    )
    waiting: list[pa.RecordBatch] = []
    held = 0
    with writer:
        for batch in reader:
            waiting.append(batch)
            held += len(batch)
            if held >= ROW_GROUP:
                writer.write_table(pa.Table.from_batches(waiting), row_group_size=ROW_GROUP)
                waiting, held = [], 0
        if waiting:
            writer.write_table(pa.Table.from_batches(waiting), row_group_size=ROW_GROUP)


WAYS = {"ours": ours, "bare": bare}


def measured(way: str, source: Path) -> tuple[float, float, float]:
    """Run one way in a process of its own; return seconds, of a core, and peak resident MB."""
    with tempfile.TemporaryDirectory(dir=source.parent) as folder:
        command = [sys.executable, __file__, "--way", way, "--log", str(source), "--to", folder]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    seconds, of_core, memory = map(float, done.stdout.split())
    return seconds, of_core, memory


def main() -> None:
    """Print the ratio and the memory for each length."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", type=int, nargs="+", default=[10_000_000, 30_000_000])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--way", choices=WAYS, help=argparse.SUPPRESS)
    parser.add_argument("--log", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--to", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.way:
        # What is compiled or imported once is not counted on either side.
        small = given.to / "small.csv"
        write_log(small, 5000)
        (given.to / "small").mkdir()
        WAYS[given.way](small, given.to / "small")
        start, of_core = time.perf_counter(), time.process_time()
        WAYS[given.way](given.log, given.to)
        print(time.perf_counter() - start, time.process_time() - of_core, peak_memory())
        return
    for rows in given.rows:
        with tempfile.TemporaryDirectory() as name:
            source = Path(name) / "log.csv"
            write_log(source, rows)
            pairs = [[measured(way, source) for way in WAYS] for _ in range(given.runs)]
        ratios = [[bare[k] / ours[k] for ours, bare in pairs] for k in (0, 1)]
        for way, results in zip(WAYS, zip(*pairs, strict=True), strict=True):
            seconds = np.median([result[0] for result in results])
            memory = max(result[2] for result in results)
            print(f"{rows:,} rows x 7, {way}: {seconds:.2f} s, peak resident {memory:.0f} MB")
        of_time, of_core = (np.median(of_runs) for of_runs in ratios)
        print(
            f"speed of ours over the bare conversion, median: {of_time:.2f}, by core time "
            f"{of_core:.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
