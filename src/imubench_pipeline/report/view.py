"""The data of each recording and channel, gathered from the tables for the pages."""

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property, partial

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pandas.util import hash_pandas_object
from scipy.special import chdtri

from imubench_pipeline.estimators.rows import make_estimate
from imubench_pipeline.model import estimates
from imubench_pipeline.model.comparisons import DatasheetRow, ErrorBudgetRow
from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.model.table import R
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.settings.experiments import AT_REST
from imubench_pipeline.tables.findings import LEFT_OUT
from imubench_pipeline.tables.keys import TableParts, split_table
from imubench_pipeline.tables.schemas import BY_RECORDING
from imubench_pipeline.typing import Array

Name = tuple[str, str]
"""Sensor and recording."""

_ROWS_OF_CHANNELS = (
    estimates.ModelRow,
    estimates.LineRow,
    estimates.DeterministicRow,
    DatasheetRow,
)

METHOD_NAMES = {
    "robust": "robust fit",
    "likelihood": "likelihood",
    "likelihood_gm": "likelihood, model N+GM+K",
    "compensated": "temperature compensated",
    "curve": "read from the curve",
    "paper": "fit, weights of Maia et al.",
    "weighted": "fit, correct weights",
    "authors": "values of the authors",
}
_CURVE_COLUMNS = ("tau", "adev", "lower", "upper")
QUANTITY_NAMES = {"gyro": "Gyroscope", "accel": "Accelerometer"}


@dataclass
class ChannelView:
    """All data of one channel from the tables, in SI units."""

    sensor: str
    recording: str
    channel: str
    simulated: bool
    tau: Array
    adev: Array
    lower: Array
    upper: Array
    rate: float = math.nan
    parameters: dict[str, list[estimates.ParameterRow]] = field(default_factory=dict)
    recommended: str = ""
    reconstruction: dict[str, dict[str, Array]] = field(default_factory=dict)
    scores: dict[str, estimates.ScoreRow] = field(default_factory=dict)
    datasheet: list[DatasheetRow] = field(default_factory=list)
    true_components: dict[str, list[estimates.SimulatedTruthRow]] = field(default_factory=dict)
    models: list[estimates.ModelRow] = field(default_factory=list)
    lines: list[estimates.LineRow] = field(default_factory=list)
    spectrum: dict[str, Array] = field(default_factory=dict)
    findings: list[FindingRow] = field(default_factory=list)
    fixed_bias: float | None = None
    temperature: dict[str, estimates.TemperatureRow] = field(default_factory=dict)
    low_pass: dict[str, estimates.LowPassRow] = field(default_factory=dict)
    deterministic: list[estimates.DeterministicRow] = field(default_factory=list)
    compensated: dict[str, Array] = field(default_factory=dict)
    _models: dict[str, NoiseModel] = field(default_factory=dict)

    @property
    def truth(self) -> dict[str, estimates.SimulatedTruthRow]:
        """The true parameters of a simulation; only the first of a repeated term."""
        return {name: rows[0] for name, rows in self.true_components.items()}

    @property
    def warnings(self) -> list[str]:
        """Keys in the glossary of the warnings about the channel, each once."""
        serious = [row.finding for row in self.findings if row.severity != "note"]
        if any(row.chosen and row.verdict == "not explained" for row in self.models):
            serious.append("verdict_not_explained")
        return list(dict.fromkeys(serious))

    @property
    def quantity(self) -> str:
        """``gyro`` or ``accel``."""
        return self.channel.split("_", maxsplit=1)[0]

    @property
    def axis(self) -> str:
        """``x``, ``y`` or ``z``."""
        return self.channel.rsplit("_", maxsplit=1)[-1]

    @property
    def title(self) -> str:
        """The channel in words."""
        return f"{QUANTITY_NAMES[self.quantity]} {self.axis}"

    @property
    def label(self) -> str:
        """Sensor and recording, and whether it is simulated."""
        return f"{self.sensor} / {self.recording}" + " (simulated)" * self.simulated

    def bin_limits(self) -> tuple[Array, Array]:
        """Return the 95 % limits of the density of the bins, if the fit of the spectrum is correct.

        A bin divided by the fit is a chi-squared variate divided by its degrees of freedom.
        """
        fitted, freedom = self.spectrum["fitted"], self.spectrum["ordinates"]
        lower, upper = (fitted * chdtri(freedom, tail) / freedom for tail in (0.975, 0.025))
        return lower, upper

    def model(self, method: str) -> NoiseModel:
        """Return the noise model that a method estimated."""
        if method not in self._models:
            self._models[method] = make_estimate(method, self.parameters[method]).model
        return self._models[method]

    def named(self, method: str, symbol: str) -> list[estimates.ParameterRow]:
        """Return the estimates of the parameter ``symbol`` by a method, one row per component."""
        return [row for row in self.parameters[method] if row.parameter == symbol]


@dataclass
class RecordingView:
    """All data of one recording from the tables.

    The channels of a thousand recordings do not fit into memory at once: they are made on request,
    and are not stored.
    """

    row: RecordingRow  # of the table ``recordings``
    tables: Mapping[str, TableParts]  # tables of all recordings
    # returns the digests of all recordings, by sensor and name
    keys: Callable[[], Mapping[Name, str]]
    page: str = ""  # path of its page
    # the page of its device, if the device has a name of its own or several recordings
    device_page: str | None = None

    @property
    def sensor(self) -> str:
        """Name of the sensor file."""
        return self.row.sensor

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.row.recording

    @property
    def full_name(self) -> Name:
        """Sensor and name."""
        return self.sensor, self.name

    @property
    def simulated(self) -> bool:
        """Whether the recording is simulated from known parameters, not measured."""
        return self.row.simulated

    @property
    def left_out(self) -> bool:
        """Whether the recording was rejected, or one of its steps failed."""
        return self.row.status != "ok"

    @property
    def rejected(self) -> bool:
        """Whether it was rejected."""
        return self.row.status == "rejected"

    @property
    def static(self) -> bool:
        """Whether it was analysed, and its sensor was at rest."""
        return not self.left_out and self.row.kind == AT_REST

    @property
    def key(self) -> str:
        """Digest of its rows in all tables."""
        return self.keys()[self.full_name]

    @cached_property
    def findings(self) -> list[FindingRow]:
        """Findings of the recording, except the finding that it is left out."""
        return [row for row in self.rows(FindingRow) if row.finding not in LEFT_OUT]

    @property
    def warnings(self) -> list[FindingRow]:
        """Its warnings; notes and errors are omitted."""
        return [row for row in self.findings if row.severity == "warning"]

    @property
    def budget(self) -> list[ErrorBudgetRow]:
        """Its error budget for the times in the settings, without the times of requirements."""
        part = self.part(ErrorBudgetRow.table)
        return ErrorBudgetRow.rows_of(part.filter(pc.is_null(part["requirement"])))

    def part(self, table: str) -> pa.Table:
        """Return the rows of the recording in a table."""
        return self.tables[table].get_or_empty(self.full_name)

    def rows(self, of: type[R]) -> list[R]:
        """Return the rows of the recording in the table of class ``of``."""
        part = self.part(of.table)
        return of.rows_of(part) if part.num_rows else []

    def recommended(self) -> dict[str, str]:
        """Return the recommended method of each channel."""
        part = self.part("parameters")
        chosen = part.filter(part["recommended"])
        return dict(zip(chosen["channel"].to_pylist(), chosen["method"].to_pylist(), strict=True))

    @property
    def rates(self) -> list[float]:
        """The sampling rate of the channel of each row of the table ``allan``, Hz."""
        allan = self.part("allan")
        return (allan["cluster_size"].to_numpy() / allan["tau"].to_numpy()).tolist()

    @property
    def channel_names(self) -> list[str]:
        """Names of its channels, which are read from the table ``allan``."""
        return self.part("allan")["channel"].unique().to_pylist()

    def channels(self) -> list[ChannelView]:
        """Return the data of its channels, made from the tables in each call."""
        channels = {}
        for (name,), part in split_table(self.part("allan"), "channel").items():
            named = (self.sensor, self.name, name, self.simulated)
            tau, adev, lower, upper = _read_floats(part, *_CURVE_COLUMNS).values()
            rate = float(part["cluster_size"][0].as_py() / tau[0])
            channels[name] = ChannelView(*named, tau, adev, lower, upper, rate)
        for row in self.rows(estimates.ParameterRow):
            channel = channels[row.channel]
            channel.parameters.setdefault(row.method, []).append(row)
            if row.recommended:
                channel.recommended = row.method
        reconstruction = split_table(self.part("reconstruction"), "channel", "method")
        for (name, method), part in reconstruction.items():
            curve = _read_floats(part, *_CURVE_COLUMNS, "reconstructed")
            channels[name].reconstruction[method] = curve
        for of in _ROWS_OF_CHANNELS:
            for one in self.rows(of):
                getattr(channels[one.channel], of.table).append(one)
        for (name,), part in split_table(self.part("spectrum"), "channel").items():
            columns = ("frequency", "ordinates", "density", "fitted", "used")
            channels[name].spectrum = _read_floats(part, *columns)
        for (name,), part in split_table(self.part("allan_compensated"), "channel").items():
            channels[name].compensated = _read_floats(part, *_CURVE_COLUMNS)
        for score in self.rows(estimates.ScoreRow):
            channels[score.channel].scores[score.method] = score
        for thermal in self.rows(estimates.TemperatureRow):
            channels[thermal.channel].temperature[thermal.parameter] = thermal
        for low_pass in self.rows(estimates.LowPassRow):
            channels[low_pass.channel].low_pass[low_pass.parameter] = low_pass
        for bias in self.rows(estimates.FixedBiasRow):
            channels[bias.channel].fixed_bias = bias.value
        for truth in self.rows(estimates.SimulatedTruthRow):
            if truth.channel in channels:
                components = channels[truth.channel].true_components
                components.setdefault(truth.parameter, []).append(truth)
        for name, channel in channels.items():
            channel.findings = [row for row in self.findings if row.channel in (None, name)]
        return list(channels.values())


def gather_recordings(tables: Mapping[str, pa.Table]) -> list[RecordingView]:
    """Return the data of each recording, in the order of the table ``recordings``."""
    divided = {name: split_table(tables[name], "sensor", "recording") for name in BY_RECORDING}
    keys = cache(partial(_make_keys, tables))
    recordings = RecordingRow.rows_of(tables["recordings"])
    return [RecordingView(row, divided, keys) for row in recordings]


def _make_keys(tables: Mapping[str, pa.Table]) -> dict[Name, str]:
    digests: dict[Name, hashlib._Hash] = {}
    for table_name in BY_RECORDING:
        table = tables[table_name]
        if not table.num_rows:
            continue
        plain = table
        for place, name in enumerate(table.column_names):
            column = table[place]
            if pa.types.is_list(column.type) and pa.types.is_string(column.type.value_type):
                joined = pc.binary_join(column, "\x1f").dictionary_encode()
                plain = plain.set_column(place, name, joined)
            elif pa.types.is_list(column.type):
                texts = [str(value) for value in column.to_pylist()]
                plain = plain.set_column(place, name, pa.array(texts, pa.string()))
            elif pa.types.is_primitive(column.type):
                # Integers with nulls would become floats, depending on other recordings.
                plain = plain.set_column(place, name, column.cast(pa.float64()))
        rows = hash_pandas_object(plain.to_pandas(), index=False).to_numpy()
        named = table.select(["sensor", "recording"]).append_column("rows", pa.array(rows))
        for (sensor, recording), part in split_table(named, "sensor", "recording").items():
            digest = digests.setdefault((sensor, recording), hashlib.sha256())
            digest.update(
                f"{table_name} {part.num_rows}".encode() + part["rows"].to_numpy().tobytes()
            )
    return {name: digest.hexdigest() for name, digest in digests.items()}


def _read_floats(part: pa.Table, *columns: str) -> dict[str, Array]:
    return {name: np.asarray(part[name].to_numpy(), dtype=np.float64) for name in columns}
