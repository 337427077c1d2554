"""Hard requirements of a sensor other than noise, and the conditions of a verdict.

Several unknown figures share the remaining error budget: with all of them at their largest, the
limit is just reached.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np
from pydantic import Field

from imubench_pipeline.datasheets.class_limits import count_sensors_within
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.states import MEASURED, Cause, Measured, SourceCode, Verdict
from imubench_pipeline.model.verdicts import Condition, Property, Share, Shortfall
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, Datasheet, PrintedFigure
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor
from imubench_pipeline.settings.validation import Strict
from imubench_pipeline.units import convert_to_si, parse_quantity

_ROUNDING_MARGIN = 1.0 + 1e-9
"""Tolerance for figures that are equal to the required ones in another unit."""


class Abilities(Strict):
    """Properties of a sensor, SI; None if not known."""

    # full_scale, bandwidth: largest fixed or selectable value, by quantity; rad/s, m/s^2, Hz
    full_scale: dict[Measured, float] = Field(default_factory=dict)
    bandwidth: dict[Measured, float] = Field(default_factory=dict)
    # logged_rate, rate: rate of its logs, and its highest rate, Hz
    logged_rate: float | None = None
    rate: float | None = None
    temperature: tuple[float, float] | None = None  # range of operation, degC
    channels: tuple[str, ...] = ()  # logged axes
    without: tuple[Measured, ...] = ()  # quantities that it does not measure
    # mass, power: kg and W
    mass: float | None = None
    power: float | None = None


def read_abilities(sensor: Sensor) -> Abilities:
    """Return the properties of a sensor from its file."""
    printed = {
        name: {
            quantity: largest
            for quantity in MEASURED
            if (largest := _find_largest(sensor.datasheet, quantity, name)) is not None
        }
        for name in ("full_scale", "bandwidth")
    }
    ends = sensor.temperature_range
    return Abilities(
        full_scale=printed["full_scale"],
        bandwidth=printed["bandwidth"],
        logged_rate=sensor.log.rate_hz,
        rate=_convert_to_si(sensor.rate, "frequency"),
        temperature=(
            (parse_quantity(ends[0], "temperature"), parse_quantity(ends[1], "temperature"))
            if ends
            else None
        ),
        channels=tuple(sensor.log.channels),
        without=tuple(each for each in MEASURED if getattr(sensor.datasheet, each) is None),
        mass=_convert_to_si(sensor.mass, "mass"),
        power=_convert_to_si(sensor.power, "power"),
    )


def _convert_to_si(text: str | None, dimension: str) -> float | None:
    return None if text is None else parse_quantity(text, dimension)


def _find_largest(datasheet: Datasheet, quantity: Measured, name: str) -> float | None:
    """Return the largest printed figure of the weakest axis, SI."""
    sheet = getattr(datasheet, quantity)
    figures: list[PrintedFigure] = [
        figure
        for figure in (sheet.printed(name) if sheet else ())
        if figure.option is None or not datasheet.options or figure.option in datasheet.options
    ]
    by_axis = []
    for axis in "xyz":
        values = [
            convert_to_si(size, figure.unit or "", FIGURE_DIMENSIONS[quantity][name][0])
            for figure in figures
            for size in np.ravel(figure.on_axis(axis) or ()).tolist()
        ]
        if not values:
            return None
        by_axis.append(max(values))
    return min(by_axis)


def judge(requirement: Requirement, has: Abilities) -> tuple[list[Shortfall], list[Condition]]:
    """Return the required properties that a sensor lacks, and the unknown ones."""
    points: dict[tuple[Property, str], tuple[bool | None, Shortfall]] = {}
    for fulfilled, point in _compare(requirement, has):
        points.setdefault((point.property, point.subject), (fulfilled, point))
    lacking = [point for fulfilled, point in points.values() if fulfilled is False]
    unknown = [Condition(None, *key) for key, (fulfilled, _) in points.items() if fulfilled is None]
    return lacking, unknown


def _compare(requirement: Requirement, has: Abilities) -> Iterator[tuple[bool | None, Shortfall]]:
    """Yield each required property, and whether it is fulfilled; None if that is not known."""
    must = requirement.must
    for measured in requirement.quantities:
        if measured in has.without:
            yield False, Shortfall("quantity", measured, measured)
    for text in must.axes:
        quantity, axes = text.split("_")
        if quantity in has.without:
            yield False, Shortfall("quantity", quantity, text)
            continue
        for axis in axes:
            # The sensor may have axes that are not in its logs.
            logged = f"{quantity}_{axis}" in has.channels or None
            yield logged, Shortfall("axis", f"{quantity}_{axis}", text)
    for measured in MEASURED:
        text = getattr(must.full_scale, measured)
        if text is None:
            continue
        if measured in has.without:
            yield False, Shortfall("quantity", measured, text)
            continue
        largest = has.full_scale.get(measured)
        least = parse_quantity(text, QUANTITIES[measured])
        enough = None if largest is None else largest * _ROUNDING_MARGIN >= least
        yield enough, Shortfall("full_scale", measured, text, _list_known(largest))
    if must.bandwidth is not None:
        # Of the quantities with required axes, or else of all.
        asked = {axes.split("_")[0] for axes in must.axes} or set(requirement.quantities)
        lowest = parse_quantity(must.bandwidth, "frequency")
        for measured in MEASURED:
            if measured in asked and measured not in has.without:
                width = has.bandwidth.get(measured)
                wide = None if width is None else width >= lowest
                yield wide, Shortfall("bandwidth", measured, must.bandwidth, _list_known(width))
    if must.rate is not None:
        least = parse_quantity(must.rate, "frequency")
        if has.logged_rate is not None and has.logged_rate >= least:
            yield True, Shortfall("rate", "", must.rate)
        else:
            # The rate of a log may be lower than the highest rate of the sensor.
            fast = None if has.rate is None else has.rate >= least
            yield fast, Shortfall("rate", "", must.rate, _list_known(has.rate))
    if must.temperature is not None:
        low, high = (parse_quantity(end, "temperature") for end in must.temperature)
        ends = has.temperature
        within = None if ends is None else ends[0] <= low and high <= ends[1]
        yield within, Shortfall("temperature", "", " to ".join(must.temperature), ends or ())
    sizes: tuple[tuple[Literal["mass", "power"], str | None, float | None], ...] = (
        ("mass", must.mass, has.mass),
        ("power", must.power, has.power),
    )
    for name, most, size in sizes:
        if most is not None:
            small = None if size is None else size <= parse_quantity(most, name) * _ROUNDING_MARGIN
            yield small, Shortfall(name, "", most, _list_known(size))


def _list_known(value: float | None) -> tuple[float, ...]:
    return () if value is None else (value,)


PASSING_VERDICTS: tuple[Verdict, ...] = ("meets", "likely_meets")
"""Verdicts with a margin above 1."""


@dataclass(frozen=True)
class Conditions:
    """Conditions of a verdict on a sensor."""

    shortfalls: tuple[Shortfall, ...]
    unknown: tuple[Condition, ...]  # demanded properties that are not known
    # largest value with which all limits are met, SI, of each unknown figure, by quantity and cause
    figures: Mapping[tuple[str, Cause], float]

    @classmethod
    def of(
        cls, requirement: Requirement, has: Abilities, conditions: Iterable[ErrorBudgetRow]
    ) -> "Conditions":
        """Return all conditions; ``conditions`` are budget rows with too large class limits."""
        lacking, unknown = judge(requirement, has)
        largest = merge_largest((row.quantity, row.source, row.largest) for row in conditions)
        return cls(tuple(lacking), tuple(unknown), largest)

    def judge(self, verdict: Verdict) -> tuple[Verdict, tuple[Condition, ...]]:
        """Return the final verdict and its conditions, from the verdict on the errors."""
        if self.shortfalls:
            return "excluded", ()
        if verdict == "meets_if":
            return verdict, (*make_figure_conditions(self.figures), *self.unknown)
        if self.unknown and verdict in PASSING_VERDICTS:
            return "meets_if", self.unknown
        return verdict, ()


def make_figure_conditions(figures: Mapping[tuple[str, Cause], float]) -> tuple[Condition, ...]:
    """Return the conditions that figures do not exceed these values, SI, except values of 0."""
    return tuple(
        Condition(cause, None, quantity, size, *count_sensors_within(quantity, cause, size))
        for (quantity, cause), size in figures.items()
        if size > 0.0
    )


def merge_largest(
    figures: Iterable[tuple[str | None, SourceCode, float | None]],
) -> dict[tuple[str, Cause], float]:
    """Return the smallest of the permitted values of each figure, by quantity and cause."""
    merged: dict[tuple[str, Cause], float] = {}
    for quantity, source, size in figures:
        if quantity and size and source in _CAUSES:
            key = quantity, cast("Cause", source)
            merged[key] = min(merged.get(key, size), size)
    return merged


_CAUSES = get_args(Cause)


def select_known_errors(rows: Iterable[ErrorBudgetRow]) -> list[tuple[ErrorBudgetRow, float]]:
    """Return the rows with a known standard deviation, each as a pair of row and deviation."""
    return [(row, row.sigma) for row in rows if row.sigma is not None]


def compute_variance_shares(total: float, sources: Iterable[ErrorBudgetRow]) -> tuple[Share, ...]:
    """Return the sources with 1 % or more of ``total``^2, the largest first, with their shares."""
    if total <= 0.0:
        return ()
    shares = (
        Share(
            row.source,
            row.quantity,
            row.through,
            row.T_B,
            row.frequency,
            share=(sigma / total) ** 2,
            origin=row.origin,
        )
        for row, sigma in select_known_errors(sources)
    )
    kept = (share for share in shares if share.share >= 0.01)
    return tuple(sorted(kept, key=lambda share: -share.share))
