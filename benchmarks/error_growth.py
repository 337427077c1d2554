"""Error budgets in closed form against simulated runs of dead reckoning.

python benchmarks/error_growth.py [--runs 2000] [--processes 2]

Every term of a gyro and of an accelerometer by itself, and all together, calibrated over a window
of 60 s and uncalibrated, after 1, 10, 60 and 600 s. The runs are mechanised: the mean of the
window is taken off, or not, and the samples are summed up to attitude, velocity and position.
Flicker noise comes from Kasdin's fractional integration, all else from the project's simulator.
Differences are in standard errors of the simulated figure, with at least 0.1 % of it for what
sampling changes; the exit status is 1 if any is beyond 4.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.in_use import Figure, Figures
from imubench_pipeline.navigation.error_budget.parts import Quantity
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.noise.growth import Uncalibrated
from imubench_pipeline.noise.simulate import simulate

Array = NDArray[np.float64]

WINDOW = 60.0
RATES = {100.0: (1.0, 10.0), 10.0: (60.0, 600.0)}
"""Hz, and the times in s that are simulated at this rate."""

GYRO_BIAS = 1e-3
ACCEL_BIAS = 0.05
TILT = 1e-3
NOTHING = NoiseModel()
ORDER: dict[Quantity, int] = {"attitude": 0, "velocity": 1, "position": 2}
CHUNK = 100
LARGEST = 4.0
SAMPLING = 1e-3


@dataclass(frozen=True)
class Case:
    """Noise of the two sensors, and how dead reckoning begins."""

    name: str
    gyro: NoiseModel
    accel: NoiseModel
    levelled: bool
    quantities: Sequence[Quantity] = ("attitude", "velocity", "position")

    @property
    def stated(self) -> float:
        """1 where turn-on biases and tilts belong to the case, 0 where one term stands alone."""
        return 1.0 if self.name == "all" else 0.0

    def start(self, rate: float) -> Start:
        """Return the start; a sample stands for the middle of its interval, where a walk begins."""
        if self.levelled:
            return Start.calibrated(WINDOW)
        on = partial(Uncalibrated, on_time=WINDOW - 0.5 / rate)
        return Start(
            gyro=on(bias=self.stated * GYRO_BIAS),
            accel=on(bias=self.stated * ACCEL_BIAS),
            tilt=self.stated * TILT,
        )


TERMS = {
    "N": (NoiseModel(N=8.4e-5), NoiseModel(N=9.6e-4)),
    "Q": (NoiseModel(Q=5e-5), NoiseModel(Q=1e-3)),
    "flicker": (NoiseModel(B=6.7e-5), NoiseModel(B=2.4e-4)),
    "GM 5 s": (NoiseModel(B=6.7e-5, T_B=5.0), NoiseModel(B=2.4e-4, T_B=5.0)),
    "GM 90 s": (NoiseModel(B=6.7e-5, T_B=90.0), NoiseModel(B=2.4e-4, T_B=90.0)),
    "K": (NoiseModel(K=8e-7), NoiseModel(K=3e-6)),
    "R": (NoiseModel(R=1e-8), NoiseModel(R=3e-8)),
    "line": (
        NoiseModel(sinusoids=(Sinusoid(1e-4, 0.0313),)),
        NoiseModel(sinusoids=(Sinusoid(1e-3, 0.0313),)),
    ),
}
ALL = tuple(
    NoiseModel(N=N, B=B, K=K, Q=Q, sinusoids=(Sinusoid(B, 0.0313),))
    for N, B, K, Q in ((8.4e-5, 6.7e-5, 8e-7, 5e-5), (9.6e-4, 2.4e-4, 3e-6, 1e-3))
)


def cases() -> Iterator[Case]:
    """Yield each term of each sensor by itself, and all of both."""
    for levelled in (True, False):
        for name, (gyro, accel) in TERMS.items():
            yield Case(f"gyro {name}", gyro, NOTHING, levelled)
            # Without the gyro an uncalibrated start leaves the attitude as it is stated.
            seen: tuple[Quantity, ...] = ("velocity", "position")
            if levelled:
                seen = ("attitude", *seen)
            yield Case(f"accel {name}", NOTHING, accel, levelled, seen)
        yield Case("all", ALL[0], ALL[1], levelled)


def fractional_noise(shape: tuple[int, int], earlier: int, rng: np.random.Generator) -> Array:
    """Return flicker noise of B = 1 that began so many samples earlier (N. J. Kasdin, 1995)."""
    runs, samples = shape
    k = np.arange(1, samples + earlier, dtype=np.float64)
    weights = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))
    white = rng.standard_normal((runs, samples + earlier))
    return np.asarray(fftconvolve(white, weights[None, :], axes=1)[:, earlier : earlier + samples])


def logs(
    model: NoiseModel, rate: float, shape: tuple[int, int], earlier: int, rng: np.random.Generator
) -> Array:
    """Return simulated logs, window and motion; their flicker noise began some samples earlier."""
    if not model.terms:
        return np.zeros(shape)
    flicker = model.B if model.T_B is None else 0.0
    rest = NoiseModel(
        Q=model.Q,
        N=model.N,
        B=0.0 if flicker else model.B,
        T_B=model.T_B,
        K=model.K,
        R=model.R,
        sinusoids=model.sinusoids,
    )
    found = np.array([simulate(rest, rate, shape[1], one) for one in rng.spawn(shape[0])])
    return found + flicker * fractional_noise(shape, earlier, rng) if flicker else found


def integral(change: Array, first: Array, interval: float) -> Array:
    """Return the integral of what moves linearly from the end of one sample to that of the next."""
    before = np.concatenate([first, change[:, :-1]], axis=1)
    return np.asarray(np.cumsum((before + change) / 2.0, axis=1) * interval)


def dead_reckoning(case: Case, rate: float, runs: int, rng: np.random.Generator) -> list[Array]:
    """Return the errors of attitude, velocity and position at the end of each sample, of runs."""
    rest, moving = round(WINDOW * rate), round(max(RATES[rate]) * rate)
    shape = (runs, rest + moving)
    # Calibrated sensors have been on for long; an uncalibrated one counts from switch-on.
    earlier = 9 * shape[1] if case.levelled else 0
    rates = logs(case.gyro, rate, shape, earlier, rng)
    forces = logs(case.accel, rate, shape, earlier, rng)
    sigmas = case.stated * np.array([GYRO_BIAS, ACCEL_BIAS, TILT])
    biases = rng.standard_normal((3, runs, 1)) * sigmas[:, None, None]
    if case.levelled:
        level = forces[:, :rest].mean(axis=1, keepdims=True)
        rates = rates[:, rest:] - rates[:, :rest].mean(axis=1, keepdims=True)
        # The tilt makes gravity cancel what the accelerometer reads at rest, all of it.
        forces = forces[:, rest:] - level
        felt = np.zeros((runs, 1))
        if case.accel.B and case.accel.T_B is None:
            # An absolute tilt counts from switch-on: flicker noise of a long past has no level.
            level = logs(case.accel, rate, (runs, rest), 0, rng).mean(axis=1, keepdims=True)
        tilt = -(level + biases[1]) / STANDARD_GRAVITY
    else:
        rates = rates[:, rest:] + biases[0]
        forces = forces[:, rest:] + biases[1]
        felt = tilt = biases[2]
    turned = np.cumsum(rates, axis=1) / rate
    velocity = np.cumsum(forces, axis=1) / rate
    velocity += STANDARD_GRAVITY * integral(felt + turned, felt, 1.0 / rate)
    return [tilt + turned, velocity, integral(velocity, np.zeros((runs, 1)), 1.0 / rate)]


def of_case(runs: int, case: Case) -> list[tuple[str, float]]:
    """Return the lines of the table of a case, each with its difference in standard errors."""
    lines = []
    for rate, times in RATES.items():
        seed = [round(rate), case.levelled, *case.name.encode()]
        at = [round(time * rate) - 1 for time in times]
        errors = np.concatenate(
            [
                np.stack([found[:, at] for found in dead_reckoning(case, rate, CHUNK, rng)])
                for rng in np.random.default_rng(seed).spawn(-(-runs // CHUNK))
            ],
            axis=1,
        )
        for quantity in case.quantities:
            for i, time in enumerate(times):
                square = errors[ORDER[quantity], :, i] ** 2
                sigma = math.sqrt(float(square.mean()))
                error = float(square.std()) / math.sqrt(len(square)) / (2.0 * sigma)
                biased: Figures = {
                    "turn_on_bias": Figure(sigma=case.stated * ACCEL_BIAS)
                }  # levelled
                closed = budget(
                    quantity,
                    time,
                    gyro=case.gyro,
                    accel=case.accel,
                    start=case.start(rate),
                    accel_figures=biased,
                ).total
                difference = (sigma - closed) / max(error, SAMPLING * closed)
                line = (
                    f"{'calibrated' if case.levelled else 'uncalibrated':12}  {case.name:13}  "
                    f"{quantity:8}  {time:5g} s  {closed:12.5e}  {sigma:12.5e}  "
                    f"{100.0 * (sigma / closed - 1.0):+8.2f} %  {difference:+6.2f}"
                )
                lines.append((line, difference))
    return lines


def main() -> int:
    """Print the table; return 1 if a difference is beyond 4 standard errors."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    print(
        "start         noise          quantity     time   closed form     simulated  difference  "
        "std. errors"
    )
    differences = []
    with ProcessPoolExecutor(given.processes) as pool:
        for lines in pool.map(partial(of_case, given.runs), cases()):
            for line, difference in lines:
                print(line, flush=True)
                differences.append(difference)
    squares = float(np.mean(np.square(differences)))
    print(
        f"{len(differences)} figures, {given.runs} runs each: differences of "
        f"{math.sqrt(squares):.2f} standard errors (rms), {max(map(abs, differences)):.2f} at most"
    )
    return int(max(map(abs, differences)) > LARGEST)


if __name__ == "__main__":
    sys.exit(main())
