"""The table ``published``: lines of the papers, results of this project, and verdicts."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators import least_squares
from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.estimators.intervals import compute_cramer_rao_bounds
from imubench_pipeline.estimators.model_choice import PAPERS_MODEL
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import Whittle, make_whittle
from imubench_pipeline.extensions.papers import engers, maia, silva
from imubench_pipeline.extensions.papers.maia import DURATION, MTI_GYRO
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
from imubench_pipeline.extensions.papers.tables import AccuracyRow, PublishedRow
from imubench_pipeline.noise.simulate import channel_rng, simulate
from imubench_pipeline.tables.files import build, read, write_arrow
from imubench_pipeline.tables.keys import group_rows

LOGS = 100  # enough to separate ratios of 1.1 and 1.5; `benchmarks/accuracy.py` has more

_RATE = MTI_GYRO.rate / 10.0
_FIT_METHODS: tuple[Literal["paper", "weighted"], ...] = ("paper", "weighted")

Values = Mapping[str, float | None]


def make_accuracy_rows(logs: int = LOGS) -> Iterator[AccuracyRow]:
    """Yield the rows of the table ``accuracy``: errors of the methods on simulated logs.

    These are of the gyro of the MTi-7 by Table 2 of Maia et al., 10 h at a tenth of its rate, which
    does not change N, B, T_B and K. The likelihood has the model of the papers.
    """
    model = MTI_GYRO.table_2
    bounds = compute_cramer_rao_bounds(model, _RATE, DURATION, _RATE / 2.0)
    by_method: dict[str, list[Values]] = {}
    whittle: Whittle | None = None
    for number in range(logs):
        estimates, whittle = _estimate_log(number, whittle)
        for method, values in estimates.items():
            by_method.setdefault(method, []).append(values)
    for method, of_logs in by_method.items():
        for name in PARAMETERS:
            truth = float(getattr(model, name))
            given = [value for values in of_logs if (value := values[name]) is not None]
            errors = np.array(given) / truth - 1.0
            rmse = math.sqrt(float(np.mean(errors**2))) if given else None
            # Relative standard deviation of the rms of n normal errors: 1 / sqrt(2 n).
            spread = 1.96 / math.sqrt(2.0 * len(given)) if given else 0.0
            ratio = None if rmse is None else rmse / bounds[name]
            yield AccuracyRow(
                method=method,
                parameter=name,
                logs=logs,
                given=len(given),
                rmse=rmse,
                bias=float(np.mean(errors)) if given else None,
                bound=bounds[name],
                ratio=ratio,
                ratio_lower=None if ratio is None else ratio * (1.0 - spread),
                ratio_upper=None if ratio is None else ratio * (1.0 + spread),
            )


def _estimate_log(number: int, before: Whittle | None) -> tuple[dict[str, Values], Whittle]:
    """Return the estimates by method, and the likelihood, with the shapes of the one `before`."""
    samples = round(DURATION * _RATE)
    rng = channel_rng(1, MTI_GYRO.sensor, MTI_GYRO.channel, f"panel {number}")
    log = simulate(MTI_GYRO.table_2, _RATE, samples, rng)
    curve = allan_variance(log, _RATE, overlap="octave")
    estimates = [
        reading.read(curve),
        *(least_squares.fit(curve, method=m, with_limits=False) for m in _FIT_METHODS),
    ]
    spectrum, _ = compute_spectra([log], samples, _RATE)
    whittle = before.of(spectrum) if before else make_whittle(spectrum, _RATE / 2.0)
    best = whittle.maximum(PAPERS_MODEL)
    powers = [best.parameter("N"), float(best.biases[0]), float(best.times[0]), best.parameter("K")]
    by_likelihood = {
        name: value if value > 0.0 else None for name, value in zip(PARAMETERS, powers, strict=True)
    }
    of_curve: dict[str, Values] = {
        estimate.method: {name: estimate.parameters[name].value for name in PARAMETERS}
        for estimate in estimates
    }
    return of_curve | {"likelihood_gm": by_likelihood}, whittle


_MODULES = {module.__name__.rpartition(".")[2]: module for module in (engers, maia, silva)}


def evaluate(line: Line, evidence: Evidence) -> Result:
    """Return the result of this project for a line of a paper; empty if the line names none."""
    if not line.find:
        return Result()
    name, *arguments = (part.format(**line.fields) for part in line.find)
    module, _, attribute = name.partition(".")
    found = getattr(_MODULES[module], attribute)
    if callable(found):
        found = found(evidence, *arguments)
    if found is None:
        return Result(words="", verdict="not available", reason=line.missing)
    return found if isinstance(found, Result) else Result(value=found)


def judge(printed: float | None, result: Result, tolerance: float) -> Verdict:
    """Return whether a printed number is in the interval of the result, or near its value."""
    if result.value is None or printed is None:
        return "not available"
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
        unit = paper.units.get(printed_unit, Unit(si=printed_unit))
        if line.found:
            result = replace(result, value=parse_number(line.found.format(**fields)) * unit.scale)
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
    parts = group_rows(tables, lambda path: path.stem)
    evidence = Evidence({name: read(name, paths) for name, paths in parts.items()})
    of_maia = any(evidence.has(*log) for log in read_paper("maia").logs)
    made = {
        "published": build("published", make_published_rows(evidence)),
        "accuracy": build("accuracy", make_accuracy_rows() if of_maia else ()),
    }
    for output in outputs:
        write_arrow(made[output.stem], output)


def make_published_rows(evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` for papers with logs in the run."""
    for paper in read_papers():
        if any(evidence.has(*log) for log in paper.logs):
            yield from make_rows(paper, evidence)


def make_rows_without_run() -> Iterator[PublishedRow]:
    """Yield the rows that need printed figures and closed forms only, and no log."""
    for paper in read_papers():
        for row in make_rows(paper, Evidence()):
            if row.basis in ("computed", "checked"):
                yield row
