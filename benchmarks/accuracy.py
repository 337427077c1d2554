"""Errors of the methods on simulated logs, against the truth.

python benchmarks/accuracy.py [--logs 50] [--hours 10]
"""

from __future__ import annotations

import argparse
from typing import Literal

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators import estimate
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate import simulate

CASES = {
    "MTi-7 gyro, 100 Hz": (NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7), 100.0),
    "C102 accelerometer, 50 Hz": (NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5), 50.0),
}
METHODS: tuple[Literal["curve", "paper", "weighted"], ...] = ("curve", "paper", "weighted")


def main() -> None:
    """Print a table of relative RMSE in per cent, and how many logs gave a value."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=50)
    parser.add_argument("--hours", type=float, default=10.0)
    given = parser.parse_args()
    for name, (model, rate) in CASES.items():
        rng = np.random.default_rng(1)
        errors: dict[tuple[str, str], list[float]] = {}
        for _ in range(given.logs):
            log = simulate(model, rate, round(given.hours * 3600 * rate), rng)
            curve = allan_variance(log, rate)
            for method in METHODS:
                found = estimate(curve, method, longest=1 / 9).parameters
                for symbol in PARAMETERS:
                    value = found[symbol].value
                    if value is not None:
                        error = value / getattr(model, symbol) - 1
                        errors.setdefault((method, symbol), []).append(error)
        print(
            f"{name}, {given.logs} simulated logs of {given.hours:g} h: "
            "RMSE in % (logs with a value)"
        )
        print("method    " + "".join(f"{symbol:>16}" for symbol in PARAMETERS))
        for method in METHODS:
            cells = ""
            for symbol in PARAMETERS:
                found_errors = errors.get((method, symbol), [])
                rmse = 100 * np.sqrt(np.mean(np.square(found_errors))) if found_errors else np.nan
                cells += f"{rmse:10.3f} ({len(found_errors):3d})"
            print(f"{method:10}" + cells)


if __name__ == "__main__":
    main()
