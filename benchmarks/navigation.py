"""Filters tuned by what is known of a sensor, on simulated drives with outages of GNSS.

python benchmarks/navigation.py consistency [--runs 300]
python benchmarks/navigation.py speed
python benchmarks/navigation.py budget [--runs 300]
python benchmarks/navigation.py claim RESULTS SENSOR [...] [--runs 100]
    [--trajectories field car drone rest] [--simulated FILE]

``consistency``: the share of epochs in which NEES is within its 95 % bounds, by group of states,
with the true model; the exit status is 1 if one is not 93 to 97 %. ``speed``: 100 runs of 10 min
at 100 Hz. ``budget``: the error at the end of an outage of a vehicle at rest, over what the error
budget says: of a static window of 60 s, as reports have it, and of the state in which the filter
begins the outage; the exit status is 1 if that is off by more than 10 %. ``claim``: what each
tuning costs against the true model, of a sensor of a finished run. The gyro figures of the C102-F9R
taken for degrees are in `c102_f9r_in_degrees.yaml`, for a run with

    snakemake -c2 --config simulated=benchmarks/c102_f9r_in_degrees.yaml results=degrees logs=none
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.extensions.aided import navigate
from imubench_pipeline.extensions.aided.axis_states import AxisStates, make_axis_states
from imubench_pipeline.extensions.aided.error_state import GROUPS
from imubench_pipeline.extensions.aided.plan import dump_navigate_settings
from imubench_pipeline.extensions.aided.runs import (
    FIX_INTERVAL,
    Drive,
    compute_mean_squares,
    compute_nees_share,
    compute_root_mean_square,
    schedule_outages,
)
from imubench_pipeline.extensions.aided.settings import NavigateSettings
from imubench_pipeline.extensions.aided.trajectories import (
    TRAJECTORY_NAMES,
    Signals,
    Spreads,
    simulate_signals,
    simulate_trajectory,
)
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.growth import Uncalibrated
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.simulate.model import SensorModel

GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
ACCEL = NoiseModel(N=9.6e-4, B=3.4e-4, T_B=38.3, K=1.7e-5)
"""MTi-7 of 000's Table 2."""

SPREADS = Spreads(1.75e-3, 0.03)
RATE, DURATION = 100.0, 600.0
LENGTHS = (10.0, 30.0, 60.0)
CORES = len(os.sched_getaffinity(0))


def models(*, flicker: bool = False) -> dict[str, NoiseModel]:
    """Return the noise of the six axes."""
    of = {"gyro": GYRO, "accel": ACCEL}
    if flicker:
        of = {name: replace(model, T_B=None) for name, model in of.items()}
    return {channel: of[channel.split("_")[0]] for channel in CHANNELS}


def states(noise: dict[str, NoiseModel], shortest: float = FIX_INTERVAL) -> list[AxisStates]:
    """Return the states of a filter with the true model."""
    return [
        make_axis_states(
            noise[channel],
            RATE,
            turn_on=SPREADS.bias(channel),
            shortest=shortest,
            longest=DURATION,
        )
        for channel in CHANNELS
    ]


def of_run(drive: Drive, noise: dict[str, NoiseModel], name: str, number: int) -> Signals:
    """Return the signals of a run."""
    axes = {channel: SensorModel(noise=model) for channel, model in noise.items()}
    return simulate_signals(drive.trajectory, axes, SPREADS, drive.every, 1, (name, str(number)))


def consistency(runs: int) -> int:
    """Print the shares of NEES within its bounds."""
    failed = 0
    print("| trajectory | bias instability | epochs | " + " | ".join(GROUPS) + " |")
    print("|---" * (3 + len(GROUPS)) + "|")
    for name in TRAJECTORY_NAMES:
        for flicker in (False, True):
            noise = models(flicker=flicker)
            drive = Drive(
                simulate_trajectory(name, DURATION, RATE), schedule_outages(DURATION, LENGTHS)
            )
            # Biases are those of a bank: the states of flicker noise follow it to the sample.
            tuned = {"true": states(noise, 1.0 / RATE if flicker else FIX_INTERVAL)}
            outcome = drive.repeat(tuned, partial(of_run, drive, noise, name), runs, CORES)["true"]
            for length in (None, *LENGTHS):
                shares = [compute_nees_share(drive, outcome, group, length) for group in GROUPS]
                told = [share for share in shares if share is not None]
                failed += sum(not 0.93 <= share.value <= 0.97 for share in told)
                cells = [f"{100 * s.value:.1f} ± {100 * s.error:.1f}" if s else "–" for s in shares]
                epochs = "with GNSS" if length is None else f"outage of {length:g} s"
                kind = "flicker" if flicker else "Gauss-Markov"
                print(f"| {name} | {kind} | {epochs} | " + " | ".join(cells) + " |", flush=True)
    print(f"{failed} shares outside of 93 to 97 %")
    return int(failed > 0)


def speed() -> int:
    """Print the time of 100 runs."""
    for flicker in (False, True):
        noise = models(flicker=flicker)
        drive = Drive(
            simulate_trajectory("field", DURATION, RATE), schedule_outages(DURATION, LENGTHS)
        )
        tuned = {"true": states(noise)}
        drive.repeat(tuned, partial(of_run, drive, noise, "field"), 1)
        begun, cpu = time.perf_counter(), time.process_time()
        outcome = drive.repeat(tuned, partial(of_run, drive, noise, "field"), 100, CORES)
        took, used = time.perf_counter() - begun, time.process_time() - cpu
        print(
            f"100 runs of 10 min at 100 Hz, {outcome['true'].states} states: {took:.1f} s on "
            f"{CORES} cores, {used:.1f} s of CPU"
        )
    return 0


def predicted_by_filter(
    drive: Drive, noise: dict[str, NoiseModel], begin: float, t: float
) -> float:
    """Return the rms position error in the plane after t s, by the budget from the filter's state.

    The covariance with which the filter begins, of position, velocity, specific force and rate of
    a horizontal axis, grows with 1, t, t^2 / 2 and g t^3 / 6; what the terms add since then is that
    of the error budget, a Gauss-Markov process being a walk with the same drive since it is known.
    """
    whole = drive.trajectory
    until = round(begin * whole.sampling)
    cut = replace(
        whole,
        position=whole.position[: until + 1],
        velocity=whole.velocity[: until + 1],
        attitude=whole.attitude[: until + 1],
        rate=whole.rate[:until],
        force=whole.force[:until],
    )
    before = Drive(cut, [])
    stacked = before.stacked(states(noise))
    P = before.filter(stacked, of_run(before, noise, "start", 0))[3]
    first, g = stacked.first, STANDARD_GRAVITY
    square = 0.0
    for axis in range(2):  # north with the tilt about east, east with that about north
        h = np.zeros(len(P))
        sign = 1.0 if axis == 0 else -1.0
        gyro, accel = 1 - axis, 3 + axis
        h[axis], h[3 + axis] = 1.0, t
        h[7 - axis] = -sign * g * t**2 / 2.0
        for sensor, lever in ((gyro, sign * g * t**3 / 6.0), (accel, -(t**2) / 2.0)):
            own = slice(9 + first[sensor], 9 + first[sensor + 1])
            h[own] += lever * stacked.output[first[sensor] : first[sensor + 1]]
        square += float(h @ P @ h)
    start = Start(
        gyro=Uncalibrated(bias=0.0, on_time=0.0),
        accel=Uncalibrated(bias=0.0, on_time=0.0),
        tilt=0.0,
    )
    driven = []
    for model in (noise["gyro_x"], noise["accel_x"]):
        process = GaussMarkov(model.B, model.T_B or 1.0)
        driven.append(NoiseModel(N=model.N, K=math.hypot(model.K, math.sqrt(process.density))))
    grown = budget("position", t, gyro=driven[0], accel=driven[1], start=start).total
    return math.sqrt(square + 2.0 * grown**2)


def of_budget(runs: int) -> int:
    """Print errors at the end of outages over what the error budget says of them."""
    noise, failed = models(), 0
    begin = 240.0
    print(
        "| outage | rms position, m | filter expects | budget from its start | over rms | "
        "budget of a window of 60 s | over rms |"
    )
    print("|---" * 7 + "|")
    for length in LENGTHS:
        drive = Drive(simulate_trajectory("rest", begin + length, RATE), [(begin, length)])
        outcome = drive.repeat(
            {"true": states(noise)}, partial(of_run, drive, noise, "rest"), runs, CORES
        )["true"]
        size = compute_root_mean_square(compute_mean_squares(drive, outcome, "position", length))[0]
        expected = math.sqrt(float(np.mean(outcome.variances[:, -1, :2].sum(axis=1))))
        started = predicted_by_filter(drive, noise, begin, length)
        window = (
            math.sqrt(2.0)
            * budget(
                "position",
                length,
                gyro=noise["gyro_x"],
                accel=noise["accel_x"],
                start=Start.calibrated(60.0),
            ).total
        )
        failed += abs(started / size - 1.0) > 0.1
        cells = [size, expected, started, started / size, window, window / size]
        print(f"| {length:g} s | " + " | ".join(f"{cell:.3g}" for cell in cells) + " |", flush=True)
    return int(failed > 0)


def claim(results: Path, sensors: list[str], how: NavigateSettings, simulated: str | None) -> int:
    """Print what tunings cost against the true model."""
    plan = Plan({"results": str(results)} | ({"simulated": simulated} if simulated else {}))
    for sensor in sensors:
        folders = sorted(
            folder
            for folder in (results / "recordings" / sensor).iterdir()
            if (folder / "parameters.parquet").is_file()
        )
        sections = json.loads(dump_navigate_settings(plan, sensor))
        sections |= {"navigate": how.model_dump(mode="json", exclude={"of"}), "asked": []}
        print(f"\n### {sensor}\n")
        print(
            "| signals | trajectory | outage | tuning | states | position, m | over true | "
            "heading, ° | over true | filter expects, m | NEES inside |"
        )
        print("|---" * 11 + "|")
        for row in navigate.navigate(folders, sensor, json.dumps(sections)):
            begun = [row.signals or "–", row.trajectory or "–"]
            if row.position is None:
                print("| " + " | ".join([*begun, "", f"{row.tuning}: {row.reason}"]) + " |")
                continue
            cells = [
                *begun,
                "none" if row.outage is None else f"{row.outage:g} s",
                row.tuning,
                str(row.states),
                figure(row, "position", 1.0),
                figure(row, "position_ratio", 1.0),
                figure(row, "heading", 180.0 / math.pi),
                figure(row, "heading_ratio", 1.0),
                f"{row.position_predicted:.3g}",
                f"{row.nees_inside:.3f} ± {row.nees_error:.3f}",
            ]
            print("| " + " | ".join(cells) + " |", flush=True)
    return 0


def figure(row: TableRow, name: str, factor: float) -> str:
    """Return a figure of a row with its limits."""
    if getattr(row, name) is None:
        return "–"
    value, low, high = (factor * getattr(row, f"{name}{end}") for end in ("", "_lower", "_upper"))
    return f"{value:.3g} ({low:.3g}–{high:.3g})"


def main() -> int:
    """Run what is asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    what = parser.add_subparsers(dest="what", required=True)
    for name, runs in (("consistency", 300), ("budget", 300)):
        what.add_parser(name).add_argument("--runs", type=int, default=runs)
    what.add_parser("speed")
    of_claim = what.add_parser("claim")
    of_claim.add_argument("results", type=Path)
    of_claim.add_argument("sensors", nargs="+")
    of_claim.add_argument("--runs", type=int, default=100)
    of_claim.add_argument(
        "--trajectories", nargs="+", default=list(TRAJECTORY_NAMES), choices=TRAJECTORY_NAMES
    )
    of_claim.add_argument("--simulated", help="list of the simulated recordings of that run")
    given = parser.parse_args()
    if given.what == "consistency":
        return consistency(given.runs)
    if given.what == "speed":
        return speed()
    if given.what == "budget":
        return of_budget(given.runs)
    how = NavigateSettings(
        trajectories=tuple(given.trajectories), duration="600 s", rate="100 Hz", runs=given.runs
    )
    return claim(given.results, given.sensors, how, given.simulated)


if __name__ == "__main__":
    sys.exit(main())
