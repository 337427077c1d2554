"""Figures of a sensor as one standard deviation, and limits of its class where it prints none.

A document may make several statements about a figure: typical and maximum, at 25 degC and over the
range, an offset and its repeatability. The statement with the least standard deviation counts, so
that a further figure never makes a sensor worse, and none that is left out makes it better. A
typical figure is one standard deviation, a maximum three, and the end of a range the root of three.
A total over the temperature range bounds the coefficient: it is reached in half of the range. An
rms over the range is the coefficient times the range, divided by the root of 12. Of several options
(grades, ranges), the best one counts for each figure, unless the file selects some.

A sensor that prints no figure counts as the worst of its class (`find_limit`).
"""

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from statistics import median
from typing import cast, get_args

import numpy as np

from imubench_pipeline.datasheets.comparable import Comparable, PrintedAxis, read_comparables
from imubench_pipeline.model.states import Cause
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, Datasheet, QuantityDatasheet
from imubench_pipeline.settings.sensor import QUANTITIES, Grade, Sensor
from imubench_pipeline.units import SI_UNITS, parse_quantity

FILE = Path(__file__).with_name("class_limits.csv")
"""The limits of the shipped catalogue."""

_GRADE_FILE = Path(__file__).with_name("grade_limits.csv")

STATEMENTS: Mapping[Cause, tuple[str, ...]] = {
    "turn_on_bias": ("offset", "bias_repeatability"),
    "temperature": ("temperature_coefficient", "temperature_total", "temperature_rms"),
    "scale_factor": ("scale_factor_error",),
    "scale_factor_temperature": ("scale_factor_temperature",),
    "nonlinearity": ("nonlinearity",),
    "misalignment": ("misalignment", "cross_axis"),
    "g_sensitivity": ("g_sensitivity",),
    "vibration_rectification": ("vibration_rectification",),
}
"""Keys of a datasheet that state a figure which static logs do not show, the usual one first."""

_NOISE: Mapping[str, str] = {"N": "N", "B": "adev_minimum", "K": "K"}
"""Statistic of each noise figure. B is the minimum of the Allan deviation, as vendors print it."""

FIGURES: tuple[str, ...] = (*_NOISE, *STATEMENTS)
"""Figures that have limits."""

_GRADES: tuple[str, ...] = get_args(Grade)
_MIN_SENSORS = 3  # a class with fewer is not taken to be better than the next better class
_UNKNOWN_RANGE = 50.0  # K; less than any sensor of the catalogue has, so that silence does not help
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
    """The range of a figure among the sensors of a class, SI, as one standard deviation."""

    grade: str
    quantity: str  # ``gyro`` or ``accel``
    figure: str  # of `FIGURES`
    unit: str
    # best, median, worst: of the sensors that print the figure
    best: float
    median: float
    worst: float
    spread: float | None  # standard deviation of the logarithm; None with one sensor
    sensors: Mapping[str, float]  # the figure of each sensor


def derive_class_limits(sensors: Mapping[str, Sensor]) -> list[ClassLimit]:
    """Return the limits of each class from the figures of its sensors, in a fixed order."""
    limits = []
    for grade in _GRADES:
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
    rounded = {name: _round_up(value) for name, value in values.items()}
    logarithms = np.log(list(rounded.values()))
    return ClassLimit(
        grade=grade,
        quantity=quantity,
        figure=figure,
        unit=_unit_of(quantity, figure),
        best=min(rounded.values()),
        median=median(rounded.values()),
        worst=max(rounded.values()),
        spread=float(np.std(logarithms, ddof=1)) if len(values) > 1 else None,
        sensors=rounded,
    )


def _round_up(value: float) -> float:
    """Return a figure with four digits, which is not below the printed one."""
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.ceil(value / step - 1e-6) * step:.4g}")


@cache
def _load_shipped() -> dict[tuple[str, str, str], ClassLimit]:
    return {(one.grade, one.quantity, one.figure): one for one in read_class_limits()}


def find_limit(grade: str | None, quantity: str, figure: str) -> ClassLimit:
    """Return the shipped limit of a figure for a class; grade None: for all classes together.

    A class with fewer than three sensors is not taken to be better than the next better class: its
    worst figure is the worst of both. If no sensor of the class prints the figure, the next worse
    class is used. Raises KeyError if no sensor of the catalogue prints it.
    """
    limits = [_load_shipped().get((each, quantity, figure)) for each in _GRADES]
    known = [limit for limit in limits if limit]
    if not known:
        raise KeyError(f"no sensor of the catalogue prints {figure} of the {quantity}")
    if grade is None:
        every = {name: value for limit in known for name, value in limit.sensors.items()}
        return _summarise("any", quantity, figure, every)
    place = _GRADES.index(grade)
    own, better = limits[place], next(filter(None, limits[place + 1 :]), None)
    if own is None:
        return next(filter(None, reversed(limits[:place])), known[0])
    if len(own.sensors) >= _MIN_SENSORS or better is None or better.worst <= own.worst:
        return own
    return _summarise(own.grade, quantity, figure, {**better.sensors, **own.sensors})


def count_sensors_within(quantity: str, figure: str, largest: float) -> tuple[int, int]:
    """Return how many sensors print a figure up to ``largest``, SI, and how many print any."""
    values = find_limit(None, quantity, figure).sensors.values()
    return sum(value <= largest for value in values), len(values)


def read_sigma(sensor: Sensor, quantity: str, figure: str) -> float | None:
    """Return a printed figure, SI, as 1 sigma of the worst axis; None if an axis has none."""
    if getattr(sensor.datasheet, quantity) is None:
        return None
    axes = [list(_list_statements(sensor, f"{quantity}_{axis}", figure)) for axis in "xyz"]
    return max(map(min, axes)) if all(axes) else None


def _list_statements(sensor: Sensor, channel: str, figure: str) -> Iterator[float]:
    datasheet = _with_options(sensor.datasheet)
    if figure in _NOISE:
        by_figure: dict[int, list[Comparable]] = {}
        for row in read_comparables(datasheet, channel):
            if row.statistic == _NOISE[figure] and row.figure and row.value:
                by_figure.setdefault(id(row.figure), []).append(row)
        for rows in by_figure.values():
            # A density of unknown sidedness may be either: the larger N counts.
            yield max(row.value or 0.0 for row in rows)
        return
    axis = PrintedAxis.of(datasheet, channel)
    for name in STATEMENTS[cast("Cause", figure)]:
        if name not in FIGURE_DIMENSIONS[axis.quantity]:
            continue
        factor = 1.0
        if name == "temperature_total":
            factor = 2.0 / _temperature_span(sensor)
        elif name == "temperature_rms":
            factor = math.sqrt(12.0) / _temperature_span(sensor)
        for row in axis.read(name, Comparable(name, name, None), axis.si(name)):
            if row.figure and row.value and row.figure.kind in SIGMAS_OF_KIND:
                yield factor * row.value / SIGMAS_OF_KIND[row.figure.kind]


def _with_options(datasheet: Datasheet) -> Datasheet:
    """Return a datasheet with the options of the logged sensor, or else with all."""
    printed = [
        figure.option
        for sheet in (datasheet.gyro, datasheet.accel)
        for name in (QuantityDatasheet.model_fields if sheet else ())
        for figure in (sheet.printed(name) if sheet else ())
        if figure.option is not None
    ]
    return datasheet if datasheet.options else datasheet.model_copy(update={"options": printed})


def _temperature_span(sensor: Sensor) -> float:
    if sensor.temperature_range is None:
        return _UNKNOWN_RANGE
    low, high = (parse_quantity(text, "temperature") for text in sensor.temperature_range)
    return high - low


def _unit_of(quantity: str, figure: str) -> str:
    if figure == "N":
        return SI_UNITS[f"{quantity}_density"]
    if figure == "B":
        return SI_UNITS[QUANTITIES[quantity]]
    name = "rate_random_walk" if figure == "K" else STATEMENTS[cast("Cause", figure)][0]
    return SI_UNITS[FIGURE_DIMENSIONS[quantity][name][0]]


def write_class_limits(limits: Iterable[ClassLimit]) -> str:
    """Return limits as CSV, with four digits; the last column has the figure of each sensor."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(ClassLimit))
    for one in limits:
        spread = "" if one.spread is None else f"{one.spread:.3g}"
        numbers = (f"{one.best:.4g}", f"{one.median:.4g}", f"{one.worst:.4g}", spread)
        names = _SEPARATOR.join(f"{name} {value:.4g}" for name, value in one.sensors.items())
        writer.writerow((one.grade, one.quantity, one.figure, one.unit, *numbers, names))
    return text.getvalue()


def read_class_limits(path: Path = FILE) -> list[ClassLimit]:
    """Return the limits in a file that `write_class_limits` made."""
    limits = []
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            pairs = (each.split(" ") for each in row["sensors"].split(_SEPARATOR))
            values = {name: float(value) for name, value in pairs}
            limits.append(_summarise(row["grade"], row["quantity"], row["figure"], values))
    return limits


@cache
def read_grade_limits(quantity: str) -> Mapping[str, Mapping[str, float]]:
    """Return the largest N and B of each grade, the worst grade first; consumer has none.

    N in rad/s/sqrt(Hz) or m/s^2/sqrt(Hz), two-sided; B in rad/s or m/s^2.

    The file names the source of each limit. Between grades, figures of the catalogue overlap; these
    limits are for orientation, not for verdicts.
    """
    limits: dict[str, dict[str, float]] = {}
    with _GRADE_FILE.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["quantity"] == quantity:
                limits.setdefault(row["grade"], {})[row["figure"]] = float(row["limit"])
    return limits
