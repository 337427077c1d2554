"""Write a simulated log as a file that the readers support, with its notes.

Parquet files have the form of ingested recordings, in SI. CSV files have the columns, units and
delimiter of the sensor file if it names columns of one text file, otherwise the columns and units
of Parquet. The notes, ``<log>.yaml``, contain the log format where it differs from the sensor file.
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import yaml

from imubench_pipeline.readers.text.header import SIMULATED, is_simulated
from imubench_pipeline.readers.text_log import TextLog
from imubench_pipeline.recordings.drop_zone import get_recording_name
from imubench_pipeline.recordings.recording import LogWriter
from imubench_pipeline.settings.sensor import (
    QUANTITIES,
    TEMPERATURE,
    ColumnSource,
    LogFormat,
    diff_settings,
    quantity_of,
)
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.typing import Array
from imubench_pipeline.units import SI_UNITS

FORMATS = (".parquet", ".csv")
_NOTES_PREFIX = f"# {SIMULATED}: "
"""Start of the notes, before the name of their log."""

Blocks = Iterable[Mapping[str, Array]]


def write_log(
    path: Path,
    blocks: Blocks,
    columns: Iterable[str],
    log: LogFormat,
    metadata: Mapping[str, Any],
    remarks: Iterable[str],
    progress: Callable[[int], None],
) -> None:
    """Write a simulated log as Parquet or CSV.

    The columns are in SI; for the format see `layout`. The metadata are for Parquet files; the
    remarks become comments at the top of CSV files. ``progress`` is called after each block with
    the number of its samples.
    """
    names = list(columns)
    known_sources = {str(name): source for name, source in log.channels.items()}
    known_sources |= {} if log.temperature is None else {TEMPERATURE: log.temperature}
    sources = {name: known_sources[name] for name in names}
    samples = 0
    with (
        LogWriter(path, dict.fromkeys(names, pa.float64()))
        if log.reader == "arrow"
        else TextLog(path, log, sources, log.rate_hz or 1.0, remarks)
    ) as writer:
        for block in blocks:
            writer.write(block)
            written = len(next(iter(block.values())))
            samples += written
            progress(written)
        if isinstance(writer, LogWriter):
            shape = {"rows": samples, "grid": samples, "segments": [[0, samples]]}
            writer.finish({**metadata, **shape})


def notes_text(name: str, log: LogFormat, sensor: LogFormat | None, words: str) -> str:
    """Return the notes of the log file ``name``: ``words`` as comments, and its log format."""
    own = log.model_dump(exclude_unset=True, exclude_none=True)
    base = {} if sensor is None else sensor.model_dump(exclude_unset=True)
    notes = {"device": "simulated", "simulated": True, "log": diff_settings(own, base)}
    text = yaml.safe_dump(notes, sort_keys=False, default_flow_style=None, width=100)
    comment = "".join(f"# {line}\n" for line in words.splitlines())
    return f"{_NOTES_PREFIX}{name}\n{comment}{text}"


def check_notes(notes: Path, path: Path) -> None:
    """Check that the notes of a simulated log do not belong to another recording.

    ``notes``, ``path``: the notes, and the log; they need not exist. Raises ConfigError if another
    log or folder has the same name, which the notes would belong to as well, or the notes that
    exist are not from a simulation of this log.
    """
    beside = sorted(path.parent.iterdir()) if path.parent.is_dir() else []
    for other in beside:
        name = other.name if other.is_dir() else get_recording_name(other.name)
        if name == path.stem and other not in (path, notes):
            raise ConfigError(
                f"{path}: {other.name} is a recording of the same name, and the notes "
                f"{notes.name} would change it; name another --out"
            )
    if not notes.is_file():
        return
    mark = notes.read_text("utf-8", "replace").partition("\n")[0].partition(": ")[0]
    if not is_simulated([mark]):
        raise ConfigError(
            f"{notes}: exists, and does not belong to a simulation; name another --out"
        )


def layout(path: Path, columns: Iterable[str], rate: float, sensor: LogFormat | None) -> LogFormat:
    """Return the log format to write to ``path`` at a rate, Hz; ConfigError for other suffixes."""
    if path.suffix not in FORMATS:
        raise ConfigError(f"{path}: expected a name that ends in {' or '.join(FORMATS)}")
    names = list(columns)
    text = path.suffix == ".csv"
    channels = {name: _make_si_source(name) for name in names if name != TEMPERATURE}
    temperature = _make_si_source(TEMPERATURE) if TEMPERATURE in names else None
    delimiter = ","
    if text and sensor is not None and sensor.reader in (None, "csv"):
        # Are the sensor's logs one text file with a named column for each channel?
        by_name = {str(name): source for name, source in sensor.channels.items()}
        sources = [by_name.get(name) for name in channels]
        if sensor.temperature is not None:
            sources.append(sensor.temperature)
        if all(s is not None and isinstance(s.column, str) and not s.file for s in sources):
            channels = {name: by_name[name] for name in channels}
            temperature = temperature and (sensor.temperature or temperature)
            delimiter = sensor.delimiter or delimiter
    keys: dict[str, Any] = {
        "reader": "csv" if text else "arrow",
        "rate": f"{rate:.17g} Hz",
        "channels": {name: each.model_dump(exclude_unset=True) for name, each in channels.items()},
    }
    if temperature is not None:
        keys["temperature"] = temperature.model_dump(exclude_unset=True)
    if text:
        keys |= {"delimiter": delimiter, "header": True, "comment": "#", "decimal": "."}
    if sensor is not None and sensor.bandwidth is not None:
        keys["bandwidth"] = sensor.bandwidth
    return LogFormat.model_validate(keys)


def _make_si_source(name: str) -> ColumnSource:
    unit = SI_UNITS["temperature" if name == TEMPERATURE else QUANTITIES[quantity_of(name)]]
    return ColumnSource(column=name, unit=unit)
