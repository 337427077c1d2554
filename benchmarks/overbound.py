"""How often a model that should lie above the truth does, and how much too large it is.

python benchmarks/overbound.py [--logs 100] [--processes 2] [--horizon 60]

Simulated logs of 10 h. For each family of models and each longest tau: the share of logs whose
model lies above the true Allan variance at every tau, above the true spectral density from
1 / horizon to half the rate, and above the true growth of the integrals up to the horizon; the
share in which a filter that loads it is not overconfident; and the median ratio to the true Allan
variance at its minimum, and at its worst. ``family`` is that ratio of the model found from the
truth itself: what the family costs, however long the log. The likelihood takes the band that it
finds, which is said.

The filter estimates the angle and the noise from a measurement of the angle every second for ten
minutes, then goes without for the horizon; its true covariance, that of a filter with a wrong
model, is computed, not simulated.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from bands import highest, what_is_cut
from imubench_pipeline.allan import AllanCurve, allan_variance, cluster_sizes
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.extensions.exports.overbound import (
    Family,
    growth,
    overbound,
    simultaneous_upper,
)
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from model_choice import fractional_noise

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """Simulated logs of one model."""

    name: str
    model: NoiseModel
    rate: float
    hours: float = 10.0


CASES = (
    Case("MTi-7 gyro", NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7), 5.0),
    Case("C102 accelerometer", NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5), 5.0),
    Case("flicker noise", NoiseModel(N=1e-4, B=6e-5, K=1e-6), 5.0),
)
FAMILIES: tuple[Family, ...] = ("N+K", "N+GM", "N+GM+K")
PARTS = (None, 1 / 100, 1 / 20)
"""Longest tau as a part of the log; None: the horizon."""

Scores = tuple[bool, bool, bool, bool, float, float, float]
Key = tuple[Family, float]


def log_of(case: Case, rng: np.random.Generator) -> Array:
    """Return a simulated log; its flicker noise does not come from the bank."""
    samples, model = round(case.hours * 3600.0 * case.rate), case.model
    if model.T_B is not None:
        return simulate(model, case.rate, samples, rng)
    rest = simulate(NoiseModel(N=model.N, K=model.K), case.rate, samples, rng)
    return rest + model.B * fractional_noise(samples, rng)


Found = tuple[dict[Key, Scores], list[bool], float]


def of_log(case: Case, horizon: float, number: int) -> Found:
    """Return the scores of a log, whether the limits alone hold (pointwise, together), its band."""
    rng = np.random.default_rng([number, CASES.index(case)])
    log = log_of(case, rng)
    curve = allan_variance(log, case.rate, overlap="octave")
    result = fit(log, case.rate, rng=rng)
    fitted = result.estimates[0].model
    drawn = draw_models(result.estimates[0], 200, rng)
    found: dict[Key, Scores] = {}
    for part in PARTS:
        longest = part * case.hours * 3600.0 if part else horizon
        for family in FAMILIES:
            bound = overbound(
                curve,
                fitted,
                case.rate,
                family=family,
                horizon=horizon,
                longest=longest,
                drawn=drawn,
                most_excess=math.inf,
            )
            found[family, longest] = scores(case, bound.model, longest, horizon)
    truth = case.model.allan_variance(curve.tau, case.rate)
    within = curve.tau <= longest
    pointwise = curve.limits(0.95)[1] ** 2
    together = simultaneous_upper(curve, longest)
    limits = [bool(np.all((upper > truth)[within])) for upper in (pointwise, together)]
    return found, limits, highest(result, case.rate)


def scores(case: Case, model: NoiseModel, longest: float, horizon: float) -> Scores:
    """Compare a model with the truth."""
    n = np.unique(np.rint(np.geomspace(1.0, longest * case.rate, 400)))
    truth = case.model.allan_variance(n / case.rate, case.rate)
    ratio = model.allan_variance(n / case.rate, case.rate) / truth
    frequency = np.geomspace(1.0 / horizon, 0.5 * case.rate, 200)
    density = model.psd(frequency) / case.model.psd(frequency)
    time = np.geomspace(1.0 / case.rate, horizon, 100)
    true, own = growth(case.model, time, case.rate), growth(model, time, case.rate)
    grown = np.minimum(own[0] / true[0], own[1] / true[1])
    honest = confidence_of(model, case.model, case.rate, horizon)
    lowest = float(ratio[np.argmin(truth)])
    return (
        bool(ratio.min() >= 1.0),
        bool(density.min() >= 1.0),
        bool(grown.min() >= 1.0),
        honest >= 1.0,
        honest,
        lowest,
        float(ratio.max()),
    )


def confidence_of(model: NoiseModel, truth: NoiseModel, rate: float, horizon: float) -> float:
    """Return the variance a filter expects over the true one, at its lowest while it coasts."""
    step, calibrated = 1.0, 600
    own, real = model.state_space(1.0 / step), truth.state_space(1.0 / step, 4.0 * horizon)
    m, r = len(own.output), len(real.output)
    own_step, real_step = joined(1.0, own.transition), joined(1.0, real.transition)
    own_step[0, 1:], real_step[0, 1:] = own.output * step, real.output * step
    # A random walk starts anywhere; the turn-on bias is not the matter here.
    start = own.initial_variance + (np.diag(own.transition) == 1.0) * np.eye(m) * np.trace(
        real.initial_variance
    )
    covariance = joined(0.0, start)
    drive = joined(own.measurement_noise * step**2, own.process_noise)
    # The true angle error and states, then what the filter has.
    nothing = np.zeros((1 + m, 1 + m))
    joint = joined(0.0, real.initial_variance, nothing)
    real_drive = joined(real.measurement_noise * step**2, real.process_noise, nothing)
    both = joined(real_step, own_step)
    see = np.eye(1 + m)[0]
    error = np.concatenate(([1.0], np.zeros(r), -see))
    noise = (10.0 * truth.N) ** 2
    worst = math.inf
    for k in range(calibrated + round(horizon / step)):
        covariance = own_step @ covariance @ own_step.T + drive
        joint = both @ joint @ both.T + real_drive
        if k < calibrated:
            gain = covariance @ see / (see @ covariance @ see + noise)
            covariance = (np.eye(1 + m) - np.outer(gain, see)) @ covariance
            update = np.eye(2 + r + m)
            update[1 + r :, 0] = gain
            update[1 + r :, 1 + r] -= gain
            joint = update @ joint @ update.T
            joint[1 + r :, 1 + r :] += np.outer(gain, gain) * noise
        else:
            worst = min(worst, covariance[0, 0] / float(error @ joint @ error))
    return worst


def joined(*parts: float | Array) -> Array:
    """Return a matrix of the parts on its diagonal."""
    return np.asarray(block_diag(*(np.atleast_2d(part) for part in parts)))


def of_truth(case: Case, family: Family, longest: float, horizon: float) -> NoiseModel:
    """Return the model of a family that is found from the true curve, without uncertainty."""
    samples = round(case.hours * 3600.0 * case.rate)
    n = cluster_sizes(samples)
    tau = n / case.rate
    curve = AllanCurve(
        tau, n, case.model.allan_variance(tau, case.rate), np.full(len(n), 1e8), samples
    )
    return overbound(
        curve,
        case.model,
        case.rate,
        family=family,
        horizon=horizon,
        longest=longest,
        most_excess=math.inf,
    ).model


def table(case: Case, horizon: float, found: list[Found]) -> Iterator[str]:
    """Yield the lines of a case."""
    yield f"{case.name}, {len(found)} simulated logs of {case.hours:g} h, {case.rate:g} Hz"
    yield f"  {what_is_cut([band for *_, band in found], case.rate)}"
    for i, name in enumerate(("95 % limits at each tau", "limits for all tau together")):
        share = 100 * np.mean([alone[i] for _, alone, _ in found])
        yield f"  {name}: above the true curve everywhere in {share:.0f} % of the logs"
    yield (
        f"  {'family':8}{'tau to':>8}{'AV':>7}{'PSD':>7}{'growth':>8}{'filter':>8}"
        f"{'minimum':>10}{'90 %':>7}{'family':>8}{'worst':>8}"
    )
    for key in found[0][0]:
        family, longest = key
        columns = list(zip(*(scores[key] for scores, *_ in found), strict=True))
        shares = [100.0 * np.mean(column) for column in columns[:4]]
        own = scores(case, of_truth(case, family, longest, horizon), longest, horizon)
        yield (
            f"  {family:8}{longest:8.0f}"
            + "".join(f"{share:{w}.0f}" for share, w in zip(shares, (7, 7, 8, 8), strict=True))
            + f"{np.median(columns[5]):10.2f}{np.quantile(columns[5], 0.9):7.2f}"
            + f"{own[5]:8.2f}{np.median(columns[6]):8.2f}"
        )


def main() -> None:
    """Print a table for each case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--horizon", type=float, default=60.0)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        for case in CASES:
            work = partial(of_log, case, given.horizon)
            found = []
            for result in pool.map(work, range(given.logs)):
                found.append(result)
                if len(found) % 25 == 0:
                    print(f"{case.name}: {len(found)} of {given.logs}", file=sys.stderr)
            print("\n".join(table(case, given.horizon, found)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
