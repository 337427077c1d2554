"""Which sensors of a catalogue are worth logging for a requirement: the table ``shortlist``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from imubench_pipeline.expected_errors import Question, of_requirement
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.requirements import Requirement
from imubench_pipeline.sensor import Sensor
from imubench_pipeline.shortlist.classes import MeasuredRanges
from imubench_pipeline.shortlist.columns import SHORTLIST
from imubench_pipeline.shortlist.figures import End, Figures, figures_of

Row = Mapping[str, Any]

VERDICTS: Mapping[str, str] = {
    "cannot pass": "fails even with the best that its datasheet allows",
    "worth logging": "passes at its best and not, or nobody knows, at its worst: a log decides",
    "passes at its worst": "passes with the worst that its datasheet allows",
    "not judged": "too little is published, or it is outside the price class",
}
"""What a verdict says."""

_NOTHING = NoiseModel()


def shortlist_rows(
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Sensor],
    ranges: MeasuredRanges,
    ranking: Iterable[Row] = (),
    recordings: Iterable[Row] = (),
) -> Iterator[Row]:
    """Judge all sensors of a catalogue by their datasheets alone, beside what is measured.

    Parameters
    ----------
    requirements : mapping of str to Requirement
    sensors : mapping of str to Sensor
    ranges : MeasuredRanges
        For what is not published.
    ranking, recordings : iterable of mapping
        Rows of the tables of a run: what its logs say.

    Yields
    ------
    mapping
        One a requirement and sensor, the best margin first; what is not judged is last.
    """
    simulated = {(row["sensor"], row["recording"]): row["simulated"] for row in recordings}
    measured = {(row["requirement"], row["sensor"]): row for row in ranking if row["decides"]}
    found = {
        name: {quantity: figures_of(sensor, quantity, ranges) for quantity in ("gyro", "accel")}
        for name, sensor in sensors.items()
    }
    for name, requirement in requirements.items():
        questions = list(of_requirement(name, requirement))
        rows = []
        for sensor, figures in found.items():
            row = _judged(requirement, questions, sensors[sensor].price_class, figures)
            standing = measured.get((name, sensor))
            if standing is not None and standing["margin"] is not None:
                of_model = simulated.get((sensor, standing["recording"]), False)
                row |= {
                    "measured_margin_of": "simulated logs" if of_model else "logs",
                    "measured_margin": standing["margin"],
                    "measured_verdict": standing["limit_verdict"],
                }
            rows.append(row | {"requirement": name, "sensor": sensor})
        yield from sorted(rows, key=lambda row: (-(row["best_margin"] or 0.0), row["sensor"]))


def _judged(
    requirement: Requirement,
    questions: Sequence[Question],
    price_class: str | None,
    figures: Mapping[str, Figures | str],
) -> dict[str, Any]:
    row: dict[str, Any] = dict.fromkeys(column.name for column in SHORTLIST)
    row["price_class"] = price_class
    needed = dict.fromkeys(quantity for one in questions for quantity in one.needs)
    known = {q: one for q in needed if isinstance(one := figures[q], Figures)}
    if len(known) < len(needed):
        why = "; ".join(one for q in needed if isinstance(one := figures[q], str))
        return row | {"verdict": "not judged", "reason": why}
    best = [_margin(one, known, "best") for one in questions]
    least = min(range(len(best)), key=best.__getitem__)
    row |= {
        "best_margin": best[least],
        "decides": requirement.limits[least].text,
        "assumed": "; ".join(words for one in known.values() for words in one.assumed) or None,
    }
    if all(one.bounded for one in known.values()):
        row["worst_margin"] = min(_margin(one, known, "worst") for one in questions)
    if not requirement.admits(price_class):
        why = "outside the price class" if price_class else "price class not stated"
        return row | {"verdict": "not judged", "reason": why}
    return row | {"verdict": _verdict(row["best_margin"], row["worst_margin"])}


def _verdict(best: float, worst: float | None) -> str:
    if best < 1.0:
        return "cannot pass"
    return "passes at its worst" if worst is not None and worst >= 1.0 else "worth logging"


def _margin(question: Question, figures: Mapping[str, Figures], end: End) -> float:
    """Return the limit over the error, of the best or the worst models of the quantities."""
    pick = min if end == "best" else max

    def alone(quantity: str, model: NoiseModel) -> float:
        pair = (model, _NOTHING) if quantity == "gyro" else (_NOTHING, model)
        return question.answer(*pair).total

    chosen = {"gyro": _NOTHING, "accel": _NOTHING}
    for quantity in question.needs:
        # The quantities are independent: each has its own extreme.
        models = figures[quantity].models(end)
        chosen[quantity] = pick(models, key=lambda one, of=quantity: alone(of, one))  # type: ignore[misc]  # a default binds the loop's variable
    total = question.answer(chosen["gyro"], chosen["accel"]).total
    assert question.limit is not None  # of a requirement
    return question.limit / total if total > 0.0 else math.inf
