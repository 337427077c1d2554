"""How often the limits of the Allan curve hold the true value, at every tau.

python benchmarks/allan_limits.py [--logs 400] [--processes 2] [--case NAME] [--every-tau]

Logs simulated here, with numpy alone, and analysed at the settings that a user gets: the curve,
the fit of the likelihood, the degrees of freedom by the fitted spectrum. For each case and for 95 %
and 68 % limits: the least and the largest share over tau of the logs whose limits hold the true
Allan variance, with the tau where that is, and how far chance alone may take them; the same with
the degrees of freedom of the identified power law; how often the fit explained the log.

The true Allan variance is summed from the covariance of the samples, not taken from the package.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.allan.phase import count_presence
from imubench_pipeline.estimators.curve_limits import add_fitted_limits
from imubench_pipeline.estimators.likelihood import fit

Array = NDArray[np.float64]
Rng = np.random.Generator
LEVELS = (0.95, 0.6827)


@dataclass(frozen=True)
class Case:
    """Simulated logs; a process is a variance a sample and a correlation time in samples.

    Attributes
    ----------
    name : str
    samples : int
    rate : float
        Hz.
    white : float
        Standard deviation of a sample.
    flicker : float
        B: its power density is B^2 / |2 sin(w/2)|.
    processes : tuple of (float, float)
        Standard deviation and correlation time in s of each Gauss-Markov process.
    walk : float
        Standard deviation of a step.
    lost : float
        Part of the samples that is missing, one by one.
    hole : float
        Part of the log that is missing in one piece, after three eighths of it.
    """

    name: str
    samples: int = 40_000
    rate: float = 10.0
    white: float = 0.0
    flicker: float = 0.0
    processes: tuple[tuple[float, float], ...] = ()
    walk: float = 0.0
    lost: float = 0.0
    hole: float = 0.0


def papers_case(
    name: str, hours: float, rate: float, N: float, B: float, T_B: float, K: float
) -> Case:
    """Return a case of N, B, T_B and K in SI as the papers give them."""
    # S_B T_B / 2 with S_B = 2 B^2 ln 2 / (pi 0.4365^2 T_B).
    spread = B * math.sqrt(math.log(2.0) / math.pi) / 0.4365
    return Case(
        name,
        round(hours * 3600.0 * rate),
        rate,
        white=N * math.sqrt(rate),
        processes=((spread, T_B),),
        walk=K / math.sqrt(rate),
    )


CASES = (
    Case("white", white=1.0),
    Case("flicker", flicker=1.0),
    Case("random walk", walk=1.0),
    Case("white + flicker", white=10.0, flicker=1.0),
    Case("white + walk", white=10.0, walk=0.05),
    Case("white + GM 2 s", white=1.0, processes=((0.7, 2.0),)),
    Case("white + GM 20 s", white=1.0, processes=((0.5, 20.0),)),
    Case("white + GM 200 s", white=1.0, processes=((0.3, 200.0),)),
    Case("GM 20 s alone", processes=((1.0, 20.0),)),
    Case("white + GM + walk", white=1.0, processes=((0.3, 30.0),), walk=0.002),
    Case("white + flicker + walk", white=10.0, flicker=1.0, walk=0.02),
    papers_case("MTi-7 gyro", 5.0, 5.0, 8.4e-5, 6.7e-5, 89.5, 8.2e-7),
    papers_case("C102 accelerometer", 5.0, 5.0, 1.1e-3, 7.2e-4, 148.9, 2.0e-5),
    Case("white + GM 20 s, 5 % lost", white=1.0, processes=((0.5, 20.0),), lost=0.05),
    Case("white, 5 % lost", white=1.0, lost=0.05),
    Case(
        "white + GM + walk, a hole of 20 %", 40_000, 10.0, 1.0, 0.0, ((0.3, 30.0),), 0.002, 0, 0.2
    ),
)


def log_of(case: Case, rng: Rng) -> Array:
    """Return a log, NaN where a sample is missing."""
    size = case.samples
    log = case.white * rng.standard_normal(size)
    log += case.walk * np.cumsum(rng.standard_normal(size))
    for spread, time in case.processes:
        log += spread * gauss_markov(size, math.exp(-1.0 / (time * case.rate)), rng)
    if case.flicker:
        log += case.flicker * flicker(size, rng)
    if case.lost:
        log[rng.random(size) < case.lost] = np.nan
    if case.hole:
        start = round(0.375 * size)
        log[start : start + round(case.hole * size)] = np.nan
    return log


def gauss_markov(size: int, p: float, rng: Rng) -> Array:
    """Return a stationary first-order process of variance 1, exact, by recursive doubling."""
    x = math.sqrt(1.0 - p * p) * rng.standard_normal(size)
    x[0] = rng.standard_normal()
    shift = 1
    while shift < size and p**shift > 1e-18:
        x[shift:] = x[shift:] + p**shift * x[:-shift]
        shift *= 2
    return x


def flicker(size: int, rng: Rng) -> Array:
    """Return noise of power density 1 / |2 sin(w/2)|: circular, on 16 times the length."""
    long = 16 * size
    omega = 2.0 * np.pi * np.arange(1, long // 2 + 1) / long
    density = 1.0 / (2.0 * np.sin(omega / 2.0))
    parts = rng.standard_normal((2, len(omega)))
    bins = np.concatenate(([0.0], np.sqrt(density * long / 2.0) * (parts[0] + 1j * parts[1])))
    return np.fft.irfft(bins, long)[:size]


def truth(case: Case, n: Array, averaged: Array) -> Array:
    """Return the true Allan variance at n samples a cluster, summed from covariances."""
    found = case.white**2 / averaged
    found = found + case.walk**2 * (2.0 * n**2 + 1.0) / (6.0 * n)
    for spread, time in case.processes:
        found = found + spread**2 * from_covariance(n, math.exp(-1.0 / (time * case.rate)))
    if case.flicker:
        found = found + case.flicker**2 * np.array([flicker_variance(int(m)) for m in n])
    return np.asarray(found)


def from_covariance(n: Array, p: float) -> Array:
    """Return the Allan variance of samples of covariance p^k: half the mean square difference."""
    found = []
    for m in n.astype(np.int64):
        k = np.arange(1, m)
        own = m + 2.0 * np.sum((m - k) * p**k)
        k = np.arange(1, 2 * m)
        across = np.sum(np.minimum(k, 2 * m - k) * p**k)
        found.append((own - across) / m**2)
    return np.array(found)


def flicker_variance(n: int) -> float:
    """Return the Allan variance of flicker noise: its power density integrated by midpoints."""
    points = max(200_000, 64 * n)
    if points > 1_000_000:
        return 2.0 * math.log(2.0) / math.pi
    x = (np.arange(points) + 0.5) * (np.pi / 2.0) / points
    # (1/2 pi) integral of 1/(2 sin x) 4 sin^4(n x) / (n^2 sin^2 x) / 2 over both signs of w = 2 x.
    return float(
        np.sum(np.sin(n * x) ** 4 / np.sin(x) ** 3) * (np.pi / 2.0) / points * 2 / np.pi / n**2
    )


@dataclass(frozen=True)
class Held:
    """What the limits of one log hold.

    Attributes
    ----------
    tau : ndarray, shape (m,)
        s.
    fitted, power_law : ndarray of bool, shape (2, m)
        The limits of each level hold the true Allan deviation.
    explained : bool
    model : str
        What was fitted.
    """

    tau: Array
    fitted: NDArray[np.bool_]
    power_law: NDArray[np.bool_]
    explained: bool
    model: str


def of_log(case: Case, number: int) -> Held:
    """Simulate a log and compare its limits with the truth."""
    rng = np.random.default_rng([number, [one.name for one in CASES].index(case.name)])
    log = log_of(case, rng)
    curve = allan_variance(log, case.rate, overlap="octave")
    found = fit(log, case.rate, rng=rng)
    holes = bool(np.isnan(log).any())
    there = count_presence([log], len(log)) if holes else None
    fitted = add_fitted_limits(curve, found, None, there)
    true = np.sqrt(_truths(case, tuple(curve.cluster_size), tuple(curve.averaged)))
    rows = []
    for one in (fitted, curve):
        limits = [one.limits(level) for level in LEVELS]
        rows.append(np.array([(low <= true) & (true <= high) for low, high in limits]))
    chosen = found.candidates[0]
    explained = chosen.goodness.verdict == "explained"
    return Held(curve.cluster_size / case.rate, rows[0], rows[1], explained, chosen.terms.name)


_KNOWN: dict[tuple[str, tuple[int, ...]], Array] = {}


def _truths(case: Case, sizes: tuple[int, ...], averaged: tuple[float, ...]) -> Array:
    n = np.array(sizes, dtype=np.float64)
    if (case.name, sizes) not in _KNOWN:
        _KNOWN[case.name, sizes] = truth(case, n, n) - case.white**2 / n
    return _KNOWN[case.name, sizes] + case.white**2 / np.array(averaged)


def table(case: Case, results: list[Held], every_tau: bool) -> Iterator[str]:
    """Yield the lines of a case."""
    number = len(results)
    explained = 100.0 * np.mean([one.explained for one in results])
    names: dict[str, int] = {}
    for one in results:
        names[one.model] = names.get(one.model, 0) + 1
    models = ", ".join(f"{k} {v}" for k, v in sorted(names.items(), key=lambda kv: -kv[1])[:4])
    yield f"{case.name}: {number} logs, explained {explained:.0f} %, models {models}"
    shared = set(results[0].tau).intersection(*(set(one.tau) for one in results))
    tau = np.array(sorted(shared))
    picks = [np.isin(one.tau, tau) for one in results]
    by_source = {
        "fitted": [one.fitted for one in results],
        "power law": [one.power_law for one in results],
    }
    for label, rows in by_source.items():
        held = np.mean([row[:, pick] for row, pick in zip(rows, picks, strict=True)], axis=0)
        words = []
        for level, share in zip(LEVELS, 100.0 * held, strict=True):
            error = 100.0 * math.sqrt(level * (1.0 - level) / number)
            low, high = int(np.argmin(share)), int(np.argmax(share))
            words.append(
                f"{100 * level:.0f} %: {share[low]:5.1f} ({tau[low]:.4g} s) to {share[high]:5.1f} "
                f"({tau[high]:.4g} s), mean {share.mean():.1f} (σ {error:.1f})"
            )
        yield f"  {label:10} " + "; ".join(words)
        if every_tau:
            for t, *shares in zip(tau, *(100.0 * held), strict=True):
                yield f"    {t:10.4g} s " + " ".join(f"{share:6.1f}" for share in shares)


def main() -> None:
    """Print the shares of every case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=400)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--case", help="only cases whose name has this in it")
    parser.add_argument("--every-tau", action="store_true")
    given = parser.parse_args()
    with ProcessPoolExecutor(given.processes) as pool:
        run: Callable[..., Iterator[Held]] = pool.map
        for case in CASES:
            if given.case and given.case not in case.name:
                continue
            results = list(run(partial(of_log, case), range(given.logs), chunksize=4))
            print("\n".join(table(case, results, given.every_tau)), flush=True)


if __name__ == "__main__":
    main()
