"""N before a low-pass and its cut-off, with a process and a walk beside, at default settings.

python benchmarks/low_pass_family.py [--logs 20] [--processes 2] [--first 0]

The simulators share no code with the package. Kind and order of the filter, its cut-off (0.05 to
0.8 of Nyquist), the rate, N, B, T_B and K are drawn anew for each log.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

import simulators
from imubench_pipeline.estimators.likelihood import fit

Array = NDArray[np.float64]

FAMILY = [
    *((kind, order) for kind in ("analogue", "digital") for order in (1, 2, 3, 4)),
    ("moving mean", 1),
]
SAMPLES = 200_000

_SIGMAS = 1.96


@dataclass(frozen=True)
class Found:
    """What was found of one log; N and the cut-off as relative errors.

    Attributes
    ----------
    part : float
        The true cut-off over Nyquist.
    N_claimed : float
        Relative standard deviation of N as its 95 % interval claims it.
    """

    filter: str
    log: int
    part: float
    N_off: float
    N_claimed: float
    N_inside: bool
    N_status: str
    cutoff_told: bool
    cutoff_off: float
    cutoff_inside: bool
    verdict: str


def of_log(number: int, place: int) -> Found:
    """Simulate a log and estimate it."""
    kind, order = FAMILY[place]
    rng = np.random.default_rng([20261122, place, number])
    rate = 10.0 ** rng.uniform(0.5, 2.3)
    N = 10.0 ** rng.uniform(-5.0, -2.5)
    part = math.exp(rng.uniform(math.log(0.05), math.log(0.8)))
    cutoff = 0.5 * part * rate
    duration = SAMPLES / rate
    T_B = duration * 10.0 ** rng.uniform(-3.3, -1.5)
    # The process shows: its density at 0 Hz is a few times that of the white noise.
    B = N * math.sqrt(10.0 ** rng.uniform(0.3, 1.5) / (2.0 * T_B))
    K = N / T_B * 10.0 ** rng.uniform(-1.5, -0.5)

    def slow(samples: int, rate: float) -> Array:
        process = simulators.gauss_markov(samples, rate, B, T_B, rng)
        return np.asarray(process + simulators.random_walk(samples, rate, K, rng))

    def make(samples: int, rate: float) -> Array:
        return np.asarray(simulators.white(samples, rate, N, rng) + slow(samples, rate))

    if kind == "analogue":
        log = simulators.analogue(slow, N, SAMPLES, rate, cutoff, order, rng)
    elif kind == "digital":
        log = simulators.digital(make, SAMPLES, rate, cutoff, order)
    else:
        taps = max(2, round(0.443 * rate / cutoff))
        cutoff = simulators.moving_mean_cutoff(rate, taps)
        log = simulators.moving_mean(make, SAMPLES, rate, taps)
    found = fit(log, rate)
    parameters = found.estimates[0].parameters
    white = parameters.get("N_sensor", parameters["N"])
    value = white.value or math.nan
    width = math.nan if white.lower is None or white.upper is None else white.upper - white.lower
    told = found.frame.low_pass.frequency if found.frame.low_pass is not None else None
    inside = told is not None and told.lower is not None and told.upper is not None
    return Found(
        f"{kind} {order}",
        number,
        part,
        value / N - 1.0,
        width / (2.0 * _SIGMAS * N),
        white.lower is not None and white.upper is not None and white.lower < N < white.upper,
        white.status,
        told is not None and told.value is not None,
        told.value / cutoff - 1.0 if told is not None and told.value else math.nan,
        bool(inside and told is not None and told.lower < cutoff < told.upper),
        found.candidates[0].goodness.verdict if found.candidates else "nothing fitted",
    )


def share(hits: Sequence[bool]) -> str:
    """Return a share with its 95 % limits, in words."""
    k, n = sum(hits), len(hits)
    if not n:
        return "none"
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return f"{100 * k / n:5.1f} % [{100 * low:.0f}, {100 * high:.0f}] of {n}"


def lines(found: Sequence[Found]) -> Iterator[str]:
    """Yield the table."""
    for name in dict.fromkeys(one.filter for one in found):
        yield row(name, [one for one in found if one.filter == name])
    yield row("all", found)


def row(name: str, found: Sequence[Found]) -> str:
    """Return a line of the table."""
    within = share([abs(one.N_off) < 0.03 for one in found])
    covered = share([one.N_inside for one in found])
    told = share([one.cutoff_told for one in found])
    right = share([abs(one.cutoff_off) < 0.05 for one in found if one.cutoff_told])
    plain = share([one.N_status == "ok" for one in found])
    off = np.array([one.N_off for one in found])
    over = off / np.array([one.N_claimed for one in found])
    return (
        f"{name:14} N within 3 %: {within}; inside: {covered}; ok: {plain}; "
        f"mean error {100 * np.nanmean(off):+.2f} %; "
        f"rms over claimed {math.sqrt(np.nanmean(over**2)):.2f}; "
        f"cut-off told: {told}; of those within 5 %: {right}"
    )


def main() -> None:
    """Print the table, and the logs whose N is off."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=20, help="of each filter")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.logs)
    jobs = [(number, place) for place in range(len(FAMILY)) for number in numbers]
    with ProcessPoolExecutor(given.processes, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(of_log, *zip(*jobs, strict=True), chunksize=2))
    print(*lines(found), sep="\n")
    for one in found:
        if abs(one.N_off) > 0.03 or not one.N_inside:
            print(one)


if __name__ == "__main__":
    main()
