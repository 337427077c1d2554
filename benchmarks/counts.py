"""Counts that do not depend on the speed of the machine, beside those of `history.md`.

python benchmarks/counts.py [--results results]

A log of 10 minutes of six axes at 100 Hz is read in this process, and one axis of it is estimated.
Counted are files opened, bytes read and written (Linux), allocations of Arrow, and the peak of the
memory that Python traces while it reads. With ``--results``, the jobs of the demonstration are
counted, too. Exits with 1 if a count differs by more than 20 % from the last row of `history.md`. A
wanted change adds a row there, which is printed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import tracemalloc
from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

import imubench_pipeline as imu
from imubench_pipeline.library.logs import Log
from ingest_speed import LAYOUT, write_log

HISTORY = Path(__file__).with_name("history.md")
ROWS = 60_000
MAX_DIFFERENCE = 0.2
COLUMNS = ("jobs", "opened", "MB read", "MB written", "allocations", "MB allocated", "MB peak")

opened: list[str] = []


def note_open(event: str, arguments: tuple[object, ...]) -> None:
    """Note a file that Python opens; an audit hook."""
    if event == "open":
        opened.append(str(arguments[0]))


def open_log(log: Path) -> Log:
    """Read a log."""
    return imu.read_log(log, {"vendor": "Benchmark", "model": "counts", "log": LAYOUT})


def analyse(log: Path) -> None:
    """Read a log and estimate the noise of one axis."""
    imu.estimate(open_log(log), channels=["gyro_x"], threads=1)


def read_transfers() -> tuple[float, float]:
    """Return the MB that this process has read and written; 0 where the system does not say."""
    path = Path("/proc/self/io")
    if not path.exists():
        return 0.0, 0.0
    lines = dict(line.split(": ") for line in path.read_text().splitlines())
    return int(lines["rchar"]) / 1e6, int(lines["wchar"]) / 1e6


def count_analysis(log: Path) -> dict[str, float]:
    """Return the counts of one analysis."""
    analyse(log)  # what is imported, compiled or loaded once is not counted
    pool = pa.default_memory_pool()
    read, written = read_transfers()
    allocations, allocated = pool.num_allocations(), pool.total_bytes_allocated()
    opened.clear()
    analyse(log)
    counts: dict[str, float] = {"opened": len(opened)}
    after = read_transfers()
    counts |= {"MB read": after[0] - read, "MB written": after[1] - written}
    counts["allocations"] = pool.num_allocations() - allocations
    counts["MB allocated"] = (pool.total_bytes_allocated() - allocated) / 1e6
    tracemalloc.start()
    open_log(log)
    return counts | {"MB peak": tracemalloc.get_traced_memory()[1] / 1e6}


def read_last_row() -> dict[str, float]:
    """Return the last row of the history."""
    last = HISTORY.read_text(encoding="utf-8").strip().splitlines()[-1]
    figures = [cell.strip() for cell in last.strip("|").split("|")][2:]
    return {name: float(cell) for name, cell in zip(COLUMNS, figures, strict=True)}


def list_differences(counts: Mapping[str, float], before: Mapping[str, float]) -> list[str]:
    """Return the counts that differ too much; a count of 0 is not known on this system."""
    return [
        f"{name}: {counts[name]:.4g}, before {before[name]:.4g}"
        for name in COLUMNS
        if counts.get(name) and abs(counts[name] / before[name] - 1.0) > MAX_DIFFERENCE
    ]


def main() -> None:
    """Print the counts as a row, and compare them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--results", type=Path, help="of the demonstration: its jobs are counted")
    given = parser.parse_args()
    sys.addaudithook(note_open)
    counts: dict[str, float] = {}
    if given.results is not None:
        counts["jobs"] = sum(path.is_file() for path in (given.results / "seals").rglob("*"))
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        write_log(log, ROWS)
        counts |= count_analysis(log)
    cells = [f"{counts[name]:.4g}" if name in counts else "" for name in COLUMNS]
    print(f"| {' | '.join(cells)} |")
    if faults := list_differences(counts, read_last_row()):
        sys.exit(
            f"more than {MAX_DIFFERENCE:.0%} from the last row of {HISTORY.name}: "
            f"{'; '.join(faults)}. Find the cause, or add a row if it is wanted"
        )


if __name__ == "__main__":
    main()
