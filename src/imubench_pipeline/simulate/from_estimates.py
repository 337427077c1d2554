"""Build the model of a sensor from the estimates of a run, which replace datasheet figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.estimators.rows import estimate_of
from imubench_pipeline.model.estimates import FixedBiasRow, LowPassRow, ParameterRow, TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.settings.sensor import CHANNELS, quantity_of
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.imu import ImuModel
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift, before_the_filter
from imubench_pipeline.simulate.sources import Origin, Remark, Topic
from imubench_pipeline.tables import read, tables_folder, tables_of_run

_NEEDED_TABLES = ("recordings", "parameters", "fixed_bias", "temperature", "low_pass")


def with_estimates(
    printed: Origin, results: Path, name: str, recording: str | None = None
) -> Origin:
    """Replace printed figures by the estimates of a run; there may be no printed figures.

    The estimates are from the longest recording, or from the named one: noise (recommended method)
    and bias. If a temperature effect was compensated, the compensated noise, the bias and the drift
    are used. The cut-off is used if it has a value. Resolution and full scale stay as printed.

    Raises
    ------
    ConfigError
        If there is no estimate of the sensor, or of the recording.
    """
    folder = tables_folder(results)
    try:
        paths = tables_of_run(results, _NEEDED_TABLES)
        tables = {table: read(table, [path]) for table, path in paths.items()}
    except (OSError, ValueError) as error:
        raise ConfigError(str(error)) from error
    recorded = _select_recording(tables["recordings"], folder, name, recording)
    chosen = recorded.recording
    of_log = {
        table: tables[table].filter(
            (pc.field("sensor") == name) & (pc.field("recording") == chosen)
        )
        for table in _NEEDED_TABLES[1:]
    }
    axes: dict[str, SensorModel] = {}
    figures: dict[str, list[Remark]] = {}
    topics: list[set[Topic]] = []
    for channel in CHANNELS:
        of_channel = _Estimated.of(
            {table: rows.filter(pc.field("channel") == channel) for table, rows in of_log.items()}
        )
        if of_channel.parameters:
            axis = _Axis(printed, channel, of_channel, f"{name}/{chosen}")
            axes[channel] = axis.model(_require_rate(recorded))
            topics.append({remark.topic for remark in axis.remarks})
            of_datasheet = printed.figures.get(channel, [])
            figures[channel] = [
                *axis.remarks,
                *(remark for remark in of_datasheet if remark.topic not in topics[-1]),
            ]
    if not axes:
        raise ConfigError(f"{folder}: no estimate of {name}/{chosen}")
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
        text = "accel: the mean of a recording is mostly gravity, so it is no bias here"
        origin.assume("bias", text)
    return origin


def _select_recording(
    recordings: pa.Table, folder: Path, name: str, asked: str | None
) -> RecordingRow:
    """Return the row of the requested recording, or of the longest one."""
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


def _require_rate(recording: RecordingRow) -> float:
    if recording.rate is None:
        raise ConfigError(f"{recording.sensor}/{recording.recording}: its rate is not known")
    return recording.rate


@dataclass(frozen=True)
class _Estimated:
    """Rows of one channel in the tables of a run."""

    parameters: Sequence[ParameterRow]
    fixed_bias: Sequence[FixedBiasRow]
    temperature: Mapping[str, TemperatureRow]
    """By parameter."""
    low_pass: Mapping[str, LowPassRow]
    """By parameter."""

    @classmethod
    def of(cls, tables: Mapping[str, pa.Table]) -> _Estimated:
        temperature = TemperatureRow.rows_of(tables["temperature"])
        low_pass = LowPassRow.rows_of(tables["low_pass"])
        return cls(
            ParameterRow.rows_of(tables["parameters"]),
            FixedBiasRow.rows_of(tables["fixed_bias"]),
            {row.parameter: row for row in temperature},
            {row.parameter: row for row in low_pass},
        )


class _Axis:
    """Model of one channel from the estimates of a run."""

    def __init__(self, printed: Origin, channel: str, found: _Estimated, log: str) -> None:
        self._printed = printed.imu.axes.get(channel) or SensorModel()
        self._gravity = quantity_of(channel) == "accel"
        self._found, self._log = found, log
        self._temperature, self._low_pass = found.temperature, found.low_pass
        self.remarks: list[Remark] = []

    def model(self, rate: float) -> SensorModel:
        """Return the model, and add the sources of its figures to ``remarks``; rate in Hz."""
        printed = replace(self._printed, low_pass=self._filter(), drift=self._drift())
        method = "compensated" if self._compensated else None
        rows = [
            row
            for row in self._found.parameters
            if (row.method == method if method else row.recommended)
        ]
        estimate = estimate_of(rows[0].method, rows)
        self._note(
            "noise",
            f"noise {estimate.model.name}: estimated by {estimate.method} from {self._log}, N "
            "taken back to before low-pass and rounding",
        )
        noise = before_the_filter(printed, estimate.model, rate)
        return replace(printed, noise=noise, bias=self._bias())

    @property
    def _compensated(self) -> bool:
        return any(row.compensated for row in self._temperature.values())

    def _note(self, topic: Topic, text: str) -> None:
        self.remarks.append(Remark(topic, text))

    def _filter(self) -> LowPass | None:
        cutoff = self._low_pass.get("cutoff")
        if cutoff is None or cutoff.value is None or cutoff.order is None:
            return self._printed.low_pass
        self._note("low-pass", f"cut-off {cutoff.value:.4g} Hz: estimated from {self._log}")
        return LowPass(cutoff.value, cutoff.order)

    def _drift(self) -> TemperatureDrift | None:
        reference = self._temperature["T_0"].value if self._compensated else None
        if reference is None:
            return self._printed.drift
        values = {
            name: row.value if row.value is not None else row.fitted
            for name, row in self._temperature.items()
        }
        slope, unit = values["sensitivity"] or 0.0, self._temperature["sensitivity"].unit
        self._note(
            "drift", f"temperature sensitivity {slope:.4g} {unit}: estimated from {self._log}"
        )
        return TemperatureDrift(
            sensitivity=slope,
            reference=reference,
            quadratic=values["quadratic"] or 0.0,
            lag=values["lag"] or 0.0,
        )

    def _bias(self) -> float:
        if self._gravity:
            return self._printed.bias
        bias = self._temperature["bias"].value if self._compensated else None
        if bias is not None:
            self._note("bias", f"bias {bias:g} rad/s at T_0: estimated from {self._log}")
            return bias
        for row in self._found.fixed_bias:
            self._note("bias", f"bias {row.value:g} rad/s: mean of {self._log}")
            return row.value
        return self._printed.bias
