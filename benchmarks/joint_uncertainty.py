"""How sure error budgets are, against how far off they are, on logs of known noise.

python benchmarks/joint_uncertainty.py [--logs 100] [--first 0] [--cases "N+K" "MTi-7 gyro"]

The logs come from a simulator of its own (exact Gauss-Markov recursion; flicker noise by inverse
FFT of S = B^2 / (2 pi f) up to Nyquist, cut out of a record four times as long) and are estimated
as the workflow does with its default settings, which are told nothing. The totals are those of the
table ``error_budget``, the draws those of the table ``draws``, read back.

For each error: ``claimed``, the root mean square over the logs of the relative standard deviation
that the 95 % interval stands for, log(upper / lower) / 3.92; ``actual``, that of log(total / true
total); their ratio; the share of logs whose interval holds the truth, with its binomial limits; and
the same ratio and share of who is told which terms there are (``terms known``: sigma and draws of
that model alone), and of parameters drawn one by one from their limits. What who is told cannot
reach either is chance, or the log's; beyond, it is the price of not knowing the terms. That price
is high for north where a walk is there: a process of a correlation time near the longest that a
log can show has a level, a walk has none, and few logs tell the two apart. ``N+slow GM`` is that
process, which the limits must hold as well.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binomtest

from imubench_pipeline.allan import cluster_sizes, of_blocks
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.posterior import draw_jointly, sample
from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import Terms, make_noise_model, make_whittle
from imubench_pipeline.navigation.expected_errors import (
    AxisErrors,
    Question,
    list_error_rows,
    list_standard_questions,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.recordings.recording import LogWriter, open_channel_logs
from imubench_pipeline.settings.config import ErrorBudgetSettings, EstimateSettings
from imubench_pipeline.steps.estimate import Estimation, estimate_channel
from imubench_pipeline.tables.files import write
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.units import parse_quantity

Array = NDArray[np.float64]

CHANNEL = "gyro_x"
_DRAWN = 4_000
Place = tuple[str, float]
"""An error, and after how many seconds."""


@dataclass(frozen=True)
class Case:
    """Logs of one model; SI as of a gyro, whatever the sensor is."""

    name: str
    model: NoiseModel
    rate: float
    hours: float


CASES = (
    Case("N+K", NoiseModel(N=1e-4, K=1e-6), 5.0, 4.0),
    Case("N+GM", NoiseModel(N=1e-4, B=6e-5, T_B=100.0), 5.0, 4.0),
    Case("N+GM+K", NoiseModel(N=1e-4, B=6e-5, T_B=60.0, K=1e-6), 5.0, 6.0),
    Case("N+F+K", NoiseModel(N=1e-4, B=4e-5, K=2e-6), 5.0, 6.0),
    Case("MTi-7 gyro", NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7), 5.0, 10.0),
    Case("C102 accelerometer", NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5), 5.0, 10.0),
    Case("N+slow GM", NoiseModel(N=1e-4, B=6e-5, T_B=800.0), 5.0, 4.0),
    Case("N+weak F+K", NoiseModel(N=1e-4, B=1e-5, K=1e-6), 5.0, 4.0),
)


def simulated(case: Case, rng: np.random.Generator) -> Array:
    """Return a log, without any code of the package."""
    model, rate = case.model, case.rate
    samples = round(case.hours * 3600.0 * rate)
    log = model.N * math.sqrt(rate) * rng.standard_normal(samples)
    log += model.K / math.sqrt(rate) * np.cumsum(rng.standard_normal(samples))
    if model.T_B is not None:
        driving = 2.0 * model.B**2 * math.log(2.0) / (math.pi * 0.4365**2 * model.T_B)
        variance, phi = driving * model.T_B / 2.0, math.exp(-1.0 / (rate * model.T_B))
        steps = rng.standard_normal(samples) * math.sqrt(variance * (1.0 - phi**2))
        steps[0] = rng.standard_normal() * math.sqrt(variance)
        log += lfilter([1.0], [1.0, -phi], steps)
    elif model.B > 0.0:
        long = 4 * samples
        frequency = np.fft.rfftfreq(long, 1.0 / rate)[1:]
        size = np.sqrt(model.B**2 / (2.0 * np.pi * frequency) * rate * long / 2.0)
        phases = rng.standard_normal((2, len(frequency)))
        log += np.fft.irfft(np.append(0.0, size * (phases[0] + 1j * phases[1])), long)[:samples]
    return np.asarray(log)


def estimated(case: Case, log: Array, number: int, folder: Path) -> Estimate:
    """Return what the workflow makes of a log, through its tables."""
    with LogWriter(folder / "log.parquet", {CHANNEL: pa.float64()}) as writer:
        writer.write({CHANNEL: log})
        writer.finish(
            {
                "rate": case.rate,
                "grid": len(log),
                "segments": [[0, len(log)]],
                "holes": {CHANNEL: False},
                "unusable": [],
            }
        )
    channel = open_channel_logs(folder)[CHANNEL]
    sizes = cluster_sizes(len(log), per_decade=10, longest=0.5)
    curve = of_blocks(
        channel.blocks(), len(log), case.rate, sizes, holes=False, segments=channel.segments
    )
    rows, settings = Estimation(), EstimateSettings(methods=("likelihood",))
    estimate_channel(Key("own", f"{number}", CHANNEL), channel, curve, settings, None, rows)
    write("parameters", rows.parameters, folder / "parameters.parquet")
    write("draws", rows.draws, folder / "draws.parquet")
    return read_recommended_estimates(folder / "parameters.parquet", folder / "draws.parquet")[
        CHANNEL
    ]


def of_known_terms(case: Case, log: Array) -> Estimate:
    """Return the fit and the draws of the model that has the terms of a case, and no other."""
    spectrum, _ = compute_spectra([log], len(log), case.rate)
    whittle = make_whittle(spectrum, 0.5 * case.rate)
    letters = "NK" if case.model.K > 0.0 else "N"
    flicker = case.model.B > 0.0 and case.model.T_B is None
    terms = Terms(
        letters.replace("N", "NF") if flicker else letters, int(case.model.T_B is not None)
    )
    found = whittle.maximum(terms)
    posterior = sample(whittle, found, np.random.default_rng(0), _DRAWN)
    model = make_noise_model(found)
    values = {"N": model.N, "B": model.B, "T_B": model.T_B, "K": model.K}
    return Estimate(
        "likelihood",
        {name: Parameter(value or None) for name, value in values.items()},
        draws=draw_jointly([(terms, posterior, 1.0)], math.inf),
    )


def questions(how: ErrorBudgetSettings) -> Iterator[Question]:
    """Yield what a gyro alone answers, with the default settings."""
    times = [parse_quantity(one, "time") for one in how.times]
    window = parse_quantity(how.static_window, "time")
    latitude = parse_quantity(how.latitude, "angle")
    for question in list_standard_questions(times, window, latitude, ["worst"]):
        if question.error in ("heading", "north"):
            yield question


def limits(estimate: Estimate, how: ErrorBudgetSettings) -> dict[Place, Array]:
    """Return total, lower and upper limit of each error, as the table ``error_budget`` has them."""
    names = {"sensor": "own", "recording": "log"}
    rows = list_error_rows(
        names, {CHANNEL: estimate}, questions(how), draws=how.draws, seed=how.seed
    )
    return {
        (row.error, row.time): np.array([row.sigma, row.lower, row.upper], dtype=float)
        for row in rows
        if row.source == "total"
    }


def claimed_and_actual(found: Array, truth: float) -> tuple[float, float, int]:
    """Return the claimed and the actual relative error, rms, and how many intervals hold.

    Parameters
    ----------
    found : ndarray, shape (logs, 3)
        Total, lower and upper limit.
    truth : float
    """
    claimed = np.log(found[:, 2] / found[:, 1]) / 3.92
    actual = np.log(found[:, 0] / truth)
    inside = (found[:, 1] <= truth) & (truth <= found[:, 2])
    rms = [math.sqrt(float(np.mean(one**2))) for one in (claimed, actual)]
    return rms[0], rms[1], int(inside.sum())


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--cases", nargs="+", default=[case.name for case in CASES])
    options = parser.parse_args(arguments)
    how = ErrorBudgetSettings()
    for case in CASES:
        if case.name not in options.cases:
            continue
        began, chosen = time.process_time(), Counter[str]()
        together: dict[Place, list[Array]] = {}
        one_by_one: dict[Place, list[Array]] = {}
        known: dict[Place, list[Array]] = {}
        for number in range(options.first, options.first + options.logs):
            log = simulated(case, np.random.default_rng([number, CASES.index(case), 17]))
            with tempfile.TemporaryDirectory() as folder:
                estimate = estimated(case, log, number, Path(folder))
            chosen[estimate.model.name] += 1
            for into, one in (
                (together, estimate),
                (one_by_one, replace(estimate, draws=None)),
                (known, of_known_terms(case, log)),
            ):
                for place, values in limits(one, how).items():
                    into.setdefault(place, []).append(values)
        each = (time.process_time() - began) / options.logs
        models = ", ".join(f"{name} {count}" for name, count in chosen.most_common())
        print(
            f"{case.name}: {case.hours:g} h at {case.rate:g} Hz, {options.logs} logs, {each:.2f} s"
        )
        print(f"  chosen: {models}")
        print(
            f"  {'error':14s} claimed  actual  ratio  inside 95 %          terms known   one by one"
        )
        for question in questions(how):
            place = (question.error, question.time)
            truth = question.answer(AxisErrors(case.model), AxisErrors()).total
            claimed, actual, inside = claimed_and_actual(np.array(together[place]), truth)
            ci = binomtest(inside, options.logs).proportion_ci(0.95, "exact")
            told, missed, kept = claimed_and_actual(np.array(known[place]), truth)
            apart, _, held = claimed_and_actual(np.array(one_by_one[place]), truth)
            print(
                f"  {place[0]:8s}{place[1]:4.0f} s {100 * claimed:6.2f} % {100 * actual:6.2f} % "
                f"{claimed / actual:5.2f}  {100 * inside / options.logs:5.1f} "
                f"[{100 * ci.low:.1f}, {100 * ci.high:.1f}]   "
                f"{told / missed:5.2f}  {100 * kept / options.logs:5.1f}  "
                f"{apart / actual:5.2f}  {100 * held / options.logs:5.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
