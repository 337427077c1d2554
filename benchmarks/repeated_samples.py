"""How often repeated samples are found in coarse logs: where there are none, and where there are.

python benchmarks/repeated_samples.py [--logs 25]

Logs of ten minutes at 100 Hz, rounded to steps from a tenth of their noise to six times it: white
noise, with a random walk, with flicker noise, behind a mean over 2, 5 or 20 samples, and with
bursts; and white noise that is read faster than it is written.
"""

from __future__ import annotations

import argparse
import zlib

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.quality.columns import estimate_excess_repeats
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.settings.quality import QualitySettings

Array = NDArray[np.float64]

RATE, SAMPLES = 100.0, 60_000
STEPS = (0.1, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 2.5, 3.0, 6.0)
CLEAN = ("white", "walk", "flicker", "mean of 2", "mean of 5", "mean of 20", "bursts")
READ_AGAIN = (0.2, 0.5, 0.75)


def clean(kind: str, rng: np.random.Generator) -> Array:
    """Return a log in which no sample is repeated, with a white noise of 1."""
    models = {
        "walk": NoiseModel(N=0.1, K=0.1),
        "flicker": NoiseModel(N=0.1, B=1.0),
    }
    if kind in models:
        return simulate(models[kind], RATE, SAMPLES, rng)
    log = rng.standard_normal(SAMPLES)
    if kind.startswith("mean"):
        length = int(kind.split()[-1])
        return np.convolve(log, np.full(length, length**-0.5), "valid")
    if kind == "bursts":
        log[20_000:30_000] *= 4.0
    return log


def read_again(share: float, rng: np.random.Generator) -> Array:
    """Return white noise of which a share of the samples is that before."""
    return rng.standard_normal(SAMPLES)[(np.arange(SAMPLES) * (1.0 - share)).astype(np.int64)]


def found(log: Array, step: float, rng: np.random.Generator) -> bool:
    """Tell whether repeated samples are found in a log that is rounded at a random place."""
    column = ColumnSummary()
    column.add(np.round(log / step + rng.uniform()) * step)
    return estimate_excess_repeats(column)[0] > QualitySettings().repeated


def main() -> None:
    """Print a line for each step."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=25)
    logs = parser.parse_args().logs
    shares = [f"{100 * share:.0f} % again" for share in READ_AGAIN]
    print("step    " + "  ".join([*CLEAN, *shares]))
    for step in STEPS:
        counts = []
        for kind in (*CLEAN, *READ_AGAIN):
            rngs = [
                np.random.default_rng([zlib.crc32(str(kind).encode()), number])
                for number in range(logs)
            ]
            counts.append(
                sum(
                    found(
                        clean(kind, rng) if isinstance(kind, str) else read_again(kind, rng),
                        step,
                        rng,
                    )
                    for rng in rngs
                )
            )
        widths = map(len, (*CLEAN, *shares))
        cells = (f"{count}".rjust(width) for count, width in zip(counts, widths, strict=True))
        print(f"{step:<8.3g}" + "  ".join(cells) + f"  of {logs}", flush=True)


if __name__ == "__main__":
    main()
