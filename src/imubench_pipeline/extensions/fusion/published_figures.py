"""Compare printed figures of a sensor with estimates of the log simulated from them."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

import pyarrow as pa

from imubench_pipeline.datasheets.comparable import SENSITIVITY
from imubench_pipeline.estimators.estimate import SI_UNITS
from imubench_pipeline.extensions.fusion.tables import PublishedFigureRow
from imubench_pipeline.model import estimates
from imubench_pipeline.model.comparisons import DatasheetRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import ChannelRow
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording

_Place = tuple[str, str, str, str]

_DATASHEET_PARAMETERS = {  # parameter and factor of datasheet figures, by statistic or quantity
    "N": ("N", 1.0),
    "adev_minimum": ("B", 1.0 / FLOOR),
    "offset": ("bias", 1.0),
    SENSITIVITY: (SENSITIVITY, 1.0),
}
_MAX_TAU_OVER_LENGTH = 1.0 / 9.0  # longest tau at which a curve is read, over the duration


def yield_published_figures(
    truths: str, truth: Iterable[estimates.SimulatedTruthRow], tables: Mapping[str, pa.Table]
) -> Iterator[PublishedFigureRow]:
    """Yield the rows of the table ``published_figures`` of a sensor.

    `truths`: the simulated recordings, as JSON; `truth`: their true parameters; `tables`:
    ``recordings``, ``allan``, ``parameters``, ``fixed_bias``, ``temperature``, ``datasheet``.
    """
    entries = [SimulatedRecording.model_validate(entry) for entry in json.loads(truths)]
    if not any(settings.published for entry in entries for settings in entry.channels.values()):
        return
    true = _slowest(truth)
    curve, best = _estimates(tables)
    printed = _printed(DatasheetRow.rows_of(tables["datasheet"]))
    for entry in entries:
        for channel, settings in entry.channels.items():
            quantity = quantity_of(channel)
            units = SI_UNITS[quantity]
            for figure in settings.published:
                key = (entry.sensor, entry.recording, str(channel), figure.parameter)
                estimate = best.get(key)
                sheet = [
                    value for kind, value in printed.get(key, []) if figure.kind in (None, kind)
                ]
                shown = true.get(key)
                unit = units["B"] + "/K" * (figure.parameter == "sensitivity")
                yield PublishedFigureRow(
                    sensor=entry.sensor,
                    recording=entry.recording,
                    channel=channel,
                    place=figure.where,
                    figure=figure.figure,
                    printed=figure.printed,
                    of=figure.of,
                    parameter=figure.parameter,
                    means=figure.si(quantity),
                    unit=units.get(figure.parameter, unit),
                    truth=shown.value if shown else None,
                    curve=curve.get(key),
                    value=estimate.value if estimate else None,
                    lower=estimate.lower if estimate else None,
                    upper=estimate.upper if estimate else None,
                    datasheet=min(sheet, default=None),
                    datasheet_upper=max(sheet) if len(set(sheet)) > 1 else None,
                    reason=figure.why,
                )


def _place(row: ChannelRow, parameter: str) -> _Place:
    return row.sensor, row.recording, row.channel, parameter


def _estimates(
    tables: Mapping[str, pa.Table],
) -> tuple[dict[_Place, float], dict[_Place, estimates.ParameterRow | estimates.TemperatureRow]]:
    """Return the values from the curve, and the rows of the recommended method."""
    durations = {
        (row.sensor, row.recording): row.duration
        for row in RecordingRow.rows_of(tables["recordings"])
    }
    # B from the lowest point of each curve, for sources without a visible minimum.
    curve: dict[_Place, float] = {}
    for point in estimates.AllanRow.rows_of(tables["allan"]):
        duration = durations.get((point.sensor, point.recording))
        if duration is not None and point.tau <= _MAX_TAU_OVER_LENGTH * duration:
            place = _place(point, "B")
            curve[place] = min(curve.get(place, math.inf), point.adev / FLOOR)
    parameters = estimates.ParameterRow.rows_of(tables["parameters"])
    for row in parameters:
        if row.method == "curve" and row.component == 1 and row.value is not None:
            curve[_place(row, row.parameter)] = row.value
    best: dict[_Place, estimates.ParameterRow | estimates.TemperatureRow] = {}
    best.update(_slowest(row for row in parameters if row.recommended))
    for bias in estimates.FixedBiasRow.rows_of(tables["fixed_bias"]):
        curve[_place(bias, "bias")] = bias.value
    for thermal in estimates.TemperatureRow.rows_of(tables["temperature"]):
        if thermal.parameter in ("bias", "sensitivity"):
            best[_place(thermal, thermal.parameter)] = thermal
    return curve, best


S = TypeVar("S", bound=estimates.ParameterRow | estimates.SimulatedTruthRow)


def _slowest(rows: Iterable[S]) -> dict[_Place, S]:
    """Return rows by key; of several processes the slowest, the floor of the curve."""
    with_value = [row for row in rows if row.value is not None]
    times = {
        (_place(row, "B"), row.component): row.value
        for row in with_value
        if row.parameter == "T_B" and row.value is not None
    }

    def slowness(row: S) -> float:
        # Flicker noise, which has no T_B, is slower than all.
        of_process = row.parameter == "B"
        return times.get((_place(row, "B"), row.component), math.inf) if of_process else 0.0

    return {_place(row, row.parameter): row for row in sorted(with_value, key=slowness)}


def _printed(rows: Iterable[DatasheetRow]) -> dict[_Place, list[tuple[str | None, float]]]:
    """Return kind and value of the figures of the datasheet, in the parameters' conventions."""
    figures: dict[_Place, list[tuple[str | None, float]]] = {}
    for row in rows:
        conventions = _DATASHEET_PARAMETERS
        convention = conventions.get(row.statistic) or conventions.get(row.quantity)
        if convention is not None and row.comparable is not None:
            parameter, factor = convention
            figure = (row.kind, row.comparable * factor)
            figures.setdefault(_place(row, parameter), []).append(figure)
    return figures
