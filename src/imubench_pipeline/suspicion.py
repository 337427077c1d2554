"""Whether a printed or an estimated figure is so far from others that its unit is in doubt."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median

from imubench_pipeline.comparable import Comparable, comparables
from imubench_pipeline.sensor import QUANTITIES, Sensor
from imubench_pipeline.units import from_si

_FAR = 20.0
_FEWEST = 5
_DEGREES = math.degrees(1.0)
_SHOWN: dict[tuple[str, str], tuple[str, str]] = {
    ("gyro", "N"): ("°/s/√Hz", "gyro_density"),
    ("gyro", "B"): ("°/h", "angular_rate"),
    ("accel", "N"): ("µg/√Hz", "accel_density"),
    ("accel", "B"): ("µg", "acceleration"),
}


@dataclass(frozen=True)
class Usual:
    """What is usual of a figure.

    Attributes
    ----------
    median, least : float
        SI.
    sensors : int
        How many there are.
    """

    median: float
    least: float
    sensors: int


UsualFigures = Mapping[tuple[str, str], Usual]


def usual_figures(sensors: Mapping[str, Sensor]) -> dict[tuple[str, str], Usual]:
    """Return what is usual of N and B in a catalogue.

    Parameters
    ----------
    sensors : mapping of str to Sensor

    Returns
    -------
    dict
        By quantity and figure (``N``, ``B``), where at least five sensors have it.
    """
    found: dict[tuple[str, str], list[float]] = {}
    for sensor in sensors.values():
        for quantity in QUANTITIES:
            for figure, value in printed_figures(sensor, quantity).items():
                found.setdefault((quantity, figure), []).append(value)
    return {
        key: Usual(median(values), min(values), len(values))
        for key, values in found.items()
        if len(values) >= _FEWEST
    }


def printed_figures(sensor: Sensor, quantity: str) -> dict[str, float]:
    """Return N and B of a sensor as its datasheet prints them, of the first axis that has them.

    Parameters
    ----------
    sensor : Sensor
    quantity : str
        ``gyro`` or ``accel``.

    Returns
    -------
    dict
        SI, under ``N`` and ``B``; B is the minimum of the curve, as vendors print it.
    """
    found: dict[str, float] = {}
    for axis in "xyz":
        rows = comparables(sensor.datasheet, f"{quantity}_{axis}")
        known = [(row, row.value) for row in rows if row.value is not None]
        for figure, statistic in (("N", "N"), ("B", "adev_minimum")):
            values = [value for row, value in known if row.statistic == statistic and _plain(row)]
            if values:
                found.setdefault(figure, values[0])
    return found


def _plain(row: Comparable) -> bool:
    return row.figure is not None and row.figure.kind != "range"


def suspicious(quantity: str, figures: Mapping[str, float], usual: UsualFigures) -> list[str]:
    """Say which figures are twenty times off what is usual, and what they would be in degrees.

    Too large is what is above twenty times the median of the catalogue; too small, since there
    are sensors of every price, what is below a twentieth of its least.

    Parameters
    ----------
    quantity : str
        ``gyro`` or ``accel``.
    figures : mapping of str to float
        ``N`` and ``B``, printed or estimated, SI.
    usual : mapping
        What `usual_figures` returns.

    Returns
    -------
    list of str
        A sentence a figure.
    """
    found = []
    for figure, value in figures.items():
        known = usual.get((quantity, figure))
        if known is None:
            continue
        if value > _FAR * known.median:
            how = f"{value / known.median:.3g} times the median of {known.sensors} sensors, "
            doubt = _in_degrees(quantity, figure, value / _DEGREES, "degrees, and not rad")
            found.append(_sentence(quantity, figure, value, how, known.median, doubt))
        elif 0 < value < known.least / _FAR:
            how = f"{known.least / value:.3g} times below the least of {known.sensors} sensors, "
            doubt = _in_degrees(quantity, figure, value * _DEGREES, "rad, and not degrees")
            found.append(_sentence(quantity, figure, value, how, known.least, doubt))
    return found


def _sentence(quantity: str, figure: str, value: float, how: str, other: float, doubt: str) -> str:
    shown = _text(quantity, figure, value)
    return f"{quantity} {figure} = {shown} is {how}{_text(quantity, figure, other)}: {doubt}"


def _in_degrees(quantity: str, figure: str, value: float, unit: str) -> str:
    if quantity != "gyro":
        return "is its unit right?"
    return f"is it in {unit}? It would be {_text(quantity, figure, value)} then"


def _text(quantity: str, figure: str, value: float) -> str:
    unit, dimension = _SHOWN[quantity, figure]
    return f"{from_si(value, unit, dimension):.3g} {unit}"


def suspicious_datasheets(sensors: Mapping[str, Sensor]) -> dict[str, list[str]]:
    """Say which printed figures of a catalogue are twenty times off what is usual in it.

    Parameters
    ----------
    sensors : mapping of str to Sensor

    Returns
    -------
    dict
        Sentences (see `suspicious`) by sensor, of those that have any.
    """
    usual = usual_figures(sensors)
    said = {
        name: [
            sentence
            for quantity in QUANTITIES
            for sentence in suspicious(quantity, printed_figures(sensor, quantity), usual)
        ]
        for name, sensor in sensors.items()
    }
    return {name: sentences for name, sentences in said.items() if sentences}
