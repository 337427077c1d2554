"""Check printed and estimated figures for wrong units, against the figures of other sensors."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from statistics import median

from imubench_pipeline.datasheets.comparable import read_comparables
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor, quantity_of
from imubench_pipeline.tables.findings import find
from imubench_pipeline.words.findings.plausibility import (
    UNIT_MISTAKES,
    ImpossibleNoise,
    UnusualFigure,
)

_SUSPICIOUS_FACTOR = 20.0
_IMPOSSIBLE_FACTOR = 1e4  # below the least of a catalogue: seismometers have a thousandth of it
_MIN_SENSORS = 5
MAX_FACTOR_FROM_PRINTED = 4.0
"""Maximum usual ratio of a figure to the printed one, either way: low-pass filters, a bad specimen
or another sidedness explain it."""

_MAX_FACTOR_BEYOND_CATALOGUE = 2.0
"""Maximum usual factor below the least, or above the largest, figure of a catalogue."""


@dataclass(frozen=True)
class Usual:
    """The range of a figure among the sensors of a catalogue."""

    # median, least, most: SI
    median: float
    least: float
    most: float
    sensors: int  # number of sensors


UsualFigures = Mapping[tuple[str, str], Usual]


def usual_as_text(usual: UsualFigures) -> str:
    """Return usual figures as JSON, for the settings of a step."""
    rows = [[*key, asdict(value)] for key, value in sorted(usual.items())]
    return json.dumps(rows, sort_keys=True)


def usual_of_text(text: str) -> UsualFigures:
    """Return the usual figures that `usual_as_text` wrote."""
    return {(quantity, figure): Usual(**value) for quantity, figure, value in json.loads(text)}


def usual_figures(sensors: Mapping[str, Sensor]) -> dict[tuple[str, str], Usual]:
    """Return the usual N and B of a catalogue, if at least five sensors have them."""
    by_figure: dict[tuple[str, str], list[float]] = {}
    for sensor in sensors.values():
        for quantity in QUANTITIES:
            for figure, value in printed_figures(sensor, quantity).items():
                by_figure.setdefault((quantity, figure), []).append(value)
    return {
        key: Usual(median(values), min(values), max(values), len(values))
        for key, values in by_figure.items()
        if len(values) >= _MIN_SENSORS
    }


def printed_figures(sensor: Sensor, quantity: str) -> dict[str, float]:
    """Return the printed N and B (minimum of the curve), SI, from the first axis that has them."""
    figures: dict[str, float] = {}
    for axis in "xyz":
        rows = read_comparables(sensor.datasheet, f"{quantity}_{axis}")
        with_value = [(row, row.value) for row in rows if row.value is not None]
        for figure, statistic in (("N", "N"), ("B", "adev_minimum")):
            values = [
                value
                for row, value in with_value
                if row.statistic == statistic and row.figure and row.figure.kind != "range"
            ]
            if values:
                figures.setdefault(figure, values[0])
    return figures


def suspicious(
    quantity: str,
    figures: Mapping[str, float],
    usual: UsualFigures,
    printed: Mapping[str, float] | None = None,
) -> list[UnusualFigure]:
    """Return a finding for each figure that is 20 times too large or small, and the likely unit.

    The figures are N and B, printed or estimated, SI. A figure is too large above 20 times the
    median of the catalogue (`usual_figures`). It is too small below a twentieth of the least of the
    catalogue, since there are sensors of every price. A figure near the one in the sensor's own
    datasheet (``printed``, SI) is neither. Another unit is named if its factor gives a usual figure
    for the sensor, or for the catalogue if the datasheet prints none.
    """
    found = []
    for figure, value in figures.items():
        typical = usual.get((quantity, figure))
        if typical is None:
            continue
        least = typical.least / _MAX_FACTOR_BEYOND_CATALOGUE
        most = typical.most * _MAX_FACTOR_BEYOND_CATALOGUE
        if own := (printed or {}).get(figure):
            least, most = own / MAX_FACTOR_FROM_PRINTED, own * MAX_FACTOR_FROM_PRINTED
            if least <= value <= most:
                continue
        if value > _SUSPICIOUS_FACTOR * typical.median:
            other = typical.median
        elif 0 < value < typical.least / _SUSPICIOUS_FACTOR:
            other = typical.least
        else:
            continue
        factor = next((f for f, _ in UNIT_MISTAKES[quantity] if least <= value * f <= most), None)
        found.append(UnusualFigure(quantity, figure, value, other, typical.sensors, factor))
    return found


def unusual_rows(
    parameters: Iterable[ParameterRow], sensors: Mapping[str, Sensor], usual: UsualFigures
) -> Iterator[FindingRow]:
    """Yield rows of ``findings`` on estimates of N and B far from all printed figures."""
    for row in parameters:
        # Vendors print the minimum of the Allan deviation as B.
        figure = {"N": "N", "sigma_min": "B"}.get(row.parameter)
        value = row.value
        if figure is None or value is None:
            continue
        quantity, sensor = quantity_of(row.channel), sensors.get(row.sensor)
        printed = printed_figures(sensor, quantity) if sensor else None
        typical = usual.get((quantity, "N"))
        if figure == "N" and typical and value < typical.least / _IMPOSSIBLE_FACTOR:
            impossible = ImpossibleNoise(value, typical.least, typical.sensors)
            yield find(impossible, "warning", value, row.channel).row(row.sensor, row.recording)
            continue
        for data in suspicious(quantity, {figure: value}, usual, printed):
            estimate = replace(data, lower=row.lower, upper=row.upper, estimated=True)
            yield find(estimate, "warning", value, row.channel).row(row.sensor, row.recording)
