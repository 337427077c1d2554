"""Simulated recordings of a run: single sensors, boards of several sensors, experiments.

An experiment has the settings of its notes, and the true values.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Self, TypeVar

from pydantic import Field, model_validator

from imubench_pipeline.settings.experiments import (
    Kind,
    SimulatedSensors,
    WithBlocks,
    kind_of,
    stated_experiments,
    with_blocks,
)
from imubench_pipeline.settings.printed import Kind as FigureKind
from imubench_pipeline.settings.profile_forms import FileForm, Form, Surroundings
from imubench_pipeline.settings.sensor import (
    QUANTITIES,
    Channel,
    ColumnSource,
    LogFormat,
    Sensor,
    TimeSource,
    quantity_of,
)
from imubench_pipeline.settings.simulated_sensor import AxisSettings, ImuSettings, check_axes
from imubench_pipeline.settings.validation import (
    ConfigError,
    Duration,
    Frequency,
    NamedPath,
    Strict,
    Text,
)
from imubench_pipeline.settings.yaml_files import read_settings
from imubench_pipeline.units import add_key_to_errors, parse_quantity

_Around = TypeVar("_Around", bound=Surroundings)
_NAME_PATTERN = r"^sim_[A-Za-z0-9_.-]+$"
_MAX_SAMPLES = 1e10  # 80 GB per channel; more is due to a wrong unit


class PublishedFigure(Strict):
    """A printed value, and its meaning in the conventions of the project."""

    where: Text = Field(description="such as Table 5")
    figure: Text = Field(description="its name there")
    printed: Text = Field(description="printed value, with its unit")
    of: Literal["log", "datasheet"] = Field("log", description="subject of the value")
    kind: FigureKind | None = Field(None, description="of a datasheet: max, typ ...; left out: any")
    parameter: Literal["N", "B", "bias", "sensitivity"]
    means: Text = Field(description="the same as that parameter: N two-sided, B the floor / 0.664")
    why: Text | None = Field(None, description="reason for the difference from an estimate")

    def si(self, quantity: str) -> float:
        """Return the figure ``means`` in SI."""
        dimensions = {
            "N": f"{quantity}_density",
            "sensitivity": f"{quantity}_temperature_coefficient",
        }
        return parse_quantity(self.means, dimensions.get(self.parameter, QUANTITIES[quantity]))


class ReadByAuthors(Strict):
    """Values that a source read from the curve of its own, unpublished log."""

    N: Text | None = Field(None, description="white noise density, two-sided")
    B: Text | None = Field(None, description="bias instability: the floor of the curve / 0.664")
    T_B: Text | None = Field(None, description="correlation time")
    K: Text | None = Field(None, description="rate or acceleration random walk")

    def si(self, channel: str) -> dict[str, float]:
        """Return the stated figures in SI."""
        return AxisSettings(**self.model_dump()).si(channel)


class SimulatedChannel(AxisSettings):
    """The true parameters of one simulated channel, with units as published."""

    assumed: tuple[Text, ...] = Field((), description="values that no source publishes")
    published: tuple[PublishedFigure, ...] = ()
    read: ReadByAuthors | None = Field(
        None, description="values that the source read from its own curve: method `authors`"
    )
    figures: Text | None = Field(None, description="figures of the source that show this channel")

    def check(self, channel: str) -> None:
        """Raise UnitError if a unit has the wrong dimension for its figure."""
        super().check(channel)
        if self.read is not None:
            with add_key_to_errors("read."):
                self.read.si(channel)
        for number, figure in enumerate(self.published):
            with add_key_to_errors(f"published.{number}.means: "):
                figure.si(quantity_of(channel))

    @model_validator(mode="after")
    def _known(self) -> Self:
        stated = {name for name in AxisSettings.model_fields if getattr(self, name) is not None}
        if unknown := set(self.assumed) - stated:
            raise ValueError(f"assumed: {min(unknown)!r} is no figure of this channel; remove it")
        return self


class OfASensor(ImuSettings):
    """Settings of one simulated sensor."""

    sensor: str = Field(description="name of the sensor file whose log format it is written in")
    duration: Duration = Field(description="length with its unit, such as 10 h")
    rate: Frequency
    source: Text = Field(description="where the figures are published")
    channels: dict[Channel, SimulatedChannel] = Field(min_length=1)
    shows: dict[Text, Text] = Field(
        default_factory=dict,
        description="intended findings, each with the reason: pages distinguish them from "
        "unexpected ones",
    )

    @model_validator(mode="after")
    def _samples_and_units(self) -> Self:
        length = parse_quantity(self.duration, "time") * parse_quantity(self.rate, "frequency")
        if not 0.5 < length <= _MAX_SAMPLES:
            content = "no sample" if length < 1.0 else f"more than {_MAX_SAMPLES:g} samples"
            raise ValueError(
                f"duration: {self.duration} at {self.rate} gives {content}; correct one of them"
            )
        check_axes(self.channels, "channels")
        return self

    @property
    def samples(self) -> int:
        """Number of samples of the log."""
        rate = parse_quantity(self.rate, "frequency")
        return round(parse_quantity(self.duration, "time") * rate)


@with_blocks("simulated")
class SimulatedRecording(OfASensor, Surroundings, WithBlocks):
    """A recording that is simulated before the run, from known parameters."""

    recording: str = Field(pattern=_NAME_PATTERN, description="starts with sim_")
    seed: int

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for key, sensors in self.simulated_sensors.items():
            try:
                sensors.check(self.channels)
            except ValueError as error:
                raise ValueError(f"{key}: {error}") from None
        experiments = stated_experiments(self)
        if len(experiments) > 1:
            raise ValueError(f"found {' and '.join(experiments)}; expected one of them")
        for key in experiments:
            try:
                gyro = self.moved_gyro
            except ValueError as error:
                raise ValueError(f"{key}.{error}") from error
            if gyro in self.motion or (gyro is None and self.motion):
                raise ValueError(
                    f"motion.{gyro or min(self.motion)}: {key} also states its motion; expected "
                    "one of the two"
                )
        return self

    @property
    def simulated_sensors(self) -> dict[str, SimulatedSensors]:
        """Settings for a recording of several units, by key; one at most."""
        return {key: value for key, value in self if isinstance(value, SimulatedSensors)}

    @property
    def moved_gyro(self) -> str | None:
        """The gyro of its experiment, or None; ValueError if it is not stated or simulated."""
        channels = [str(name) for name in self.channels]
        for experiment in stated_experiments(self).values():
            return experiment.moved_gyro(channels, column=False)
        return None

    @property
    def kind(self) -> Kind:
        """Experiment with the sensor: ``static``, or the key of its settings."""
        return kind_of(stated_experiments(self))


class Simulated(Strict):
    """The file with the list of simulated recordings."""

    recordings: tuple[SimulatedRecording, ...] = ()
    boards: tuple[NamedPath, ...] = Field(
        (), description="files of boards, from the folder of this one"
    )


class Board(Surroundings):
    """Several sensors that share one motion and one temperature."""

    title: Text
    note: Text | None = None
    seed: int
    why: dict[str, Text] = Field(
        default_factory=dict,
        description="by the name of a published figure: reason for the difference from an estimate",
    )
    sensors: tuple[OfASensor, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _explains_what_there_is(self) -> Self:
        channels = (channel for sensor in self.sensors for channel in sensor.channels.values())
        figures = {figure.figure for channel in channels for figure in channel.published}
        if unknown := self.why.keys() - figures:
            expected = ", ".join(sorted(figures)) or "none: nothing is published"
            raise ValueError(
                f"why: {min(unknown)!r} names no published figure; expected {expected}"
            )
        return self

    def recordings(self, name: str) -> Iterator[SimulatedRecording]:
        """Yield the recording ``sim_<name>`` of each sensor of the board."""
        around = {key: getattr(self, key) for key in Surroundings.model_fields}
        for sensor in self.sensors:
            own = {key: getattr(sensor, key) for key in OfASensor.model_fields}
            own["channels"] = {}
            for key, channel in sensor.channels.items():
                figures = tuple(
                    figure.model_copy(update={"why": figure.why or self.why.get(figure.figure)})
                    for figure in channel.published
                )
                own["channels"][key] = channel.model_copy(update={"published": figures})
            yield SimulatedRecording(**own, **around, recording=f"sim_{name}", seed=self.seed)


@dataclass(frozen=True)
class ToSimulate:
    """Simulations of a run: recordings, including recordings of boards, and boards by name."""

    recordings: list[SimulatedRecording]
    boards: dict[str, Board]


def read_simulated(path: Path | None, sensors: Mapping[str, Sensor | ConfigError]) -> ToSimulate:
    """Read the list of simulations; empty if ``path`` is None. Raises `ConfigError`."""
    if path is None:
        return ToSimulate([], {})
    declared = read_settings(Simulated, path)
    recordings = []
    for number, entry in enumerate(declared.recordings):
        _check(entry, sensors, f"{path}: recordings.{number}")
        recordings.append(_found_from(entry, path, f"recordings.{number}."))
    boards: dict[str, Board] = {}
    for file in declared.boards:
        place = path.parent / file
        if not place.is_file():
            raise ConfigError(
                f"{path}: boards: {place}: no such file; expected the file of a board, relative to "
                f"{path.parent}"
            )
        board = read_settings(Board, place)
        for number, sensor in enumerate(board.sensors):
            _check(sensor, sensors, f"{place}: sensors.{number}")
        names = [sensor.sensor for sensor in board.sensors]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ConfigError(f"{place}: sensors: {twice} occurs twice; expected each once")
        board = _found_from(board, place)
        if file.stem in boards:
            raise ConfigError(f"{path}: boards: two are named {file.stem}; rename one of the files")
        if not re.match(_NAME_PATTERN, f"sim_{file.stem}"):
            raise ConfigError(
                f"{path}: boards: found {str(file)!r}; expected a name of letters, digits and . _ -"
            )
        boards[file.stem] = board
        recordings += board.recordings(file.stem)
    names = [f"{entry.sensor}/{entry.recording}" for entry in recordings]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ConfigError(f"{path}: {twice} is simulated twice; expected each once")
    return ToSimulate(recordings, boards)


def _check(entry: OfASensor, sensors: Mapping[str, Sensor | ConfigError], key: str) -> None:
    sensor = sensors.get(entry.sensor)
    if isinstance(sensor, ConfigError):
        raise sensor
    if sensor is None:
        raise ConfigError(
            f"{key}.sensor: found {entry.sensor!r}; expected one of the sensor "
            f"files: {', '.join(sensors)}"
        )
    unknown = set(entry.channels) - set(sensor.log.channels)
    if unknown:
        raise ConfigError(
            f"{key}.channels: found {', '.join(sorted(unknown))}; expected channels of the sensor "
            f"file {entry.sensor}: {', '.join(sensor.log.channels)}"
        )


def _found_from(around: _Around, path: Path, key: str = "") -> _Around:
    """Return the same with profile files relative to the folder of the list."""

    def placed(form: Form | None, name: str) -> Form | None:
        if not isinstance(form, FileForm):
            return form
        file = path.parent / form.file
        if not file.is_file():
            raise ConfigError(
                f"{path}: {key}{name}.file: {file}: no such file; expected a CSV or Parquet file, "
                f"relative to {path.parent}"
            )
        return form.model_copy(update={"file": file})

    temperature = placed(around.temperature, "temperature")
    motion = {name: placed(form, f"motion.{name}") for name, form in around.motion.items()}
    return around.model_copy(update={"temperature": temperature, "motion": motion})


def profile_files(recording: SimulatedRecording) -> list[Path]:
    """Return the files with the temperature and motion profiles of a recording."""
    forms = (recording.temperature, *recording.motion.values())
    return sorted({form.file for form in forms if isinstance(form, FileForm)})


def layout(recording: SimulatedRecording, log: LogFormat) -> LogFormat:
    """Return the log format of a simulated recording, with its columns and rate.

    Where the sensor's `log` has no temperature, and the recording has one, the temperature gets its
    own column (or file, if each channel has one), in degC.
    """
    channels = {name: log.channels[name] for name in recording.channels}
    temperature = None
    if recording.temperature is not None:
        temperature = log.temperature or _free_column(list(channels.values()), log.time)
    # Where the sensor's logs are read with a stated rate, this one is read with its own.
    rate = None if log.rate is None else recording.rate
    own = {"channels": channels, "temperature": temperature, "rate": rate}
    return log.model_copy(update=own | {"position": None, "table_rate": None})


def _free_column(channels: Sequence[ColumnSource], time: TimeSource | None) -> ColumnSource:
    file = None if channels[0].file is None else "temperature.csv"
    stamps = [time.column] if time else []
    places = stamps + [source.column for source in channels]
    if any(isinstance(place, str) for place in places):
        return ColumnSource(file=file, column="temperature", unit="degC")
    # Its own file contains only the stamps and the temperature.
    beside = [int(place) for place in (stamps if file else places)]
    return ColumnSource(file=file, column=max(beside, default=0) + 1, unit="degC")
