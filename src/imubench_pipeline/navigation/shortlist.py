"""Select the catalogue sensors worth logging for a requirement: the table ``shortlist``.

Noise figures are a range: a density of unknown sidedness is N or N sqrt(2). A printed bias
instability is B at best, and the minimum of the curve, 0.664 B, at worst. All grades are included,
unless the sensor file selects one. An unpublished figure is from measured sensors of the class, or
B from its datasheets. If a figure is not known, neither is the worst case.

Errors in use are from the datasheet; the best case excludes a calibrated turn-on bias.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from imubench_pipeline.datasheets.comparable import Comparable, read_comparables
from imubench_pipeline.model.comparisons import RankingRow, ShortlistRow
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.verdicts import Shortfall
from imubench_pipeline.navigation.error_budget.in_use import (
    BIAS_CAUSES,
    Figure,
    read_datasheet_figures,
)
from imubench_pipeline.navigation.error_budget.in_use import Figures as InUse
from imubench_pipeline.navigation.expected_errors import (
    AxisErrors,
    Question,
    list_requirement_questions,
)
from imubench_pipeline.navigation.suitability import judge, read_abilities
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.settings.printed import SENSORS, Datasheet, QuantityDatasheet
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import Sensor, quantity_of
from imubench_pipeline.words.reasons import budgets as texts
from imubench_pipeline.words.verdicts import source_text, subject_text

_FIGURE_OF_PARAMETER = {"N": "N", "B_curve": "B", "K": "K", "T_B": "T_B"}
"""Figure for each parameter of the estimates: B is taken from the curve."""


@dataclass(frozen=True)
class Span:
    """Range of possible values of a figure."""

    # low, high: SI
    low: float
    high: float
    words: str = ""  # source of an assumed range; empty if printed


@dataclass(frozen=True)
class MeasuredRanges:
    """Ranges of measured parameters, by sensor, quantity and figure."""

    # (sensor, quantity, figure) -> (low, high), SI
    of_sensor: Mapping[tuple[str, str, str], tuple[float, float]]
    classes: Mapping[str, str]  # class of each sensor that states one
    # (sensor, quantity) -> (low, high) of B, SI, from datasheets: used if none is measured
    printed: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)

    def span(self, price_class: str | None, quantity: str, figure: str) -> Span | None:
        """Return the range of a figure (N, B, K or T_B) over the measured sensors of a class.

        If none of the class is measured, the range is over all measured sensors; if none is
        measured at all, the range of B is from datasheets. None if nothing is known.
        """
        by_sensor = {
            sensor: ends
            for (sensor, of, name), ends in self.of_sensor.items()
            if (of, name) == (quantity, figure)
        }
        measured = bool(by_sensor)
        if not by_sensor and figure == "B":
            by_sensor = {name: ends for (name, of), ends in self.printed.items() if of == quantity}
        if not by_sensor:
            return None
        wanted = parse_price_class(price_class)
        own = {s: ends for s, ends in by_sensor.items() if wanted and self.classes.get(s) == wanted}
        used = own or by_sensor
        low, high = min(ends[0] for ends in used.values()), max(ends[1] for ends in used.values())
        source = texts.range_source(sorted(used), wanted if own else "", measured=measured)
        return Span(low, high, source)


def parse_price_class(price_class: str | None) -> str:
    """Return the name in a price class, such as ``consumer`` in ``consumer, about US$8``."""
    return re.split(r"[,(]", price_class or "")[0].strip().lower()


def collect_measured_ranges(
    parameters: Iterable[ParameterRow],
    recordings: Iterable[RecordingRow],
    price_classes: Mapping[str, str | None],
) -> MeasuredRanges:
    """Return the measured ranges of a run, from real sensors and recordings used in comparisons.

    They are the 95 % limits of parameters with a value. A random walk that is not significant in a
    log may be 0; its upper limit is used only if no log of the sensor determines one.
    """
    about = list(recordings)
    apart = list_excluded(about)
    real = {
        place
        for row in about
        if not row.simulated and (place := (row.sensor, row.recording)) not in apart
    }
    shown: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    absent: dict[tuple[str, str, str], list[float]] = {}
    for one in parameters:
        figure = _FIGURE_OF_PARAMETER.get(one.parameter)
        if figure is None or not one.recommended or one.component != 1:
            continue
        if (one.sensor, one.recording) not in real:
            continue
        key = (one.sensor, quantity_of(one.channel), figure)
        if one.status == "ok" and one.value is not None:
            low, high = (one.value if end is None else end for end in (one.lower, one.upper))
            shown.setdefault(key, []).append((low, high))
        elif one.status == "absent" and figure == "K":
            absent.setdefault(key, []).append(one.upper or 0.0)
    ranges = {}
    for key in {*shown, *absent}:
        several = shown.get(key, [(0.0, max(absent.get(key, [0.0])))])
        low = 0.0 if key in absent else min(ends[0] for ends in several)
        high = max(ends[1] for ends in several)
        if math.isfinite(high):
            ranges[key] = (low, high)
    classes = {sensor: parse_price_class(text) for sensor, text in price_classes.items() if text}
    return MeasuredRanges(ranges, classes)


End = Literal["best", "worst"]


@dataclass(frozen=True)
class Figures:
    """Ranges of the noise figures of a quantity of a sensor."""

    # N, B, K: SI; None: not published, and known for no other sensor. The best case is then 0, and
    # the worst case is not known
    N: Span
    B: Span | None
    K: Span | None
    # possible correlation times of B, s; None: flicker noise
    times: tuple[float | None, ...]
    assumed: tuple[str, ...]  # assumptions for figures that are not printed, in words

    @property
    def bounded(self) -> bool:
        """Whether the worst case is known."""
        return self.B is not None and self.K is not None

    def models(self, end: End) -> list[NoiseModel]:
        """Return the models of one case, one for each correlation time; the case must be known."""
        if end == "worst" and not self.bounded:
            raise ValueError(
                "the worst case is not known: one figure is not measured for any sensor"
            )
        N, B, K = (
            0.0 if span is None else span.low if end == "best" else span.high
            for span in (self.N, self.B, self.K)
        )
        if B == 0.0:
            return [NoiseModel(N=N, K=K)]
        return [NoiseModel(N=N, B=B, T_B=T_B, K=K) for T_B in self.times]


def read_figure_ranges(sensor: Sensor, quantity: str, ranges: MeasuredRanges) -> Figures | str:
    """Return the ranges that a datasheet allows for a quantity, or the reason without one."""
    if getattr(sensor.datasheet, quantity) is None:
        return texts.no_quantity(quantity)
    printed, options = _read_printed(sensor.datasheet, quantity)
    assumed: list[str] = [texts.any_option(quantity, options)] if options else []
    unknown: list[str] = []

    def filled(figure: str, statistic: str) -> Span | None:
        own = [row for row in printed if row.statistic == statistic]
        if own:
            if any(row.is_side_assumed for row in own):
                assumed.append(texts.either_side(quantity, figure))
            if all(row.figure is not None and row.figure.kind == "max" for row in own):
                assumed.append(texts.only_maximum(quantity, figure))
            return _find_ends(own)
        span = ranges.span(sensor.price_class, quantity, figure)
        if span is None:
            unknown.append(figure)
        else:
            assumed.append(texts.assumed_range(quantity, figure, span.low, span.high, span.words))
        return span

    if not any(row.statistic == "N" for row in printed):
        return texts.no_density(quantity)
    N = filled("N", "N")
    assert N is not None  # at least one is printed
    B = filled("B", "adev_minimum")
    if B is not None and not B.words:
        assumed.append(texts.floor_and_minimum(quantity))
        B = Span(B.low, B.high / FLOOR)
    K = filled("K", "K")
    T_B = filled("T_B", "T_B")
    if unknown:
        assumed.append(texts.neither_printed_nor_measured(quantity, unknown))
        if B is not None and "T_B" in unknown:
            assumed.append(texts.flicker_assumed(quantity))
    times: tuple[float | None, ...] = (None,)
    if T_B is not None:
        middle = math.sqrt(T_B.low * T_B.high)
        alone = (T_B.low, middle, T_B.high)
        times = alone if not T_B.words else (None, *alone)
    return Figures(N, B, K, tuple(dict.fromkeys(times)), tuple(assumed))


def collect_printed_ranges(
    sensors: Mapping[str, Sensor],
) -> dict[tuple[str, str], tuple[float, float]]:
    """Return the range of B, SI, by (sensor, quantity), that each datasheet prints."""
    ranges = {}
    for name, sensor in sensors.items():
        for quantity in SENSORS:
            if getattr(sensor.datasheet, quantity) is None:
                continue
            printed, _ = _read_printed(sensor.datasheet, quantity)
            own = [row for row in printed if row.statistic == "adev_minimum"]
            if own:
                ends = _find_ends(own)
                ranges[name, quantity] = (ends.low, ends.high / FLOOR)
    return ranges


def _find_ends(rows: Sequence[Comparable]) -> Span:
    values = [row.value for row in rows if row.value is not None]
    least = [row.least for row in rows if row.least is not None]
    return Span(min([*values, *least]), max(values))


def _read_printed(datasheet: Datasheet, quantity: str) -> tuple[list[Comparable], list[str]]:
    """Return the printed figures of all axes of a quantity, and the options included."""
    sheet: QuantityDatasheet = getattr(datasheet, quantity)
    named = {
        figure.option
        for name in ("noise_density", "random_walk", "rms_noise", "bias_instability")
        for figure in sheet.printed(name)
        if figure.option is not None
    }
    options: list[str] = []
    if named and not datasheet.options:  # select all of them
        options = sorted(named)
        datasheet = datasheet.model_copy(update={"options": tuple(options)})
    rows = [row for axis in "xyz" for row in read_comparables(datasheet, f"{quantity}_{axis}")]
    return [row for row in rows if row.value is not None], options


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
        why = tuple(entry for q in needed if isinstance(entry := figures[q], str))
        return replace(row, reasons=why)
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
        texts.figure_not_known(source_text(missed.source), missed.reason)
        for budget in budgets
        for missed in budget.missing
    )
    return margins, list(dict.fromkeys(missing))
