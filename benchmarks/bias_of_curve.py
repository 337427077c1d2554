"""The bias instability of the curve against the B of a model's first term, on simulated logs.

python benchmarks/bias_of_curve.py [--logs 200] [--processes 2] [--case 0]

The logs are made by numpy and scipy alone (`simulators`), and estimated at default settings.
Errors are held against the Cramér-Rao bound of B in N+GM+K over the band that was used; those of
the lowest point of the curve are relative. Terms of the chosen models that no log has are counted.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from bands import bounds_over, highest, what_is_cut
from imubench_pipeline.estimators.curve_bias import compute_curve_figures, make_averaging_times
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.noise import NoiseModel
from simulators import gauss_markov, random_walk, white


@dataclass(frozen=True)
class Case:
    """Simulated logs of N, B, T_B and K."""

    name: str
    N: float
    B: float
    T_B: float
    K: float
    rate: float
    hours: float = 10.0

    @property
    def model(self) -> NoiseModel:
        """The truth."""
        return NoiseModel(N=self.N, B=self.B, T_B=self.T_B, K=self.K)

    @property
    def duration(self) -> float:
        """Length of a log, s."""
        return 3600.0 * self.hours


CASES = (
    Case("MTi-7 gyro, 100 Hz", 8.4e-5, 6.7e-5, 89.5, 8.2e-7, 100.0),
    Case("C102 accelerometer, 50 Hz", 1.1e-3, 7.2e-4, 148.9, 2.0e-5, 50.0),
)
_SHOWN = ("B", "B_curve", "sigma_min", "tau_min", "K")


@dataclass(frozen=True)
class Found:
    """What is estimated of a log: figures by method, the chosen model, the band."""

    figures: dict[str, dict[str, Parameter]]
    model: str
    band: float


def of_log(case: Case, number: int) -> Found:
    """Return the estimates of one simulated log."""
    rng = np.random.default_rng([number, CASES.index(case), 17])
    samples = round(case.duration * case.rate)
    log = white(samples, case.rate, case.N, rng)
    log += gauss_markov(samples, case.rate, case.B, case.T_B, rng)
    log += random_walk(samples, case.rate, case.K, rng)
    result = fit(log, case.rate, rng=rng)
    figures = {one.method: {**one.parameters, **one.curve} for one in result.estimates}
    return Found(figures, result.candidates[0].terms.name, highest(result, case.rate))


def table(case: Case, found: Sequence[Found]) -> Iterator[str]:
    """Yield the lines of a table."""
    true = compute_curve_figures(case.model, make_averaging_times(case.rate, case.duration))
    truths = {name: one.value for name, one in true.items()} | {"B": case.B, "K": case.K}
    bounds = bounds_over(case.model, case.rate, case.duration, [one.band for one in found])
    yield f"{case.name}, {len(found)} simulated logs of {case.hours:g} h"
    yield what_is_cut([one.band for one in found], case.rate)
    models = Counter(one.model for one in found)
    yield "chosen: " + ", ".join(f"{model} {number}" for model, number in models.most_common())
    for letter, name in (("Q", "quantization noise"), ("R", "a ramp")):
        number = sum(count for model, count in models.items() if letter in model.split("+"))
        yield f"with {name}: {100 * number / len(found):.1f} %"
    yield (
        f"{'method':16}{'':10}{'value':>7}{'not id.':>8}{'absent':>7}{'RMSE %':>9}{'of bound':>9}"
        f"{'bias %':>9}{'largest %':>10}{'covered %':>10}"
    )
    for method in found[0].figures:
        for name in _SHOWN:
            rows = [one.figures[method][name] for one in found]
            bound = bounds.get("B" if name == "B_curve" else name)
            yield f"{method:16}{name:10}" + row(rows, truths[name], bound)


def row(parameters: Sequence[Parameter], truth: float | None, bound: np.ndarray | None) -> str:
    """Return the figures of one parameter of one method; a value that is not quoted has none."""
    status = Counter(parameter.status for parameter in parameters)
    valued = [i for i, parameter in enumerate(parameters) if parameter.value is not None]
    text = f"{len(valued):7d}{status['not_identified']:8d}{status['absent']:7d}"
    if truth is None or not valued:
        return text
    values = np.array([parameters[i].value for i in valued], dtype=np.float64)
    errors = values / truth - 1.0
    text += f"{100 * np.sqrt(np.mean(errors**2)):9.2f}"
    over = "" if bound is None else f"{np.sqrt(np.mean((errors / bound[valued]) ** 2)):.3f}"
    text += f"{over:>9}{100 * errors.mean():9.2f}{100 * np.abs(errors).max():10.1f}"
    limits = [(p.lower, p.upper) for p in parameters if p.upper is not None and p.lower is not None]
    inside = [lower <= truth <= upper for lower, upper in limits]
    return text + f"{100 * np.mean(inside):10.1f}" if inside else text


def main() -> None:
    """Print a table for each case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--case", type=int, choices=range(len(CASES)), help="one case only")
    given = parser.parse_args()
    chosen = CASES if given.case is None else (CASES[given.case],)
    with ProcessPoolExecutor(given.processes) as pool:
        for case in chosen:
            found = []
            for one in pool.map(partial(of_log, case), range(given.logs)):
                found.append(one)
                if len(found) % 50 == 0:
                    print(f"{case.name}: {len(found)} of {given.logs}", file=sys.stderr)
            print("\n".join(table(case, found)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
