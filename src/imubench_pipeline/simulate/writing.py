"""A simulated log as a file that the readers of the project read, and the notes beside it.

Parquet is written as recordings are kept, in SI. CSV has the columns, units and delimiter of the
sensor file where that names columns of one text file, and those of Parquet elsewhere. The notes,
``<log>.yaml``, say how it is written where the sensor file says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import yaml

from imubench_pipeline.readers.text.header import SIMULATED, states_simulated
from imubench_pipeline.readers.text_log import TextLog
from imubench_pipeline.recordings.drop_zone import name_of
from imubench_pipeline.recordings.recording import LogWriter
from imubench_pipeline.settings.sensor import (
    QUANTITIES,
    TEMPERATURE,
    ColumnSource,
    LogFormat,
    quantity_of,
)
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.typing import Array
from imubench_pipeline.units import SI_UNITS

FORMATS = (".parquet", ".csv")
_HEAD = f"# {SIMULATED}: "
"""How notes begin, before the name of their log."""

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

    The columns are in SI; the format is as `layout` gives it. The metadata is that of a Parquet
    file, the remarks are comments at the top of a CSV file. Progress is told after each block how
    many samples there are.
    """
    names = list(columns)
    known_sources = {str(name): source for name, source in log.channels.items()}
    known_sources |= {} if log.temperature is None else {TEMPERATURE: log.temperature}
    sources = {name: known_sources[name] for name in names}
    samples = 0
    if log.reader == "arrow":
        with LogWriter(path, dict.fromkeys(names, pa.float64())) as writer:
            for block in blocks:
                writer.write(block)
                samples += len(next(iter(block.values())))
                progress(samples)
            writer.finish(
                {**metadata, "rows": samples, "grid": samples, "segments": [[0, samples]]}
            )
        return
    with TextLog(path, log, sources, log.rate_hz or 1.0, remarks) as text:
        for block in blocks:
            text.write(block)
            samples += len(next(iter(block.values())))
            progress(samples)


def notes_text(name: str, log: LogFormat, sensor: LogFormat | None, words: str) -> str:
    """Return the notes beside a log: what of its format the sensor file says otherwise.

    ``name``: file name of the log. ``words``: description of the log.
    """
    own = log.model_dump(exclude_unset=True, exclude_none=True)
    base = {} if sensor is None else sensor.model_dump(exclude_unset=True)
    notes = {"device": "simulated", "simulated": True, "log": _over(own, base)}
    text = yaml.safe_dump(notes, sort_keys=False, default_flow_style=None, width=100)
    comment = "".join(f"# {line}\n" for line in words.splitlines())
    return f"{_HEAD}{name}\n{comment}{text}"


def check_notes(notes: Path, path: Path) -> None:
    """Check that the notes of a simulated log are the notes of no other recording.

    Parameters
    ----------
    notes, path : Path
        The notes, and the log; they need not exist.

    Raises
    ------
    ConfigError
        If another log or folder has the same name, which the notes would belong to as well, or the
        notes that exist are not from a simulation of this log.
    """
    beside = sorted(path.parent.iterdir()) if path.parent.is_dir() else []
    for other in beside:
        name = other.name if other.is_dir() else name_of(other.name)
        if name == path.stem and other not in (path, notes):
            raise ConfigError(
                f"{path}: {other.name} is a recording of the same name, and the notes "
                f"{notes.name} would change it; name another --out"
            )
    if not notes.is_file():
        return
    mark = notes.read_text("utf-8", "replace").partition("\n")[0].partition(": ")[0]
    if not states_simulated([mark]):
        raise ConfigError(f"{notes}: exists, and is not of a simulation; name another --out")


def layout(path: Path, columns: Iterable[str], rate: float, sensor: LogFormat | None) -> LogFormat:
    """Return how a log of columns, channels and perhaps temperature, at a rate, Hz, is written.

    Raises
    ------
    ConfigError
        If the suffix is of no format that is written.
    """
    if path.suffix not in FORMATS:
        raise ConfigError(f"{path}: expected a name that ends in {' or '.join(FORMATS)}")
    names = list(columns)
    text = path.suffix == ".csv"
    channels = {name: _si_source(name) for name in names if name != TEMPERATURE}
    temperature = _si_source(TEMPERATURE) if TEMPERATURE in names else None
    delimiter = ","
    if text and sensor is not None and _has_names(sensor, channels):
        channels = {name: sensor.channels[name] for name in channels}  # type: ignore[index]  # the keys are channels, as text
        temperature = sensor.temperature if temperature and sensor.temperature else temperature
        delimiter = sensor.delimiter or delimiter
    keys: dict[str, Any] = {
        "reader": "csv" if text else "arrow",
        "rate": f"{rate:.17g} Hz",
        "channels": {
            name: source.model_dump(exclude_unset=True) for name, source in channels.items()
        },
    }
    if temperature is not None:
        keys["temperature"] = temperature.model_dump(exclude_unset=True)
    if text:
        keys |= {"delimiter": delimiter, "header": True, "comment": "#", "decimal": "."}
    if sensor is not None and sensor.bandwidth is not None:
        keys["bandwidth"] = sensor.bandwidth
    return LogFormat.model_validate(keys)


def _has_names(sensor: LogFormat, channels: Mapping[str, ColumnSource]) -> bool:
    """Return whether a sensor's logs are one text file with a name for each of these channels."""
    by_name = {str(name): source for name, source in sensor.channels.items()}
    sources = [by_name.get(name) for name in channels]
    if sensor.temperature is not None:
        sources.append(sensor.temperature)
    named = all(s is not None and isinstance(s.column, str) and not s.file for s in sources)
    return named and sensor.reader in (None, "csv")


def _si_source(name: str) -> ColumnSource:
    unit = SI_UNITS["temperature" if name == TEMPERATURE else QUANTITIES[quantity_of(name)]]
    return ColumnSource(column=name, unit=unit)


def _over(own: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Return what makes ``own`` of ``base`` when it is merged over it; null takes a key out."""
    changes: dict[str, Any] = {key: None for key, value in base.items() if key not in own and value}
    for key, value in own.items():
        before = base.get(key)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            if inner := _over(value, before):
                changes[key] = inner
        elif value != before:
            changes[key] = dict(value) if isinstance(value, Mapping) else value
    return changes
