"""Time of the estimates of a channel of 10 h at 100 Hz, beside a plain DCT of the log.

python benchmarks/likelihood_speed.py [--samples 3600000] [--runs 5]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.estimators.model_choice import PAPERS_MODEL, compare_models
from imubench_pipeline.estimators.posterior import sample
from imubench_pipeline.estimators.robust import fit as robust
from imubench_pipeline.estimators.robust.parts import compute_part_variances
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE = 100.0
Result = TypeVar("Result")


def timed(work: Callable[[], Result], taken: list[float]) -> Result:
    """Call, and note the seconds."""
    start = time.perf_counter()
    result = work()
    taken.append(time.perf_counter() - start)
    return result


def fit_robustly(log: NDArray[np.float64]) -> None:
    """Estimate as the recommended method does."""
    curve = allan_variance(log, RATE, overlap="octave")
    parts = compute_part_variances([log], curve, holes=False)
    robust.fit(curve, parts, rng=np.random.default_rng(0))


def main() -> None:
    """Print the median of each step."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--samples", type=int, default=3_600_000)
    parser.add_argument("--runs", type=int, default=5)
    given = parser.parse_args()
    rng = np.random.default_rng(1)
    model = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
    log = simulate(model, RATE, given.samples, rng)
    taken: dict[str, list[float]] = {}
    for run in range(given.runs + 1):
        if run == 1:
            taken.clear()  # compiled once

        def of(name: str, taken: dict[str, list[float]] = taken) -> list[float]:
            return taken.setdefault(name, [])

        timed(lambda: scipy.fft.dct(log, norm="ortho"), of("DCT of the log, scipy"))
        spectrum, _ = timed(lambda: compute_spectra([log], len(log), RATE), of("spectra"))
        whittle = make_whittle(spectrum, 0.5 * RATE)
        best = timed(partial(whittle.maximum, PAPERS_MODEL), of("fit of the papers' model"))
        timed(partial(compare_models, whittle, quantization=True), of("fits of all models"))
        timed(partial(sample, whittle, best, rng), of("posterior of a model"))
        timed(lambda: fit(log, RATE), of("likelihood: lines, band, models, all intervals"))
        timed(lambda: fit_robustly(log), of("robust: Allan variance, its parts, all intervals"))
    print(f"{given.samples:,} samples, median of {given.runs} runs")
    reference = float(np.median(taken["DCT of the log, scipy"]))
    for name, seconds in taken.items():
        median = float(np.median(seconds))
        print(f"{name:50}{median:8.3f} s{median / reference:8.2f} times the DCT")


if __name__ == "__main__":
    main()
