"""Which model the likelihood chooses on simulated logs, and how well it then knows it.

python benchmarks/model_choice.py [--logs 200] [--processes 2] [--case white ...]

The flicker noise of the logs comes from Kasdin's fractional integration, not from the project's
bank of Gauss-Markov processes, whose ripple is printed first. All settings are the default ones;
the bounds are those over the band that was used of each log.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from bands import bounds_over, highest, what_is_cut
from imubench_pipeline.estimators.estimate import PARAMETERS, Parameter
from imubench_pipeline.estimators.likelihood import Likelihood, fit
from imubench_pipeline.noise import Flicker, GaussMarkov, NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.noise.terms.flicker import fit_flicker_bank

RATE = 20.0
DURATION = 36_000.0


@dataclass(frozen=True)
class Case:
    """Simulated logs of one model, and the models that are right for it."""

    name: str
    model: NoiseModel
    right: str
    absent: str = ""


CASES = (
    Case("white", NoiseModel(N=1e-4), "N", "BK"),
    Case("white, random walk", NoiseModel(N=1e-4, K=3e-6), "N+K", "B"),
    Case("white, Gauss-Markov", NoiseModel(N=1e-4, B=1e-4, T_B=60.0), "N+GM", "K"),
    Case("the papers' four", NoiseModel(N=1e-4, B=2e-4, T_B=20.0, K=1e-5), "N+GM+K"),
    Case("white, flicker", NoiseModel(N=1e-4, B=1e-4), "N+F", "K"),
    Case("white, flicker, walk", NoiseModel(N=1e-4, B=2e-4, K=2e-5), "N+F+K"),
    Case(
        "white, two Gauss-Markov",
        NoiseModel(N=1e-4, B=2e-4, T_B=4.0, further=(GaussMarkov(2e-4, 100.0),)),
        "N+GM+GM",
        "K",
    ),
)


def fractional_noise(samples: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return flicker noise of B = 1, sampled at 1 Hz or any other rate (N. J. Kasdin, 1995).

    White noise of unit variance, integrated to the power 1/2, has the sampled spectrum
    1 / |1 - e^(-i omega)|; that of flicker noise is B² / omega at low frequencies.
    """
    # What came before the log is as long as the log: a start from nothing would not be 1/f.
    k = np.arange(1, 2 * samples, dtype=np.float64)
    weights = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))
    white = rng.standard_normal(2 * samples)
    return np.asarray(fftconvolve(white, weights)[samples : 2 * samples])


Found = tuple[str, dict[str, Parameter], bool, str, float]


def log_of(model: NoiseModel, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a simulated log; its flicker noise does not come from the bank."""
    samples = round(DURATION * RATE)
    flicker = model.B if model.T_B is None else 0.0
    rest = NoiseModel(
        N=model.N,
        B=0.0 if flicker else model.B,
        T_B=model.T_B,
        K=model.K,
        further=model.further,
    )
    log = simulate(rest, RATE, samples, rng)
    return log + flicker * fractional_noise(samples, rng) if flicker else log


def of_log(case: Case, number: int) -> Found:
    """Return the chosen model, its parameters, whether flicker beats a process, verdict, band."""
    rng = np.random.default_rng([number, CASES.index(case)])
    found = fit(log_of(case.model, rng), RATE, rng=rng)
    return (
        found.candidates[0].terms.name,
        dict(found.estimates[0].parameters),
        _flickers(found),
        found.candidates[0].goodness.verdict,
        highest(found, RATE),
    )


def _flickers(found: Likelihood) -> bool:
    """Tell whether the best model with flicker beats the best with one Gauss-Markov process."""
    terms = [candidate.terms for candidate in found.candidates]
    flicker = next(i for i, t in enumerate(terms) if "F" in t.linear and not t.gauss_markov)
    process = next(i for i, t in enumerate(terms) if "F" not in t.linear and t.gauss_markov == 1)
    return flicker < process


def table(case: Case, found: list[Found]) -> Iterator[str]:
    """Yield the lines of a case."""
    chosen = Counter(name for name, *_ in found)
    share = 100 * chosen[case.right] / len(found)
    others = ", ".join(f"{n} {c}" for n, c in chosen.most_common(5) if n != case.right)
    yield f"{case.name}: {case.right} in {share:.1f} % of {len(found)} simulated logs ({others})"
    for letter in case.absent:
        absent = sum(parameters[letter].status == "absent" for _, parameters, *_ in found)
        yield f"  {letter} = 0 reported as absent: {100 * absent / len(found):.1f} %"
    if case.model.B and case.model.T_B is None:
        share = 100 * sum(flickers for *_, flickers, _, _ in found) / len(found)
        yield f"  flicker chosen over one Gauss-Markov process: {share:.1f} %"
    explained = 100 * sum(verdict == "explained" for *_, verdict, _ in found) / len(found)
    yield f"  goodness of fit says explained: {explained:.1f} %"
    bands = [band for *_, band in found]
    yield f"  {what_is_cut(bands, RATE)}"
    bounds = bounds_over(case.model, RATE, DURATION, bands)
    for name in PARAMETERS:
        truth = getattr(case.model, name)
        if not truth or case.model.further:
            continue
        given = [i for i, one in enumerate(found) if one[1][name].value is not None]
        if not given:
            yield f"  {name:4} never given"
            continue
        known = [found[i][1][name] for i in given]
        bound = bounds[name][given]
        errors = (np.array([p.value for p in known]) / truth - 1.0) / bound
        covered = [p.lower <= truth <= p.upper for p in known if p.lower and p.upper]
        yield (
            f"  {name:4} bound {100 * np.median(bound):7.3f} %  RMSE/bound "
            f"{np.sqrt(np.mean(errors**2)):.2f}  bias/bound "
            f"{errors.mean():+.2f}  covered {100 * np.mean(covered):.1f} % of "
            f"{len(covered)}"
        )


def compute_bank_ripple(interval: float, longest: float) -> tuple[float, float]:
    """Return the largest relative errors of the Allan variance and spectrum of a bank."""
    terms, flicker = fit_flicker_bank(1.0, interval, longest), Flicker(1.0)
    n = np.unique(np.rint(np.geomspace(1.0, longest / interval, 400)))
    omega = np.pi / n
    variance = np.sum([term.sampled_allan_variance(n, interval) for term in terms], axis=0)
    density = np.sum([term.sampled_spectrum(omega, interval) for term in terms], axis=0)
    return (
        float(np.max(np.abs(variance / flicker.sampled_allan_variance(n, interval) - 1.0))),
        float(np.max(np.abs(density / flicker.sampled_spectrum(omega, interval) - 1.0))),
    )


def main() -> None:
    """Print the ripple of the bank, and a table for each case."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    names = [case.name for case in CASES]
    parser.add_argument("--case", action="append", choices=names, help="default: all")
    given = parser.parse_args()
    for rate, hours in ((100.0, 10.0), (20.0, 10.0), (500.0, 5.0), (32.0, 168.0)):
        variance, density = compute_bank_ripple(1.0 / rate, hours * 3600.0)
        print(
            f"bank of Gauss-Markov processes, {rate:g} Hz, {hours:g} h: its Allan variance within "
            f"{100 * variance:.4f} % of the samples' flicker noise, its spectrum within "
            f"{100 * density:.3f} %"
        )
    with ProcessPoolExecutor(given.processes) as pool:
        for case in CASES:
            if given.case and case.name not in given.case:
                continue
            found = []
            work: Callable[[int], Found]
            work = partial(of_log, case)
            for result in pool.map(work, range(given.logs)):
                found.append(result)
                if len(found) % 50 == 0:
                    print(f"{case.name}: {len(found)} of {given.logs}", file=sys.stderr)
            print("\n".join(table(case, found)), flush=True)


if __name__ == "__main__":
    main()
