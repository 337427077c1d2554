"""Turns found in simulated Earth-rate runs: missed, false, and how far off in time.

python benchmarks/dwell_detection.py [--runs 200] [--first 1000] [--processes 2]

The noise is that of paper 003 (N = 0.0122 deg/sqrt(s), B = 0.0027 deg/s, T_B = 238.1 s, K =
6.8314e-5 deg/s^1.5), sampled at 32 Hz for 12 to 120 min. A run has dwells of 10 to 120 s, mostly
30 s, by the clock or unequal, turned by hand within a few seconds of the schedule in 0.5 to 3 s,
either sense first, the last not broken off; some have missed turns, overshoots, knocks and missing
samples. What is sensed of a turn has a random shape; its peak is that of the samples, without
noise.

The first table is what is asked: transients of 2 to 20 deg/s. The second has transients of one
peak each, down to none, where the schedule decides. Wrong: samples used whose sense is the other
one, in percent of those used; the sense of the first dwell is given. Turning: samples of turns that
are used, in percent of the turning. Plain: runs of equal dwells without missed turns, overshoots,
knocks and missing samples. By hand: standard deviation of the turns about the schedule's clock.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.earth_rate.turning import find_turning
from imubench_pipeline.extensions.earth_rate.turns import FoundBy, Turning
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

Array = NDArray[np.float64]

DEGREE = math.pi / 180.0
RATE = 32.0
PAPER = NoiseModel(
    N=0.0122 * DEGREE, B=0.0027 * DEGREE, T_B=238.1, K=6.8314e-5 * DEGREE
)  # rad/s/sqrt(Hz), rad/s, s, rad/s/sqrt(s)
EARTH = 7.292115e-5  # rad/s
DWELLS = (30.0, 30.0, 30.0, 10.0, 15.0, 20.0, 45.0, 60.0, 120.0)  # s
KINDS = ("unequal", "missed", "overshoot", "knocks", "holes")


@dataclass
class Run:
    """A simulated run, and what is true of it."""

    log: Array
    dwell: float
    first: int
    turns: list[tuple[float, float]]
    sense: NDArray[np.int8]
    kinds: set[str]
    left_out: list[float]
    knocks: list[tuple[float, float]] = field(default_factory=list)


@dataclass
class Score:
    """How a run was found."""

    kinds: set[str]
    dwell: float
    turns: int
    missed: int
    false: int
    errors: Array
    by: list[FoundBy]
    wrong: float
    turning_used: float
    knocks_used: float
    refused: bool = False
    contradicted: bool = False


def shape(samples: int, rng: np.random.Generator) -> Array:
    """Return a transient of random shape with peak 1: lobes of either sign, skewed, uneven."""
    u = (np.arange(samples) + 0.5) / samples
    u = u ** rng.uniform(0.7, 1.4)
    lobes = rng.choice([1, 1, 2, 3])
    wave = np.sin(np.pi * u) * (np.cos(np.pi * (lobes - 1) * u) if lobes > 1 else 1.0)
    for k in range(2, 6):
        wave = wave + rng.normal(0.0, 0.25) * np.sin(k * np.pi * u)
    return np.asarray(rng.choice([-1.0, 1.0]) * wave / np.abs(wave).max())


def simulated(
    rng: np.random.Generator,
    peak: tuple[float, float],
    kinds: set[str],
    jitter: float | None = None,
    dwell: float | None = None,
    noise: NoiseModel = PAPER,
) -> Run:
    """Return a run with transients of peaks between two, deg/s."""
    dwell = dwell or float(rng.choice(DWELLS))
    duration = max(4.0 * dwell, 60.0 * math.exp(rng.uniform(math.log(12.0), math.log(120.0))))
    if not kinds:
        duration = round(duration / dwell) * dwell
    n = round(duration * RATE)
    spread = min(rng.uniform(0.5, 3.0), 0.1 * dwell) if jitter is None else jitter
    usual = rng.uniform(0.6, min(2.4, 0.2 * dwell))
    planned = np.arange(1, int(duration / dwell) + 1) * dwell
    if "unequal" in kinds:
        planned = np.cumsum(dwell * rng.uniform(0.7, 1.3, len(planned)))
        spread = 0.0
    starts = planned + np.clip(rng.normal(0.0, 1.0, len(planned)), -2.5, 2.5) * spread
    left_out: list[float] = []
    if "missed" in kinds:
        kept_turns = rng.uniform(size=len(starts)) > 0.04
        left_out = [float(at) for at in starts[~kept_turns]]
        starts = starts[kept_turns]
    log = simulate(noise, RATE, n, rng)
    strength = np.exp(rng.uniform(*np.log(peak))) if peak[0] else 0.0
    first = int(rng.choice([-1, 1]))
    sense = np.full(n, float(first))
    turns, kept = [], np.zeros(n, dtype=np.int8)
    for start in starts:
        a = round(start * RATE)
        length = round(usual * rng.uniform(0.8, 1.25) * RATE)
        if a + length + round(max(4.0, 0.3 * dwell) * RATE) >= n or a < 0:
            continue
        size = np.clip(strength * rng.uniform(0.5, 2.0), *peak)
        log[a : a + length] += DEGREE * size * shape(length, rng)
        before, b = sense[a], a + length
        sense[a:b] = before * np.cos(np.pi * np.arange(length) / length)
        sense[b:] = -before
        if "overshoot" in kinds and rng.uniform() < 0.15:
            c = b + round(rng.uniform(0.0, min(2.0, 0.07 * dwell)) * RATE)
            b = c + round(rng.uniform(0.3, 0.6) * length)
            log[c:b] += DEGREE * size * rng.uniform(0.3, 1.0) * shape(b - c, rng)
        turns.append((a / RATE, b / RATE))
    at, sign = 0, first
    for a, b in [*turns, (duration, duration)]:
        kept[at : round(a * RATE)] = sign
        at, sign = round(b * RATE), -sign
    log += sense * EARTH * math.cos(rng.uniform(0.0, math.pi / 3.0)) + 0.01 * rng.normal()
    run = Run(log, dwell, first, turns, kept, kinds, left_out)
    if "knocks" in kinds:
        knock(run, rng)
    if "bumps" in kinds:
        handle(run, rng)
    if "holes" in kinds:
        make_holes(run, rng)
    return run


def knock(run: Run, rng: np.random.Generator) -> None:
    """Add knocks of 1 to 6 samples and 1 to 30 deg/s, one in 5 min, and away from the turns."""
    n = len(run.log)
    for _ in range(rng.poisson(n / RATE / 300.0)):
        a, length = int(rng.integers(0, n - 8)), int(rng.integers(1, 7))
        if all(not s - 0.5 < a / RATE < e + 0.5 for s, e in run.turns):
            ring = (-0.6) ** np.arange(length) * math.exp(rng.uniform(0.0, math.log(30.0)))
            run.log[a : a + length] += DEGREE * ring * rng.choice([-1.0, 1.0])
            run.knocks.append((a / RATE, (a + length) / RATE))


def handle(run: Run, rng: np.random.Generator) -> None:
    """Add disturbances that last and look like turns, one in 20 min, at least 3 s from turns."""
    duration = len(run.log) / RATE
    for _ in range(rng.poisson(duration / 1200.0)):
        start, length = rng.uniform(0.0, duration - 4.0), rng.uniform(0.5, 2.0)
        if all(not s - 3.0 - length < start < e + 3.0 for s, e in run.turns):
            a, count = round(start * RATE), round(length * RATE)
            size = math.exp(rng.uniform(math.log(2.0), math.log(20.0)))
            run.log[a : a + count] += DEGREE * size * shape(count, rng)
            run.knocks.append((a / RATE, (a + count) / RATE))


def make_holes(run: Run, rng: np.random.Generator) -> None:
    """Take 1 % of the samples, and stretches up to 5 s that leave half of each turn.

    Where a turn was missed there is none: nothing could say that it was.
    """
    n = len(run.log)
    lost = rng.uniform(size=n) < 0.01
    for _ in range(rng.poisson(n / RATE / 200.0)):
        a = int(rng.integers(0, n))
        b = a + round(rng.uniform(0.1, 5.0) * RATE)
        seen = all(min(b / RATE, e) - max(a / RATE, s) < 0.5 * (e - s) for s, e in run.turns)
        if seen and all(abs(a / RATE - at) > 0.5 * run.dwell + 5.0 for at in run.left_out):
            lost[a:b] = True
    run.log[lost] = np.nan


def scored(run: Run, found: Turning | None) -> Score:
    """Compare what is found with what is true."""
    total = len(run.turns)
    if found is None:
        return Score(run.kinds, run.dwell, total, 0, 0, np.empty(0), [], 0.0, 0.0, 0.0, True)
    middle = np.array([0.5 * (a + b) for a, b in run.turns])
    left = list(range(len(middle)))
    errors, false = [], 0
    by: list[FoundBy] = []
    for turn in found.turns:
        by.append(turn.found_by)
        near = [k for k in left if abs(middle[k] - turn.time) < 0.35 * run.dwell]
        if near:
            k = min(near, key=lambda k: abs(middle[k] - turn.time))
            left.remove(k)
            errors.append(turn.time - middle[k])
        else:
            false += 1
    senses = found.senses(len(run.log), RATE)
    used = (senses != 0) & np.isfinite(run.log)
    turning = run.sense == 0
    knocked = np.zeros(len(run.log), dtype=bool)
    for start, stop in run.knocks:
        knocked[round(start * RATE) : round(stop * RATE)] = True
    return Score(
        run.kinds,
        run.dwell,
        total,
        len(left),
        false,
        np.array(errors),
        by,
        float(np.mean(senses[used & ~turning] != run.sense[used & ~turning])),
        float(np.mean(used[turning])) if turning.any() else 0.0,
        float(np.mean(used[knocked])) if knocked.any() else 0.0,
        contradicted=any("the other way" in doubt for doubt in found.doubts),
    )


def of_run(
    peak: tuple[float, float],
    kinds: set[str] | None,
    trust: bool,
    known: bool,
    jitter: float | None,
    dwell: float | None,
    noise: NoiseModel,
    number: int,
) -> Score:
    """Simulate a run, find its turns and compare."""
    rng = np.random.default_rng([number, round(1000 * peak[0]), 9])
    if kinds is None:
        kinds = {kind for kind in KINDS if rng.uniform() < 0.5}
    run = simulated(rng, peak, kinds, jitter, dwell, noise)
    model = noise if known else None
    try:
        found = find_turning(
            run.log, RATE, run.dwell, first_sense=run.first, model=model, trust_schedule=trust
        )
    except ValueError as error:
        if "nothing shows" not in str(error):
            raise
        return scored(run, None)
    return scored(run, found)


def row(name: str, scores: list[Score]) -> str:
    """Return the figures of some runs."""
    done = [one for one in scores if not one.refused]
    turns = sum(one.turns for one in done)
    errors = np.abs(np.concatenate([one.errors for one in done])) if done else np.empty(0)
    middle, high, most = (
        (np.median(errors), np.quantile(errors, 0.95), errors.max())
        if len(errors)
        else (math.nan,) * 3
    )
    seen = sum(by in ("transient", "step") for one in done for by in one.by)
    wrong = [one.wrong for one in done]
    return (
        f"{name:34}{len(scores):5d}{len(scores) - len(done):8d}{turns:8d}"
        f"{sum(one.missed for one in done):8d}{sum(one.false for one in done):7d}"
        f"{sum(one.missed + one.false > 0 for one in done):6d}"
        f"{100 * seen / max(1, sum(len(one.by) for one in done)):7.1f}"
        f"{middle:8.2f}{high:7.2f}{most:7.2f}"
        f"{100 * np.mean(wrong) if done else math.nan:8.2f}"
        f"{100 * np.mean([one.turning_used for one in done]) if done else math.nan:9.2f}"
    )


HEAD = (
    f"{'':34}{'runs':>5}{'refused':>8}{'turns':>8}{'missed':>8}{'false':>7}{'runs':>6}"
    f"{'seen':>7}{'error of time, s':>22}{'wrong':>8}{'turning':>9}\n"
    f"{'':34}{'':5}{'':8}{'':8}{'':8}{'':7}{'off':>6}{'%':>7}"
    f"{'median':>8}{'95 %':>7}{'most':>7}{'%':>8}{'used %':>9}"
)


def asked(scores: list[Score]) -> Iterator[str]:
    """Yield what is asked beside what is found, and by what the runs had."""
    missed, false = (sum(getattr(one, name) for one in scores) for name in ("missed", "false"))
    yield HEAD
    yield row("2 to 20 deg/s", scores)
    for kind in KINDS:
        yield row(f"  with {kind}", [one for one in scores if kind in one.kinds])
    for dwell in sorted(set(DWELLS)):
        yield row(f"  dwell {dwell:g} s", [one for one in scores if one.dwell == dwell])
    knocks = [one.knocks_used for one in scores if "knocks" in one.kinds]
    yield f"samples of knocks that are used: {100 * np.mean(knocks):.2f} %"
    good = "met" if missed == false == 0 else "NOT met"
    yield (
        f"asked: no missed and no false turn in 200 runs at 2 deg/s and more; found: "
        f"{missed} missed, {false} false in {len(scores)} runs: {good}"
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=1000, help="seed of the first run")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    began = time.monotonic()
    with ProcessPoolExecutor(given.processes) as pool:

        def of(
            peak: tuple[float, float],
            kinds: set[str] | None = None,
            trust: bool = False,
            known: bool = False,
            jitter: float | None = None,
            dwell: float | None = None,
            noise: NoiseModel = PAPER,
            runs: int = given.runs,
        ) -> list[Score]:
            work = partial(of_run, peak, kinds, trust, known, jitter, dwell, noise)
            numbers = range(given.first, given.first + runs)
            scores = list(pool.map(work, numbers, chunksize=4))
            print(f"{peak[0]:g} deg/s: {time.monotonic() - began:.0f} s", file=sys.stderr)
            return scores

        print("\n".join(asked(of((2.0, 20.0)))), flush=True)
        print("\nwith the noise model given\n" + HEAD)
        print(row("2 to 20 deg/s", of((2.0, 20.0), known=True)), flush=True)
        some = max(1, given.runs // 2)
        print("\nbelow, and none\n" + HEAD)
        for peak in (1.0, 0.5, 0.4, 0.3, 0.25, 0.2, 0.15, 0.1, 0.05):
            print(row(f"{peak:g} deg/s", of((peak, peak), trust=True, runs=some)))
            plain = of((peak, peak), kinds=set(), trust=True, runs=some)
            print(row(f"{peak:g} deg/s, plain", plain), flush=True)
        print("\nhandling that lasts and looks like a turn, 2 to 20 deg/s, once in 20 min\n" + HEAD)
        for extra in (set(), {"missed"}, {"unequal"}):
            name = ", ".join(["handling", *sorted(extra)])
            print(row(name, of((2.0, 20.0), kinds={"bumps", *extra}, runs=some)), flush=True)
        print("\nnone: the schedule, and the level where it alternates clearly\n" + HEAD)
        for jitter in (0.0, 1.0, 2.0, 3.0):
            name = f"plain, 30 s, by hand {jitter:g} s"
            none = partial(of, (0.0, 0.0), kinds=set(), jitter=jitter, dwell=30.0, runs=some)
            print(row(name, none(trust=True)))
            print(row("  schedule not trusted", none()), flush=True)
        better = NoiseModel(N=0.05 * PAPER.N, B=0.05 * PAPER.B, T_B=PAPER.T_B, K=0.05 * PAPER.K)
        of_better = partial(of, (0.0, 0.0), noise=better, runs=some)
        print(row("a gyro of a 20th of the noise", of_better()))
        print(row("a gyro of a 20th, plain", of_better(kinds=set())))


if __name__ == "__main__":
    main()
