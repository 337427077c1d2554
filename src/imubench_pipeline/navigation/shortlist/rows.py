"""Select the catalogue sensors worth logging for a requirement: the table ``shortlist``.

Errors in use are from the datasheet. The best case excludes a turn-on bias, which can be
calibrated. If a figure is not published, the worst case is not known.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from imubench_pipeline.model.comparisons import RankingRow, ShortlistRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.verdicts import Shortfall
from imubench_pipeline.navigation.error_budget.in_use import BIAS_CAUSES, Figure
from imubench_pipeline.navigation.error_budget.in_use import Figures as InUse
from imubench_pipeline.navigation.error_budget.printed_errors import read_datasheet_figures
from imubench_pipeline.navigation.expected_errors import (
    AxisErrors,
    Question,
    list_requirement_questions,
)
from imubench_pipeline.navigation.shortlist.figures import (
    End,
    Figures,
    MeasuredRanges,
    read_figure_ranges,
)
from imubench_pipeline.navigation.suitability.abilities import judge, read_abilities
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.words.reasons import budgets as texts
from imubench_pipeline.words.verdicts import subject_text

_QUANTITIES = ("gyro", "accel")
_NO_ERRORS = dict.fromkeys(_QUANTITIES, AxisErrors())
_CALIBRATED_BIASES: InUse = dict.fromkeys(BIAS_CAUSES, Figure(sigma=0.0))


def list_shortlist_rows(
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Sensor],
    ranges: MeasuredRanges,
    ranking: Iterable[RankingRow] = (),
    recordings: Iterable[RecordingRow] = (),
) -> Iterator[ShortlistRow]:
    """Judge all sensors of a catalogue by their datasheets, with measured verdicts for comparison.

    Yields a row for each requirement and sensor, the best margin first. The ranges replace
    unpublished figures; the ranking and the recordings of a run provide the measured verdicts.
    """
    simulated = {(row.sensor, row.recording): row.simulated for row in recordings}
    measured = {(row.requirement, row.sensor): row for row in ranking if row.decides}
    by_sensor = {
        name: {
            quantity: read_figure_ranges(sensor, quantity, ranges) for quantity in ("gyro", "accel")
        }
        for name, sensor in sensors.items()
    }
    for name, requirement in requirements.items():
        questions = list(list_requirement_questions(name, requirement))
        if not questions:
            continue  # a datasheet gives no errors in outages
        rows = []
        for sensor, figures in by_sensor.items():
            row = _judge((name, sensor), requirement, questions, sensors[sensor], figures)
            standing = measured.get((name, sensor))
            if standing is not None and standing.margin is not None:
                of_model = standing.recording and simulated.get((sensor, standing.recording), False)
                row = replace(
                    row,
                    measured_margin_of="simulated logs" if of_model else "logs",
                    measured_margin=standing.margin,
                    measured_verdict=standing.verdict,
                )
            rows.append(row)
        yield from sorted(rows, key=lambda row: (-(row.best_margin or 0.0), row.sensor))


def _judge(
    names: tuple[str, str],
    requirement: Requirement,
    questions: Sequence[Question],
    sensor: Sensor,
    figures: Mapping[str, Figures | str],
) -> ShortlistRow:
    """Return the row of a requirement and a sensor, by these names."""
    price_class = sensor.price_class
    row = ShortlistRow(
        requirement=names[0], sensor=names[1], price_class=price_class, verdict="not_judged"
    )
    # The sensor has all axes of its quantities, logged or not.
    has = read_abilities(sensor)
    channels = tuple(f"{q}_{axis}" for q in _QUANTITIES if q not in has.without for axis in "xyz")
    has = has.model_copy(update={"channels": channels, "logged_rate": None})
    lacking, unknown = judge(requirement.must, has)
    if lacking:
        return replace(row, verdict="cannot_meet", shortfalls=tuple(lacking))
    needed = dict.fromkeys(quantity for question in questions for quantity in question.needs)
    published = {q: entry for q in needed if isinstance(entry := figures[q], Figures)}
    if len(published) < len(needed):
        why = "; ".join(entry for q in needed if isinstance(entry := figures[q], str))
        return replace(row, reason=why)
    in_use = {
        quantity: read_datasheet_figures(sensor.datasheet, f"{quantity}_x")
        for quantity in published
    }
    best, missing = _compute_margins(questions, published, in_use, "best")
    least = min(range(len(best)), key=best.__getitem__)
    worst = None
    if all(allowed.bounded for allowed in published.values()):
        margins, missing = _compute_margins(questions, published, in_use, "worst")
        worst = min(margins) if not missing else None
    assumed = [words for allowed in published.values() for words in allowed.assumed] + missing
    row = replace(
        row,
        best_margin=best[least],
        worst_margin=worst,
        decides=requirement.by_dead_reckoning[least].text,
        assumed=(*assumed, *(texts.figure_not_known(subject_text(each)) for each in unknown)),
    )
    if not requirement.admits(price_class):
        asked = " or ".join(requirement.price_class or ())
        return replace(row, shortfalls=(Shortfall("price_class", price_class or "", asked),))
    if best[least] < 1.0:
        return replace(row, verdict="cannot_meet")
    at_worst = worst is not None and worst >= 1.0
    return replace(row, verdict="meets_at_worst" if at_worst else "worth_logging")


def _compute_margins(
    questions: Sequence[Question],
    figures: Mapping[str, Figures],
    in_use: Mapping[str, InUse],
    end: End,
) -> tuple[list[float], list[str]]:
    """Return the limit over the error of each question, and all omissions in words."""
    pick = min if end == "best" else max
    beside = _CALIBRATED_BIASES if end == "best" else {}
    budgets = []
    for question in questions:
        chosen = dict(_NO_ERRORS)
        for quantity in question.needs:
            models = figures[quantity].models(end)
            axes = [AxisErrors(model, {**in_use[quantity], **beside}) for model in models]
            # The quantities are independent: take the extreme of each.
            totals = [question.answer(**{**_NO_ERRORS, quantity: axis}).total for axis in axes]
            chosen[quantity] = axes[totals.index(pick(totals))]
        budgets.append(question.answer(**chosen))
    margins = [
        question.limit / budget.total if budget.total > 0.0 else math.inf
        for question, budget in zip(questions, budgets, strict=True)
        if question.limit is not None  # every question of a requirement has one
    ]
    missing = (
        texts.figure_not_known(missed.source, missed.reason)
        for budget in budgets
        for missed in budget.missing
    )
    return margins, list(dict.fromkeys(missing))
