"""Simulated logs with a filter, with a ramp and with holes: what the likelihood makes of them.

python benchmarks/hard_logs.py [--logs 200] [--processes 2]

All settings are the default ones; bounds are those over the band that was used of each log.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bands import bounds_over, highest, what_is_cut
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

Array = NDArray[np.float64]
Change = Callable[[Array, np.random.Generator], Array]

GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
ACCELEROMETER = NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5)
WALK = NoiseModel(N=1e-4, K=3e-6)
DURATION = 36_000.0
RATE = 50.0


def as_it_is(log: Array, rng: np.random.Generator) -> Array:
    """Return the log."""
    return log


def two_taps(log: Array, rng: np.random.Generator) -> Array:
    """Return the means of neighbouring samples."""
    return np.append(0.5 * (log[1:] + log[:-1]), log[-1])


def singles(share: float, log: Array, rng: np.random.Generator) -> Array:
    """Lose samples at random."""
    log[rng.random(len(log)) < share] = np.nan
    return log


def bursts(share: float, log: Array, rng: np.random.Generator) -> Array:
    """Lose 100 samples at a time."""
    for start in rng.integers(0, len(log) - 100, round(share * len(log) / 100)):
        log[start : start + 100] = np.nan
    return log


def one_hole(share: float, log: Array, rng: np.random.Generator) -> Array:
    """Lose a part of the log in one piece."""
    size = round(share * len(log))
    start = rng.integers(0, len(log) - size)
    log[start : start + size] = np.nan
    return log


@dataclass(frozen=True)
class Case:
    """Simulated logs of one model, changed in one way."""

    name: str
    model: NoiseModel
    change: Change = as_it_is


def with_ramp(model: NoiseModel, times: float) -> NoiseModel:
    """Return a model with a ramp of so many standard deviations of its random walk at the end."""
    return replace(model, R=times * model.K / math.sqrt(DURATION))


CASES = (
    Case("gyro", GYRO),
    Case("gyro, 2-tap filter", GYRO, two_taps),
    Case("accelerometer, complete", ACCELEROMETER),
    Case("accelerometer, singles 0.1 %", ACCELEROMETER, partial(singles, 0.001)),
    Case("accelerometer, singles 1 %", ACCELEROMETER, partial(singles, 0.01)),
    Case("accelerometer, singles 10 %", ACCELEROMETER, partial(singles, 0.1)),
    Case("accelerometer, bursts 1 %", ACCELEROMETER, partial(bursts, 0.01)),
    Case("accelerometer, bursts 10 %", ACCELEROMETER, partial(bursts, 0.1)),
    Case("accelerometer, one hole of 10 %", ACCELEROMETER, partial(one_hole, 0.1)),
    Case("gyro, ramp of 3 K sqrt(duration)", with_ramp(GYRO, 3.0)),
    Case("random walk, no ramp", WALK),
    Case("random walk, ramp of 3 K sqrt(duration)", with_ramp(WALK, 3.0)),
    Case("random walk, ramp of 3 mean ranges, 4.8 K sqrt(duration)", with_ramp(WALK, 4.79)),
)


def of_log(case: Case, number: int) -> tuple[dict[str, Parameter], dict[str, Parameter], float]:
    """Return the parameters of the chosen model, of the papers', and the band, Hz."""
    rng = np.random.default_rng([number, 7])
    log = simulate(case.model, RATE, round(DURATION * RATE), rng)
    found = fit(case.change(log, rng), RATE, rng=rng)
    chosen, papers = (dict(estimate.parameters) for estimate in found.estimates)
    return chosen, papers, highest(found, RATE)


def table(
    case: Case, found: list[tuple[dict[str, Parameter], dict[str, Parameter], float]]
) -> Iterator[str]:
    """Yield the lines of a case."""
    bands = [band for *_, band in found]
    yield f"{case.name}: {len(found)} simulated logs of 10 h, {what_is_cut(bands, RATE)}"
    bounds = bounds_over(case.model, RATE, DURATION, bands)
    # Where a ramp matters, what counts is the model that was chosen.
    with_papers = case.model.B > 0 and case.model.R == 0
    for name in ("N", "B", "T_B", "K") if with_papers else ("N", "K", "R"):
        truth = getattr(case.model, name)
        rows = [(papers if with_papers else chosen)[name] for chosen, papers, _ in found]
        given = [i for i, p in enumerate(rows) if p.value is not None and p.status == "ok"]
        known = [rows[i] for i in given]
        text = f"  {name:4}given in {100 * len(known) / len(rows):5.1f} %"
        if truth and known:
            errors = np.array([p.value for p in known]) / truth - 1.0
            limits = [p for p in rows if p.lower is not None and p.upper is not None]
            covered = 100 * np.mean([p.lower <= truth <= p.upper for p in limits])
            rmse, bound = np.sqrt(np.mean(errors**2)), np.sqrt(np.mean(bounds[name][given] ** 2))
            text += (
                f"  bias {100 * errors.mean():+7.3f} %  RMSE {100 * rmse:7.3f} % (bound "
                f"{100 * bound:.3f} %)  worst {100 * np.abs(errors).max():.2f} %"
                f"  covered {covered:.1f} % of {len(limits)}"
            )
        yield text


def main() -> None:
    """Print a table for each case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        for case in CASES:
            found = list(pool.map(partial(of_log, case), range(given.logs)))
            print("\n".join(table(case, found)), flush=True)
            print(f"{case.name}: done", file=sys.stderr)


if __name__ == "__main__":
    main()
