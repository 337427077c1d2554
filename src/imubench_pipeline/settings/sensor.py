"""The file of one sensor: the format of its logs, and its datasheet."""

import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, model_validator

from imubench_pipeline.registry import blocks
from imubench_pipeline.settings import experiments, validation
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.shipped import CATALOGUE, list_folders
from imubench_pipeline.settings.yaml_files import read_folder, require_valid
from imubench_pipeline.typing import JsonObject
from imubench_pipeline.units import UnitError, find_conversion, parse_quantity

QUANTITIES: dict[str, str] = {"gyro": "angular_rate", "accel": "acceleration"}
"""The measured quantities and the dimension of each."""

CHANNELS: tuple[str, ...] = tuple(f"{q}_{axis}" for q in QUANTITIES for axis in "xyz")
"""Every channel: one axis of one quantity."""

TEMPERATURE = "temperature"  # name of the temperature column of a recording

POSITION = "position"  # name of the column with the position of a turned sensor

TABLE_RATE = "table_rate"  # name of the column with the rate of the rate table

Channel = Literal["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]


def quantity_of(channel: str) -> str:
    """Return the quantity of a channel: ``gyro`` or ``accel``."""
    return channel.split("_", maxsplit=1)[0]


class ColumnSource(validation.Strict):
    """Location and unit of one column of a recording."""

    column: str | int = Field(
        description="name in the header, or position counted from 1 (as spreadsheets, awk and "
        "MATLAB count)"
    )
    unit: str = Field(description="unit of the figures as written, after scale and offset")
    file: str | None = Field(
        None, description="file inside a recording that is a folder; null: the only one"
    )
    variable: str | None = Field(
        None,
        description="array, topic or kind of message of a file that has several; null: the only "
        "one of the file",
    )
    scale: float = Field(1.0, description="unit per count or volt")
    offset: float = Field(0.0, description="counts or volts at zero: scale * (raw - offset)")

    @model_validator(mode="after")
    def _from_one(self) -> Self:
        if isinstance(self.column, int) and self.column < 1:
            raise ValueError(f"column {self.column}: columns are counted from 1")
        if self.scale == 0:
            raise ValueError("scale is 0; expected the unit per count")
        return self


class PositionSource(ColumnSource):
    """Location of the column with the position of a turned sensor."""

    unit: str = Field("1", description="not relevant: any two numbers distinguish two positions")


class TimeSource(validation.Strict):
    """Location and format of the time stamps."""

    column: str | int = Field(description="name in the header, or position counted from 1")
    unit: Literal["s", "ms", "us", "ns", "samples"] | None = Field(
        None,
        description="unit of numeric stamps; samples: the column counts samples, and 'rate' gives "
        "the interval",
    )
    date: str | int | None = Field(
        None, description="column of the date, where 'column' holds the time of day alone"
    )
    scale: float = Field(
        1.0, gt=0, description="unit per tick, such as 0.1 for a clock that counts 0.1 ms in ms"
    )
    format: str | None = Field(
        None,
        description="of stamps in text: iso8601, or a pattern as for strptime such as "
        "%d.%m.%Y %H:%M:%S.%f; of date and time of day with a space between them",
        examples=["iso8601", "%d.%m.%Y %H:%M:%S.%f"],
    )
    wraps: float | None = Field(
        None,
        gt=0,
        description="where the stamps start again from 0, as written, such as 65536 for a "
        "counter of 16 bits; null: they never do",
    )

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.unit is None) == (self.format is None):
            raise ValueError(
                "expected exactly one of 'unit' (s, ms, us, ns, samples) and 'format' (iso8601, or "
                "a pattern such as %d.%m.%Y %H:%M:%S)"
            )
        for column in (self.column, self.date):
            if isinstance(column, int) and column < 1:
                raise ValueError(f"column {column}: columns are counted from 1")
        if self.date is not None and self.format is None:
            raise ValueError("'date' is given without 'format'; state one for date and time")
        if self.format is not None:
            _check_stamp_format(self.format)
            if self.wraps is not None or self.scale != 1:
                raise ValueError("'wraps' and 'scale' need numeric stamps; drop 'format'")
        return self


_STAMP_FIELDS = "YymbdjHIpMSfzTFR%"


def _check_stamp_format(form: str) -> None:
    if form == "iso8601":
        return
    fields = re.findall(r"%(.?)", form)
    if unknown := [field for field in fields if field not in _STAMP_FIELDS or not field]:
        raise ValueError(
            f"format {form!r} has %{unknown[0]}; expected fields of %{' %'.join(_STAMP_FIELDS)}"
        )
    if not set(fields) & set("HITR"):
        raise ValueError(
            f"found format {form!r}; expected iso8601, or a pattern with the hour such as "
            "%d.%m.%Y %H:%M:%S.%f"
        )
    if repeated := [field for field in fields if field != "%" and fields.count(field) > 1]:
        raise ValueError(f"format {form!r} has %{repeated[0]} twice; expected each field once")


Reader = Literal["csv", "vectornav", "ubx", "novatel", "ulog", "dataflash", "rosbag", "matlab",
                 "numpy", "arrow", "hdf5", "excel"]  # fmt: skip
"""The formats of log files; each is declared in ``readers/formats.py``, or by an extension."""

_MIN_RATE, _MAX_RATE = 1e-6, 1e9  # range of valid sampling rates, Hz


class LogFormat(validation.Strict):
    """Format of the logs of a sensor."""

    reader: Reader | None = Field(
        None, description="format of the files; null: found in the file by its first bytes"
    )
    rate: validation.Frequency | None = Field(
        None, description="sampling rate with its unit; needed where there are no stamps"
    )
    time: TimeSource | None = Field(None, description="null: no time stamps")
    channels: dict[Channel, ColumnSource] = Field(min_length=1)
    temperature: ColumnSource | None = None
    position: PositionSource | None = Field(
        None,
        description="of a sensor that is turned between two positions: angle, 0 and 1, or +1 where "
        "the axis points north and -1 south; null: the log does not say",
    )
    table_rate: ColumnSource | None = Field(
        None,
        description="of a sensor on a rate table: the rate of the table, of the gyro's sign; null: "
        "the notes beside the log have the steps",
    )
    bandwidth: validation.Frequency | None = Field(
        None, description="cut-off of the sensor's own low-pass filter, where known"
    )
    delimiter: str | None = Field(
        None, min_length=1, max_length=1, description="of text files; null: found in the file"
    )
    header: bool | None = Field(
        None, description="is there a line of column names? null: found in the file"
    )
    skip_lines: int = Field(0, ge=0, description="lines at the top to pass over")
    comment: str | None = Field(
        None,
        min_length=1,
        description="lines that start so are passed over; null: those that start with # // % ; !",
    )
    decimal: Literal[".", ","] | None = Field(
        None, description="sign before the decimals; null: found in the file"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.rate is None and self.time is None:
            raise ValueError("expected 'rate' (such as 100 Hz) or 'time': neither is there")
        if self.time is not None and self.time.unit == "samples" and self.rate is None:
            raise ValueError("'time' counts samples; expected 'rate' (such as 100 Hz) with it")
        if self.decimal is not None and self.decimal == self.delimiter:
            raise ValueError(f"'delimiter' and 'decimal' are both {self.decimal!r}; change one")
        for channel, source in self.channels.items():
            _check_unit(source.unit, QUANTITIES[quantity_of(channel)], f"channels.{channel}.unit")
        if self.temperature is not None:
            _check_unit(self.temperature.unit, "temperature", "temperature.unit")
        if self.table_rate is not None:
            _check_unit(self.table_rate.unit, "angular_rate", "table_rate.unit")
        beside = (self.temperature, self.position, self.table_rate)
        sources = [*self.channels.values(), *(source for source in beside if source is not None)]
        if self.rate_hz is not None and not _MIN_RATE <= self.rate_hz <= _MAX_RATE:
            raise ValueError(
                f"rate: found {self.rate!r}; expected {_MIN_RATE:g} to {_MAX_RATE:g} Hz"
            )
        if any(source.file for source in sources) and not all(source.file for source in sources):
            raise ValueError("some channels name a 'file' and others do not; expected all or none")
        return self

    @property
    def rate_hz(self) -> float | None:
        """The stated sampling rate in Hz."""
        return None if self.rate is None else parse_quantity(self.rate, "frequency")


def _check_unit(unit: str, dimension: str, key: str) -> None:
    try:
        find_conversion(unit, dimension)
    except UnitError as error:
        raise ValueError(f"{key}: {error}") from error


Grade = Literal["consumer", "industrial", "tactical", "navigation"]
Technology = Literal[
    "silicon MEMS", "quartz MEMS", "FOG", "RLG", "HRG", "DTG", "servo accelerometer"
]


class Sensor(validation.Strict):
    """One IMU model: its logs, its demands on a vehicle, and its datasheet."""

    vendor: validation.Text
    model: validation.Text
    aliases: tuple[validation.Text, ...] = Field(
        (), description="products that contain it, and other names, such as RealSense D435i"
    )
    grade: Grade | None = Field(None, description="class of the sensor, by which limits are made")
    technology: tuple[Technology, ...] = Field(
        (), description="of gyro and accelerometer, or one for both"
    )
    price_class: validation.Text | None = Field(None, description="its price in words")
    sold: bool = Field(
        True,
        description="false: the sensor is not for sale, such as a simulated board of several; it "
        "is in no comparison and on no shortlist",
    )
    price: validation.Text | None = Field(
        None, description="with its currency and number, such as 12 EUR"
    )
    mass: Annotated[validation.Text, validation.make_size_validator("mass")] | None = Field(
        None, examples=["15 g"], description="null: not known"
    )
    power: Annotated[validation.Text, validation.make_size_validator("power")] | None = Field(
        None, examples=["0.2 W"], description="supply that it requires; null: not known"
    )
    temperature_range: validation.Between | None = Field(
        None, description="of operation, such as [-40 degC, 85 degC]; null: not known"
    )
    rate: validation.Frequency | None = Field(
        None, description="highest sampling rate; null: not known"
    )
    interface: validation.Text | None = Field(None, description="such as SPI, I2C, UART or CAN")
    log: LogFormat
    datasheet: Datasheet = Datasheet()


class UsedPart(validation.Strict):
    """The part of a recording to analyse, in s from its first sample."""

    start: float = Field(0.0, ge=0)
    end: float | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.end is not None and self.end <= self.start:
            raise ValueError(f"end {self.end} s is not after start {self.start} s; correct one")
        return self


@experiments.with_blocks("notes")
class RecordingNotes(experiments.WithBlocks):
    """Contents of ``<recording>.yaml`` beside a log."""

    device: validation.Text | None = Field(
        None, description="serial number; default: the recording's name"
    )
    started: validation.Text | None = Field(None, description="date and time of the first sample")
    simulated: bool | None = Field(
        None,
        description="true: the log is simulated, and is not compared with measured ones; false "
        "does not overrule the mark in a log of `imubench simulate`; null: by the mark in the log",
    )
    power_cycled: bool | None = Field(
        None,
        description="whether the sensor was without power between this recording and the one "
        "before it of the same device; null: not known",
    )
    use: UsedPart = UsedPart()
    log: dict[str, JsonValue] = Field(default=dict(), description="merged over the sensor's log")

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        stated = experiments.stated_experiments(self)
        if len(stated) > 1:
            raise ValueError(
                f"found {' and '.join(stated)}; expected one of them: a recording is of one kind"
            )
        return self

    @property
    def kind(self) -> experiments.Kind:
        """Experiment of the recording, as stated in its notes."""
        return experiments.kind_of(experiments.stated_experiments(self))

    def check_gyro(self, log: LogFormat) -> None:
        """Raise ValueError, with the key, if ``log`` lacks the gyro or rates of an experiment."""
        channels = [str(name) for name in log.channels]
        for key, experiment in experiments.stated_experiments(self).items():
            try:
                experiment.moved_gyro(channels, column=log.table_rate is not None)
            except ValueError as error:
                raise ValueError(f"{key}.{error}") from None


def read_sensors(folders: Path | Iterable[Path]) -> dict[str, Sensor]:
    """Read every sensor file of one or several folders, by name; raises `ConfigError`."""
    return require_valid(read_sensor_files(folders))


def read_sensor_files(folders: Path | Iterable[Path]) -> dict[str, Sensor | validation.ConfigError]:
    """Return the sensors in folders by file name; the `ConfigError` of an invalid file, instead.

    Raises `ConfigError` if a folder is missing.
    """
    return read_folder(Sensor, folders, "sensor")


@cache
def shipped_sensors() -> Mapping[str, Sensor]:
    """Return the sensors of the catalogue that comes with the package."""
    declared = read_sensor_files(list_folders(CATALOGUE, "sensors"))
    return {name: sensor for name, sensor in declared.items() if isinstance(sensor, Sensor)}


def sensors_of(catalogue: str) -> dict[str, Sensor]:
    """Return the sensors, by name, from the JSON text in a plan."""
    return {name: Sensor.model_validate(section) for name, section in json.loads(catalogue).items()}


def merged_log(sensor: Sensor, notes: RecordingNotes, file: str) -> LogFormat:
    """Return the log format of one recording: the keys of its notes override the sensor file."""
    merged = _merge(sensor.log.model_dump(exclude_unset=True), notes.log)
    return validation.parse(LogFormat, merged, f"{file}: log")


class IngestPlan(validation.Strict):
    """Settings of the ingest of a recording; if ``log`` is None, ``error`` is the reason."""

    kind: experiments.Kind = experiments.AT_REST
    simulated: bool = False
    notes: RecordingNotes | None = None
    log: LogFormat | None = None
    quality: QualitySettings = QualitySettings()
    files: Mapping[str, str] | None = None
    error: str | None = None
    unavailable: str | None = None

    def to_json(self) -> JsonObject:
        """Return the settings without parts that the ingest does not depend on."""
        log = self.log
        if log is not None and self.kind != "rate_table":
            log = log.model_copy(update={"table_rate": None})
        unused = {"notes": {"log", *blocks("notes")}, "log": {"bandwidth"}}
        dump = self.model_copy(update={"log": log}).model_dump(mode="json", exclude=unused)
        return {key: value for key, value in dump.items() if value is not None}


def _merge(base: JsonObject, over: JsonObject) -> dict[str, JsonValue]:
    """Return ``base`` updated with the keys of ``over``; null removes a key."""
    merged = dict(base)
    for key, value in over.items():
        below = merged.get(key)
        if isinstance(value, Mapping) and isinstance(below, Mapping):
            value = _merge(below, value)
        merged[key] = value
    return {key: value for key, value in merged.items() if value is not None}


def diff_settings(own: JsonObject, base: JsonObject) -> dict[str, JsonValue]:
    """Return the changes that turn ``base`` into ``own`` when merged; null removes a key."""
    changes: dict[str, JsonValue] = {key: None for key in base if key not in own and base[key]}
    for key, value in own.items():
        before = base.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            if inner := diff_settings(value, before):
                changes[key] = inner
        elif value != before:
            changes[key] = value
    return changes
