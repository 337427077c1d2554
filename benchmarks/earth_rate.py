"""Estimates of the Earth's rate on simulated runs against what they say of themselves.

    python benchmarks/earth_rate.py [--runs 4000] [--minutes 30]

A gyro is turned every 30 s, with the noise of several models; the block means of the runs are drawn
from their exact distribution. What is asked stands beside what is found, and the exit status is 1
if something is not fulfilled. NEES and NIS are compared with the two-sided 95 % bounds of their
chi-squared distribution, each run at each epoch once both positions have been seen; NEES is that
of the rate and all states. Below, what noise allows in the four runs of Silva et al., and what the
paper prints.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.kalman import Filtered, RateFilter
from imubench_pipeline.extensions.earth_rate.bound import (
    choose_block_length,
    compute_cramer_rao_bounds,
)
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, mean_sigma, settled, track
from imubench_pipeline.extensions.earth_rate.outlook import Outlook
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs, by_triples
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    ASSUMED_TURNING,
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_PERIOD,
    PAPER_RATE,
    design_paper_run,
    simulate_log,
    simulate_runs,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel

Array = NDArray[np.float64]

N, B, T_B, K = PAPER_MODEL.N, PAPER_MODEL.B, PAPER_MODEL.T_B, PAPER_MODEL.K
MODELS = {
    "paper": PAPER_MODEL,
    "white": NoiseModel(N=N),
    "K strong": NoiseModel(N=N, B=B, T_B=T_B, K=10.0 * K),
    "flicker": NoiseModel(N=N, B=B, K=K),
    "flicker strong": NoiseModel(N=N, B=2.0 * B, K=K),
    "GM 15 s": NoiseModel(N=N, B=3.0 * B, T_B=15.0, K=K),
}
BIAS = math.radians(0.05)
"""Turn-on bias of the simulated runs, rad/s; the filter is told its standard deviation."""

CHUNK = 250
"""Runs that are drawn at once."""

PART = 1 << 23
"""Numbers in the states of the runs that are filtered at once."""

MOST_BLOCKS = 4096
PUBLISHED = {
    "1": 0.004396,
    "2": 0.0004846,
    "3": 0.002483,
    "4": -0.000193,
    "4, last 13 min": 0.001132,
}
"""Estimates that the paper prints, deg/s (003 section 6)."""


@dataclass
class Tally:
    """What the runs of a model have shown; errors as root mean squares, of the drift centred."""

    runs: int
    inside: dict[str, Array]
    mean: dict[str, Array]
    errors: dict[str, Array]


@dataclass
class Moments:
    """Sums of errors over runs, so that no run has to be kept."""

    number: int = 0
    total: Array | float = 0.0
    squares: Array | float = 0.0

    def add(self, errors: Array) -> None:
        """Count runs, shape (runs, epochs)."""
        self.number += len(errors)
        self.total = self.total + errors.sum(axis=0)
        self.squares = self.squares + (errors**2).sum(axis=0)

    @property
    def root_mean_square(self) -> Array:
        """Shape (epochs,)."""
        return np.sqrt(np.asarray(self.squares) / self.number)

    @property
    def deviation(self) -> Array:
        """Standard deviation, shape (epochs,)."""
        mean = np.asarray(self.total) / self.number
        return np.sqrt(np.asarray(self.squares) / self.number - mean**2)


def tallied(model: NoiseModel, one: RateFilter, runs: int, seed: int, after: slice) -> Tally:
    """Return what filter and pairs do in simulated runs."""
    blocks = one.blocks
    freedoms = {"NEES": count_states(one) + 1, "NEES of the rate": 1, "NIS": 1}
    epochs = len(blocks.start[after])
    at_once = max(PART // (len(blocks) * (count_states(one) + 2)), 1)
    inside = {name: np.zeros(epochs) for name in freedoms}
    mean = {name: np.zeros(epochs) for name in freedoms}
    errors = {name: Moments() for name in ("filter", "pairs", "A-B-A", "drift")}
    for rng in np.random.default_rng(seed).spawn(-(-runs // CHUNK)):
        drawn = simulate_runs(
            model, blocks, earth_rate=EARTH_RATE, turn_on_bias=BIAS, runs=CHUNK, rng=rng
        )
        for first in range(0, CHUNK, at_once):
            part = slice(first, first + at_once)
            means = drawn.means[part]
            found = one.run(means)
            for name, squares in of_part(found, drawn.states[part]).items():
                lower, upper = (float(chi2.ppf(level, freedoms[name])) for level in (0.025, 0.975))
                there = squares[:, after]
                inside[name] += ((there > lower) & (there < upper)).sum(axis=0)
                mean[name] += there.sum(axis=0) / freedoms[name]
            errors["filter"].add(found.rate - EARTH_RATE)
            errors["pairs"].add(by_pairs(means, blocks, model).rate - EARTH_RATE)
            errors["A-B-A"].add(by_triples(means, blocks, model).rate - EARTH_RATE)
            drift, sigma = one.smooth(found)
            errors["drift"].add((drift - drawn.drift[part]) / sigma)
    total = CHUNK * -(-runs // CHUNK)
    return Tally(
        total,
        {name: count / total for name, count in inside.items()},
        {name: count / total for name, count in mean.items()},
        {
            name: one.deviation if name == "drift" else one.root_mean_square
            for name, one in errors.items()
        },
    )


def count_states(one: RateFilter) -> int:
    """Return the number of states of the gyro's error."""
    return one.run(np.zeros((1, len(one.blocks)))).states.shape[2] - 2


def of_part(found: Filtered, states: Array) -> dict[str, Array]:
    """Return the squares that are compared with their bounds, each of shape (runs, b)."""
    return {
        "NEES": found.nees(EARTH_RATE, states),
        "NEES of the rate": found.rate_nees(EARTH_RATE),
        "NIS": found.nis,
    }


def of_model(name: str, model: NoiseModel, given: argparse.Namespace) -> Iterator[bool]:
    """Print what is asked of a model and what is found, and yield whether it is fulfilled."""
    design = design_paper_run(given.minutes)
    longest = choose_block_length(design, model)
    blocks = design.blocks(longest)
    one = RateFilter(blocks, model, turn_on_bias=BIAS)
    # From the second block of the second dwell on.
    after = slice(int(np.searchsorted(blocks.dwell, 1)) + 1, None)
    tally = tallied(model, one, given.runs, 1, after)
    pairs = by_pairs(np.zeros((1, len(blocks))), blocks, model)
    triples = by_triples(np.zeros((1, len(blocks))), blocks, model)
    print(
        f"\n{name}: {model.name}, {tally.runs} runs of {given.minutes:g} min, {len(design.dwells)} "
        f"dwells, {len(blocks)} blocks of up to {longest / PAPER_RATE:.3g} s, "
        f"{count_states(one)} states"
    )
    for what, part in tally.inside.items():
        text = (
            f"{100 * part.mean():.2f} % (epochs {100 * part.min():.1f} to {100 * part.max():.1f}), "
            f"mean {tally.mean[what].mean():.4f} of its freedom"
        )
        yield asked(
            f"{what} inside its 95 % bounds", "93 to 97 %", text, 0.93 <= part.mean() <= 0.97
        )
    deviations = {"filter": one.rate_sigma, "pairs": pairs.sigma, "A-B-A": triples.sigma}
    places = {"filter": after, "pairs": slice(0, None), "A-B-A": slice(0, None)}
    for what, sigma in deviations.items():
        ratio = tally.errors[what] / sigma
        inside = ratio[places[what]]
        yield asked(
            f"error over its sigma: {what}",
            "0.95 to 1.05",
            f"{ratio[-1]:.4f} at the end, {inside.min():.3f} to {inside.max():.3f} on the way",
            abs(ratio[-1] - 1.0) < 0.05,
        )
    drift = tally.errors["drift"]
    yield asked(
        "error over its sigma: smoothed drift",
        "0.95 to 1.05",
        f"{drift.mean():.4f}, {drift.min():.3f} to {drift.max():.3f}",
        abs(float(drift.mean()) - 1.0) < 0.05,
    )
    fine = design.blocks(max(longest // 2, 1))
    if len(fine) > MOST_BLOCKS:
        fine = blocks
    bound = float(compute_cramer_rao_bounds(fine, model, BIAS)[-1])
    ratio_to_bound = float(one.rate_sigma[-1]) / bound
    yield asked(
        f"sigma of the filter over the Cramér-Rao bound ({len(fine)} blocks)",
        "at most 1.02",
        f"{ratio_to_bound:.5f}",
        ratio_to_bound <= 1.02,
    )
    to_pairs = float(one.rate_sigma[-1] / pairs.sigma[-1])
    white = model.name == "N"
    yield asked(
        "sigma of the filter over that of the pairs (of A-B-A)",
        "1 (white)" if white else "below 1",
        f"{to_pairs:.4f} ({float(one.rate_sigma[-1] / triples.sigma[-1]):.4f})",
        abs(to_pairs - 1.0) < 1e-3 if white else to_pairs < 1.0,
    )
    minute = Experiment.regular(
        dwell=30.0, turning=ASSUMED_TURNING, dwells=2, rate=PAPER_RATE, latitude=ASSUMED_LATITUDE
    )
    of_minute = minute.blocks(min(longest, round(30.0 * PAPER_RATE)))
    least = N / math.sqrt(60.0) / math.cos(ASSUMED_LATITUDE)
    claims = [
        float(RateFilter(of_minute, model, turn_on_bias=bias).rate_sigma[-1]) / least
        for bias in (0.0, BIAS, 1.0)
    ]
    claims.append(
        float(by_pairs(np.zeros((1, len(of_minute))), of_minute, model).sigma[-1]) / least
    )
    yield asked(
        "sigma from 60 s over N / sqrt(60) / cos(latitude)",
        "at least 1",
        "filter "
        + ", ".join(f"{claim:.4f}" for claim in claims[:3])
        + f" (bias known, 0.05 deg/s, not known); pairs {claims[3]:.4f}",
        min(claims) >= 1.0 - 1e-9,
    )


def asked(what: str, wanted: str, found: str, fulfilled: bool) -> bool:
    """Print a line, and return whether it is fulfilled."""
    print(f"  {'ok ' if fulfilled else 'NOT'}  {what:68s} {wanted:14s} {found}", flush=True)
    return fulfilled


def samples_against_blocks() -> Iterator[bool]:
    """Print what block means lose against samples, in a run of 12 min."""
    print("\nblock means against samples, 12 min at 32 Hz")
    for name in ("paper", "K strong", "flicker", "GM 15 s"):
        design, model = design_paper_run(12.0), MODELS[name]
        longest = choose_block_length(design, model)
        of_means = RateFilter(design.blocks(longest), model).rate_sigma[-1]
        of_samples = RateFilter(design.blocks(1), model).rate_sigma[-1]
        loss = float(of_means / of_samples) - 1.0
        yield asked(
            f"{name}: loss by blocks of up to {longest / PAPER_RATE:.3g} s",
            "below 0.5 %",
            f"{100 * loss:.3f} %",
            -1e-6 < loss < 5e-3,
        )


def published() -> None:
    """Print what noise allows in the runs of the paper, and what it prints."""
    print(
        "\nThe runs of Silva et al. (deg/s), by its noise model; assumed, as the paper prints "
        f"neither: latitude {math.degrees(ASSUMED_LATITUDE):.1f} deg (Londrina), "
        f"{ASSUMED_TURNING:g} s of each {PAPER_PERIOD:g} s for turning; true rate "
        f"{math.degrees(EARTH_RATE):.6f}"
    )
    print(
        "run             printed  off by      sigma: white, pairs, A-B-A, filter    "
        "off, in sigma of the pairs (filter), of white noise"
    )
    for run, minutes in PAPER_MINUTES.items():
        blocks = design_paper_run(minutes).blocks(
            choose_block_length(design_paper_run(minutes), PAPER_MODEL)
        )
        nothing = np.zeros((1, len(blocks)))
        sigmas = [
            N / math.sqrt(blocks.time_in_blocks) / math.cos(ASSUMED_LATITUDE),
            float(by_pairs(nothing, blocks, PAPER_MODEL).sigma[-1]),
            float(by_triples(nothing, blocks, PAPER_MODEL).sigma[-1]),
            float(RateFilter(blocks, PAPER_MODEL).rate_sigma[-1]),
        ]
        white, pairs, triples, filtered = (math.degrees(sigma) for sigma in sigmas)
        off = PUBLISHED[run] - math.degrees(EARTH_RATE)
        print(
            f"{run:14s} {PUBLISHED[run]:8.6f} {off:+.6f}   {white:.6f} {pairs:.6f} {triples:.6f} "
            f"{filtered:.6f}   {off / pairs:+6.1f} ({off / filtered:+.1f}), {off / white:+.1f}"
        )
    print(
        "the same in sigma of the pairs, had the paper divided by the cosine of another latitude:"
    )
    for degrees in (0.0, 23.3, 40.0):
        scale = math.cos(math.radians(degrees)) / math.cos(ASSUMED_LATITUDE)
        offs = []
        for run, minutes in PAPER_MINUTES.items():
            blocks = design_paper_run(minutes).blocks(896)
            sigma = by_pairs(np.zeros((1, len(blocks))), blocks, PAPER_MODEL).sigma[-1] / scale
            offs.append((math.radians(PUBLISHED[run]) - EARTH_RATE) / sigma)
        print(f"  latitude {degrees:4.1f} deg: " + ", ".join(f"{off:+.1f}" for off in offs))


def outlook() -> None:
    """Print the prediction for the sensor of the paper, bias not known."""
    print("\nPrediction for the paper's gyro, bias not known, turns of 2 s")
    one = Outlook(PAPER_MODEL, ASSUMED_LATITUDE, ASSUMED_TURNING, PAPER_RATE)
    for relative in (1.0, 0.1, 0.01):
        turns = one.turns_needed(28.0, relative)
        assert turns is not None
        hours = one.run_time(28.0, turns) / 3600.0
        print(
            f"  {100 * relative:3.0f} % of the rate: {turns} turns, dwells of 28 s, {hours:.3f} h"
        )
    for minutes in (10.0, 60.0):
        curve = one.over_dwell(60.0 * minutes)
        best = curve.best
        near = curve.dwell[curve.nearly_best]
        least, of_one_turn = (math.degrees(curve.sigma[place]) for place in (best, 0))
        print(
            f"  best dwell in {minutes:g} min: {curve.dwell[best]:.1f} s ({curve.dwells[best]} "
            f"dwells), sigma {least:.6f} deg/s; with one turn {of_one_turn:.6f}; within 1 % of the "
            f"best from {near.min():.1f} to {near.max():.1f} s"
        )
    heading = one.sigmas_after(28.0, 119) / EARTH_RATE
    print(
        f"  heading by gyrocompassing: {math.degrees(heading[0]):.1f} deg after one turn, "
        f"{math.degrees(heading[-1]):.1f} deg after 1 h"
    )


def circular() -> None:
    """Print what the filter of the paper finds in a simulated run when it is given a rate."""
    print(
        "\nBias tracking with known rate (003 eq. 15, 16), a simulated run of 12 min, true rate 1"
    )
    design = design_paper_run(12.0)
    model = SensorModel(noise=PAPER_MODEL, bias=BIAS)
    log = simulate_log(
        model, design, earth_rate=EARTH_RATE, transient=0.0, rng=np.random.default_rng(1)
    )
    for unit, start in STARTS.items():
        for given in (0.0, 1.0, 2.0, -1.0):
            mean = track(log, design, PAPER_MODEL, given * EARTH_RATE, start).mean / EARTH_RATE
            print(
                f"  P_0 in {unit}, given {given:+.0f}: finds {mean[-1]:+.3f}; {mean[999]:+.3f} "
                "after 1,000 samples"
            )


def settling(runs: int = 100) -> None:
    """Print when the mean of that filter stays near what it was given, over simulated runs."""
    print(
        f"\nThe same, given the true rate, {runs} simulated runs: data after which the mean stays "
        "within a tenth of it (quartiles, s; inf: not by the end), and its sigma in deg/h"
    )
    model = SensorModel(noise=PAPER_MODEL, bias=BIAS)
    for run in ("2", "3", "4", "1"):
        design = design_paper_run(PAPER_MINUTES[run])
        rng = np.random.default_rng(int(run))
        logs = [
            simulate_log(model, design, earth_rate=EARTH_RATE, transient=0.0, rng=rng)
            for _ in range(runs)
        ]
        for unit, start in STARTS.items():
            times = [
                settled(
                    track(log, design, PAPER_MODEL, EARTH_RATE, start).mean, PAPER_RATE, EARTH_RATE
                )
                for log in logs
            ]
            quartiles = np.quantile(times, [0.25, 0.5, 0.75], method="inverted_cdf")
            sigma = mean_sigma(PAPER_MODEL, PAPER_RATE, 1000, start, BIAS)[-1]
            print(
                f"  run {run}, P_0 in {unit:8s}: {', '.join(f'{t:.0f}' for t in quartiles)}; "
                f"within 60 s in {sum(t <= 60.0 for t in times)}; after 1,000 samples "
                f"{math.degrees(sigma) * 3600:.2f} deg/h"
            )


def main() -> int:
    """Print the tables; return 1 if something that is asked is not fulfilled."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=4000)
    parser.add_argument("--minutes", type=float, default=30.0)
    given = parser.parse_args()
    fulfilled: list[bool] = []
    for name, model in MODELS.items():
        fulfilled += of_model(name, model, given)
    fulfilled += samples_against_blocks()
    published()
    outlook()
    circular()
    settling()
    print(f"\n{sum(fulfilled)} of {len(fulfilled)} fulfilled")
    return int(not all(fulfilled))


if __name__ == "__main__":
    sys.exit(main())
