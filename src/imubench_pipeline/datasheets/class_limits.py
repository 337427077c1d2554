"""Limits of a class of sensors: what its members print, for those that are silent.

A figure counts as one standard deviation, as in error budgets: typical ones as printed, a maximum
as three, and the end of a range as the root of three. A total over the temperature range bounds the
coefficient: it is reached over half of the range. An rms over the range is the coefficient times
the range over the root of 12.
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from statistics import median
from typing import get_args

import numpy as np

from imubench_pipeline.datasheets.comparable import Comparable, PrintedAxis, read_comparables
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, Datasheet, QuantityDatasheet
from imubench_pipeline.settings.sensor import QUANTITIES, Grade, Sensor
from imubench_pipeline.units import SI_UNITS, convert_to_si

FILE = Path(__file__).with_name("class_limits.csv")
"""The limits of the shipped catalogue."""

FIGURES = (
    *("N", "B", "rate_random_walk", "offset", "bias_repeatability", "temperature_coefficient"),
    *("scale_factor_error", "scale_factor_temperature", "nonlinearity", "misalignment"),
    *("cross_axis", "g_sensitivity", "vibration_rectification"),
)
"""Figures that have limits. B is the minimum of the Allan deviation, as vendors print it."""

_USUAL_RANGE = 125.0  # K, from -40 to 85 degC
SIGMAS_OF_KIND: Mapping[str, float] = {
    "1sigma": 1.0,
    "typ": 1.0,
    "derived": 1.0,
    "range": math.sqrt(3.0),
    "max": 3.0,
}
"""Number of standard deviations of a figure, by kind, in order of preference."""

_SEPARATOR = "; "


@dataclass(frozen=True)
class ClassLimit:
    """One figure of the sensors of a class, SI, one standard deviation."""

    grade: str
    quantity: str  # ``gyro`` or ``accel``
    figure: str  # of `FIGURES`
    unit: str
    sensors: int  # number that print the figure
    median: float
    worst: float
    spread: float | None  # standard deviation of the logarithm; None: of one sensor
    names: tuple[str, ...]  # these sensors


def derive_class_limits(sensors: Mapping[str, Sensor]) -> list[ClassLimit]:
    """Return the limits of each class from the figures of its sensors, in a fixed order."""
    limits = []
    for grade in get_args(Grade):
        members = {name: one for name, one in sensors.items() if one.grade == grade and one.sold}
        for quantity in QUANTITIES:
            for figure in FIGURES:
                values = {
                    name: value
                    for name, sensor in sorted(members.items())
                    if (value := read_sigma(sensor, quantity, figure)) is not None
                }
                if values:
                    limits.append(_summarise(grade, quantity, figure, values))
    return limits


def _summarise(grade: str, quantity: str, figure: str, values: Mapping[str, float]) -> ClassLimit:
    logarithms = np.log(list(values.values()))
    return ClassLimit(
        grade=grade,
        quantity=quantity,
        figure=figure,
        unit=_unit_of(quantity, figure),
        sensors=len(values),
        median=median(values.values()),
        worst=max(values.values()),
        spread=float(np.std(logarithms, ddof=1)) if len(values) > 1 else None,
        names=tuple(values),
    )


def read_sigma(sensor: Sensor, quantity: str, figure: str) -> float | None:
    """Return a printed figure as one standard deviation of the worst axis, SI; None: none."""
    if getattr(sensor.datasheet, quantity) is None:
        return None
    if figure not in ("N", "B") and figure not in FIGURE_DIMENSIONS[quantity]:
        return None
    axes = [f"{quantity}_{axis}" for axis in "xyz"]
    values = [value for axis in axes for value in _list_sigmas(sensor, axis, figure)]
    return max(values, default=None)


def _list_sigmas(sensor: Sensor, channel: str, figure: str) -> Iterator[float]:
    """Yield the standard deviations of a figure of a channel, SI."""
    datasheet = _with_options(sensor.datasheet)
    axis = PrintedAxis.of(datasheet, channel)
    if figure in ("N", "B"):
        statistic = {"N": "N", "B": "adev_minimum"}[figure]
        rows = [row for row in read_comparables(datasheet, channel) if row.statistic == statistic]
        # A random walk is N itself; a density of unknown sidedness counts as one-sided.
        rows = [row for row in rows if row.sidedness != "two-sided" or not row.is_side_assumed]
        yield from _sigmas_of(rows)
        return
    own = list(_sigmas_of(_read(axis, figure)))
    if figure == "temperature_coefficient" and not own:
        span = _temperature_span(sensor)
        totals = _sigmas_of(_read(axis, "temperature_total"))
        own = [2.0 * total / span for total in totals]
        if not own:
            rms = _sigmas_of(_read(axis, "temperature_rms"))
            own = [s * math.sqrt(12.0) / span for s in rms]
    yield from own


def _with_options(datasheet: Datasheet) -> Datasheet:
    """Return a datasheet with the options of the logged sensor, or else with all."""
    sheets = (datasheet.gyro, datasheet.accel)
    printed = [
        figure.option
        for sheet in sheets
        for name in (QuantityDatasheet.model_fields if sheet else ())
        for figure in (sheet.printed(name) if sheet else ())
        if figure.option is not None
    ]
    return datasheet if datasheet.options else datasheet.model_copy(update={"options": printed})


def _read(axis: PrintedAxis, name: str) -> list[Comparable]:
    return axis.read(name, Comparable(name, name, None), axis.si(name))


def _sigmas_of(rows: Iterable[Comparable]) -> Iterator[float]:
    """Yield the standard deviations of the kind that is preferred among those printed."""
    listed = [(row.figure.kind, row.value) for row in rows if row.figure and row.value]
    kind = next((kind for kind in SIGMAS_OF_KIND if kind in dict(listed)), None)
    if kind is not None:
        yield from (value / SIGMAS_OF_KIND[kind] for own, value in listed if own == kind)


def _temperature_span(sensor: Sensor) -> float:
    """Return the width of the temperature range of operation, K."""
    if sensor.temperature_range is None:
        return _USUAL_RANGE
    low, high = (_celsius(text) for text in sensor.temperature_range)
    return high - low


def _celsius(text: str) -> float:
    value, _, unit = text.partition(" ")
    return convert_to_si(float(value), unit, "temperature")


def _unit_of(quantity: str, figure: str) -> str:
    if figure == "N":
        return SI_UNITS[f"{quantity}_density"]
    if figure == "B":
        return SI_UNITS[QUANTITIES[quantity]]
    return SI_UNITS[FIGURE_DIMENSIONS[quantity][figure][0]]


def write_class_limits(limits: Iterable[ClassLimit]) -> str:
    """Return limits as CSV, with numbers of four digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(ClassLimit))
    for one in limits:
        spread = "" if one.spread is None else f"{one.spread:.3g}"
        numbers = (one.sensors, f"{one.median:.4g}", f"{one.worst:.4g}", spread)
        place = (one.grade, one.quantity, one.figure, one.unit)
        writer.writerow((*place, *numbers, _SEPARATOR.join(one.names)))
    return text.getvalue()


def read_class_limits(path: Path = FILE) -> list[ClassLimit]:
    """Return the limits in a file that `write_class_limits` made."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            ClassLimit(
                grade=row["grade"],
                quantity=row["quantity"],
                figure=row["figure"],
                unit=row["unit"],
                sensors=int(row["sensors"]),
                median=float(row["median"]),
                worst=float(row["worst"]),
                spread=float(row["spread"]) if row["spread"] else None,
                names=tuple(row["names"].split(_SEPARATOR)),
            )
            for row in csv.DictReader(file)
        ]
