"""Lines in simulated logs: how often one is found where there is none, and where there is one.

python benchmarks/lines.py [--logs 1000] [--processes 2]

The power of a line, A²/4 at its frequency, is given in units of the noise's power in one bin of
the spectrum in which lines are looked for, and beside it in one bin of a Fourier transform of
the whole log.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.frame import select_for_fit
from imubench_pipeline.estimators.lines import Line
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.noise.simulate import simulate

RATE = 100.0
SAMPLES = 720_000
MODELS = {
    "white": NoiseModel(N=1e-4),
    "MTi-7 gyro": NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7),
    "flicker, random walk": NoiseModel(N=1e-4, B=3e-4, K=1e-5),
}
RATIOS = (2.0, 4.0, 8.0, 20.0, 100.0)


def without(name: str, number: int) -> bool:
    """Tell whether a line is found in a log that has none."""
    rng = np.random.default_rng([number, len(name)])
    return bool(found_in(simulate(MODELS[name], RATE, SAMPLES, rng)))


def found_in(log: NDArray[np.float64]) -> list[Line]:
    """Return the lines that the likelihood leaves out."""
    return list(select_for_fit(*compute_spectra([log], len(log), RATE)).lines)


def bin_width(frequency: float) -> float:
    """Return the distance of the bins of the spectrum in which a frequency is looked for, Hz."""
    spectrum, lines = compute_spectra([np.zeros(SAMPLES) + np.arange(SAMPLES) % 2], SAMPLES, RATE)
    low = spectrum.block > 1
    crossover = float(spectrum.upper[low].max()) if low.any() else 0.0
    chosen = min(lines, key=lambda line: (line.block > 1) != (frequency < crossover))
    return float(chosen.frequency[1])


def with_line(ratio: float, number: int) -> tuple[Sinusoid, float, list[Line]]:
    """Return the line of a log, its power over the noise of the whole log's bin, what is found."""
    rng = np.random.default_rng([number, round(ratio)])
    model = MODELS["MTi-7 gyro"]
    frequency = float(np.exp(rng.uniform(np.log(0.02), np.log(45.0))))
    density = float(model.sampled_spectrum(np.array([2 * np.pi * frequency / RATE]), RATE)[0])
    density /= RATE
    width = bin_width(frequency)
    line = Sinusoid(2.0 * math.sqrt(ratio * density * width), frequency)
    phase = rng.uniform(0.0, 2.0 * np.pi)
    time = np.arange(SAMPLES) / RATE
    log = simulate(model, RATE, SAMPLES, rng)
    log += line.amplitude * np.sin(2.0 * np.pi * frequency * time + phase)
    found = [line for line in found_in(log) if line.kind != "alias"]
    return line, ratio * width * SAMPLES / RATE, found


def row(ratio: float, logs: list[tuple[Sinusoid, float, list[Line]]]) -> Iterator[str]:
    """Yield the figures of one power."""
    hits: list[tuple[Sinusoid, Line]] = []
    further = 0
    for line, _, found in logs:
        near = [f for f in found if abs(f.frequency - line.frequency) < 2.0 * f.resolution]
        hits += [(line, f) for f in near[:1]]
        further += len(found) > len(near[:1])
    whole = [w for _, w, _ in logs]
    text = f"{ratio:8g}{min(whole):9.0f} -{max(whole):7.0f}{100 * len(hits) / len(logs):10.1f}"
    if hits:
        frequency = np.mean(
            [f.frequency_lower <= t.frequency <= f.frequency_upper for t, f in hits]
        )
        amplitude = np.mean(
            [f.amplitude_lower <= t.amplitude <= f.amplitude_upper for t, f in hits]
        )
        text += f"{100 * frequency:12.1f}{100 * amplitude:12.1f}"
    yield text + f"{100 * further / len(logs):12.1f}"


def main() -> None:
    """Print the false alarms, and a table of lines that were found."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        for name in MODELS:
            alarms = list(pool.map(partial(without, name), range(given.logs)))
            print(
                f"{name}: a line in {100 * np.mean(alarms):.2f} % of {given.logs} simulated logs "
                "that have none",
                flush=True,
            )
        print(f"\nMTi-7 gyro with a line, {given.logs // 2} simulated logs of 2 h each")
        print(
            f"{'power/bin':>8}{'in whole log':>18}{'found %':>10}{'frequency':>12}{'amplitude':>12}"
            f"{'others %':>12}\n{'':36}{'within its interval, %':>24}"
        )
        for ratio in RATIOS:
            logs = list(pool.map(partial(with_line, ratio), range(given.logs // 2)))
            print("\n".join(row(ratio, logs)), flush=True)
            print(f"ratio {ratio:g} done", file=sys.stderr)


if __name__ == "__main__":
    main()
