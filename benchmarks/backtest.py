"""How often the back-test is right: on clean logs, and on logs with what no model describes.

python benchmarks/backtest.py [--logs 200] [--disturbed 60] [--real DIR]

Logs come from `simulators`, are estimated as the workflow does with its default settings, and are
held against the requirements that ship, by the step's own function.

Clean: the share of ratios within their ranges (95 % is claimed), above and below; and the share of
logs that are said to contradict their budgets, of which each is a false alarm (1 % is allowed).

Disturbed: noise of a random walk, flicker or white noise alone with a day's cycle, a warm-up or one
step, of a size that makes the error of a requirement 1.5 to 4 times that of the noise. Counted are
the errors whose true rms over the windows of the log, noise and disturbance, is 1.5 times the
budget that was estimated of that log, or more: how many are above their range, how many logs with
one of them contradict their budgets. Where the fit takes the disturbance for noise the budget grows
with it, and nothing is hidden: ``covered`` counts the errors of which this is so.

With --real, the folder of the results of a run, its table ``backtest`` is shown.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

import simulators
from imubench_pipeline.allan import cluster_sizes, of_blocks
from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.model.estimates import BacktestRow
from imubench_pipeline.navigation.backtest.comparison import list_backtest_rows
from imubench_pipeline.recordings.recording import LogWriter, open_channel_logs
from imubench_pipeline.settings.config import ErrorBudgetSettings, EstimateSettings
from imubench_pipeline.settings.requirements import read_requirements
from imubench_pipeline.steps.estimate import Estimation, estimate_channel
from imubench_pipeline.tables.files import build, read, write
from imubench_pipeline.tables.keys import Key

Array = NDArray[np.float64]
Row = Mapping[str, Any]

CHANNEL = "gyro_x"
N = 1e-4
GRAVITY = 9.80665
REQUIREMENTS = read_requirements(Path(__file__).parents[1] / "config/requirements")
KINDS = ("N", "N+K", "N+F", "N+GM+K")
DISTURBED = ("N", "N+K", "N+F")
DISTURBANCES = ("day cycle", "warm-up", "step")
HALF = 1.5
"""True error over the budget from which a log should be flagged."""

_ORDERS = {"attitude": 0, "heading": 0, "velocity": 1, "position": 2}


@dataclass(frozen=True)
class Simulated:
    """A log: its noise, and what is added to it."""

    kind: str
    rate: float
    noise: Array
    added: Array


def noise(kind: str, samples: int, rate: float, rng: np.random.Generator) -> Array:
    """Return noise of one kind, of random strength."""
    log = simulators.white(samples, rate, N, rng)
    if "F" in kind:
        # The curve levels off after 10 to 300 s.
        B = N / simulators.FLOOR / math.sqrt(10 ** rng.uniform(1.0, 2.5))
        log += simulators.fractional_flicker(samples, B, rng)
    if "GM" in kind:
        T_B = 10 ** rng.uniform(1.3, 2.3)
        B = 3.0 * N / math.sqrt(T_B) * 10 ** rng.uniform(-0.3, 0.3)
        log += simulators.gauss_markov(samples, rate, B, T_B, rng)
    if "K" in kind:
        log += simulators.random_walk(samples, rate, N / 10 ** rng.uniform(1.7, 2.7), rng)
    return log


def clean(number: int) -> Simulated:
    """Return a log of noise alone."""
    rng = np.random.default_rng([number, 5])
    kind = KINDS[number % len(KINDS)]
    rate, hours = float(rng.choice([2.0, 5.0, 20.0, 50.0])), float(rng.choice([1.0, 3.0, 6.0]))
    samples = round(rate * hours * 3600.0)
    return Simulated(kind, rate, noise(kind, samples, rate, rng), np.zeros(samples))


def disturbed(number: int, disturbance: str) -> Simulated:
    """Return a log of noise with something else."""
    rng = np.random.default_rng([number, DISTURBANCES.index(disturbance), 7])
    kind = DISTURBED[number % len(DISTURBED)]
    hours = float(rng.choice([24.0, 48.0] if disturbance == "day cycle" else [3.0, 6.0, 12.0]))
    rate = 2.0
    samples = round(rate * hours * 3600.0)
    stamps = np.arange(samples) / rate
    if disturbance == "day cycle":
        shape = np.sin(2.0 * math.pi * (stamps / 86400.0 + rng.uniform()))
    elif disturbance == "warm-up":
        shape = np.exp(-stamps / (60.0 * 10 ** rng.uniform(0.5, 1.7)))
    else:
        shape = (stamps > stamps[-1] * rng.uniform(0.1, 0.9)).astype(np.float64)
    made = noise(kind, samples, rate, rng)
    rest, moving, order = rng.choice(np.array([(30.0, 600.0, 0), (10.0, 60.0, 0), (5.0, 10.0, 2)]))
    of_noise, of_shape = (rms(one, rate, rest, moving, int(order)) for one in (made, shape))
    times = rng.uniform(1.5, 4.0)
    return Simulated(kind, rate, made, shape * math.sqrt(times**2 - 1.0) * of_noise / of_shape)


def rms(log: Array, rate: float, rest: float, moving: float, order: int) -> float:
    """Return the rms error of dead reckoning over windows at every sample, SI without gravity."""
    before, after = round(rest * rate), round(moving * rate)
    left = np.arange(after, -1, -1) / rate
    weights = -np.diff(left ** (order + 1)) / math.factorial(order + 1)
    weights = np.concatenate((np.full(before, -weights.sum() / before), weights))
    size = 1 << (len(log) + len(weights)).bit_length()
    product = np.fft.rfft(log - log[0], size) * np.conj(np.fft.rfft(weights, size))
    found = np.fft.irfft(product, size)[: len(log) - len(weights) + 1]
    return math.sqrt(float(np.mean(found**2)))


def tested(log: Simulated, number: int, folder: Path) -> list[Row]:
    """Return the rows of the table ``backtest`` that the workflow would make of a log."""
    samples = log.noise + log.added + 0.01
    with LogWriter(folder / "log.parquet", {CHANNEL: pa.float64()}) as writer:
        writer.write({CHANNEL: samples})
        writer.finish(
            {
                "rate": log.rate,
                "grid": len(samples),
                "segments": [[0, len(samples)]],
                "holes": {CHANNEL: False},
                "unusable": [],
            }
        )
    logs = open_channel_logs(folder)
    channel = logs[CHANNEL]
    sizes = cluster_sizes(len(samples), per_decade=10, longest=0.5)
    curve = of_blocks(
        channel.blocks(), len(samples), log.rate, sizes, holes=False, segments=channel.segments
    )
    rows = Estimation()
    key = Key("own", f"{number}", CHANNEL)
    estimate_channel(key, channel, curve, EstimateSettings(methods=("likelihood",)), None, rows)
    write("parameters", rows.parameters, folder / "parameters.parquet")
    write("draws", rows.draws, folder / "draws.parquet")
    estimates = read_recommended_estimates(folder / "parameters.parquet", folder / "draws.parquet")
    how, names = ErrorBudgetSettings(), {"sensor": "own", "recording": f"{number}"}
    found = list_backtest_rows(
        names, logs, estimates, REQUIREMENTS, rows.deterministic, draws=how.draws, seed=how.seed
    )
    made: list[Row] = build("backtest", found).to_pylist()
    return made


def exceeds(log: Simulated, row: Row) -> bool | None:
    """Tell whether the true error is well above the budget; None: the budget covers what is added.

    Parameters
    ----------
    log : Simulated
    row : mapping
        Of the table ``backtest``.
    """
    order = _ORDERS[row["error"]]
    asked = log.rate, row["window"], row["time"], order
    of_noise = rms(log.noise, *asked)
    true = math.hypot(of_noise, rms(log.added, *asked))
    unit = GRAVITY if order else 1.0
    if true < HALF * of_noise:
        return False
    return True if unit * true >= HALF * row["predicted"] else None


def share(part: int, whole: int) -> str:
    """Return a share with its numbers."""
    return f"{100.0 * part / whole:.1f} % ({part} of {whole})" if whole else "none"


def show_clean(number: int, folder: Path) -> None:
    """Print what comes of clean logs."""
    found: dict[str, list[list[Row]]] = {}
    hours: dict[float, list[list[Row]]] = {}
    for i in range(number):
        log = clean(i)
        rows = [row for row in tested(log, i, folder) if row["ratio"] is not None]
        found.setdefault(log.kind, []).append(rows)
        hours.setdefault(len(log.noise) / log.rate / 3600.0, []).append(rows)
    for name, logs in {
        "all": [rows for kind in found.values() for rows in kind],
        **found,
        **{f"{length:g} h": logs for length, logs in sorted(hours.items())},
    }.items():
        rows = [row for one in logs for row in one]
        verdicts = [row["verdict"] for row in rows]
        inside, above, below = (
            verdicts.count(f"{word} predicted") for word in ("as", "more than", "less than")
        )
        alarms = sum(any(row["contradicted"] for row in one) for one in logs)
        print(
            f"clean {name:8s} in range {share(inside, len(rows))}, above {share(above, len(rows))},"
            f" below {share(below, len(rows))}; contradicted logs {share(alarms, len(logs))}"
        )


def show_disturbed(number: int, disturbance: str, folder: Path) -> None:
    """Print what comes of logs with a disturbance."""
    counts = dict.fromkeys(("exceeding", "above", "logs", "contradicted", "covered"), 0)
    for i in range(number):
        log = disturbed(i, disturbance)
        rows = [row for row in tested(log, i, folder) if row["ratio"] is not None]
        much = [exceeds(log, row) for row in rows]
        counts["covered"] += much.count(None)
        over = [row for row, one in zip(rows, much, strict=True) if one]
        counts["exceeding"] += len(over)
        counts["above"] += sum(row["verdict"] == "more than predicted" for row in over)
        counts["logs"] += bool(over)
        counts["contradicted"] += bool(over) and any(row["contradicted"] for row in rows)
    print(
        f"{disturbance:10s} errors above their range {share(counts['above'], counts['exceeding'])};"
        f" logs that contradict their budgets {share(counts['contradicted'], counts['logs'])};"
        f" errors covered by the budget {counts['covered']}"
    )


def _describe(row: BacktestRow) -> str:
    """Return the measured over the predicted error of a row, or why there is none."""
    if row.ratio is None:
        return str(row.reason)
    return (
        f"{row.ratio:.2f} times the prediction at {row.time:g} s "
        f"(expected {row.ratio_lower:.2f} to {row.ratio_upper:.2f}), {row.windows} windows, "
        f"equivalent to {row.independent:.3g} independent ones"
    )


def lines(results: Path) -> Iterator[str]:
    """Yield what the table ``backtest`` of a run says."""
    for row in BacktestRow.rows_of(read("backtest", [results / "tables/backtest.parquet"])):
        yield (
            f"{row.sensor}/{row.recording} {row.channel} {row.error}: {_describe(row)}"
            + (f": {row.verdict}" if row.verdict else "")
            + (", contradicted" if row.contradicted else "")
        )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--disturbed", type=int, default=60)
    parser.add_argument("--real", type=Path)
    options = parser.parse_args(arguments)
    if options.real:
        print("\n".join(lines(options.real)))
        return
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        show_clean(options.logs, Path(folder))
        for disturbance in DISTURBANCES:
            show_disturbed(options.disturbed, disturbance, Path(folder))
    print(f"{time.process_time() - began:.0f} s of CPU time")


if __name__ == "__main__":
    main()
