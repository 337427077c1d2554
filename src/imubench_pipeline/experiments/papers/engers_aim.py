"""Engers' aim, several cheap gyros in place of a better one, which he leaves for later."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from imubench_pipeline.experiments.papers.claims import Claim, Found, nothing
from imubench_pipeline.experiments.papers.engers_axes import DEGREE, NAMES
from imubench_pipeline.experiments.papers.evidence import Evidence
from imubench_pipeline.model.comparisons import GradeRow

_PLACE = "Section 1.0.1.1"
_CHECK = "tests/test_specimens.py"
_NO_LOGS = "it takes the simulated logs of one and of 25 fused"
_GRADES = {"stim300": (None,), "hg4930": ("A", "B", "C"), "ln_200": (None,)}
"""The sensors that are to be reached, and their grades."""

_TITLES = {"stim300": "STIM300", "hg4930": "HG4930", "ln_200": "LN-200"}
_ONE, _FUSED, _NUMBER = "scc2130", "scc2130_x25", 25


def aim() -> Iterator[Claim]:
    """Yield the lines of how many SCC2130 reach each sensor of the tactical class."""
    for grade, options in _GRADES.items():
        for option in options:
            name = _TITLES[grade] + (f", grade {option}" if option else "")
            yield Claim(
                place=_PLACE, quantity=f"how many SCC2130 equal one {name}",
                printed="left for later", found=_reached(grade, option), basis="simulated",
                page="fusion.html#grades", check=_CHECK,
            )  # fmt: skip
    yield Claim(
        place=_PLACE, quantity=f"white noise of {_NUMBER} SCC2130, fused",
        printed="left for later", found=_fused, basis="simulated", page="fusion.html#grades",
        check=_CHECK, unit="rad/s/sqrt(Hz)", printed_unit="°/√h", scale=DEGREE / 60.0,
    )  # fmt: skip


def _reached(grade: str, option: str | None) -> Callable[[Evidence], Found]:
    """Return how many it takes by the white noise and by the lowest point, of one and of fused."""

    def found(run: Evidence) -> Found:
        words = []
        for sensor, name in ((_ONE, ""), (_FUSED, f"of {_NUMBER} fused ")):
            rows = run.rows(GradeRow, sensor=sensor, quantity="gyro", grade=grade, option=option)
            by = {row.statistic: row for row in reversed(rows)}
            if not by:
                return nothing(_NO_LOGS)
            if all(row.printed is None for row in rows):
                return nothing(f"noise of {rows[0].grade_name}: {rows[0].reason}")
            shown = [
                f"{count} by its {what}"
                for statistic, what in (("N", "white noise"), ("sigma_min", "lowest point"))
                if (count := _count(by.get(statistic)))
            ]
            words.append(name + ", ".join(shown))
        return Found(words="; ".join(words), verdict="done here")

    return found


def _count(row: GradeRow | None) -> str:
    """Return the least whole number that is enough; empty where none is known."""
    if row is None or row.n_upper is None:
        return ""
    most = "at most " if row.n is None else ""
    return f"{most}{max(math.ceil(row.n_upper if row.n is None else row.n), 1)}"


def _fused(run: Evidence) -> Found:
    """Return N of the fused log, beside what that of one makes expect."""
    one, fused = (
        next(iter(run.rows(GradeRow, sensor=sensor, quantity="gyro", statistic="N")), None)
        for sensor in (_ONE, _FUSED)
    )
    if one is None or fused is None or not one.value:
        return nothing(_NO_LOGS)
    expected = one.value / math.sqrt(_NUMBER)
    return Found(
        value=fused.value, lower=fused.lower, upper=fused.upper,
        words=f"that of the one {NAMES[_ONE]} over √{_NUMBER} is "
        f"{expected / DEGREE * 60.0:.4f}; the fused ones are others of their kind",
        verdict="done here",
    )  # fmt: skip
