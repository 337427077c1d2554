"""Bias at rest, rate table and alignment on simulated runs against what they say of themselves.

    python benchmarks/alignment_and_rate_table.py [--runs 20000]    (five minutes on one core)

The block means of the runs are drawn from their exact distribution. What is asked stands beside
what is found, and the exit status is 1 if something is not fulfilled. An interval of 95 % should
hold the truth in 93 to 97 % of the runs, an error should be 0.95 to 1.05 of its sigma (root mean
squares over the runs), NEES and NIS inside their two-sided 95 % bounds the same.

The gyro is the SiRRS01-03 of Silva et al. with the noise that they print; the accelerometer of its
triad is assumed to be that of the MTi-7 (Maia et al., Table 2), as they have none.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.alignment.accuracy import simulate_triad
from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles, matrix
from imubench_pipeline.extensions.calibration.alignment.coarse import (
    coarse_alignment,
    coarse_sigma,
    mean_vectors,
)
from imubench_pipeline.extensions.calibration.alignment.fine import FineAlignment, align
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.extensions.calibration.least_squares import Estimated
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.extensions.calibration.rate_table import fit_rate_table
from imubench_pipeline.extensions.calibration.schedule import Schedule
from imubench_pipeline.extensions.calibration.still import fit_bias_at_rest
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    PAPER_MODEL,
    PAPER_RATE,
    simulate_runs,
)
from imubench_pipeline.noise import NoiseModel

Array = NDArray[np.float64]

N, B, T_B, K = PAPER_MODEL.N, PAPER_MODEL.B, PAPER_MODEL.T_B, PAPER_MODEL.K
MODELS = {
    "paper": PAPER_MODEL,
    "white": NoiseModel(N=N),
    "K strong": NoiseModel(N=N, B=B, T_B=T_B, K=10.0 * K),
    "flicker strong": NoiseModel(N=N, B=2.0 * B, K=K),
    "GM 15 s": NoiseModel(N=N, B=3.0 * B, T_B=15.0, K=K),
}
BIAS = math.radians(0.3)
SCALE = 1.002
DEGREES = (0.0, 10.0, -10.0, 50.0, -50.0, 100.0, -100.0, 0.0)
"""Rates of the table, deg/s."""

SITE = Site(latitude=ASSUMED_LATITUDE, gravity=9.787)
ATTITUDE = matrix(math.radians(5.0), math.radians(-3.0), math.radians(40.0))
ACCELEROMETER = NoiseModel(N=9.6e-4, B=3.4e-4, T_B=38.3, K=1.7e-5)

CHUNK = 1000
"""Runs that are drawn at once."""

STEPS = 2
"""Corrections of the attitude of all runs by one filter, about the true attitude."""

ALIGNED = 2000
"""Most runs that are aligned one by one, with filters of their own."""

LINEAR = 0.3
"""Standard deviation up to which an angle is small, rad."""


def asked(what: str, wanted: str, found: str, fulfilled: bool) -> bool:
    """Print a line, and return whether it is fulfilled."""
    print(f"  {'ok ' if fulfilled else 'NOT'}  {what:66s} {wanted:14s} {found}", flush=True)
    return fulfilled


def near_one(what: str, ratio: float) -> bool:
    """Print a ratio of error and sigma, and return whether it is near 1."""
    return asked(
        f"error over its sigma: {what}", "0.95 to 1.05", f"{ratio:.4f}", abs(ratio - 1) < 0.05
    )


def covered(what: str, inside: NDArray[np.bool_]) -> bool:
    """Print how often an interval holds the truth, and return whether that is as often as said."""
    share = float(np.mean(inside))
    return asked(f"95 % {what}", "93 to 97 %", f"{100 * share:.2f} %", 0.93 <= share <= 0.97)


def at_rest(runs: int) -> Iterator[bool]:
    """Print the bias of runs at rest."""
    blocks = Experiment((Dwell(0, round(600 * PAPER_RATE), 1),), PAPER_RATE, 0.0).blocks(160)
    place = {"latitude": ASSUMED_LATITUDE, "elevation": 0.1}
    for name, model in MODELS.items():
        rng = np.random.default_rng(1)
        print(f"\nbias at rest, {name}: {model.name}, {runs} runs of 10 min, {len(blocks)} blocks")
        drawn = simulate_runs(model, blocks, earth_rate=0.0, turn_on_bias=0.0, runs=runs, rng=rng)
        present = BIAS + drawn.drift[:, -1]
        known = Pointing(heading=0.7, heading_sigma=0.05, **place)
        headings = 0.7 + 0.05 * rng.standard_normal(runs)
        rates = np.array([Pointing(heading=one, **place).rate for one in headings.tolist()])
        means = drawn.means + BIAS
        found = fit_bias_at_rest(blocks, means + rates[:, None], model, known)
        for what, one, true in (
            ("fixed bias", found.fixed, BIAS),
            ("bias at the end", found.present, present),
        ):
            text = f"{what}, sigma {3600 * math.degrees(one.sigma):.2f} deg/h"
            yield near_one(text, float(np.sqrt(np.mean((one.value - true) ** 2))) / one.sigma)
            yield covered(f"interval of the {what}", (one.lower < true) & (true < one.upper))
        yield asked(
            "runs whose scatter has a chance below 5 %",
            "4 to 6 %",
            f"{100 * np.mean(found.p_value < 0.05):.2f} %",
            abs(float(np.mean(found.p_value < 0.05)) - 0.05) < 0.01,
        )
        headings = rng.uniform(-math.pi, math.pi, runs)
        rates = np.array([Pointing(heading=one, **place).rate for one in headings.tolist()])
        unknown = Pointing(heading=None, **place)
        bound = fit_bias_at_rest(blocks, means + rates[:, None], model, unknown).fixed
        share = float(np.mean((bound.lower < BIAS) & (bound.upper > BIAS)))
        half = 3600 * math.degrees(float(bound.upper[0] - bound.lower[0]) / 2)
        yield asked(
            f"heading not known: interval, half width {half:.1f} deg/h",
            "at least 95 %",
            f"{100 * share:.2f} %",
            share >= 0.95 - 3.0 * math.sqrt(0.05 * 0.95 / runs),
        )


def on_the_table(runs: int) -> Iterator[bool]:
    """Print scale factor and bias of runs on a rate table."""
    rates = np.radians(DEGREES)
    steps = [(70.0 * i + 10.0, 70.0 * i + 70.0, rate) for i, rate in enumerate(rates.tolist())]
    schedule = Schedule.from_steps(steps, PAPER_RATE)
    blocks = schedule.experiment.blocks(160)
    up = Pointing(latitude=ASSUMED_LATITUDE, heading=None, elevation=math.pi / 2)
    true = schedule.of_blocks(blocks) + up.rate
    for name, model in MODELS.items():
        print(
            f"\nrate table, {name}: {model.name}, {runs} runs, {len(steps)} rates of 60 s up to "
            f"{max(DEGREES):g} deg/s, ramps of 10 s left out, {len(blocks)} blocks"
        )
        drawn = simulate_runs(
            model,
            blocks,
            earth_rate=0.0,
            turn_on_bias=0.0,
            runs=runs,
            rng=np.random.default_rng(2),
        )
        means = drawn.means + BIAS + SCALE * true
        found = fit_rate_table(schedule, blocks, means, model, up)
        assert found.quadratic and found.asymmetry and found.linearity
        for what, one, at in (
            ("bias", found.bias, BIAS),
            ("scale factor", found.scale_factor, SCALE),
            ("quadratic term", found.quadratic, 0.0),
            ("asymmetry", found.asymmetry, 0.0),
        ):
            text = f"{what} ({one.sigma:.3g})"
            yield near_one(text, float(np.sqrt(np.mean((one.value - at) ** 2))) / one.sigma)
            yield covered(f"interval of the {what}", (one.lower < at) & (at < one.upper))
        alarms = share_below_5_percent(found.linearity)
        yield asked(
            "straight lines that are doubted at 5 %",
            "4 to 6 %",
            f"{100 * alarms:.2f} %",
            abs(alarms - 0.05) < 0.01,
        )
        means += 4.0 * found.quadratic.sigma * true**2
        bent = fit_rate_table(schedule, blocks, means, model, up)
        assert bent.quadratic and bent.linearity
        curved, any_departure = map(share_below_5_percent, (bent.quadratic, bent.linearity))
        yield asked(
            "bends of four sigma that are found: quadratic term (any departure)",
            "at least 95 %",
            f"{100 * curved:.1f} % ({100 * any_departure:.1f} %)",
            curved > 0.95,
        )


def share_below_5_percent(estimated: Estimated) -> float:
    """Return the share of the runs with a p-value below 5 %."""
    assert estimated.p_value is not None
    return float(np.mean(estimated.p_value < 0.05))


How = Literal["together", "one by one", "not told"]
"""Runs whose coarse heading is nearly right share a filter; where it may be wrong by any angle each
has its own; or the heading is not told."""


def triads() -> Iterator[tuple[str, Triad, Positions, How]]:
    """Yield names, triads and positions, and how the runs are aligned."""
    better = NoiseModel(N=N / 500.0, B=B / 500.0, T_B=T_B, K=K / 500.0)
    flicker = NoiseModel(N=N / 500.0, B=B / 500.0, K=K / 500.0)
    bias = math.radians(0.1) / 3600.0
    good = Triad(
        gyros=[better] * 3,
        accelerometers=[ACCELEROMETER] * 3,
        gyro_bias=bias,
        accelerometer_bias=5e-3,
    )
    unlike = Triad(
        gyros=(better, flicker, NoiseModel(N=N / 250.0, K=K / 100.0)),
        accelerometers=(ACCELEROMETER, NoiseModel(N=2e-3, B=3e-4), NoiseModel(N=1e-3)),
        gyro_bias=bias,
        accelerometer_bias=5e-3,
    )
    one = Positions.at_rest(600.0, 20.0, PAPER_RATE)
    two = Positions.turned_about_z(
        [0.0, math.pi], dwell=290.0, turning=20.0, block=29.0, rate=PAPER_RATE
    )
    yield "a gyro 500 times as good, one position", good, one, "together"
    yield "the same, two opposite positions", good, two, "together"
    yield "unlike axes, one position", unlike, one, "together"
    yield "unlike axes, two positions", unlike, two, "together"
    paper = Triad(
        gyros=[PAPER_MODEL] * 3,
        accelerometers=[ACCELEROMETER] * 3,
        gyro_bias=BIAS,
        accelerometer_bias=0.02,
    )
    yield (
        "the paper's gyro, one position of an hour",
        paper,
        Positions.at_rest(3600.0, 30.0, PAPER_RATE),
        "not told",
    )
    yield (
        "the paper's gyro, an hour, turned end for end every 30 s",
        paper,
        Positions.turned_about_z(
            [0.0, math.pi] * 60, dwell=28.0, turning=2.0, block=28.0, rate=PAPER_RATE
        ),
        "one by one",
    )


def aligned(runs: int) -> Iterator[bool]:
    """Print coarse and fine alignment."""
    for name, triad, positions, how in triads():
        fine = FineAlignment(triad, positions, SITE, ATTITUDE)
        number = min(runs, ALIGNED) if how == "one by one" else runs
        print(f"\nalignment, {name}: {number} runs, {len(positions.blocks)} blocks")
        minutes = fine.positions.blocks.end / 60.0
        for place in np.searchsorted(minutes, minutes[-1] * np.array([0.1, 0.3, 1.0]) - 1e-9):
            roll, pitch, heading = np.degrees(fine.sigma[place])
            print(
                f"       sigma after {minutes[place]:5.1f} min: roll {roll:.5f}, pitch "
                f"{pitch:.5f}, heading {heading:.4f} deg"
            )
        if how == "not told":
            reasons = [one.reason for one in fine.not_observable]
            yield asked(
                "the heading is said not to be told", "yes", "; ".join(reasons), bool(reasons)
            )
            continue
        yield from of_triad(triad, positions, fine, number, how)


def of_triad(
    triad: Triad, positions: Positions, fine: FineAlignment, runs: int, how: How
) -> Iterator[bool]:
    """Print errors of alignment over what is said of them."""
    errors: dict[str, list[Array]] = {"coarse": [], "fine": [], "drift": []}
    nees, nis = [], []
    for rng in np.random.default_rng(3).spawn(-(-runs // CHUNK)):
        drawn = simulate_triad(triad, positions, SITE, ATTITUDE, runs=min(CHUNK, runs), rng=rng)
        attitude = coarse_alignment(*mean_vectors(drawn.means, positions), SITE)
        errors["coarse"].append(angle_errors(attitude))
        if how == "together":
            for _ in range(STEPS):
                found = fine.run(drawn.means, attitude)
                attitude = found.attitude
            drift = found.drift
            nis.append(found.nis[:, 3:])
        else:
            each = [align(means, triad, positions, SITE)[0] for means in drawn.means]
            attitude = np.concatenate([one.attitude for one in each])
            drift = np.concatenate([one.drift for one in each])
            nis.append(np.concatenate([one.nis for one in each])[:, 3:])
        errors["fine"].append(angle_errors(attitude))
        errors["drift"].append((drift - drawn.drift)[:, -1])
        psi = fine.run(drawn.means).psi[:, 2:]
        white = np.linalg.solve(fine.psi_covariance[2:], psi[..., None])[..., 0]
        nees.append(np.sum(white * psi, axis=2))
    size = {
        name: np.sqrt(np.mean(np.concatenate(one) ** 2, axis=0)) for name, one in errors.items()
    }
    coarse = coarse_sigma(triad, positions, SITE, ATTITUDE)
    for stage, sigmas in (("coarse", coarse), ("fine", fine.sigma[-1])):
        for angle, error, sigma in zip(
            ("roll", "pitch", "heading"), size[stage].tolist(), sigmas.tolist(), strict=True
        ):
            text = f"{stage} {angle} ({math.degrees(sigma):.4g} deg)"
            if sigma < LINEAR:
                yield near_one(text, error / sigma)
            else:
                print(f"       {text}: not told; the errors are no longer small")
    ratio = size["drift"] / fine.drift_sigma[-1]
    yield asked(
        "error over its sigma: drifts of the six axes at the end",
        "0.95 to 1.05",
        f"{ratio.min():.4f} to {ratio.max():.4f}",
        bool(np.all(np.abs(ratio - 1.0) < 0.05)),
    )
    for what, squares, freedom in (("NEES of the attitude", nees, 3), ("NIS", nis, 6)):
        lower, upper = (float(chi2.ppf(level, freedom)) for level in (0.025, 0.975))
        there = np.concatenate(squares)
        yield covered(f"bounds of the {what}", (lower < there) & (there < upper))


def angle_errors(attitude: Array) -> Array:
    """Return errors of roll, pitch and heading, rad, shape (runs, 3)."""
    error = euler_angles(attitude) - euler_angles(ATTITUDE)
    return np.asarray((error + math.pi) % (2.0 * math.pi) - math.pi)


def asymptotes() -> Iterator[bool]:
    """Print what an hour in one position leaves, against closed forms."""
    print("\nalignment: an hour in one position, level, x north, quiet sensors with fixed biases")
    bias, force = math.radians(0.01) / 3600.0, 2e-4
    triad = Triad(
        gyros=[NoiseModel(N=bias / 10.0)] * 3,
        accelerometers=[NoiseModel(N=1e-5)] * 3,
        gyro_bias=bias,
        accelerometer_bias=force,
    )
    sigma = FineAlignment(triad, Positions.at_rest(3600.0, 60.0, 1.0), SITE, np.eye(3)).sigma[-1]
    tilt = force / SITE.gravity
    east = bias / (EARTH_RATE * math.cos(SITE.latitude))
    for what, found, wanted in (
        ("roll over accelerometer bias / g", sigma[0], tilt),
        ("pitch over accelerometer bias / g", sigma[1], tilt),
        (
            "heading over gyro bias / (w_ie cos(L)), with tan(L) tilt",
            sigma[2],
            math.hypot(east, math.tan(SITE.latitude) * tilt),
        ),
    ):
        ratio = float(found / wanted)
        yield asked(what, "0.99 to 1.01", f"{ratio:.5f}", abs(ratio - 1.0) < 0.01)


def main() -> int:
    """Print the tables; return 1 if something that is asked is not fulfilled."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=20_000)
    given = parser.parse_args()
    fulfilled = [
        *at_rest(given.runs),
        *on_the_table(given.runs),
        *aligned(given.runs),
        *asymptotes(),
    ]
    print(f"\n{sum(fulfilled)} of {len(fulfilled)} fulfilled")
    return int(not all(fulfilled))


if __name__ == "__main__":
    sys.exit(main())
