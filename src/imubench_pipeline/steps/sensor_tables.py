"""Tables of a sensor: the tables of its recordings, joined, assessed and compared."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import pyarrow as pa

from imubench_pipeline.datasheets.plausibility import implausible_of
from imubench_pipeline.datasheets.suspicion import UsualFigures, unusual_rows, usual_of_text
from imubench_pipeline.model import estimates as model
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.navigation.backtest import comparison
from imubench_pipeline.navigation.drift import drift_rows
from imubench_pipeline.navigation.pooled import list_pooled_rows
from imubench_pipeline.recordings import fitness
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.quality.copies import find_copied_recordings
from imubench_pipeline.registry import Hook
from imubench_pipeline.settings.sensor import Sensor, sensors_of
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.models import SIMULATIONS, list_true_figures
from imubench_pipeline.tables.failures import mark_failures, read_with_failures, remove_recordings
from imubench_pipeline.tables.files import build
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.units import parse_quantity

SensorTable = Callable[
    [str, Sequence[model.SimulatedTruthRow], Mapping[str, pa.Table]], Iterable[TableRow]
]
"""Returns the rows of a further table of a sensor.

Takes its simulated recordings, as JSON from the plan, their true parameters, and its other tables.
"""

_ADDED: Hook[SensorTable] = Hook("sensor_tables")


def join_tables(
    parts: Mapping[str, list[Path]], truths: str, sensor: str, usual: str, decide: str
) -> dict[str, pa.Table]:
    """Return the tables of a sensor, joined from its recordings or derived from them.

    `parts`: files of each table, in the order of the recordings, and ``quality`` for the JSON
    files. `truths`, `sensor`, `usual`: true parameters of simulated recordings, the sensor file
    and usual figures of other sensors, from the plan. `decide`: section of the configuration.
    """
    qualities = [Quality.read(path) for path in parts["quality"]]
    failed_steps = [quality.failure for quality in qualities if quality.failure]
    joined = {}
    for name, paths in parts.items():
        if name != "quality":
            joined[name], failed = read_with_failures(name, paths)
            failed_steps += failed
    failures = list(dict.fromkeys(failed_steps))
    joined = remove_recordings(
        joined, {(failure.sensor, failure.recording) for failure in failures}
    )
    about = [quality.recording for quality in qualities]
    devices = {(row.sensor, row.recording): row.device for row in about}
    recommended = joined["parameters"].filter(joined["parameters"]["recommended"])
    estimated = model.ParameterRow.rows_of(recommended)
    biases = model.FixedBiasRow.rows_of(joined["fixed_bias"])
    models = model.ModelRow.rows_of(joined["models"])
    joined["drift"] = build("drift", drift_rows(estimated, biases, about))
    sensors = sensors_of(sensor)
    findings = collect_findings(
        qualities,
        model.DeterministicRow.rows_of(joined["deterministic"]),
        FindingRow.rows_of(joined.pop("estimate_findings")),
        estimated,
        sensors,
        usual_of_text(usual),
    )
    findings += find_copied_recordings(models, biases)
    if "backtest" in joined:
        findings += comparison.findings(model.BacktestRow.rows_of(joined["backtest"]))
    joined["findings"] = build("findings", findings)
    doubted = [
        *fitness.doubt_simulated_recordings(about),
        *fitness.doubt_unsold_sensors(
            about, {name for name, sensor in sensors.items() if not sensor.sold}
        ),
        *fitness.derive_doubts(FindingRow.rows_of(joined["findings"]), estimated, models),
    ]
    about = fitness.judge_recordings(about, doubted, json.loads(decide).get("include", ()))
    joined["recordings"] = build("recordings", about)
    joined["doubts"] = build("doubts", doubted)
    apart = fitness.list_excluded(about)
    pools = list_pooled_rows(
        fitness.mask_excluded(estimated, apart), fitness.mask_excluded(biases, apart), devices
    )
    joined["pooled"] = build("pooled", fitness.attach_doubts_to_pools(pools, about))
    for name in fitness.WITH_DOUBTS.keys() & joined.keys():
        joined[name] = build(
            name, fitness.attach_doubts(fitness.WITH_DOUBTS[name].rows_of(joined[name]), about)
        )
    truth = list(list_true_parameters(truths))
    joined["simulated_truth"] = build("simulated_truth", truth)
    for name, rows_of in _ADDED.by_key().items():
        joined[name] = build(name, rows_of(truths, truth, joined))
    return mark_failures(joined, failures)


_EXPLAINING = ("motion", "turning")
_KIND_OF_FINDING = {"step": "bias_step", "warm_up": "warm_up_drift"}
"""Kind in ``deterministic``, with a size, of findings that the ingest also reports."""

_MAX_STEP_DISTANCE = 1 / 100  # of two steps that count as one, over the length


def collect_findings(
    qualities: Sequence[Quality],
    deterministic: Sequence[model.DeterministicRow],
    of_estimates: Iterable[FindingRow],
    estimated: Sequence[model.ParameterRow],
    sensors: Mapping[str, Sensor],
    usual: UsualFigures,
) -> list[FindingRow]:
    """Return the rows of the table ``findings`` on single recordings, from all steps.

    `of_estimates`: findings of the step ``estimate``; `estimated`: the recommended parameters.
    """
    about = [quality.recording for quality in qualities]
    of_logs = drop_duplicate_findings(
        (row for quality in qualities for row in quality.findings),
        deterministic,
        {(row.sensor, row.recording): row.duration or 0.0 for row in about},
    )
    found = list(of_logs)
    for quality in qualities:
        found += implausible_of(quality, sensors.get(quality.recording.sensor))
    slow = {(f.sensor, f.recording) for f in found if f.finding == "slow_sampling"}
    unusual = (  # slow sampling explains large figures, and no impossibly small ones
        row
        for row in unusual_rows(_judged(estimated, found), sensors, usual)
        if row.finding == "impossible_noise" or (row.sensor, row.recording) not in slow
    )
    return [*found, *of_estimates, *unusual]


def _judged(
    estimated: Iterable[model.ParameterRow], findings: Iterable[FindingRow]
) -> Iterator[model.ParameterRow]:
    """Yield the figures whose size is not explained by motion or by the unit of the channel."""
    explained = {
        (f.sensor, f.recording, None if f.finding in _EXPLAINING else f.channel)
        for f in findings
        if f.finding in (*_EXPLAINING, "suspicious_unit")
    }
    for row in estimated:
        place = row.sensor, row.recording
        if not {(*place, row.channel), (*place, None)} & explained:
            yield row


def drop_duplicate_findings(
    findings: Iterable[FindingRow],
    deterministic: Iterable[model.DeterministicRow],
    durations: Mapping[tuple[str, str], float],
) -> Iterator[FindingRow]:
    """Yield the findings of the ingest that are not in ``deterministic``; `durations` in s."""
    by_place = group_rows(deterministic, lambda row: (row.sensor, row.recording, row.channel))
    for finding in findings:
        kind = _KIND_OF_FINDING.get(finding.finding)
        if kind is None or finding.channel is None:
            yield finding
            continue
        place = (finding.sensor, finding.recording, finding.channel)
        same = (row for row in by_place.get(place, ()) if row.kind == kind)
        near = _MAX_STEP_DISTANCE * durations.get((finding.sensor, finding.recording), 0.0)
        if not any(abs(row.start - (finding.start or 0.0)) <= near for row in same):
            yield finding


def list_true_parameters(truths: str) -> Iterator[model.SimulatedTruthRow]:
    """Yield the rows of the table ``simulated_truth``; `truths`: recordings, as JSON."""
    for entry in json.loads(truths):
        recording = SimulatedRecording.model_validate(entry)
        rate = parse_quantity(recording.rate, "frequency")
        for channel, truth in recording.channels.items():
            factors: Mapping[str, float] = {}
            for key in recording.simulated_sensors:
                factors = SIMULATIONS.by_key()[key].factors(recording, str(channel))
            for figure in list_true_figures(truth, channel, rate):
                factor = factors.get(figure.name.removesuffix(" in the log"), 1.0)
                yield model.SimulatedTruthRow(
                    sensor=recording.sensor,
                    recording=recording.recording,
                    channel=channel,
                    parameter=figure.name,
                    component=figure.component,
                    value=figure.value * factor,
                    unit=figure.unit,
                    assumed=bool({figure.setting, figure.name} & set(truth.assumed)),
                    source=recording.source,
                )
