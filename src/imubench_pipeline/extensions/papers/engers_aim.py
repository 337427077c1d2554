"""Aim of Engers, which he leaves for later: several cheap gyros replace a better one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from imubench_pipeline.extensions.fusion.tables import GradeRow
from imubench_pipeline.extensions.papers.claims import Claim, Result, no_result
from imubench_pipeline.extensions.papers.engers_axes import DEGREE, NAMES
from imubench_pipeline.extensions.papers.evidence import Evidence

_SECTION = "Section 1.0.1.1"
_TEST = "tests/test_specimens.py"
_NO_LOGS = "it takes the simulated logs of one and of 25 fused"
_TARGET_GRADES = {"stim300": (None,), "hg4930": ("A", "B", "C"), "ln_200": (None,)}
"""The target sensors, and their grades."""

_TARGET_NAMES = {"stim300": "STIM300", "hg4930": "HG4930", "ln_200": "LN-200"}
_SINGLE_SENSOR, _FUSED_SENSOR, _FUSED_COUNT = "scc2130", "scc2130_x25", 25


def aim() -> Iterator[Claim]:
    """Yield the claims on the number of SCC2130 that equal each tactical-grade sensor."""
    for grade, options in _TARGET_GRADES.items():
        for option in options:
            name = _TARGET_NAMES[grade] + (f", grade {option}" if option else "")
            yield Claim(
                place=_SECTION, quantity=f"how many SCC2130 equal one {name}",
                printed="left for later", evaluate=_evaluate_reached(grade, option),
                basis="simulated",
                page="fusion.html#grades", check=_TEST,
            )  # fmt: skip
    yield Claim(
        place=_SECTION, quantity=f"white noise of {_FUSED_COUNT} SCC2130, fused",
        printed="left for later", evaluate=_evaluate_fused, basis="simulated",
        page="fusion.html#grades",
        check=_TEST, unit="rad/s/sqrt(Hz)", printed_unit="°/√h", scale=DEGREE / 60.0,
    )  # fmt: skip


def _evaluate_reached(grade: str, option: str | None) -> Callable[[Evidence], Result]:
    """Return the evaluation of the number of sensors, by white noise and by lowest point."""

    def evaluate(run: Evidence) -> Result:
        words = []
        for sensor, name in ((_SINGLE_SENSOR, ""), (_FUSED_SENSOR, f"of {_FUSED_COUNT} fused ")):
            rows = run.rows(GradeRow, sensor=sensor, quantity="gyro", grade=grade, option=option)
            by = {row.statistic: row for row in reversed(rows)}
            if not by:
                return no_result(_NO_LOGS)
            if all(row.printed is None for row in rows):
                return no_result(f"noise of {rows[0].grade_name}: {rows[0].reason}")
            shown = [
                f"{count} by its {what}"
                for statistic, what in (("N", "white noise"), ("sigma_min", "lowest point"))
                if (count := _format_count(by.get(statistic)))
            ]
            words.append(name + ", ".join(shown))
        return Result(words="; ".join(words), verdict="done here")

    return evaluate


def _format_count(row: GradeRow | None) -> str:
    """Return the least sufficient whole number as text; empty if it is unknown."""
    if row is None or row.n_upper is None:
        return ""
    most = "at most " if row.n is None else ""
    return f"{most}{max(math.ceil(row.n_upper if row.n is None else row.n), 1)}"


def _evaluate_fused(run: Evidence) -> Result:
    """Return N of the fused log, with the expectation from the log of one sensor."""
    one, fused = (
        next(iter(run.rows(GradeRow, sensor=sensor, quantity="gyro", statistic="N")), None)
        for sensor in (_SINGLE_SENSOR, _FUSED_SENSOR)
    )
    if one is None or fused is None or not one.value:
        return no_result(_NO_LOGS)
    expected = one.value / math.sqrt(_FUSED_COUNT)
    return Result(
        value=fused.value, lower=fused.lower, upper=fused.upper,
        words=f"that of the one {NAMES[_SINGLE_SENSOR]} over √{_FUSED_COUNT} is "
        f"{expected / DEGREE * 60.0:.4f}; the fused ones are others of their kind",
        verdict="done here",
    )  # fmt: skip
