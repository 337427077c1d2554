"""Build the model of a sensor from the estimates of a run, which replace datasheet figures."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.estimators.rows import make_estimate
from imubench_pipeline.model.estimates import FixedBiasRow, LowPassRow, ParameterRow, TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.settings.sensor import CHANNELS, quantity_of
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.imu import ImuModel
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift, before_the_filter
from imubench_pipeline.simulate.models import Origin, Remark, Topic
from imubench_pipeline.tables.files import find_tables, find_tables_folder, read
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.reasons import simulations as texts

_NEEDED_TABLES = ("recordings", "parameters", "fixed_bias", "temperature", "low_pass")


def with_estimates(
    printed: Origin, results: Path, name: str, recording: str | None = None
) -> Origin:
    """Return the model ``printed``, with its figures replaced by the estimates of a run.

    The estimates are from the longest recording, or from the named one: noise (recommended method)
    and bias. If a temperature effect was compensated, the compensated noise, the bias and the drift
    are used. The cut-off is used if it has a value. Resolution and full scale remain as printed.
    Raises ConfigError if there is no estimate of the sensor, or of the recording.
    """
    folder = find_tables_folder(results)
    try:
        paths = find_tables(results, _NEEDED_TABLES)
        tables = {table: read(table, [path]) for table, path in paths.items()}
    except (OSError, ValueError) as error:
        raise ConfigError(str(error)) from error
    recorded = _select_recording(tables["recordings"], folder, name, recording)
    chosen = recorded.recording
    here = (pc.field("sensor") == name) & (pc.field("recording") == chosen)
    of_log = {table: tables[table].filter(here) for table in _NEEDED_TABLES[1:]}
    axes: dict[str, SensorModel] = {}
    figures: dict[str, list[Remark]] = {}
    topics: list[set[Topic]] = []
    for channel in CHANNELS:
        own = pc.field("channel") == channel
        of_channel = {table: rows.filter(own) for table, rows in of_log.items()}
        if len(of_channel["parameters"]):
            if recorded.rate is None:
                raise ConfigError(f"{name}/{chosen}: no rate is known; use another --recording")
            of_datasheet = printed.imu.axes.get(channel) or SensorModel()
            log, rate = f"{name}/{chosen}", recorded.rate
            axes[channel], remarks = _estimate_axis(of_datasheet, channel, of_channel, log, rate)
            topics.append({remark.topic for remark in remarks})
            others = printed.figures.get(channel, [])
            figures[channel] = remarks + [each for each in others if each.topic not in topics[-1]]
    if not axes:
        raise ConfigError(f"{folder}: no estimate of {name}/{chosen}; choose another --recording")
    estimated = set[Topic].intersection(*topics)
    origin = Origin(
        ImuModel(axes=axes),
        f"the estimates of a run in {results}, from the recording {name}/{chosen}",
        figures,
        [remark for remark in printed.assumed if remark.topic not in estimated],
        name,
    )
    if recorded.simulated:
        origin.assume("log", f"{name}/{chosen} is itself simulated")
    if any(quantity_of(channel) == "accel" for channel in axes):
        origin.assume("bias", texts.GRAVITY_IS_NO_BIAS)
    return origin


def _select_recording(
    recordings: pa.Table, folder: Path, name: str, asked: str | None
) -> RecordingRow:
    of_sensor = RecordingRow.rows_of(recordings.filter(pc.field("sensor") == name))
    usable = {row.recording: row for row in of_sensor if row.status == "ok"}
    if not usable:
        sensors = ", ".join(sorted(set(recordings["sensor"].to_pylist()))) or "none"
        raise ConfigError(f"{folder}: no estimate of sensor {name!r}; there are: {sensors}")
    if asked is not None and asked not in usable:
        raise ConfigError(
            f"{folder}: no recording {asked!r} of {name}; there are: {', '.join(usable)}"
        )
    longest = max(usable, key=lambda key: (usable[key].duration or 0.0, key))
    return usable[asked or longest]


def _estimate_axis(
    printed: SensorModel, channel: str, tables: Mapping[str, pa.Table], log: str, rate: float
) -> tuple[SensorModel, list[Remark]]:
    """Return the model of a channel from its rows in the tables of a run, and the sources."""
    remarks: list[Remark] = []
    cutoffs = [row for row in LowPassRow.rows_of(tables["low_pass"]) if row.parameter == "cutoff"]
    low_pass, drift, bias = printed.low_pass, printed.drift, printed.bias
    if cutoffs and cutoffs[-1].value is not None and cutoffs[-1].order is not None:
        low_pass = LowPass(cutoffs[-1].value, cutoffs[-1].order)
        remarks.append(
            Remark("low-pass", f"cut-off {number_text(low_pass.cutoff)} Hz: estimated from {log}")
        )
    effect = {row.parameter: row for row in TemperatureRow.rows_of(tables["temperature"])}
    compensated = any(row.compensated for row in effect.values())
    reference = effect["T_0"].value if compensated else None
    if reference is not None:
        sensitivity, quadratic, lag = (
            (row.value if row.value is not None else row.fitted) or 0.0
            for row in (effect[name] for name in ("sensitivity", "quadratic", "lag"))
        )
        drift = TemperatureDrift(
            sensitivity=sensitivity, reference=reference, quadratic=quadratic, lag=lag
        )
        unit = effect["sensitivity"].unit
        text = (
            f"temperature sensitivity {number_text(drift.sensitivity)} {unit}: estimated from {log}"
        )
        remarks.append(Remark("drift", text))
    rows = [
        row
        for row in ParameterRow.rows_of(tables["parameters"])
        if (row.method == "compensated" if compensated else row.recommended)
    ]
    estimate = make_estimate(rows[0].method, rows)
    text = (
        f"noise {estimate.model.name}: estimated by method {estimate.method} "
        f"from {log}. N is converted to its value before low-pass and rounding"
    )
    remarks.append(Remark("noise", text))
    # The mean of an accelerometer is mostly gravity.
    if quantity_of(channel) != "accel":
        fixed = FixedBiasRow.rows_of(tables["fixed_bias"])
        at_reference = effect["bias"].value if compensated else None
        if at_reference is not None:
            bias = at_reference
            remarks.append(
                Remark("bias", f"bias {number_text(bias)} rad/s at T_0: estimated from {log}")
            )
        elif fixed:
            bias = fixed[0].value
            remarks.append(Remark("bias", f"bias {number_text(bias)} rad/s: mean of {log}"))
    model = replace(printed, low_pass=low_pass, drift=drift, bias=bias)
    return replace(model, noise=before_the_filter(model, estimate.model, rate)), remarks
