"""Speed of the Allan variance kernels against allantools' oadev, as ratios of paired runs.

python benchmarks/speed.py [--samples 10000000] [--runs 5]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import allantools
import numpy as np

from imubench_pipeline.allan import cluster_sizes, of_blocks, of_phase
from imubench_pipeline.phase import integrate


def seconds(work: Callable[[], object]) -> float:
    """Return the wall time of a call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    """Print the median ratio of each kernel, on one thread and two."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--runs", type=int, default=5)
    given = parser.parse_args()
    samples = given.samples
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
    times: dict[tuple[str, int], list[float]] = {}
    for _ in range(given.runs):
        peer = seconds(lambda: allantools.oadev(log, rate=1.0, data_type="freq", taus=sizes))
        for name, kernel in kernels.items():
            for threads in (1, 2):
                ratio = peer / seconds(partial(kernel, threads))
                times.setdefault((name, threads), []).append(ratio)
    print(
        f"{samples:,} float64 samples, {len(sizes)} tau, {given.runs} paired runs: "
        "times as fast as allantools' oadev (median, least, most)"
    )
    for (name, threads), ratios in times.items():
        print(
            f"{name:14} {threads} thread{'s' * (threads > 1):1}  "
            f"{np.median(ratios):6.1f}  {min(ratios):6.1f}  {max(ratios):6.1f}"
        )


if __name__ == "__main__":
    main()
