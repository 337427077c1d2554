"""How often a user gets a wrong number that nothing warns of: the silent error rate.

python benchmarks/silent_errors.py [--logs 50] [--case NAME ...] [--first 0] [--processes 2]
    [--output judged.csv] [--log I]

Logs of known truth (`silent_cases`; none is made by code of the package) are written as CSV with a
sensor file that says no more than it must, and the steps of the workflow run on them as they are,
at the default configuration. Then every parameter of every method is judged:

silent
    a value more than twice off, more than two widths of its interval outside of its interval, or
    given where there is nothing; with status ``ok``, the model of the channel explained, and no
    finding that bears on it. Also ``absent`` with an upper limit below half of the truth.
loud
    the same with another status, a model that is not explained, or a finding that bears on it.
refused
    no value where there is one: absent, not identified, not shown.
right
    a value that is none of these, with status ``ok``.
doubted
    such a value with another status.
none
    no value where there is nothing.
failed
    a step ended with an error, or the recording was rejected.

The model of the channel is the chosen one; for method ``likelihood_gm``, which has the papers'
terms always, it is that of these terms where it is among the candidates. Method ``low_pass`` is the
table of that name, with N before the filter, and ``cutoff``. A log is silently wrong where a
parameter of the recommended method is.

A finding bears on what it speaks of. One of severity ``warning`` or ``fatal``, about the channel or
the whole recording, bears on all parameters, except for those that say how something was dealt
with so that the figures hold, and those that speak of white or of slow noise alone: `BEARS_ON` has
them. Notes bear on nothing, but for that of a recording too short for slow noise.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from scipy.stats import beta

from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables.files import read
from silent_cases import CASES, CLEAN, FILTERED, NOTHING, Log, Truth
from workflow_steps import OneRecording

ALL = frozenset({"N", "N_sensor", "B", "B_curve", "T_B", "K", "Q", "R", "cutoff"})
SLOW = frozenset({"B", "B_curve", "T_B", "K", "R"})

BEARS_ON: Mapping[str, frozenset[str]] = {
    # What is missing, late or left out is accounted for: the figures are meant to hold.
    "missing_samples": frozenset(),
    "empty_cells": frozenset(),
    "not_finite": frozenset(),
    "repeated_stamps": frozenset(),
    "missing_stamps": frozenset(),
    "jittered_stamps": frozenset(),
    "rate_contradicts_stamps": frozenset(),
    "segments": frozenset(),
    "unequal_length": frozenset(),
    "knocks": frozenset({"N"}),
    # White noise does not move the mean.
    "step": SLOW,
    "warm_up": SLOW,
    "bias_step": SLOW,
    "warm_up_drift": SLOW,
    "periodic_drift": SLOW,
    "telegraph_noise": SLOW,
    # Nor does a changing variance make a process.
    "truncated": frozenset({"N", "Q"}),
    # Of the unit, and not of the noise.
    "suspicious_unit": frozenset(),
    "gravity_norm": frozenset(),
    # A note; others only tell what is there, such as the step of a register.
    "short_recording": SLOW,
}
"""The parameters on which a finding bears; of others: all if it is a warning, none if a note."""

CLASSES = ("silent", "loud", "refused", "right", "doubted", "none", "failed")
_TELLING = 20.0
"""s between two words about how far a run is."""

IDENTIFIED = 0.2
"""Least relative standard error of a parameter, by the Cramér-Rao bound of the true model, up to
which a log is meant to give it."""

SHOWN = ("N", "N_sensor", "B", "B_curve", "T_B", "K", "Q", "R")


@dataclass(frozen=True)
class Judged:
    """A parameter of a method in one log, and what is to be thought of it."""

    case: str
    log: int
    method: str
    recommended: bool
    component: int
    parameter: str
    judgement: str
    truth_low: float
    truth_high: float
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    bound: float | None = None
    status: str = ""
    reason: str = ""
    model: str = ""
    verdict: str = ""
    warned_by: str = ""


def rng_of(case: str, number: int) -> np.random.Generator:
    """Return the random numbers of a log, which no other case or log has."""
    return np.random.default_rng([zlib.crc32(case.encode()), number])


# The steps, as a user has them


def tables_of(
    log: Log, folder: Path, spent: dict[str, float] | None = None
) -> dict[str, list[Any]]:
    """Run the steps on a log and return the rows of its tables.

    Parameters
    ----------
    log : Log
    folder : Path
        An empty one, for log, sensor file and results.
    spent : dict, optional
        Takes the time of each step, s.

    Returns
    -------
    dict
        ``parameters``, ``models``, ``findings`` and ``low_pass``; nothing of a rejected recording.
    """
    clock = _Clock({} if spent is None else spent)
    run = OneRecording(_written(log, folder))
    clock.done("write")
    for step in ("ingest", "allan", "estimate"):
        run.run(step)
        clock.done(step)
    joined = [folder / f"{name}.parquet" for name in ("parameters", "models", "findings")]
    joined.append(folder / "low_pass.parquet")
    run.run("sensor_tables", input=run.input("sensor_tables"), output=joined)
    clock.done("sensor_tables")
    found = {path.stem: read(path.stem, [path]).to_pylist() for path in joined}
    if not Quality.read(run.folder / "quality.json").channels:
        found["parameters"] = []
    return found


def _written(log: Log, folder: Path) -> Plan:
    """Write a log and a sensor file as a user has them, and return the plan of a run."""
    logs, sensors = folder / "logs/simulated", folder / "sensors"
    logs.mkdir(parents=True)
    sensors.mkdir()
    columns = {"a": log.samples} if log.stamps is None else {"t": log.stamps, "a": log.samples}
    pyarrow.csv.write_csv(pa.table(columns), logs / "log.csv")
    time_base = f"rate: {log.rate!r} Hz" if log.stamps is None else "time: {column: t, unit: s}"
    unit = "rad/s" if log.quantity == "gyro" else "m/s^2"
    (sensors / "simulated.yaml").write_text(
        f"vendor: nobody\nmodel: simulated\nlog:\n  {time_base}\n  channels:\n"
        f"    {log.quantity}_x: {{column: a, unit: {unit}}}\n",
        encoding="utf-8",
    )
    folders = {"logs": logs.parent, "sensors": sensors, "results": folder / "results"}
    given = {name: str(path) for name, path in folders.items()}
    return Plan(given | {"simulated": "false", "requirements": "false"})


class _Clock:
    """Adds up what each step takes."""

    def __init__(self, spent: dict[str, float]) -> None:
        self._spent, self._last = spent, time.perf_counter()

    def done(self, step: str) -> None:
        now = time.perf_counter()
        self._spent[step] = self._spent.get(step, 0.0) + now - self._last
        self._last = now


# The judge


def judge(case: str, number: int, log: Log, tables: Mapping[str, list[Any]]) -> Iterator[Judged]:
    """Judge the parameters that the tables of a log hold.

    Parameters
    ----------
    case : str
    number : int
        Of the log.
    log : Log
        Has the truth.
    tables : mapping of str to list of dict
        As `tables_of` returns them.
    """
    verdicts = {row["model"]: row["verdict"] for row in tables["models"]}
    chosen = next((row for row in tables["models"] if row["chosen"]), None)
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = defaultdict(list)
    for row in tables["parameters"]:
        groups[row["method"], row["parameter"]].append(_upwards(row))
    for row in tables["low_pass"]:
        if row["parameter"] == "cutoff":
            more = {"method": "low_pass", "recommended": False, "component": 1, "model": None}
            groups["low_pass", row["parameter"]].append(row | more)
    for (method, parameter), rows in groups.items():
        truth = log.truth.get(parameter)
        if truth is None:
            continue
        verdict = chosen["verdict"] if chosen else ""
        if method == "likelihood_gm":
            verdict = verdicts.get(rows[0]["model"], verdict)
        warned = [row["finding"] for row in tables["findings"] if bears(row, parameter)]
        warned += ["not explained"] if verdict == "not explained" else []
        for row, expected in _matched(rows, truth):
            yield Judged(
                case=case,
                log=number,
                method=method,
                recommended=row["recommended"],
                component=row["component"],
                parameter=parameter,
                judgement=judgement(row, expected, warned=bool(warned)),
                truth_low=expected.low,
                truth_high=expected.high,
                value=row["value"],
                lower=row["lower"],
                upper=row["upper"],
                bound=log.bounds.get(parameter),
                status=row["status"],
                reason=row["reason"] or "",
                model=row["model"] or "",
                verdict=verdict,
                warned_by=", ".join(dict.fromkeys(warned)),
            )


def _upwards(row: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a row with a value above 0: a ramp may fall."""
    if row["value"] is None or row["value"] >= 0.0:
        return row
    ends = [None if row[name] is None else -row[name] for name in ("upper", "lower")]
    return {**row, "value": -row["value"], "lower": ends[0], "upper": ends[1]}


def bears(finding: Mapping[str, Any], parameter: str) -> bool:
    """Return whether a finding warns of a parameter.

    Parameters
    ----------
    finding : mapping
        A row of the table ``findings``.
    parameter : str
    """
    otherwise = frozenset() if finding["severity"] == "note" else ALL
    return parameter in BEARS_ON.get(finding["finding"], otherwise)


def _matched(
    rows: Sequence[Mapping[str, Any]], truth: Truth
) -> Iterator[tuple[Mapping[str, Any], Truth]]:
    """Yield each component with its truth: of one process, all but the nearest are too many."""
    given = [row for row in rows if row["value"] is not None]
    several = truth.low < truth.high
    nearest: Mapping[str, Any] | None = None
    if given and not truth.nothing:
        nearest = min(given, key=lambda row: abs(np.log(max(row["value"] / truth.high, 1e-9))))
    for row in rows:
        if row["value"] is None and (row["component"] > 1 or (given and not truth.nothing)):
            continue  # another component tells it
        alone = several or nearest is None or row is nearest
        yield row, truth if alone or row["value"] is None else NOTHING


def judgement(row: Mapping[str, Any], truth: Truth, *, warned: bool) -> str:
    """Return what is to be thought of a value, or of none.

    Parameters
    ----------
    row : mapping
        With ``value``, ``lower``, ``upper`` and ``status``.
    truth : Truth
    warned : bool
        The model is not explained, or a finding bears on the parameter.
    """
    value = row["value"]
    if value is None:
        if truth.nothing:
            return "none"
        if (
            row["status"] == "absent"
            and row["upper"] is not None
            and row["upper"] < 0.5 * truth.low
        ):
            return "loud" if warned else "silent"
        return "refused"
    if not is_wrong(row, truth):
        return "right" if row["status"] == "ok" else "doubted"
    return "loud" if warned or row["status"] != "ok" else "silent"


def is_wrong(row: Mapping[str, Any], truth: Truth) -> bool:
    """Return whether a value is wrong: twice off, two widths outside its interval, or of nothing.

    Parameters
    ----------
    row : mapping
        With ``value``, ``lower`` and ``upper``.
    truth : Truth
    """
    value, lower, upper = row["value"], row["lower"], row["upper"]
    if truth.nothing or not 0.5 * truth.low <= value <= 2.0 * truth.high:
        return True
    if truth.loose or lower is None or upper is None:
        return False
    # A value in the range of what counts as the truth is right, however narrow its interval.
    far = 2.0 * (upper - lower)
    outside = truth.low > upper + far or truth.high < lower - far
    return outside and not truth.low <= value <= truth.high


# A run


def of_log(task: tuple[str, int]) -> tuple[str, int, list[Judged], dict[str, float], str]:
    """Return the judgements of one log, what its steps took in s, and the error that ended them."""
    case, number = task
    spent: dict[str, float] = {}
    begun = time.perf_counter()
    log = CASES[case](rng_of(case, number))
    spent["simulate"] = time.perf_counter() - begun
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of Python's: a user's log has them; doubts are judged
        try:
            found = list(judge(case, number, log, tables_of(log, Path(folder), spent)))
            error = "" if found else "rejected"
        except Exception:
            found, error = [], traceback.format_exc()
    if error:
        found = [
            Judged(case, number, "likelihood", True, 1, name, "failed", truth.low, truth.high)
            for name, truth in log.truth.items()
            if name in SHOWN
        ]
    return case, number, found, spent, error


def limits(wrong: int, number: int) -> tuple[float, float]:
    """Return the 95 % limits of Clopper and Pearson of a share."""
    low = beta.ppf(0.025, wrong, number - wrong + 1) if wrong else 0.0
    high = beta.ppf(0.975, wrong + 1, number - wrong) if wrong < number else 1.0
    return float(low), float(high)


def share(wrong: int, number: int) -> str:
    """Return a share with its limits, in words."""
    low, high = limits(wrong, number)
    return (
        f"{wrong} of {number}, {100 * wrong / max(number, 1):.2f} % "
        f"(95 %: {100 * low:.2f} to {100 * high:.2f} %)"
    )


def case_table(judged: Sequence[Judged]) -> Iterator[str]:
    """Yield a line a case: what the recommended method says of each parameter."""
    own = [one for one in judged if one.recommended]
    yield (
        "recommended method; silent/loud/refused/right of the logs, then doubted where there are, "
        "and none (-) where there is nothing"
    )
    yield f"{'case':26}{'logs':>5}{'silent':>8}  " + "".join(f"{name:15}" for name in SHOWN)
    for case in dict.fromkeys(one.case for one in own):
        rows = [one for one in own if one.case == case]
        logs = {one.log for one in rows}
        silent = {one.log for one in rows if one.judgement == "silent"}
        cells = "".join(f"{_cell(rows, name):15}" for name in SHOWN)
        yield f"{case:26}{len(logs):5d}{100 * len(silent) / len(logs):7.1f} %  {cells}"


def _cell(rows: Iterable[Judged], parameter: str) -> str:
    counts = Counter(row.judgement for row in rows if row.parameter == parameter)
    if not counts:
        return ""
    text = "/".join(str(counts[name]) for name in ("silent", "loud", "refused", "right"))
    text += f" d{counts['doubted']}" if counts["doubted"] else ""
    text += f" f{counts['failed']}" if counts["failed"] else ""
    return text + (f" -{counts['none']}" if counts["none"] else "")


def method_table(judged: Sequence[Judged]) -> Iterator[str]:
    """Yield a line a method and parameter, over all cases."""
    yield f"{'method':16}{'':8}" + "".join(f"{name:>9}" for name in CLASSES) + "  silent %"
    counts: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for one in judged:
        counts[one.method, one.parameter][one.judgement] += 1
    for (method, parameter), found in counts.items():
        cells = "".join(f"{found[name]:9d}" for name in CLASSES)
        yield f"{method:16}{parameter:8}{cells}{100 * found['silent'] / found.total():9.2f}"


def summary(judged: Sequence[Judged]) -> Iterator[str]:
    """Yield the silent error rate over all, and how many values are right in the clean cases."""
    own = [one for one in judged if one.recommended]
    logs = {(one.case, one.log) for one in own}
    silent = {(one.case, one.log) for one in own if one.judgement == "silent"}
    yield f"logs with a silent error, recommended method: {share(len(silent), len(logs))}"
    methods = dict.fromkeys(one.method for one in judged)
    for method in methods:
        theirs = [one for one in judged if one.method == method]
        there = {(one.case, one.log) for one in theirs}
        wrong = {(one.case, one.log) for one in theirs if one.judgement == "silent"}
        yield f"  {method}: {share(len(wrong), len(there))}"
    values = [one for one in own if one.value is not None]
    alone = sum(one.judgement == "silent" for one in values)
    yield f"values with a silent error, recommended method: {share(alone, len(values))}"
    clean = [one for one in own if one.case in CLEAN]
    for name in ("N", "B", "B_curve", "T_B", "K"):
        told = [one for one in clean if one.parameter == name and one.truth_high > 0.0]
        if told:
            there = {(one.case, one.log) for one in told}
            right = {(one.case, one.log) for one in told if one.judgement == "right"}
            warned = {(one.case, one.log) for one in told if one.warned_by}
            known = {(one.case, one.log) for one in told if (one.bound or 0.0) <= IDENTIFIED}
            text = f"clean cases, {name} right and ok: {share(len(right & known), len(known))}"
            text += f" that can be told to {100 * IDENTIFIED:.0f} %; of all "
            yield f"{text}{share(len(right), len(there))}; warned of: {len(warned)}"


def filter_summary(judged: Sequence[Judged]) -> Iterator[str]:
    """Yield how well N, N before a low-pass, and its cut-off, are known in the cases with one."""
    behind = [one for one in judged if one.case in FILTERED and one.method != "likelihood_gm"]
    for name in ("N", "N_sensor"):
        found = [one for one in behind if one.method == "likelihood" and one.parameter == name]
        values = [one.value / one.truth_high - 1.0 for one in found if one.value is not None]
        limited = [one for one in found if one.lower is not None and one.upper is not None]
        if values and limited:
            near = sum(abs(value) <= 0.03 for value in values)
            covered = sum(
                (one.lower or 0.0) <= one.truth_high <= (one.upper or 0.0) for one in limited
            )
            given, held = share(len(values), len(found)), share(covered, len(limited))
            yield f"behind a low-pass, {name}: given in {given}"
            yield f"  within 3 % {share(near, len(values))}; covered {held}"
    cutoffs = [one for one in behind if one.parameter == "cutoff"]
    if cutoffs:
        told = sum(one.judgement == "right" for one in cutoffs)
        yield f"behind a low-pass, cut-off told: {share(told, len(cutoffs))}"


def silent_list(judged: Iterable[Judged]) -> Iterator[str]:
    """Yield a line a silent error of the recommended method, enough to make it again."""
    for one in judged:
        if one.recommended and one.judgement == "silent":
            truth = f"{one.truth_low:.4g}"
            truth += f" to {one.truth_high:.4g}" if one.truth_high > one.truth_low else ""
            value = f"{one.value:.4g}" if one.value is not None else one.status
            yield (
                f"--case {one.case} --log {one.log}: {one.parameter}{_place(one)} {value} "
                f"({_limit(one.lower)} to {_limit(one.upper)}), truth {truth}, model {one.model}"
            )


def _place(one: Judged) -> str:
    return f" of component {one.component}" if one.component > 1 else ""


def _limit(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def details(case: str, number: int) -> Iterator[str]:
    """Yield all that the tables say of one log, and what is thought of it."""
    log = CASES[case](rng_of(case, number))
    yield f"{case} {number}: {len(log.samples)} samples at {log.rate:g} Hz, {log.quantity}"
    with tempfile.TemporaryDirectory() as folder:
        tables = tables_of(log, Path(folder))
    for row in tables["findings"]:
        yield f"  {row['severity']} {row['finding']}: {row['detail']}"
    for row in tables["models"]:
        yield (
            f"  {row['model']}{' (chosen)' if row['chosen'] else ''}: BIC {row['bic']:.1f}, "
            f"deviance {row['deviance']:.2f}, {row['verdict']}, band {row['band']:.4g} Hz "
            f"({row['band_source']}); {row['note']}"
        )
    reasons = {(row["method"], row["parameter"], row["component"]): row["reason"]
               for row in tables["parameters"]}  # fmt: skip
    reasons |= {("low_pass", row["parameter"], 1): row["reason"] for row in tables["low_pass"]}
    for one in judge(case, number, log, tables):
        value = "no value" if one.value is None else f"{one.value:.4g}"
        yield (
            f"  {one.method:14}{one.model:9}{one.parameter:7}{one.component} {one.judgement:8}"
            f"truth {one.truth_low:.4g}..{one.truth_high:.4g}: {value} ({_limit(one.lower)} to "
            f"{_limit(one.upper)}) {one.status}; {one.warned_by}; "
            f"{reasons[one.method, one.parameter, one.component] or ''}"
        )


def progress(judged: Mapping[tuple[str, int], Sequence[Judged]], number: int) -> str:
    """Say how many logs are judged, and how many of them are silently wrong."""
    silent = sum(
        any(one.recommended and one.judgement == "silent" for one in rows)
        for rows in judged.values()
    )
    return f"{len(judged)} of {number} logs, {silent} silently wrong"


def in_order(
    judged: Mapping[tuple[str, int], Sequence[Judged]], names: Sequence[str]
) -> list[Judged]:
    """Return all judgements, case by case."""
    return [one for name in names for (case, _), rows in judged.items() if case == name
            for one in rows]  # fmt: skip


def main() -> None:
    """Print the tables, and what must be looked at."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--logs", type=int, default=50, help="of each case")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--case", action="append", choices=CASES, help="default: all")
    parser.add_argument("--clean", action="store_true", help="the clean cases only")
    parser.add_argument("--log", type=int, help="all about this log of each case instead")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--output", type=Path, help="all judgements, .csv or .parquet")
    given = parser.parse_args()
    names = given.case or list(CLEAN if given.clean else CASES)
    # Before numpy is imported in the processes that do the work: each has one core.
    os.environ |= {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "NUMBA")}
    if given.log is not None:
        for name in names:
            print("\n".join(details(name, given.log)), flush=True)
        return
    tasks = [(n, i) for i in range(given.first, given.first + given.logs) for n in names]
    judged: dict[tuple[str, int], list[Judged]] = {}
    spent: dict[str, float] = defaultdict(float)
    took_longest = (0.0, "")
    errors: list[str] = []
    begun = told = time.monotonic()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(given.processes, mp_context=context) as pool:
        for case, number, found, took, error in pool.map(of_log, tasks, chunksize=2):
            judged[case, number] = found
            for step, seconds in took.items():
                spent[step] += seconds
            took_longest = max(took_longest, (sum(took.values()), f"{case} {number}"))
            errors += [f"{case} {number}: {error}"] if error else []
            now = time.monotonic()
            if now - told > _TELLING or len(judged) == len(tasks):
                told = now
                print(f"{progress(judged, len(tasks))}, {now - begun:.0f} s", file=sys.stderr)
                if given.output:  # what is known so far
                    write(in_order(judged, names), given.output)
    rows = in_order(judged, names)
    total = sum(spent.values())
    print("\n".join(case_table(rows)), end="\n\n")
    print("\n".join(method_table(rows)), end="\n\n")
    print("\n".join(silent_list(rows)), end="\n\n")
    print("\n".join(errors), end="\n\n" if errors else "")
    print("\n".join([*summary(rows), *filter_summary(rows)]))
    parts = ", ".join(
        f"{step} {100 * s / total:.0f} %"
        for step, s in sorted(spent.items(), key=lambda item: -item[1])
    )
    longest, name = took_longest
    print(
        f"{total / len(tasks):.2f} s of a process a log: {parts}; longest {name}, {longest:.1f} s"
    )


def write(judged: Sequence[Judged], path: Path) -> None:
    """Write all judgements as CSV, or as Parquet where the name says so."""
    table = pa.Table.from_pylist([asdict(one) for one in judged])
    if path.suffix == ".parquet":
        pyarrow.parquet.write_table(table, path)
    else:
        pyarrow.csv.write_csv(table, path)


if __name__ == "__main__":
    main()
