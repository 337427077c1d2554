"""Worth of each rule of the robust fit: what becomes wrong, or is lost, if it is switched off.

python benchmarks/ablation.py [--logs 3] [--case NAME ...] [--rule NAME ...] [--real FOLDER]
    [--processes 2]

The fit of the Allan variance runs on the simulated logs of `silent_cases`, and on halves and
quarters of the real recordings in FOLDER (default: ../shared/logs), once as it is and once without
each rule. Neither lines nor deterministic signals are removed before, and no finding is considered,
so that the errors are more than in `silent_errors`. Printed for each rule:

right, silent   figures of N, B_curve and K of the simulated logs, as `silent_errors` judges them
agree, z        neighbouring pieces of real logs, as in `real_logs`, of N and B_curve
given           share of the pieces with a value

A rule is worth its lines if one of these becomes worse without it by more than the noise: some
0.5 % of the figures, and 3 % of the pairs.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np

import real_logs
import silent_errors
from imubench_pipeline.allan import AllanCurve, of_blocks
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.least_squares import UnfitCurveError
from imubench_pipeline.estimators.robust import active_sets, fit
from imubench_pipeline.estimators.robust.parts import PartVariances, compute_part_variances
from imubench_pipeline.typing import Array
from silent_cases import CASES, Truth

RULES: Mapping[str, tuple[tuple[ModuleType, str, float], ...]] = {
    "all rules": (),
    "correction for filter and rounding": ((fit, "_GAIN_OF_BEND", math.inf),),
    "bent points left out": ((fit, "_MAX_BEND", math.inf),),
    "ramp above the slope of a walk": ((fit, "_MIN_RAMP", 0.0),),
    "gain of a process": ((active_sets, "_GAIN_OF_PROCESS", 0.0),),
    "gain of flicker noise and a process": ((active_sets, "_GAIN_OF_BOTH", 0.0),),
    "profile of K": ((active_sets, "_MAX_PROFILE_LOSS", 0.0),),
    "10 minutes for K": ((fit, "_MIN_DURATION_OF_WALK", 0.0),),
    "error of the model": ((fit, "_MAX_MODEL_ERROR", 1e-9),),
    "excess between parts": ((fit, "_MAX_EXCESS", 0.0),),
    "least eigenvalue": ((fit, "_MIN_EIGENVALUE", 1e-9),),
    "doubtful up to a ratio of 10": ((fit, "_MAX_DOUBTFUL_RATIO", 4.0),),
}
"""The constants that switch off each rule."""

SHOWN = ("N", "B_curve", "K")


class Prepared:
    """The Allan variances of a log and of its parts."""

    def __init__(self, samples: Array, rate: float) -> None:
        holes = bool(np.isnan(samples).any())
        self.curve: AllanCurve = of_blocks([samples], len(samples), rate, holes=holes)
        self.parts: PartVariances = compute_part_variances([samples], self.curve, holes=holes)

    def estimate(self) -> Mapping[str, Parameter]:
        """Return the figures of the robust fit; none of a log that is too short."""
        try:
            found = fit.fit(self.curve, self.parts, rng=np.random.default_rng(0))
        except UnfitCurveError:
            return {}
        return {**found.parameters, **found.curve}


def prepare_simulated(
    cases: Sequence[str], logs: int
) -> Iterator[tuple[Mapping[str, Truth], Prepared]]:
    """Yield truth and curve of each simulated log; those with stamps need the workflow."""
    for case in cases:
        for number in range(logs):
            log = CASES[case](silent_errors.rng_of(case, number))
            if log.stamps is None:
                yield log.truth, Prepared(np.asarray(log.samples, np.float64), log.rate)


def prepare_real(folder: Path) -> Iterator[list[Prepared]]:
    """Yield the neighbouring pieces of each channel of the real recordings."""
    for recording in real_logs.recordings(folder) if folder.is_dir() else ():
        for pieces in (2, 4):
            length = len(recording.samples) // pieces
            if length < 20_000 and length / recording.rate < 3_600.0:
                continue
            for column in recording.samples.T:
                yield [
                    Prepared(np.ascontiguousarray(column[i * length : (i + 1) * length]), rate)
                    for i in range(pieces)
                    if (rate := recording.rate)
                ]


@cache
def prepare(
    cases: tuple[str, ...], logs: int, folder: Path
) -> tuple[list[tuple[Mapping[str, Truth], Prepared]], list[list[Prepared]]]:
    """Return all curves; once for each process."""
    return list(prepare_simulated(cases, logs)), list(prepare_real(folder))


def measure(cases: tuple[str, ...], logs: int, folder: Path, rule: str) -> str:
    """Return the line of a rule that is switched off."""
    before = [(module, name, getattr(module, name)) for module, name, _ in RULES[rule]]
    for module, name, off in RULES[rule]:
        setattr(module, name, off)
    try:
        simulated, real = prepare(cases, logs, folder)
        counts: Counter[tuple[str, str]] = Counter()
        for truth, prepared in simulated:
            found = prepared.estimate()
            for name in SHOWN:
                if name in found and truth.get(name) is not None:
                    row = vars(found[name])
                    judged = silent_errors.judgement(row, truth[name], warned=False)
                    counts[name, judged] += 1
        cells = [f"{counts[name, 'right']}/{counts[name, 'silent']}" for name in SHOWN]
        estimates = [[piece.estimate() for piece in pieces] for pieces in real]
        for name in ("N", "B_curve"):
            figures = [[real_logs.figure_of(piece, name) for piece in one] for one in estimates]
            pairs = [real_logs.compare(*pair) for one in figures for pair in pairwise(one)]
            scores = np.array([pair for pair in pairs if isinstance(pair, float)])
            agree = [abs(p) < 1.96 if isinstance(p, float) else p for p in pairs if p is not None]
            given = np.mean([f.given for one in figures for f in one]) if figures else np.nan
            z = math.sqrt(np.mean(scores**2)) if len(scores) else np.nan
            share = np.mean(agree) if agree else np.nan
            cells.append(f"{100 * share:.0f} %, {z:.2f}, {100 * given:.0f} %")
    finally:
        for module, name, value in before:
            setattr(module, name, value)
    return f"| {rule} | " + " | ".join(cells) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=int, default=3)
    parser.add_argument("--case", nargs="*", choices=CASES, default=list(CASES))
    parser.add_argument("--rule", nargs="*", choices=RULES, default=list(RULES))
    parser.add_argument("--real", type=Path, default=real_logs.LOGS)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    print("| without | N right/silent | B_curve | K | real N: agree, z, given | real B_curve |")
    print("|---|---|---|---|---|---|")
    one = partial(measure, tuple(options.case), options.logs, options.real)
    with ProcessPoolExecutor(options.processes) as pool:
        for line in pool.map(one, options.rule):
            print(line, flush=True)


if __name__ == "__main__":
    main()
