"""Judge all sensors of the catalogue for a requirement, logged or not: the table ``shortlist``.

A sensor with usable logs has its row of the table ``ranking``. All others are judged in the same
way by their datasheets: noise and errors in use as printed, and the worst figure of the class for
everything that is not printed.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from imubench_pipeline.datasheets.class_limits import find_limit
from imubench_pipeline.datasheets.printed_noise import WALK_TIMES, PrintedNoise, read_printed_noise
from imubench_pipeline.model.comparisons import RankingRow, ShortlistRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.states import MEASURED, Measured, Verdict
from imubench_pipeline.model.verdicts import Share, Shortfall
from imubench_pipeline.navigation.error_budget.in_use import read_figures
from imubench_pipeline.navigation.error_budget.parts import Budget
from imubench_pipeline.navigation.expected_errors import (
    AxisErrors,
    Question,
    find_largest_figures,
    list_requirement_questions,
)
from imubench_pipeline.navigation.suitability import (
    PASSING_VERDICTS,
    judge,
    make_figure_conditions,
    merge_largest,
    read_abilities,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.words.numbers import join_names
from imubench_pipeline.words.reasons import budgets as texts
from imubench_pipeline.words.verdicts import class_limit_text, worse_than_class_text

_MIN_SHARE = 0.01  # of the variance
_MIN_EXCESS = 1.001  # of a printed figure over the worst of the class, which is rounded


@dataclass(frozen=True)
class _PrintedErrors:
    """The error sources of a sensor by its datasheet."""

    noise: Mapping[Measured, PrintedNoise]  # of the quantities that it measures
    axes: Mapping[Measured, AxisErrors]
    remarks: tuple[str, ...]  # on figures that are worse than its class


def _read_printed_errors(sensor: Sensor) -> _PrintedErrors:
    noise = {q: read_printed_noise(sensor, q) for q in MEASURED if getattr(sensor.datasheet, q)}
    axes, remarks = {}, []
    for q in MEASURED:
        models = noise[q].models if q in noise else dict.fromkeys(WALK_TIMES, NoiseModel())
        figures = read_figures(sensor, q)
        axes[q] = AxisErrors(models["in_use"], figures, models["likely"], models["best"])
        for cause, figure in figures.items():
            worst = find_limit(sensor.grade, q, cause).worst
            if figure.origin == "datasheet" and figure.sigma > _MIN_EXCESS * worst:
                remarks.append(worse_than_class_text(q, cause, figure.sigma))
    return _PrintedErrors(noise, axes, tuple(remarks))


def list_shortlist_rows(
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Sensor],
    ranking: Iterable[RankingRow] = (),
    recordings: Iterable[RecordingRow] = (),
) -> Iterator[ShortlistRow]:
    """Yield a row for each requirement and sensor of a catalogue, in the order of their ranks."""
    simulated = {(row.sensor, row.recording): row.simulated for row in recordings}
    measured = {(row.requirement, row.sensor): row for row in ranking if row.decides}
    printed = {name: _read_printed_errors(sensor) for name, sensor in sensors.items()}
    for name, requirement in requirements.items():
        questions = list(list_requirement_questions(name, requirement))
        if not questions:
            continue  # a datasheet gives no errors in outages
        rows = []
        for key, sensor in sensors.items():
            ranked = measured.get((name, key))
            if ranked is not None and ranked.margin is not None:
                made = ranked.recording and simulated.get((key, ranked.recording), False)
                asked = (ranked.error, ranked.time)
                limits = (x.text for x in requirement.limits if (x.error, x.seconds) == asked)
                row = ShortlistRow.taken_from(
                    ranked,
                    price_class=sensor.price_class,
                    rank=None,
                    basis="simulated logs" if made else "logs",
                    decides=next(limits, None),
                )
            else:
                row = _judge_by_datasheet((name, key), requirement, questions, sensor, printed[key])
            rows.append(row)
        rows.sort(key=make_order)
        places = (place for place, _ in enumerate(rows, 1))
        for row in rows:
            yield replace(row, rank=next(places)) if _is_ranked(row) else row


def make_order(row: ShortlistRow) -> tuple[object, ...]:
    """Return the sort key: the sensors that meet the limits first, by their margins in use."""
    met = row.verdict in PASSING_VERDICTS
    return not _is_ranked(row), not met, -(row.margin or 0.0), row.sensor


def _is_ranked(row: ShortlistRow) -> bool:
    """Return whether a sensor is judged, and has all demanded properties for certain."""
    unknown = any(condition.property for condition in row.conditions)
    return row.margin is not None and row.verdict != "excluded" and not unknown


def _judge_by_datasheet(
    names: tuple[str, str],
    requirement: Requirement,
    questions: Sequence[Question],
    sensor: Sensor,
    printed: _PrintedErrors,
) -> ShortlistRow:
    """Return the row of a requirement and a sensor without usable logs, by these names."""
    row = ShortlistRow(
        requirement=names[0],
        sensor=names[1],
        price_class=sensor.price_class,
        verdict="not_enough_data",
    )
    # The sensor has all axes of its quantities, logged or not.
    has = read_abilities(sensor)
    channels = tuple(f"{q}_{axis}" for q in MEASURED if q not in has.without for axis in "xyz")
    has = has.model_copy(update={"channels": channels, "logged_rate": None})
    lacking, unknown = judge(requirement, has)
    if not requirement.admits(sensor.price_class):
        asked = join_names(requirement.price_class or (), "or")
        lacking.append(Shortfall("price_class", sensor.price_class or "", asked))
    if any(quantity in has.without for quantity in requirement.quantities):
        return replace(row, verdict="excluded", shortfalls=tuple(lacking))
    answers = [
        (question, *question.answer_all(printed.axes["gyro"], printed.axes["accel"]))
        for question in questions
    ]

    def margin(question: Question, total: float) -> float:
        assert question.limit is not None  # of every limit of a requirement
        return question.limit / total if total > 0.0 else math.inf

    margins = [
        (margin(question, budget.total), *(margin(question, total) for total in others))
        for question, budget, *others in answers
    ]
    place = min(range(len(margins)), key=margins.__getitem__)
    budget = answers[place][1]
    in_use, noise_alone, likely, best = margins[place]
    by_limit = [
        find_largest_figures(total, asked.limit, total.total)
        for (asked, total, *_), of_limit in zip(answers, margins, strict=True)
        if of_limit[0] < 1.0
    ]
    largest = merge_largest(
        (source.quantity, source.source, size)
        for figures in by_limit
        for source, size in figures.items()
    )
    helps = all(figures and min(figures.values()) > 0.0 for figures in by_limit)
    shares = list(_list_shares(budget, printed.noise))
    conditions = tuple(unknown)
    worst_best = min(each[3] for each in margins)
    verdict: Verdict = "meets"
    if lacking:
        verdict = "excluded"
    elif worst_best < 1.0:
        verdict = "cannot_meet"
    elif in_use < 1.0:
        verdict = "not_enough_data"
        if helps:
            verdict, conditions = "meets_if", (*make_figure_conditions(largest), *unknown)
    elif unknown:
        verdict = "meets_if"
    return replace(
        row,
        margin=in_use,
        noise_margin=noise_alone,
        likely_margin=likely,
        best_margin=best,
        decides=requirement.by_dead_reckoning[place].text,
        verdict=verdict,
        conditions=conditions if verdict != "excluded" else (),
        parts=tuple(share for share, _ in shares),
        assumed=tuple(
            dict.fromkeys(
                class_limit_text(share.quantity, share.source, sigma)
                for share, sigma in shares
                if share.origin == "class limit" and share.quantity
            )
        ),
        shortfalls=tuple(lacking),
        reasons=(
            *((texts.NOISE_NOT_PRINTED,) if verdict == "not_enough_data" else ()),
            *printed.remarks,
        ),
    )


def _list_shares(
    budget: Budget, noise: Mapping[Measured, PrintedNoise]
) -> Iterator[tuple[Share, float | None]]:
    """Yield the sources with a relevant share, the largest first, with the figures of others."""
    for part in sorted(budget.contributions, key=lambda part: -part.sigma):
        share = (part.sigma / budget.total) ** 2 if budget.total else 0.0
        if share >= _MIN_SHARE:
            source = part.source
            if part.figure is not None:
                origin = part.figure.origin
            else:
                assumed = source.quantity and source.source in noise[source.quantity].assumed
                origin = "class limit" if assumed else "datasheet"
            sigma = part.figure.sigma if part.figure else None
            yield Share(**asdict(source), share=share, origin=origin), sigma
