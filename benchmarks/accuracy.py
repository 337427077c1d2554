"""Errors and intervals of the methods on simulated logs, against the Cramér-Rao bound.

python benchmarks/accuracy.py [--logs 1000] [--others 200] [--processes 2]

The likelihood estimates every log; the fits to the Allan variance, and the formulas of other
programs, the first ``others`` of them. All settings are the default ones: of each log the
likelihood takes the band that it finds, which is said, and is held against the bound over it.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bands import bounds_over, highest, what_is_cut
from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators import least_squares
from imubench_pipeline.estimators.estimate import PARAMETERS, Estimate, Parameter
from imubench_pipeline.estimators.intervals import compute_cramer_rao_bounds
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.estimators.model_choice import PAPERS_MODEL
from imubench_pipeline.estimators.robust import fit as robust
from imubench_pipeline.estimators.robust.parts import compute_part_variances
from imubench_pipeline.estimators.whittle import make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from peers import PEERS


@dataclass(frozen=True)
class Case:
    """Simulated logs of one model."""

    name: str
    model: NoiseModel
    rate: float
    hours: float = 10.0


CASES = (
    Case("MTi-7 gyro, 100 Hz", NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7), 100.0),
    Case("C102 accelerometer, 50 Hz", NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5), 50.0),
    Case("weak B, 100 Hz", NoiseModel(N=1e-3, B=1e-4, T_B=100.0, K=1e-5), 100.0),
)
_LIMITED = 1 / 20
_BY_LIKELIHOOD = ("likelihood", "likelihood_gm")

Found = dict[str, dict[str, Parameter]]


def of_log(case: Case, others: int, number: int) -> tuple[Found, str, float]:
    """Return the estimates of one simulated log by method, the chosen model, and the band, Hz."""
    rng = np.random.default_rng([number, CASES.index(case)])
    log = simulate(case.model, case.rate, round(case.hours * 3600 * case.rate), rng)
    result = fit(log, case.rate, rng=rng)
    spectrum = result.spectrum
    found: Found = {estimate.method: dict(estimate.parameters) for estimate in result.estimates}
    if number < others:
        limit = _LIMITED * case.rate
        whittle = make_whittle(spectrum.select(spectrum.upper <= limit), limit)
        best = whittle.maximum(PAPERS_MODEL)
        values = [best.parameter("N"), float(best.biases[0]), float(best.times[0])]
        values.append(best.parameter("K"))
        found["likelihood_gm, rate/20"] = {
            name: Parameter(value if value > 0 else None)
            for name, value in zip(PARAMETERS, values, strict=True)
        }
        curve = allan_variance(log, case.rate, overlap="octave")
        fits: list[Estimate] = [reading.read(curve, longest=1 / 9)]
        methods: tuple[Literal["paper", "weighted"], ...] = ("paper", "weighted")
        fits += [least_squares.fit(curve, method=method) for method in methods]
        parts = compute_part_variances([log], curve, holes=False)
        fits.append(robust.fit(curve, parts, rng=rng))
        found |= {estimate.method: dict(estimate.parameters) for estimate in fits}
        for peer in PEERS:
            printed = peer.estimate(log, case.rate)
            found[peer.name] = {name: Parameter(printed[name]) for name in PARAMETERS}
    return found, result.candidates[0].terms.name, highest(result, case.rate)


def table(case: Case, found: list[tuple[Found, str, float]]) -> Iterator[str]:
    """Yield the lines of a table."""
    duration = case.hours * 3600.0
    bands = [band for *_, band in found]
    whole = compute_cramer_rao_bounds(case.model, case.rate, duration, 0.5 * case.rate)
    limited = compute_cramer_rao_bounds(case.model, case.rate, duration, _LIMITED * case.rate)
    over_bands = bounds_over(case.model, case.rate, duration, bands)
    yield f"{case.name}, {len(found)} simulated logs of {case.hours:g} h"
    yield "Cramér-Rao bound up to Nyquist: " + ", ".join(
        f"{n} {100 * whole[n]:.3g} %" for n in PARAMETERS
    )
    yield f"  up to rate/20: N {100 * limited['N']:.3g} %"
    yield what_is_cut(bands, case.rate)
    chosen = Counter(model for _, model, _ in found).most_common(6)
    yield "chosen: " + ", ".join(f"{model} {number}" for model, number in chosen)
    yield (
        f"{'method':24}{'':5}{'logs':>6}{'value':>7}{'not id.':>8}{'absent':>7}{'RMSE/bound':>12}"
        f"{'bias/bound':>12}{'covered %':>11}{'width/bound':>13}"
    )
    methods = dict.fromkeys(method for estimates, *_ in found for method in estimates)
    for method in methods:
        for name in PARAMETERS:
            own = [i for i, (estimates, *_) in enumerate(found) if method in estimates]
            rows = [found[i][0][method][name] for i in own]
            if method in _BY_LIKELIHOOD:
                bounds = over_bands[name][own]
            else:
                bound = limited if method.endswith("rate/20") else whole
                bounds = np.full(len(own), bound[name])
            yield f"{method:24}{name:5}" + row(rows, getattr(case.model, name), bounds)


def row(parameters: list[Parameter], truth: float, bounds: NDArray[np.float64]) -> str:
    """Return the figures of one parameter of one method."""
    status = Counter(parameter.status for parameter in parameters)
    given = [i for i, p in enumerate(parameters) if p.value is not None and p.status != "at_bound"]
    counts = (
        f"{len(parameters):6d}{len(given):7d}{status['not_identified']:8d}{status['absent']:7d}"
    )
    if not given:
        return counts
    values = [parameters[i] for i in given]
    errors = np.array([p.value for p in values], dtype=np.float64) / truth - 1.0
    errors /= bounds[given]
    text = f"{np.sqrt(np.mean(errors**2)):12.3f}{errors.mean():12.2f}"
    limited = [
        i for i in given if parameters[i].lower is not None and parameters[i].upper is not None
    ]
    if limited:
        limits = np.array(
            [(parameters[i].lower, parameters[i].upper) for i in limited], dtype=np.float64
        )
        lower, upper = limits.T
        covered = np.mean((lower <= truth) & (truth <= upper))
        width = np.median((upper - lower) / truth / (3.92 * bounds[limited]))
        text += f"{100 * covered:11.1f}{width:13.3f}"
    return counts + text


def main() -> None:
    """Print a table for each case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=1000)
    parser.add_argument("--others", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--case", type=int, choices=range(len(CASES)), help="one case only")
    given = parser.parse_args()
    chosen = CASES if given.case is None else (CASES[given.case],)
    with ProcessPoolExecutor(given.processes) as pool:
        for case in chosen:
            found = []
            for result in pool.map(partial(of_log, case, given.others), range(given.logs)):
                found.append(result)
                if len(found) % 50 == 0:
                    print(f"{case.name}: {len(found)} of {given.logs}", file=sys.stderr)
            print("\n".join(table(case, found)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
