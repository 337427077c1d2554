"""The configuration of one run."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, Field, field_validator

from imubench_pipeline.settings.experiments import WithBlocks, with_blocks
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.requirements import Axis, Latitude, Time
from imubench_pipeline.settings.sensor import diff_settings
from imubench_pipeline.settings.shipped import CATALOGUE
from imubench_pipeline.settings.validation import (
    ConfigError,
    Duration,
    FractionOfLog,
    Frequency,
    NamedPath,
    Strict,
    Text,
    cut,
    parse,
)
from imubench_pipeline.settings.yaml_files import read_settings, read_yaml
from imubench_pipeline.typing import JsonObject

_SIMULATED_RECORDINGS_FILE = Path("config/simulated.yaml")
_SECTIONS_WITHOUT_RECORDING = {"held_back", "exports", "limits", "samples", "tables", "report"}

_Section = TypeVar("_Section", bound=BaseModel)
Folders = NamedPath | Annotated[tuple[NamedPath, ...], Field(min_length=1)]


class AllanSettings(Strict):
    """Settings of the Allan variance: averaging times, and overlap of clusters."""

    overlap: Literal["full", "octave"] = Field(
        "octave",
        description="octave: clusters that start 1/48 of their length apart, fast and equally "
        "precise; full: every cluster",
    )
    per_decade: int = Field(10, ge=1, le=100, description="cluster sizes per decade of tau")
    longest: FractionOfLog = Field(0.5, description="longest tau, as a part of the log")


HeldBack = Annotated[Text, Field(pattern=r"^[^/]+/[^/]+$", examples=["my_sensor/run_7"])]
Method = Literal[
    "robust", "likelihood", "likelihood_gm", "compensated", "curve", "paper", "weighted"
]


class EstimateSettings(Strict):
    """Settings of the estimation of noise parameters."""

    methods: tuple[Method, ...] = Field(
        ("robust", "likelihood", "likelihood_gm", "compensated", "curve", "paper", "weighted"),
        min_length=1,
    )

    longest: FractionOfLog = Field(
        1 / 9, description="longest tau of a fit to the curve, as a part of the log"
    )
    band: Frequency | None = Field(
        None,
        description="highest frequency in the likelihood; null: all, with the low-pass found in "
        "the spectrum",
    )
    seed: int = Field(
        20260101, ge=0, description="seed of the draws for intervals and missing samples"
    )

    @field_validator("methods")
    @classmethod
    def _once(cls, methods: tuple[Method, ...]) -> tuple[Method, ...]:
        if len(set(methods)) < len(methods):
            raise ValueError(f"{', '.join(methods)}: a method occurs twice; expected each once")
        if methods == ("compensated",):
            raise ValueError("compensated requires another method, such as likelihood: add one")
        return methods


class ReconstructionSettings(Strict):
    """Settings of the simulated logs with which a model is tested."""

    members: int = Field(1, ge=1, description="full-length logs per channel and method")
    band_members: int = Field(200, ge=200, description="members of the 95 % band")
    keep_series: bool = Field(False, description="keep the full-length logs as Parquet")
    seed: int = Field(20260101, ge=0)


class DatasheetSettings(Strict):
    """Settings of the comparison with printed figures."""

    tolerance: float = Field(
        0.1, gt=0, description="relative difference that still counts as 'as printed'"
    )


class ErrorBudgetSettings(Strict):
    """Settings of the dead-reckoning error budget of every recording."""

    times: tuple[Time, ...] = Field(
        ("1 s", "10 s", "60 s", "600 s"), min_length=1, description="of dead reckoning, and of rest"
    )
    static_window: Time = Field(
        "60 s", description="window at rest before it, for the estimation of biases and tilt"
    )
    latitude: Latitude = Field("45 deg", description="latitude for north-finding")
    axes: tuple[Axis, ...] = Field(("worst", "median"), min_length=1)
    draws: int = Field(
        200, ge=20, description="number of noise models for the interval of an error"
    )
    seed: int = Field(20260101, ge=0)


class DecideSettings(Strict):
    """Recordings that are used in comparisons in spite of doubts."""

    include: tuple[HeldBack, ...] = Field(
        (), description="unfit recordings that enter rankings, pools and exports all the same"
    )


class CommonSettings(Strict):
    """Share of the variance that all units of one sensor have in common, 0 to 1."""

    N: float = Field(0.0, ge=0, le=1, description="of the white noise, such as of a shared supply")
    B: float = Field(0.0, ge=0, le=1, description="of flicker noise and Gauss-Markov processes")
    K: float = Field(0.0, ge=0, le=1, description="of the random walk, such as of temperature")
    R: float = Field(0.0, ge=0, le=1, description="of the ramp, such as of ageing")


class FusionSettings(Strict):
    """Settings for computing how many cheap sensors match a good one."""

    tau: tuple[Time, ...] = Field(
        ("1 s", "10 s", "100 s", "1000 s"),
        min_length=1,
        description="averaging times of the comparison",
    )
    common: CommonSettings = Field(
        CommonSettings(),
        description="common share of the variance of units, which averaging does not reduce",
    )
    longest: FractionOfLog = Field(1 / 9, description="longest tau, as a fraction of the log")
    draws: int = Field(
        200, ge=100, description="number of noise models for the interval of a number"
    )
    seed: int = Field(20260101, ge=0)


class LimitSettings(Strict):
    """Limits of time and memory of a step; a recording or sensor that exceeds them is omitted."""

    recording: Duration = Field("10 min", description="each step of a recording")
    million_values: Duration = Field(
        "30 s", description="of it more for each million values of the log"
    )
    sensor: Duration = Field("10 min", description="each step of a sensor")
    each_recording: Duration = Field(
        "2 s", description="of it more for each of the sensor's recordings"
    )
    memory: int = Field(
        2000, ge=1000, description="MB of each step of a recording or sensor, on Linux"
    )
    memory_of_million_values: int = Field(
        200, ge=0, description="of it more for each million values of the log"
    )
    memory_of_each_recording: int = Field(
        20, ge=0, description="of it more for each of the sensor's recordings"
    )


class SamplesSettings(Strict):
    """Settings of the stored samples, `log.parquet`, which only the analysis of a log needs."""

    keep: Literal["all"] | Annotated[int, Field(ge=0)] = Field(
        "all",
        description="all, or the number of recordings of each device, the latest, whose samples "
        "stay after a run; a later run that needs others reads their logs again",
    )


class TablesSettings(Strict):
    """Settings of the joint tables of all sensors, which are always written as Parquet."""

    csv: Literal["all", "sensors", "none"] = Field(
        "all",
        description="tables that are also written as CSV; sensors: those without rows of single "
        "recordings",
    )
    parts_above: int = Field(
        1000,
        ge=0,
        description="number of recordings above which a table with rows of recordings is a folder, "
        "with a file for each sensor and month",
    )


class ReportSettings(Strict):
    """Settings of the report."""

    title: str = "Inertial sensor benchmark"
    units: Literal["practical", "si"] = Field(
        "practical", description="practical: deg/sqrt(h), deg/h, ug; si: rad/s, m/s^2"
    )


_NO_PATH_WORDS = {"false", "no", "off", "none", "null", ""}


def _path_or_none(value: object) -> object:
    return None if str(value).strip().lower() in _NO_PATH_WORDS else value


@with_blocks("run")
class Run(WithBlocks):
    """One run: the folders of logs and results, and the settings of each step."""

    logs: NamedPath = Field(Path("logs"), description="the drop zone: logs/<sensor>/<recording>")
    results: NamedPath = Field(Path("results"), description="folder of the results of a run")
    sensors: Folders = Field(
        (CATALOGUE, Path("config/sensors")),
        description="folder of the sensor files, or several: later ones have precedence; "
        "catalogue: the files of the package",
    )
    simulated: Annotated[
        NamedPath | None, BeforeValidator(_path_or_none, json_schema_input_type=str | bool | None)
    ] = Field(
        _SIMULATED_RECORDINGS_FILE,
        description="simulated recordings; false, or no such file by default: none",
    )
    requirements: Annotated[
        Folders | None,
        BeforeValidator(_path_or_none, json_schema_input_type=str | list[str] | bool | None),
    ] = Field(
        (CATALOGUE, Path("config/requirements")),
        description="folders of the requirements of applications, one file each, like sensors; "
        "false: none",
    )
    held_back: tuple[HeldBack, ...] = Field(
        (), description="recordings that are not read; existing results remain"
    )
    allan: AllanSettings = AllanSettings()
    estimate: EstimateSettings = EstimateSettings()
    reconstruction: ReconstructionSettings = ReconstructionSettings()
    quality: QualitySettings = QualitySettings()
    datasheet: DatasheetSettings = DatasheetSettings()
    error_budget: ErrorBudgetSettings = ErrorBudgetSettings()
    decide: DecideSettings = DecideSettings()
    fusion: FusionSettings = FusionSettings()
    limits: LimitSettings = LimitSettings()
    samples: SamplesSettings = SamplesSettings()
    tables: TablesSettings = TablesSettings()
    report: ReportSettings = ReportSettings()

    def section(self, model: type[_Section]) -> _Section:
        """Return the section that an extension added, by its class."""
        section = self.block(model)
        assert section is not None, model  # each has defaults
        return section

    @property
    def to_simulate(self) -> Path | None:
        """Path of the list of simulated recordings; None if not used, or the default is missing."""
        by_default = (
            self.simulated == _SIMULATED_RECORDINGS_FILE and not _SIMULATED_RECORDINGS_FILE.exists()
        )
        return None if by_default else self.simulated


def read_run(config: Mapping[str, object], file: str = "config/config.yaml or --config") -> Run:
    """Validate the configuration of a run from Snakemake (numbers may be text)."""
    return parse(Run, config, file)


def read_config(file: Path) -> JsonObject:
    """Return the unchecked settings in a file; empty without a file; ConfigError if not keys."""
    content = read_yaml(file) if file.is_file() else None
    if content is not None and not isinstance(content, dict):
        raise ConfigError(f"{file}: found {cut(content)}, expected keys and values")
    return content or {}


def given_beside(run: Run, file: Path) -> list[str]:
    """Return the settings of a run that differ from ``file``, as for ``snakemake --config``.

    Settings that do not affect the results of a recording are omitted. ``file`` is the
    configuration that Snakemake reads by default.
    """
    try:
        written = read_settings(Run, file)
    except ConfigError:
        written = Run()
    in_run, in_file = (
        run_settings.model_dump(mode="json", exclude=_SECTIONS_WITHOUT_RECORDING)
        for run_settings in (run, written)
    )
    return [f"{key}={_as_given(value)}" for key, value in diff_settings(in_run, in_file).items()]


def _as_given(value: object) -> str:
    if value is None:
        return "false"  # files that are left out: no other entry outside of a group may be null
    if not isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    # ``snakemake --config`` takes a text for itself that is no number and no other YAML.
    number = r"[+-]?([\d._]+(e[+-]?\d+)?|inf|infinity|nan)|true|false"
    plain = r"(?!\.\.\.)[\w/.]([\w/.~+ ,()-]*[\w/.~+,()-])?"
    if re.fullmatch(plain, value) and not re.fullmatch(number, value, re.IGNORECASE):
        return value
    escaped = (
        letter if letter.isprintable() and letter not in '"\\' else f"\\U{ord(letter):08x}"
        for letter in value
    )
    # Quotes at both ends would be taken away before it is read as YAML.
    return '!!str "' + "".join(escaped) + '" #'
