"""Speed of the Allan variance kernels against allantools' oadev, as ratios of paired runs.

python benchmarks/speed.py [--samples 10000000 50000000] [--runs 5]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import allantools
import numpy as np

from imubench_pipeline.allan import cluster_sizes, of_blocks, of_phase
from imubench_pipeline.allan.phase import integrate


def seconds(work: Callable[[], object]) -> float:
    """Return the wall time of a call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def compare(samples: int, runs: int) -> None:
    """Print the ratios of each kernel, on one thread and two, for one length of the log."""
    log = np.random.default_rng(1).standard_normal(samples)
    sizes = cluster_sizes(samples, per_decade=10)
    kernels: dict[str, Callable[[int], object]] = {
        "full overlap": lambda threads: of_phase(
            integrate([log], samples, holes=False), 1.0, sizes, threads=threads
        ),
        "multi-octave": lambda threads: of_blocks(
            [log], samples, 1.0, sizes, holes=False, threads=threads
        ),
    }
    for kernel in kernels.values():
        kernel(2)  # compiled once
    faster: dict[tuple[str, int], list[float]] = {}
    reads: dict[tuple[str, int], list[float]] = {}
    for _ in range(runs):
        peer = seconds(lambda: allantools.oadev(log, rate=1.0, data_type="freq", taus=sizes))
        read = seconds(lambda: np.sum(log))
        for name, kernel in kernels.items():
            for threads in (1, 2):
                time_taken = seconds(partial(kernel, threads))
                faster.setdefault((name, threads), []).append(peer / time_taken)
                reads.setdefault((name, threads), []).append(time_taken / read)
    print(
        f"{samples:,} float64 samples, {len(sizes)} tau, {runs} paired runs: times as fast as "
        "allantools' oadev, and the time in plain reads of the log (np.sum)"
    )
    print(f"{'':26}{'median':>8}{'least':>8}{'most':>8}{'reads':>8}")
    for (name, threads), ratios in faster.items():
        label = f"{name:14} {threads} thread{'s' * (threads > 1)}"
        figures = (np.median(ratios), min(ratios), max(ratios), np.median(reads[name, threads]))
        print(f"{label:26}" + "".join(f"{figure:8.1f}" for figure in figures), flush=True)


def main() -> None:
    """Print a table for each length of the log."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, nargs="+", default=[10_000_000, 50_000_000])
    parser.add_argument("--runs", type=int, default=5)
    given = parser.parse_args()
    for samples in given.samples:
        compare(samples, given.runs)


if __name__ == "__main__":
    main()
