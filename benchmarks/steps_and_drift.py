"""Steps, warm-ups and periodic drift: what is found, what is found falsely, and what becomes of K.

python benchmarks/steps_and_drift.py [--logs 50] [--part found oracle false drift walk] [--first 0]

The logs are made with numpy and scipy alone, and searched as the step ``estimate`` does, at its
default settings.

found
    Share of logs in which a step of 1 to 10 standard deviations of the Gauss-Markov process is
    found, with how often its 95 % interval holds its size. Beside it stands d², the square of what
    a matched filter that knows the noise and the place would see, in standard errors: a step of
    d² = 25 is at the threshold for a place that is not known.
oracle
    The same by tests that know the noise, at 1 % false in a log: whether the largest of the matched
    filters at all places exceeds what it does in 1 % of logs without a step, and the likelihood
    ratio of a step of this very size anywhere, over which there is none (Neyman and Pearson).
false
    Share of logs of noise alone, of four lengths, in which anything is found, and those in which a
    parameter is doubted or K is not identified for it.
drift
    Share of logs with warm-ups, periodic drift, growing or telegraph noise in which it is named.
walk
    K of logs with steps and drift by ``likelihood``: of the log as it is, and less what is found.
"""

from __future__ import annotations

import argparse
import time
import zlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, dst
from scipy.signal import lfilter
from scipy.special import logsumexp

from imubench_pipeline.estimators import likelihood
from imubench_pipeline.estimators.deterministic.courses import (
    DeterministicSignals,
    find_deterministic_signals,
)
from imubench_pipeline.estimators.deterministic.verdict import assess_signals

Array = NDArray[np.float64]
Rng = np.random.Generator


@dataclass(frozen=True)
class Noise:
    """Noise of known parameters, SI; processes as (standard deviation, correlation time)."""

    N: float
    processes: tuple[tuple[float, float], ...] = ()
    K: float = 0.0
    flicker: float = 0.0

    def log(self, rng: Rng, rate: float, hours: float) -> Array:
        """Return a log, exact at its sampling times; flicker noise is 1/f up to Nyquist."""
        n = round(hours * 3600.0 * rate)
        values = self.N * np.sqrt(rate) * rng.standard_normal(n)
        for sigma, time_constant in self.processes:
            decay = np.exp(-1.0 / rate / time_constant)
            drive = sigma * np.sqrt(1.0 - decay**2) * rng.standard_normal(n)
            drive[0] = sigma * rng.standard_normal()
            values += lfilter([1.0], [1.0, -decay], drive)
        if self.K:
            values += self.K / np.sqrt(rate) * np.cumsum(rng.standard_normal(n))
        if self.flicker:
            values += _flicker(rng, n, rate, self.flicker)
        return np.asarray(values)

    def seen(self, sigmas: float) -> float:
        """Return d² of a step in the middle of a long log: 1/pi integral of |A/w|²/S dw."""
        sigma = self.processes[0][0]
        w = np.geomspace(1e-6, 1e3, 200_000)
        return float(np.trapezoid((sigmas * sigma / w) ** 2 / self.density(w), w) / np.pi)

    def density(self, w: Array, interval: float = 0.0) -> Array:
        """Return the two-sided density without flicker noise at angular frequencies, SI²/Hz.

        A walk that is sampled at intervals has the folds of its tail.
        """
        slow = np.sin(0.5 * w * interval) / (0.5 * interval) if interval else w
        density = self.N**2 + (self.K / slow) ** 2
        for deviation, correlation in self.processes:
            density = density + 2.0 * deviation**2 * correlation / (1.0 + (w * correlation) ** 2)
        return np.asarray(density)


def _flicker(rng: Rng, n: int, rate: float, B: float) -> Array:
    """Return the middle of a periodic noise of density B²/(2 pi f), four times as long."""
    frequency = np.fft.rfftfreq(4 * n, 1.0 / rate)
    frequency[0] = np.inf
    scale = np.sqrt(B**2 / (2.0 * np.pi * frequency) * 4 * n * rate / 2.0)
    normal = rng.standard_normal((2, len(frequency)))
    return np.asarray(np.fft.irfft(scale * (normal[0] + 1j * normal[1]), 4 * n)[:n])


STEPPED: Mapping[str, tuple[Noise, float, float]] = {
    "strong process": (Noise(1e-4, ((3e-4, 100.0),), 1e-6), 20.0, 4.0),
    "MTi-7 gyro": (Noise(8.4e-5, ((7.21e-5, 89.5),), 8.2e-7), 20.0, 10.0),
    "C102 accelerometer": (Noise(9.6e-4, ((3.66e-4, 38.3),), 1.7e-5), 20.0, 10.0),
    "process of 5 s": (Noise(1e-4, ((3.2e-4, 5.0),), 2e-6), 20.0, 2.0),
}
"""Noise, rate in Hz and hours."""

CLEAN: Mapping[str, Noise] = {
    "white": Noise(1e-4),
    "walk": Noise(1e-4, K=5e-6),
    "strong walk": Noise(1e-4, K=1e-4),
    "weak walk": Noise(1e-4, K=3e-7),
    "flicker": Noise(1e-4, flicker=5e-5),
    "strong flicker": Noise(1e-4, flicker=1e-3),
    "flicker, walk": Noise(1e-4, flicker=5e-5, K=3e-6),
    "process of 5 s, walk": Noise(1e-4, ((3.2e-4, 5.0),), 2e-6),
    "process of 60 s": Noise(1e-4, ((1.1e-4, 60.0),)),
    "process of 100 s, walk": Noise(1e-4, ((5.4e-5, 100.0),), 2e-6),
    "process of 1500 s": Noise(1e-4, ((1.1e-4, 1500.0),)),
    "two processes": Noise(1e-4, ((1.1e-4, 10.0), (1.1e-4, 300.0))),
    "two processes, walk": Noise(1e-4, ((1.1e-4, 3.0), (2.2e-4, 200.0)), 5e-6),
}
LENGTHS = ((100.0, 0.3), (100.0, 1.0), (20.0, 3.0), (10.0, 10.0))
"""Rate in Hz and hours of the logs of noise alone."""

BASE = Noise(1e-4, ((1.5e-4, 80.0),), 3e-6)
RATE, HOURS = 20.0, 4.0

Change = Callable[[Array, Array, Rng], Array]
"""Returns a log that changes: of samples, their times in s, and a generator."""

S = BASE.processes[0][0]
CHANGED: Mapping[str, tuple[str, Change]] = {
    "step of 6 sigma": ("bias_step", lambda x, t, rng: x + 6 * S * (t > t[-1] * _inside(rng))),
    "three steps of 4 sigma": (
        "bias_step",
        lambda x, t, rng: x + 4 * S * sum((t > t[-1] * _inside(rng)) * 1.0 for _ in range(3)),
    ),
    "warm-up of 10 sigma, 200 s": (
        "warm_up_drift",
        lambda x, t, rng: x + 10 * S * np.exp(-t / 200.0),
    ),
    "warm-up of 10 sigma, 1200 s": (
        "warm_up_drift",
        lambda x, t, rng: x + 10 * S * np.exp(-t / 1200.0),
    ),
    "swing of 2 sigma, 20 min": (
        "periodic_drift",
        lambda x, t, rng: x + 2 * S * np.sin(2 * np.pi * t / 1200.0 + 6 * rng.random()),
    ),
    "on and off of 2 sigma, 20 min": (
        "periodic_drift",
        lambda x, t, rng: x + S * np.sign(np.sin(2 * np.pi * t / 1200.0 + 6 * rng.random())),
    ),
    "swing of 5 sigma, 2 h": (
        "periodic_drift",
        lambda x, t, rng: x + 5 * S * np.sin(2 * np.pi * t / 7200.0 + 6 * rng.random()),
    ),
    "telegraph, 4 sigma, 5 min": (
        "telegraph_noise",
        lambda x, t, rng: x + 4 * S * (np.cumsum(rng.random(len(t)) < 1 / 300 / RATE) % 2),
    ),
    "white noise grows by a tenth": (
        "noise_grows",
        lambda x, t, rng: (
            x + BASE.N * np.sqrt(RATE) * 0.46 * np.sqrt(t / t[-1]) * rng.standard_normal(len(t))
        ),
    ),
}


def _inside(rng: Rng) -> float:
    return float(rng.uniform(0.1, 0.9))


def searched(log: Array, rate: float) -> DeterministicSignals:
    """Search a log as the step ``estimate`` does."""
    return find_deterministic_signals(lambda: [log], len(log), rate)


def found(logs: int, first: int) -> None:
    """Print the share of steps that are found, by size."""
    for name, (noise, rate, hours) in STEPPED.items():
        sigma = noise.processes[0][0]
        for size in (1, 2, 3, 4, 6, 10):
            hits = covered = others = 0
            for i in range(first, first + logs):
                rng = _stream(name, size, i)
                log = noise.log(rng, rate, hours)
                place = rng.uniform(0.05, 0.95) * hours * 3600.0
                log[round(place * rate) :] += size * sigma
                near = 0
                for course in searched(log, rate).signals:
                    away = abs(course.start - place) < 2.0 * noise.processes[0][1]
                    if course.kind == "bias_step" and away and not near:
                        near = 1
                        covered += course.size_lower < size * sigma < course.size_upper
                    else:
                        others += 1
                hits += near
            cover = f"{covered / hits:6.2f}" if hits else "     -"
            print(
                f"{name:20s} {size:3d} sigma  d² {noise.seen(size):7.1f}  found {hits / logs:5.2f}"
                f"  covered {cover}  others a log {others / logs:5.2f}",
                flush=True,
            )


def oracle(logs: int, first: int) -> None:
    """Print the share of steps that are found by one who knows the noise."""
    for name, (noise, rate, hours) in STEPPED.items():
        for size in (2, 3, 4):
            step = size * noise.processes[0][0]
            seen: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
            for i in range(first, first + logs):
                rng = _stream(f"oracle {name}", size, i)
                for stepped, told in seen.items():
                    log = noise.log(rng, rate, hours)
                    place = rng.uniform(0.05, 0.95) * hours * 3600.0
                    log[round(place * rate) :] += step * stepped
                    told.append(_known_noise(noise, log, rate, step))
            without, with_step = np.array(seen[False]), np.array(seen[True])
            shares = np.mean(with_step > np.quantile(without, 0.99, axis=0), axis=0)
            print(
                f"{name:20s} {size:3d} sigma  d² {noise.seen(size):7.1f}  largest matched filter "
                f"{shares[0]:5.2f}  best test {shares[1]:5.2f}  of {logs} logs",
                flush=True,
            )


def _known_noise(noise: Noise, log: Array, rate: float, step: float) -> tuple[float, float]:
    """Return the largest square of the matched filters, and the log likelihood ratio of a step."""
    block = max(-(-len(log) // 16384), 1)
    n = len(log) // block
    interval = block / rate
    means = log[: n * block].reshape(n, block).mean(axis=1)
    k = np.arange(1, n)
    weight = interval / noise.density(np.pi * k / n / interval, interval)
    # The cosine transform of a step at place t is a sine of t, at each frequency.
    unit = -np.sqrt(2.0 / n) / (2.0 * np.sin(0.5 * np.pi * k / n))
    above = 0.5 * dst(unit * weight * dct(means, norm="ortho")[1:], type=1)
    power = np.concatenate(([0.0], unit**2 * weight))
    turned = np.fft.fft(power).real
    whole = 0.5 * (turned[0] - turned[1:])
    inside = slice(round(0.05 * n), round(0.95 * n))
    above, whole = above[inside], whole[inside]
    ratios = np.logaddexp(step * above, -step * above) - 0.5 * step**2 * whole
    return float(np.max(above**2 / whole)), float(logsumexp(ratios))


def false(logs: int, first: int) -> None:
    """Print the share of logs of noise alone in which something is found or doubted."""
    totals: Counter[str] = Counter()
    for name, noise in CLEAN.items():
        counts: Counter[str] = Counter()
        spent = 0.0
        for rate, hours in LENGTHS:
            for i in range(first, first + logs):
                log = noise.log(_stream(name, hours, i), rate, hours)
                start = time.perf_counter()
                courses = searched(log, rate)
                verdict = assess_signals("gyro_x", courses)
                spent += time.perf_counter() - start
                counts["logs"] += 1
                counts["with a course"] += bool(courses.signals) or courses.telegraph
                counts["with a finding"] += bool(verdict.findings)
                for finding in verdict.findings:
                    counts[finding.finding] += 1
                counts["slow terms doubtful"] += verdict.doubt is not None
        totals += counts
        print(f"{name:24s} {spent / counts['logs']:.2f} s a log  {_told(counts)}", flush=True)
    print(f"{'all':24s} {_told(totals)}")


def drift(logs: int, first: int) -> None:
    """Print what is said of logs that change."""
    for name, (expected, change) in CHANGED.items():
        counts: Counter[str] = Counter()
        for i in range(first, first + logs):
            log, _ = _changed(name, change, i)
            verdict = assess_signals("gyro_x", searched(log, RATE))
            counts["logs"] += 1
            names = {finding.finding for finding in verdict.findings}
            counts["named"] += expected in names
            counts["named at all"] += bool(names)
            for one in names - {expected}:
                counts[one] += 1
        print(f"{name:30s} {_told(counts)}", flush=True)


def walk(logs: int, first: int) -> None:
    """Print K over its true value, of logs as they are and less what is found."""
    changes = {"nothing": ("", lambda x, t, rng: x), **CHANGED}
    for name, (_, change) in changes.items():
        if name.startswith(("telegraph", "white noise", "walk")):
            continue
        ratios: dict[str, list[float]] = {"as it is": [], "less what is found": []}
        covered: Counter[str] = Counter()
        for i in range(first, first + logs):
            log, _ = _changed(name, change, i)
            courses = searched(log, RATE)
            less = np.concatenate(list(courses.subtract_from([log])))
            for which, samples in (("as it is", log), ("less what is found", less)):
                K = likelihood.fit(samples, RATE).estimates[0].parameters["K"]
                if K.lower is not None and K.upper is not None:
                    covered[which] += K.lower <= BASE.K <= K.upper
                if K.value is not None:
                    ratios[which].append(K.value / BASE.K)
        for which, values in ratios.items():
            middle = f"{np.median(values):5.2f}" if values else "    -"
            print(
                f"{name:30s} {which:20s} K over the truth {middle} (median of {len(values)})  "
                f"covered {covered[which] / logs:5.2f}",
                flush=True,
            )


def _changed(name: str, change: Change, number: int) -> tuple[Array, Array]:
    rng = _stream(name, 0, number)
    log = BASE.log(rng, RATE, HOURS)
    seconds = np.arange(len(log)) / RATE
    return np.asarray(change(log, seconds, rng)), seconds


def _stream(name: str, what: float, number: int) -> Rng:
    return np.random.default_rng([zlib.crc32(name.encode()), round(1000 * what), number])


def _told(counts: Counter[str]) -> str:
    logs = counts["logs"]
    shares = (f"{name} {count / logs:.3f}" for name, count in counts.items() if name != "logs")
    return f"of {logs} logs: " + ", ".join(shares)


PARTS = {"found": found, "oracle": oracle, "false": false, "drift": drift, "walk": walk}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=50, help="of each case and length")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--part", nargs="+", choices=PARTS, default=list(PARTS))
    given = parser.parse_args()
    for part in given.part:
        print(f"{part}:")
        PARTS[part](given.logs, given.first)
