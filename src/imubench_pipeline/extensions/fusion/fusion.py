"""The table ``fusion`` of a run, from its tables of recordings and parameters."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.estimators.estimate import JointDraws
from imubench_pipeline.estimators.rows import make_estimate, read_draws
from imubench_pipeline.extensions.fusion.equivalence import equivalence_rows
from imubench_pipeline.extensions.fusion.grades import Grade, yield_grade_rows
from imubench_pipeline.extensions.fusion.tables import RECORDINGS_OF_A_PAIR, FusionRow, GradeRow
from imubench_pipeline.model.estimates import CompensatedAllanRow, ParameterRow, TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import ChannelRow, TableRow
from imubench_pipeline.navigation.compared import ComparedChannel, TemperaturePart
from imubench_pipeline.navigation.error_budget.printed_errors import SIGMAS
from imubench_pipeline.recordings.fitness import attach_doubts, list_excluded
from imubench_pipeline.settings.config import FusionSettings
from imubench_pipeline.settings.sensor import Sensor, sensors_of
from imubench_pipeline.tables import build, read, write_arrow
from imubench_pipeline.units import parse_quantity

NEEDED = ("recordings", "parameters", "allan_compensated", "temperature")
"""The tables of a run that the step reads."""


def yield_candidates(
    tables: Mapping[str, pa.Table],
    joint: Mapping[tuple[str, str], Path] | None,
    besides: Container[str] = (),
) -> Iterator[ComparedChannel]:
    """Yield the channels of recordings that decide, and of the sensors in ``besides``.

    The estimate is the recommended one, or the one after removal of the temperature effect.
    ``tables`` are the tables `NEEDED` of a run, ``joint`` the files of the table ``draws``, by
    sensor and recording.
    """
    parameters = tables["parameters"]
    warm = _temperature_parts(tables)
    compensated = parameters.filter(pc.equal(parameters["method"], "compensated"))
    recommended = parameters.filter(parameters["recommended"])
    used = [row for row in ParameterRow.rows_of(compensated) if _channel(row) in warm]
    used += [row for row in ParameterRow.rows_of(recommended) if _channel(row) not in warm]
    groups: dict[tuple[str, str, str, str], list[ParameterRow]] = {}
    for row in used:
        groups.setdefault((*_channel(row), row.method), []).append(row)
    about = {(row.sensor, row.recording): row for row in RecordingRow.rows_of(tables["recordings"])}
    apart = list_excluded(about.values())
    read = cache(read_draws)

    def drawn(path: Path, channel: str, method: str) -> JointDraws | None:
        return read(path).get((channel, method))

    for (sensor, recording, channel, method), rows in groups.items():
        if (sensor, recording) in apart and sensor not in besides:
            continue
        path = (joint or {}).get((sensor, recording))
        of = about[sensor, recording]
        yield ComparedChannel(
            sensor,
            recording,
            channel,
            of.simulated,
            of.duration or 0.0,
            make_estimate(method, rows),
            warm.get((sensor, recording, channel)),
            partial(drawn, path, channel, method) if path else None,
        )


def _temperature_parts(
    tables: Mapping[str, pa.Table],
) -> dict[tuple[str, str, str], TemperaturePart]:
    """Return the removed temperature effect of channels."""
    curves: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    for point in CompensatedAllanRow.rows_of(tables["allan_compensated"]):
        curves.setdefault(_channel(point), []).append((point.tau, point.temperature))
    temperature = tables["temperature"]
    chosen = pc.and_(temperature["compensated"], pc.equal(temperature["parameter"], "sensitivity"))
    parts = {}
    for row in TemperatureRow.rows_of(temperature.filter(chosen)):
        if row.value is None or row.lower is None or row.upper is None:
            continue
        if _channel(row) in curves:
            tau, deviation = np.array(curves[_channel(row)]).T
            error = (row.upper - row.lower) / (2.0 * SIGMAS * abs(row.value))
            parts[_channel(row)] = TemperaturePart(tau, deviation, error)
    return parts


def _channel(row: ChannelRow) -> tuple[str, str, str]:
    return row.sensor, row.recording, row.channel


def yield_fusion_rows(
    tables: Mapping[str, pa.Table],
    how: FusionSettings,
    joint: Mapping[tuple[str, str], Path] | None = None,
) -> Iterator[FusionRow]:
    """Return the rows of the table ``fusion``; `tables` and `joint` as in `yield_candidates`."""
    rows = equivalence_rows(
        yield_candidates(tables, joint),
        [parse_quantity(tau, "time") for tau in how.tau],
        how.common.model_dump(),
        longest=how.longest,
        draws=how.draws,
        seed=how.seed,
    )
    return attach_doubts(rows, RecordingRow.rows_of(tables["recordings"]), RECORDINGS_OF_A_PAIR)


TACTICAL_CLASS = "tactical"
"""First word of the price class of the target datasheets."""


def yield_grades_of_run(
    tables: Mapping[str, pa.Table], sensors: Mapping[str, Sensor]
) -> Iterator[GradeRow]:
    """Return the rows of the table ``grades``, with sensors that are not sold, such as boards."""
    grades = [
        Grade(name, f"{sensor.vendor} {sensor.model}", sensor.datasheet)
        for name, sensor in sensors.items()
        if (sensor.price_class or "").split(" ")[0].strip(",") == TACTICAL_CLASS
    ]
    not_sold = {name for name, sensor in sensors.items() if not sensor.sold}
    return yield_grade_rows(yield_candidates(tables, None, not_sold), grades)


def write_fusion(
    inputs: Mapping[str, str],
    joint: list[Path],
    settings: str,
    catalogue: str,
    outputs: list[Path],
) -> None:
    """Write the tables ``fusion`` and ``grades``, as Parquet and CSV.

    ``joint``: tables ``draws`` of recordings; ``outputs``: files of both tables, by their stems.
    """
    how = FusionSettings.model_validate_json(settings)
    tables = {name: read(name, [Path(inputs[name])]) for name in NEEDED}
    of_recording = {(path.parts[-3], path.parts[-2]): path for path in joint}
    rows: dict[str, Iterator[TableRow]] = {
        "fusion": yield_fusion_rows(tables, how, of_recording),
        "grades": yield_grades_of_run(tables, sensors_of(catalogue)),
    }
    for name, own in rows.items():
        table = build(name, own)
        for output in outputs:
            if output.stem == name:
                write_arrow(table, output)
