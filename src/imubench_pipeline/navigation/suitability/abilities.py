"""Compare the properties of a sensor other than noise with the hard requirements."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args

from pydantic import Field

from imubench_pipeline.settings.printed import (
    FIGURE_DIMENSIONS,
    SENSORS,
    Datasheet,
    Measured,
    PrintedFigure,
)
from imubench_pipeline.settings.requirements import Must
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor
from imubench_pipeline.settings.validation import Strict
from imubench_pipeline.units import from_si, quantity_to_si, to_si

_FULL_SCALE_UNITS: dict[Measured, str] = {"gyro": "deg/s", "accel": "g"}

_ROUNDING_MARGIN = 1.0 + 1e-9
"""Tolerance for figures that are equal to the required ones in another unit."""


class Abilities(Strict):
    """Properties of a sensor, SI; None if not known."""

    # full_scale, bandwidth: the largest fixed or selectable one, by quantity; rad/s, m/s^2, Hz
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


@dataclass(frozen=True)
class _Point:
    """One requirement; ``fulfilled`` is None if not known."""

    name: str
    fulfilled: bool | None
    asked: str
    shown: str = ""


def abilities(sensor: Sensor) -> Abilities:
    """Return the properties of a sensor from its file."""
    quantities: tuple[Measured, ...] = ("gyro", "accel")
    printed = {
        name: {
            quantity: largest
            for quantity in quantities
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
            (quantity_to_si(ends[0], "temperature"), quantity_to_si(ends[1], "temperature"))
            if ends
            else None
        ),
        channels=tuple(sensor.log.channels),
        without=tuple(
            quantity for quantity in quantities if getattr(sensor.datasheet, quantity) is None
        ),
        mass=_convert_to_si(sensor.mass, "mass"),
        power=_convert_to_si(sensor.power, "power"),
    )


def _convert_to_si(text: str | None, dimension: str) -> float | None:
    return None if text is None else quantity_to_si(text, dimension)


def _find_largest(datasheet: Datasheet, quantity: Measured, name: str) -> float | None:
    """Return the largest printed figure of the weakest axis, SI."""
    sheet = getattr(datasheet, quantity)
    figures: list[PrintedFigure] = [
        figure
        for figure in (sheet.printed(name) if sheet else ())
        if figure.option is None or figure.option in datasheet.options
    ]
    by_axis = []
    for axis in "xyz":
        printed = [(figure, figure.on_axis(axis)) for figure in figures]
        values = [
            to_si(size, figure.unit or "", FIGURE_DIMENSIONS[quantity][name][0])
            for figure, value in printed
            if value is not None
            for size in (value if isinstance(value, tuple) else (value,))
        ]
        if values:
            by_axis.append(max(values))
    return min(by_axis, default=None)


def judge(must: Must, has: Abilities) -> tuple[list[str], list[str]]:
    """Compare the properties of a sensor with the hard requirements.

    Returns
    -------
    (list of str, list of str)
        Requirements that it does not meet, such as ``full scale of the gyro 250 deg/s, 300 deg/s
        asked``, and properties that are not known, such as ``mass``.
    """
    lacking: list[str] = []
    unknown: list[str] = []
    for point in _compare(must, has):
        if point.fulfilled is None:
            unknown.append(point.name)
        elif not point.fulfilled:
            lacking.append(
                f"{point.name} {point.shown}, {point.asked} asked"
                if point.shown
                else f"no {point.name}"
            )
    return list(dict.fromkeys(lacking)), list(dict.fromkeys(unknown))


def _compare(must: Must, has: Abilities) -> Iterator[_Point]:
    yield from _compare_axes(must, has)
    yield from _compare_full_scales(must, has)
    yield from _compare_bandwidths(must, has)
    if must.rate is not None:
        yield _compare_rate(must.rate, has)
    if must.temperature is not None:
        yield _compare_temperature(must.temperature, has)
    for name, text, size, unit in (
        ("mass", must.mass, has.mass, "g"),
        ("power", must.power, has.power, "W"),
    ):
        if text is not None:
            small = None if size is None else size <= quantity_to_si(text, name) * _ROUNDING_MARGIN
            yield _Point(name, small, text, _format_value(size, unit, name))


def _compare_full_scales(must: Must, has: Abilities) -> Iterator[_Point]:
    asked: dict[Measured, str | None] = {
        "gyro": must.full_scale.gyro,
        "accel": must.full_scale.accel,
    }
    for measured, text in asked.items():
        if text is None:
            continue
        name = f"full scale of the {SENSORS[measured]}"
        dimension, largest = QUANTITIES[measured], has.full_scale.get(measured)
        shown = _format_value(largest, _FULL_SCALE_UNITS[measured], dimension)
        if measured in has.without:
            yield _Point(SENSORS[measured], False, text)
        elif largest is None:
            yield _Point(name, None, text)
        else:
            yield _Point(
                name, largest * _ROUNDING_MARGIN >= quantity_to_si(text, dimension), text, shown
            )


def _compare_bandwidths(must: Must, has: Abilities) -> Iterator[_Point]:
    """Yield the bandwidth of the quantities with required axes, or else of all."""
    if must.bandwidth is None:
        return
    asked = {text.split("_")[0] for text in must.axes} or set(SENSORS)
    for measured in get_args(Measured):
        if measured in asked and measured not in has.without:
            width = has.bandwidth.get(measured)
            wide = None if width is None else width >= quantity_to_si(must.bandwidth, "frequency")
            shown = _format_value(width, "Hz", "frequency")
            yield _Point(f"bandwidth of the {SENSORS[measured]}", wide, must.bandwidth, shown)


def _compare_rate(text: str, has: Abilities) -> _Point:
    least = quantity_to_si(text, "frequency")
    if has.logged_rate is not None and has.logged_rate >= least:
        return _Point("rate", True, text)
    # The rate of a log may be lower than the highest rate of the sensor.
    fast = None if has.rate is None else has.rate >= least
    return _Point("rate", fast, text, _format_value(has.rate, "Hz", "frequency"))


def _compare_temperature(ends: tuple[str, str], has: Abilities) -> _Point:
    name, text = "temperature range", " to ".join(ends)
    if has.temperature is None:
        return _Point(name, None, text)
    low, high = (quantity_to_si(end, "temperature") for end in ends)
    covered = has.temperature
    within = covered[0] <= low and high <= covered[1]
    return _Point(name, within, text, f"{covered[0]:.4g} to {covered[1]:.4g} degC")


def _compare_axes(must: Must, has: Abilities) -> Iterator[_Point]:
    for text in must.axes:
        quantity, axes = text.split("_")
        if quantity in has.without:
            yield _Point(SENSORS[quantity], False, text)
            continue
        for axis in axes:
            # The sensor may have axes that are not in its logs.
            logged = f"{quantity}_{axis}" in has.channels or None
            yield _Point(f"axis {quantity}_{axis}", logged, text)


def _format_value(value: float | None, unit: str, dimension: str) -> str:
    return "" if value is None else f"{from_si(value, unit, dimension):.4g} {unit}"
