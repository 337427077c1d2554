"""Read logs like the workflow: put files and arrays on a time base, check and store them in SI."""

import json
import shutil
import tempfile
import weakref
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from imubench_pipeline.datasheets.plausibility import implausible_of
from imubench_pipeline.library.given import Channels, Column, Units, expand_channels, get_dimension
from imubench_pipeline.library.shown import cut, summarise
from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.readers.inspection.draft import Entry
from imubench_pipeline.recordings import recording
from imubench_pipeline.recordings.drop_zone import get_recording_name, get_sensor_name
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import (
    CHANNELS,
    TEMPERATURE,
    IngestPlan,
    LogFormat,
    RecordingNotes,
    Sensor,
    merged_log,
    quantity_of,
)
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import read_settings, read_yaml
from imubench_pipeline.tables.findings import RecordingError, make_finding
from imubench_pipeline.typing import Array
from imubench_pipeline.units import SI_UNITS, parse_quantity, parse_setting
from imubench_pipeline.words.numbers import duration_text, number_text

if TYPE_CHECKING:
    import pandas as pd

_SENSOR_FOLDER = Path("config/sensors")
_YAML_SUFFIXES = (".yaml", ".yml")
_MAX_FINDINGS = 6  # max. number of findings in the summary
_UNKNOWN_MODEL = {"vendor": "unknown", "model": "unknown"}


class Log:
    """An ingested recording: its channels in SI on a uniform grid, and the findings.

    The samples are stored in a temporary folder, since a log may be larger than memory. The folder
    is removed with the object.

    Attributes
    ----------
    sensor, recording : str
        Names. The random streams of an estimate depend on them, as in the workflow.
    name : str
        Sensor and recording, joined by ``/``.
    simulated : bool
        Whether the log is simulated, by its own mark or the notes beside it.
    channels : tuple of str
        Channels that can be analysed, of gyro_x to accel_z.
    findings : tuple of Finding
        Problems and remarks: name, severity, detail, channel and span.
    bandwidth : float or None
        Stated cut-off of the sensor's own low-pass, Hz.
    quality : Quality
        Result of the ingest.
    declared : Sensor or None
        Sensor file of the log; None: it was drafted.
    """

    def __init__(
        self, folder: Path, quality: Quality, sensor: Sensor | None, bandwidth: float | None
    ) -> None:
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        self._logs = recording.open_channel_logs(folder)
        self._about = quality.recording
        self.quality, self.declared = quality, sensor
        self.sensor = self._about.sensor
        self.recording = self._about.recording
        self.name = f"{self.sensor}/{self.recording}"
        self.simulated = self._about.simulated
        self.bandwidth = bandwidth
        self.channels = tuple(self._logs)
        with_temperature = any(log.temperature for log in self._logs.values())
        self._names = (*self.channels, TEMPERATURE) if with_temperature else self.channels
        self._at_rest = recording.was_at_rest(folder)
        rows = [*quality.findings, *implausible_of(quality, sensor)]
        self.findings = tuple(map(make_finding, rows))

    @property
    def rates(self) -> dict[str, float]:
        """Sampling rate of each channel, Hz; measured from the time stamps, if there are any."""
        return {name: log.rate for name, log in self._logs.items()}

    @property
    def rate(self) -> float:
        """Sampling rate of all channels, Hz.

        Raises
        ------
        ValueError
            If the channels have different rates.
        """
        if len(set(self.rates.values())) > 1:
            each = ", ".join(f"{name} {rate:.6g} Hz" for name, rate in self.rates.items())
            raise ValueError(f"the channels have different rates ({each}); use .rates")
        return next(iter(self.rates.values()))

    @property
    def duration(self) -> float:
        """Length of the longest channel, s, including gaps."""
        return max(log.grid / log.rate for log in self._logs.values())

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each channel."""
        return {name: SI_UNITS[get_dimension(name)] for name in self.channels}

    def __getitem__(self, channel: str) -> Array:
        """Return a channel, or ``temperature``, on its grid: SI, shape (L,), NaN where missing."""
        if channel not in self._names:
            raise KeyError(
                f"no channel {channel!r} in {self.name}; it has {', '.join(self._names)}"
            )
        if channel == TEMPERATURE:
            log = next(log for log in self._logs.values() if log.temperature)
            return recording.place_on_grid(log.temperatures(), log.grid)
        log = self._logs[channel]
        return recording.place_on_grid(log.blocks(), log.grid)

    def __iter__(self) -> Iterator[str]:
        return iter(self.channels)

    def __len__(self) -> int:
        return len(self.channels)

    def chosen(self, channels: Channels | None = None) -> dict[str, recording.ChannelLog]:
        """Return the selected channels, by default all, as the stored logs that steps analyse.

        Raises
        ------
        ValueError
            If the sensor was turned, since its motion is not noise, or the log has no such channel.
        """
        if not self._at_rest:
            raise ValueError(
                f"{self.name}: the notes beside the log say that the sensor was turned "
                f"({self._about.kind}); expected a log at rest, since motion is not noise"
            )
        names = expand_channels(channels) or self.channels
        if missing := [name for name in names if name not in self._logs]:
            raise ValueError(
                f"{self.name} has no channel {missing[0]}; it has {', '.join(self.channels)}"
            )
        return {name: self._logs[name] for name in names}

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table of all channels, with units in the names of columns and in ``attrs``.

        The index is the time in s from the first sample; missing samples are NaN.

        Raises
        ------
        ValueError
            If the channels have different clocks.
        """
        import pandas as pd

        if len({(log.grid, log.rate) for log in self._logs.values()}) > 1:
            raise ValueError("the channels have different clocks; use log[channel] for each")
        columns = {f"{name} [{SI_UNITS[get_dimension(name)]}]": self[name] for name in self._names}
        length = len(next(iter(columns.values())))
        table = pd.DataFrame(
            columns, index=pd.Index(np.arange(length) / self.rate, name="time [s]")
        )
        table.attrs = {
            "sensor": self.sensor,
            "recording": self.recording,
            "rate": self.rate,
            "units": {name: SI_UNITS[get_dimension(name)] for name in self._names},
        }
        return table

    def __repr__(self) -> str:
        rows = []
        for name, log in self._logs.items():
            rate, holes = f"{number_text(log.rate, 6)} Hz", "yes" if log.holes else "no"
            rows.append([name, rate, f"{log.grid:,}", self.units[name], holes])
        serious = [finding for finding in self.findings if finding.severity != "note"]
        notes = [
            f"{f.severity}: {f.finding}: {cut(f.detail, 100)}" for f in serious[:_MAX_FINDINGS]
        ]
        if len(self.findings) > len(serious[:_MAX_FINDINGS]):
            notes.append(f"{len(self.findings)} findings in all: .findings")
        heads = ["channel", "rate", "samples", "unit", "some missing"]
        made = " (simulated)" * self.simulated
        title = f"Log {self.name}{made}, {duration_text(self.duration)}"
        return summarise(title, heads, rows, notes)


def read_log(
    path: str | Path,
    sensor: str | Path | Mapping[str, Any] | Sensor | None = None,
    *,
    rate: float | str | None = None,
    units: Units | None = None,
    sensors: str | Path = _SENSOR_FOLDER,
    quality: Mapping[str, Any] | None = None,
) -> Log:
    """Read a log of any format like the workflow: time base, units, knocks, findings.

    Parameters
    ----------
    path : str or Path
        The log file, or the folder or archive of a recording. ``<recording>.yaml`` in the same
        folder contains its notes.
    sensor : str, Path or mapping, optional
        Format of the log: a sensor file, the name of one in ``sensors``, or a mapping with the
        content of a sensor file (or of its ``log``). By default it is drafted from the log, like
        `imubench inspect`.
    rate : float or str, optional
        For the draft, of a log without time stamps: Hz, or ``"100 Hz"``.
    units : mapping of str to str, optional
        For the draft, units that the log does not state: ``{"gyro": "deg/s", "accel": "g"}``, or by
        channel.
    sensors : str or Path
        Folder of the sensor files.
    quality : mapping, optional
        Thresholds of the findings, as under ``quality`` of a run's configuration.

    Returns
    -------
    Log

    Raises
    ------
    ValueError
        If the log cannot be used (`RecordingError`), a setting cannot be used (`ConfigError`), or
        the draft is incomplete: the message names the missing parts and contains the draft. The
        unit of a gyro is never guessed.

    Examples
    --------
    >>> import imubench_pipeline as imu
    >>> log = imu.read_log("run.csv", units={"gyro": "deg/s"})
    >>> log.channels
    ('gyro_z', 'accel_z')
    >>> log["gyro_z"].shape, round(log.rate, 6)
    ((2000,), 100.0)
    """
    source = Path(path)
    if not source.exists():
        raise ValueError(f"{source}: no such file; expected the log of an inertial sensor")
    name = source.name if source.is_dir() else get_recording_name(source.name)
    declared, sensor_name, own = _load_sensor(source, sensor, Path(sensors), rate, units)
    notes_file = source.with_name(f"{name}.yaml")
    notes = RecordingNotes()
    if notes_file.is_file() and notes_file != own:
        notes = parse(RecordingNotes, read_yaml(notes_file) or {}, str(notes_file))
    log = merged_log(declared, notes, str(notes_file))
    try:
        notes.check_gyro(log)
    except ValueError as error:
        raise ConfigError(f"{notes_file}: {error}") from None
    bandwidth = parse_quantity(log.bandwidth, "frequency") if log.bandwidth else None
    kept, found = _ingest(source, log, notes, (sensor_name, name), quality or {}, guarded=True)
    return Log(kept, found, declared if sensor is not None else None, bandwidth)


def ingest_columns(columns: Mapping[str, Column], rate: float, name: str) -> Log:
    """Return a log of samples at ``rate``, Hz; raises RecordingError if no channel can be used."""
    if not name or Path(name).name != name:
        raise ValueError(f"name is {name!r}; expected the name of a log, without '/'")
    channels, temperature = {}, None
    for place, (channel, column) in enumerate(columns.items(), start=1):
        entry = {"column": place, "unit": column.unit}
        if channel == TEMPERATURE:
            temperature = entry
        else:
            channels[channel] = entry
    keys = {"reader": "numpy", "rate": f"{rate!r} Hz", "channels": channels}
    log = LogFormat.model_validate(keys | {"temperature": temperature})
    with tempfile.TemporaryDirectory(prefix="imubench.") as folder:
        file = Path(folder) / f"{name}.npy"
        np.save(file, np.column_stack([column.values for column in columns.values()]))
        kept, found = _ingest(file, log, RecordingNotes(), ("array", name), {}, guarded=False)
    return Log(kept, found, None, None)


def _ingest(
    source: Path,
    log: LogFormat,
    notes: RecordingNotes,
    names: tuple[str, str],
    quality: Mapping[str, Any],
    *,
    guarded: bool,
) -> tuple[Path, Quality]:
    limits = parse(QualitySettings, quality, "quality")
    settings = IngestPlan(kind=notes.kind, notes=notes, log=log, quality=limits).to_json()
    folder = Path(tempfile.mkdtemp(prefix="imubench."))
    try:
        found = ingest_as_planned(source, json.dumps(settings), *names, folder, guarded=guarded)
        if found.recording.status != "ok":
            raise RecordingError(str(found.recording.reason))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return folder, found


def _load_sensor(
    source: Path, sensor: Any, folder: Path, rate: float | str | None, units: Units | None
) -> tuple[Sensor, str, Path | None]:
    """Return the sensor of a log, its name, and its sensor file, if there is one."""
    of_folder = get_sensor_name(source.absolute().parent)
    if sensor is None:
        return _draft_sensor(source, rate, units), of_folder, None
    if rate is not None or units is not None:
        raise ValueError(
            "rate= and units= complete a drafted sensor file; omit them, or omit sensor="
        )
    if isinstance(sensor, Sensor):
        return sensor, of_folder, None
    if isinstance(sensor, Mapping):
        whole = sensor if "log" in sensor else {"log": sensor}
        return parse(Sensor, {**_UNKNOWN_MODEL, **whole}, "sensor"), of_folder, None
    file = Path(sensor)
    if file.suffix not in _YAML_SUFFIXES:
        file = folder / f"{sensor}.yaml"
        if not file.is_file():
            names = sorted(path.stem for path in folder.glob("*.yaml"))
            close = get_close_matches(str(sensor), names, n=1)
            raise ConfigError(
                f"{file}: no such sensor file; "
                + (f"did you mean {close[0]!r}? " if close else "")
                + f"there are: {', '.join(names) or 'none'}; expected one of them, the path of a "
                "file, or no sensor= to have one drafted"
            )
    return read_settings(Sensor, file), file.stem, file


def _draft_sensor(source: Path, rate: float | str | None, units: Units | None) -> Sensor:
    inspection = inspect(source)
    stated = units or {}
    draft = inspection.draft.with_units(
        lambda channel, _: stated.get(channel) or stated.get(quantity_of(channel))
    )
    if rate is not None:
        draft.rate = Entry(f"{parse_setting(rate, 'frequency', 'rate')!r} Hz")
    if unknown := [key for key in units or () if key not in (*CHANNELS, "gyro", "accel")]:
        raise ValueError(f"units= has the key {unknown[0]!r}; expected gyro, accel, or a channel")
    if left := draft.unfilled():
        raise ValueError(
            f"{source.name}: the log does not state {', '.join(left)}; state it with units= or "
            "rate=, as units={'gyro': 'deg/s'}, or pass this as sensor=, with each ? filled in:\n\n"
            f"{inspection.block}"
        )
    return parse(Sensor, draft.sensor(), f"the sensor file drafted from {source.name}")
