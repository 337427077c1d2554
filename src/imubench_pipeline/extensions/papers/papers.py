"""The table ``published``: lines of the papers, results of this project, and verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from imubench_pipeline.extensions.papers import engers, maia, silva
from imubench_pipeline.extensions.papers.panel import make_accuracy_rows
from imubench_pipeline.extensions.papers.printed import (
    Evidence,
    Line,
    Paper,
    Result,
    Unit,
    Verdict,
    parse_number,
    read_paper,
    read_papers,
)
from imubench_pipeline.extensions.papers.tables import PublishedRow
from imubench_pipeline.tables import build, read, write_arrow

_MODULES = {module.__name__.rpartition(".")[2]: module for module in (engers, maia, silva)}


def evaluate(line: Line, evidence: Evidence) -> Result:
    """Return the counterpart of a line.

    It is a number (SI), or a function of the evidence and texts that returns a number, a `Result`,
    or None if the run has no log for it.
    """
    if not line.find:
        return Result()
    name, *arguments = (part.format(**line.fields) for part in line.find)
    module, _, attribute = name.partition(".")
    found = getattr(_MODULES[module], attribute)
    if callable(found):
        found = found(evidence, *arguments)
    if found is None:
        return Result(words="", verdict="not to be had", reason=line.missing)
    return found if isinstance(found, Result) else Result(value=found)


def judge(printed: float | None, result: Result, tolerance: float) -> Verdict:
    """Return the verdict on a printed number from the numbers of the result."""
    if result.value is None or printed is None:
        return "not to be had"
    inside = (
        result.lower is not None
        and result.upper is not None
        and result.lower <= printed <= result.upper
    )
    near = abs(result.value - printed) <= tolerance * abs(printed)
    return "agrees" if inside or near else "differs"


def make_rows(paper: Paper, evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` of a paper."""
    for line in paper.lines:
        result = evaluate(line, evidence)
        fields = {**result.fields, **line.fields}
        printed_unit = line.unit.format(**fields)
        unit = paper.units.get(printed_unit, Unit(printed_unit))
        if line.found:
            value = parse_number(line.found.format(**fields)) * unit.scale
            result = replace(result, value=value)
        printed = result.printed
        if line.value:
            printed = parse_number(line.value.format(**fields)) * unit.scale
        ratio = result.value / printed if result.value is not None and printed else None
        verdict = result.verdict or line.verdict or judge(printed, result, line.tolerance)
        words = line.words.format(**fields) if result.words is None else result.words
        reason = None
        if verdict != "agrees":
            reason = result.reason or line.why.format(**fields) or None
        yield PublishedRow(
            paper=paper.name,
            place=line.place.format(**fields),
            quantity=line.quantity.format(**fields),
            printed_as=line.printed.format(**fields),
            printed=printed,
            found=result.value,
            lower=result.lower,
            upper=result.upper,
            found_words=words or None,
            ratio=ratio,
            tolerance=line.tolerance if ratio is not None else None,
            unit=unit.si,
            printed_unit=printed_unit,
            scale=unit.scale,
            basis=line.basis,
            verdict=verdict,
            reason=reason,
            page=line.page.format(**fields) or None,
            check=line.check,
        )


def write_published(tables: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Write the tables ``published`` and ``accuracy`` of a run, empty without logs of a paper."""
    parts: dict[str, list[Path]] = {}
    for path in tables:
        parts.setdefault(path.stem, []).append(path)
    evidence = Evidence({name: read(name, paths) for name, paths in parts.items()})
    of_maia = any(evidence.has(*log) for log in read_paper("maia").logs)
    made = {
        "published": build("published", make_published_rows(evidence)),
        "accuracy": build("accuracy", make_accuracy_rows() if of_maia else ()),
    }
    for output in outputs:
        write_arrow(made[output.stem], output)


def make_published_rows(evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` for the papers with logs in the run."""
    for paper in read_papers():
        if any(evidence.has(*log) for log in paper.logs):
            yield from make_rows(paper, evidence)


def make_rows_without_run() -> Iterator[PublishedRow]:
    """Yield the rows that need printed figures and closed forms only, and no log."""
    for paper in read_papers():
        for row in make_rows(paper, Evidence()):
            if row.basis in ("computed", "checked"):
                yield row
