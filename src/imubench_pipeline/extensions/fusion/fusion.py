"""The table ``fusion`` of a run, from its tables of recordings and parameters."""

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.datasheets.comparable import Comparable, read_comparables
from imubench_pipeline.estimators.estimate import SIGMAS, JointDraws, Parameter
from imubench_pipeline.estimators.rows import make_estimate, read_draws
from imubench_pipeline.extensions.fusion.equivalence import equivalence_rows
from imubench_pipeline.extensions.fusion.tables import RECORDINGS_OF_A_PAIR, FusionRow, GradeRow
from imubench_pipeline.model.estimates import CompensatedAllanRow, ParameterRow, TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import ChannelRow, TableRow
from imubench_pipeline.navigation.ratios import ComparedChannel, TemperaturePart
from imubench_pipeline.recordings.fitness import attach_doubts, list_excluded
from imubench_pipeline.settings.config import FusionSettings
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.settings.sensor import Sensor, sensors_of
from imubench_pipeline.tables.files import build, read, write_arrow
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.units import parse_quantity

PARAMETER_OF_STATISTIC = {"N": "N", "adev_minimum": "sigma_min"}  # of a printed figure


def _yield_printed(datasheet: Datasheet, channel: str) -> Iterator[tuple[str | None, Comparable]]:
    """Yield the printed N and floor, SI, of each option; without a value if not printed."""
    sheet = getattr(datasheet, channel.split("_")[0])
    if sheet is None:
        return
    names = ("noise_density", "random_walk", "bias_instability")
    figures = [figure for name in names for figure in sheet.printed(name)]
    for option in dict.fromkeys(figure.option for figure in figures) or {None: None}:
        chosen = datasheet.model_copy(update={"options": [option] if option else []})
        for one in read_comparables(chosen, channel):
            of_option = one.figure is None or one.figure.option in (None, option)
            if one.statistic in PARAMETER_OF_STATISTIC and of_option:
                yield option, one


def yield_grade_rows(
    candidates: Iterable[ComparedChannel], grades: Mapping[str, Sensor]
) -> Iterator[GradeRow]:
    """Yield the rows of ``grades``: a row per sensor and printed figure of a better class.

    A sensor is represented by its axis of median N. `grades` has the sensors of the better class by
    their names in the catalogue.
    """
    by_sensor = group_rows(candidates, lambda one: (one.channel.split("_")[0], one.sensor))
    for (quantity, sensor), channels in sorted(by_sensor.items()):
        measured = [channel for channel in channels if not channel.simulated] or channels
        chosen = sorted(measured, key=lambda channel: channel.model.N)[len(measured) // 2]
        for grade, better in grades.items():
            if grade == sensor:
                continue
            for option, printed in _yield_printed(better.datasheet, chosen.channel):
                name = PARAMETER_OF_STATISTIC[printed.statistic]
                estimate = chosen.estimate
                of = estimate.parameters if name == "N" else estimate.curve or {}
                own = of.get(name, Parameter(None, "not_shown", "not estimated"))
                reason = printed.obstacle or printed.reason
                if printed.value is not None:
                    reason = None if own.value is not None else own.reason or own.status
                yield GradeRow(
                    quantity=quantity,
                    sensor=sensor,
                    recording=chosen.recording,
                    channel=chosen.channel,
                    simulated=chosen.simulated,
                    grade=grade,
                    grade_name=f"{better.vendor} {better.model}",
                    option=option,
                    statistic=name,
                    value=own.value,
                    lower=own.lower,
                    upper=own.upper,
                    printed=printed.value,
                    n=_divide(own.value, printed.value),
                    n_lower=_divide(own.lower, printed.value),
                    n_upper=_divide(own.upper, printed.value),
                    reason=reason,
                )


def _divide(own: float | None, printed: float | None) -> float | None:
    """Return the number of sensors that reach a printed figure."""
    if own is None or printed is None:
        return None
    return (own / printed) ** 2 if printed else math.inf


NEEDED = ("recordings", "parameters", "allan_compensated", "temperature")  # tables of a run


def yield_candidates(
    tables: Mapping[str, pa.Table],
    joint: Mapping[tuple[str, str], Path] | None,
    besides: Container[str] = (),
) -> Iterator[ComparedChannel]:
    """Yield the channels of the recordings used in comparisons, and of the sensors in ``besides``.

    The estimate is the recommended one, or the one after removal of the temperature effect.
    ``tables``: `NEEDED`; ``joint``: files of the table ``draws``, by sensor and recording.
    """
    parameters = tables["parameters"]
    warm = _temperature_parts(tables)
    compensated = parameters.filter(pc.equal(parameters["method"], "compensated"))
    recommended = parameters.filter(parameters["recommended"])
    used = [row for row in ParameterRow.rows_of(compensated) if _channel(row) in warm]
    used += [row for row in ParameterRow.rows_of(recommended) if _channel(row) not in warm]
    groups = group_rows(used, lambda row: (*_channel(row), row.method))
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
    """Yield the rows of the table ``fusion``; `tables` and `joint` as in `yield_candidates`."""
    rows = equivalence_rows(
        yield_candidates(tables, joint),
        [parse_quantity(tau, "time") for tau in how.tau],
        how.common.model_dump(),
        longest=how.longest,
        draws=how.draws,
        seed=how.seed,
    )
    return attach_doubts(rows, RecordingRow.rows_of(tables["recordings"]), RECORDINGS_OF_A_PAIR)


def yield_grades_of_run(
    tables: Mapping[str, pa.Table], sensors: Mapping[str, Sensor]
) -> Iterator[GradeRow]:
    """Yield the rows of the table ``grades``, including sensors not for sale, such as boards."""
    grades = {name: sensor for name, sensor in sensors.items() if sensor.grade == "tactical"}
    not_sold = {name for name, sensor in sensors.items() if not sensor.sold}
    return yield_grade_rows(yield_candidates(tables, None, not_sold), grades)


def write_fusion(
    inputs: Mapping[str, str], joint: list[Path], settings: str, catalogue: str, outputs: list[Path]
) -> None:
    """Write ``fusion`` and ``grades`` to the ``outputs`` of these names, from tables and draws."""
    how = FusionSettings.model_validate_json(settings)
    tables = {name: read(name, [Path(inputs[name])]) for name in NEEDED}
    of_recording = {(path.parts[-3], path.parts[-2]): path for path in joint}
    rows: dict[str, Iterator[TableRow]] = {
        "fusion": yield_fusion_rows(tables, how, of_recording),
        "grades": yield_grades_of_run(tables, sensors_of(catalogue)),
    }
    made = {name: build(name, own) for name, own in rows.items()}
    for output in outputs:
        write_arrow(made[output.stem], output)
