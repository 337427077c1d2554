"""Differences between the results of two runs, such as before and after an upgrade."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import get_args

import pyarrow as pa

from imubench_pipeline.extensions.nightly.difference_rows import (
    DifferenceKind,
    Result,
    ResultKey,
    RunDifference,
)
from imubench_pipeline.extensions.nightly.reasons import count_text, difference_text
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.model.table import arrow_type
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.run_summary import fold_text
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.datapackage import read_software
from imubench_pipeline.tables.files import find_tables, read_part
from imubench_pipeline.words.numbers import Unit

TOLERANCE = 1e-9
"""Relative difference of equal values: other processors round differently."""

KINDS: tuple[DifferenceKind, ...] = get_args(DifferenceKind)
_VERDICTS = (*get_args(Verdict), None)  # the best first; None: no verdict
_NOT_ANALYSED = ("failed", "rejected")
_STATES = ("fit", "fit with doubts", "unfit", *_NOT_ANALYSED)  # of a recording, the best first
_NAMES = {
    "parameters": ("parameter", "status"),
    "ranking": ("requirement", "verdict"),
    "findings": ("finding", "severity"),
}
"""Columns with the name and the state of a result."""

_LAST_USED = 1  # index in it
_WORST = 3  # differences that are described without `every`
_LONGEST = 400  # characters of one

Results = Mapping[ResultKey, Result]


def load_results(results: Path) -> Results:
    """Return the recordings, recommended parameters, verdicts and findings of a run.

    The run may be of another version. Raises a `tables.files.TableError` if a table is missing or
    cannot be read.
    """
    found: dict[ResultKey, Result] = {}
    for table, path in find_tables(results, (*_NAMES, "recordings")).items():
        for row in read_part(table, path, any_version=True).to_pylist():
            if table == "recordings":
                state = row["status"] if row["status"] != "ok" else row["fitness"] or "fit"
                found[ResultKey(table, row["sensor"], row["recording"])] = Result(
                    state, detail=row["reason"]
                )
            elif row.get("recommended", row.get("decides", True)):
                name, state = _NAMES[table]
                of = None if table == "ranking" else row["recording"]
                key = ResultKey(
                    table, row["sensor"], of, row.get("channel"), row[name], row.get("component")
                )
                columns = ("value", "lower", "upper", "unit") if table == "parameters" else ()
                values = {column: row[column] for column in columns}
                found[key] = Result(row[state], **values, detail=row.get("detail"))
    return found


def list_differences(a: Results, b: Results) -> list[RunDifference]:
    """Return the differences between two runs, the most important first.

    Parameters are compared in recordings that both runs have analysed, findings in recordings and
    verdicts for sensors and requirements that both have. Run B is worse (`regression`) where

    - a recording is rejected, failed or not used, and was better before,
    - a parameter has lost its value,
    - a verdict is worse in the order of `model.states.Verdict`, or missing.
    """
    judged_sensors, judged_names = (
        {getattr(key, part) for key in a if key.table == "ranking"}
        & {getattr(key, part) for key in b if key.table == "ranking"}
        for part in ("sensor", "name")
    )
    found: list[RunDifference] = []
    for key in dict.fromkeys([*a, *b]):
        old, new = a.get(key), b.get(key)
        recording = ResultKey("recordings", key.sensor, key.recording)
        states = [run[recording].state for run in (a, b) if recording in run]
        if key.table == "parameters":
            if len(states) > 1 and not {*states} & {*_NOT_ANALYSED}:
                found += _compare_values(key, old or Result("absent"), new or Result("absent"))
        elif key.table == "findings":
            if len(states) > 1 and (old is None or new is None):
                kind: DifferenceKind = "finding_gone" if new is None else "new_finding"
                found.append(RunDifference(kind, key, old, new))
        elif key.table == "ranking":
            if key.sensor in judged_sensors and key.name in judged_names:
                was, now = (_VERDICTS.index(one.state if one else None) for one in (old, new))
                found += [RunDifference("verdict", key, old, new, now > was)] * (was != now)
        elif old is None or new is None:
            found.append(RunDifference("only_in_b" if old is None else "only_in_a", key, old, new))
        elif old.state != new.state:
            was, now = (_STATES.index(state) for state in states)
            worse = now > max(was, _LAST_USED)
            found.append(RunDifference("recording_status", key, old, new, worse))
    return sorted(found, key=_rank)


def _compare_values(key: ResultKey, old: Result, new: Result) -> Iterator[RunDifference]:
    x, y = old.value, new.value
    if x is not None and y is not None:
        if abs(y - x) > TOLERANCE * max(abs(x), abs(y)):
            inside = _is_inside(y, old) and _is_inside(x, new)
            kind: DifferenceKind = "within_intervals" if inside else "beyond_intervals"
            yield RunDifference(kind, key, old, new, ratio=y / x if x * y > 0.0 else None)
    elif x is not None:
        yield RunDifference("value_lost", key, old, new, regression=True)
    elif y is not None:
        yield RunDifference("value_gained", key, old, new)
    if old.state != new.state and (x is None) == (y is None):
        yield RunDifference("parameter_status", key, old, new)


def _is_inside(value: float, result: Result) -> bool:
    """Return whether a value is inside the interval of an estimate that has one."""
    lower, upper = result.lower, result.upper
    return lower is not None and upper is not None and lower <= value <= upper


def _rank(difference: RunDifference) -> tuple[bool, int, float]:
    size = math.inf if difference.ratio is None else abs(math.log(difference.ratio))
    return not difference.regression, KINDS.index(difference.kind), -size


def make_table(found: Sequence[RunDifference]) -> pa.Table:
    """Return differences as a table, with columns such as ``sensor``, ``a.value`` and ``ratio``."""
    rows = [asdict(each) for each in found]
    table = pa.Table.from_pylist(rows, pa.schema([*arrow_type(RunDifference)])).flatten()
    return table.rename_columns([name.removeprefix("key.") for name in table.column_names])


def describe_runs(path_a: Path, path_b: Path, a: Results, b: Results) -> list[str]:
    """Return the software of two runs, if known, and the number of their recordings."""
    lines = [
        f"{name}: imubench {software.get('version')}, settings {software.get('settings')}"
        for name, path in (("A", path_a), ("B", path_b))
        if (software := read_software(path))
    ]
    of_a, of_b = ({key for key in run if key.table == "recordings"} for run in (a, b))
    both = f"{len(of_a & of_b)} in both"
    return [*lines, f"Recordings: {len(of_a)} in A, {len(of_b)} in B, {both}"]


def describe_differences(
    found: Sequence[RunDifference], system: System, *, every: bool = False
) -> list[str]:
    """Return the number of differences of each kind, and the worst or every one in words."""
    if not found:
        return ["No differences"]
    by_kind = [[each for each in found if each.kind == kind] for kind in KINDS]
    lines = [count_text(kind, some) for kind, some in zip(KINDS, by_kind, strict=True) if some]
    lines += ["", "The worst differences first:"]
    shown = found if every else found[:_WORST]
    for each in shown:
        unit = Unit("", 1.0)
        if each.key.table == "parameters":
            quantity = quantity_of(each.key.channel or "")
            unit = choose_page_unit(quantity, each.key.name or "", system)
        lines.append(f"  {fold_text(difference_text(each, unit), _LONGEST)}")
    return lines + [f"  {len(found) - len(shown)} more"] * (len(found) > len(shown))
