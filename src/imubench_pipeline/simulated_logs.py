"""Simulated recordings, written as the logger of their sensor would write them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from imubench_pipeline.config import SimulatedRecording
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.readers.batch import SECONDS
from imubench_pipeline.sensor import QUANTITIES, ColumnSource, LogFormat, quantity_of
from imubench_pipeline.simulate import channel_rng, simulate_blocks
from imubench_pipeline.units import conversion, quantity_to_si
from imubench_pipeline.validation import ConfigError

_BLOCK = 1 << 18


def write_simulated(recording: SimulatedRecording, log: LogFormat, folder: Path) -> None:
    """Simulate a recording and write it as text in the layout of its sensor's logs.

    Parameters
    ----------
    recording : SimulatedRecording
    log : LogFormat
        The sensor's: the columns, units and files that its reader expects.
    folder : Path
        Where the files go.

    Raises
    ------
    ConfigError
        If the logs of the sensor are not text.
    """
    if log.reader not in (None, "csv"):
        raise ConfigError(
            f"{recording.sensor}: simulated logs are written as text, the sensor file has "
            f"reader {log.reader!r}"
        )
    rate = quantity_to_si(recording.rate, "frequency")
    samples = round(quantity_to_si(recording.duration, "time") * rate)
    files: dict[str, dict[str, ColumnSource]] = {}
    for channel in recording.channels:
        source = log.channels[channel]
        files.setdefault(source.file or "log.txt", {})[channel] = source
    folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        writers = [
            stack.enter_context(_Writer(folder / name, log, columns, recording))
            for name, columns in files.items()
        ]
        start = 0
        for block in _blocks(recording, rate, samples):
            for writer in writers:
                writer.write(block, start, rate)
            start += len(next(iter(block.values())))


def _blocks(
    recording: SimulatedRecording, rate: float, samples: int
) -> Iterator[dict[str, NDArray[np.float64]]]:
    """Yield the channels in SI, block by block."""
    streams = {}
    bias = {}
    for channel, settings in recording.channels.items():
        truth = settings.si(channel)
        bias[channel] = truth.get("bias", 0.0)
        rng = channel_rng(recording.seed, recording.sensor, recording.recording, channel)
        model = NoiseModel(
            N=truth.get("N", 0.0),
            B=truth.get("B", 0.0),
            T_B=truth.get("T_B"),
            K=truth.get("K", 0.0),
        )
        streams[channel] = simulate_blocks(model, rate, samples, rng, _BLOCK)
    for _ in range(0, samples, _BLOCK):
        yield {str(name): next(stream) + bias[name] for name, stream in streams.items()}


class _Writer:
    """Writes one text file of a simulated recording."""

    def __init__(
        self,
        path: Path,
        log: LogFormat,
        sources: dict[str, ColumnSource],
        recording: SimulatedRecording,
    ) -> None:
        self._log, self._sources = log, sources
        self._names = self._layout()
        self._file = path.open("wb")
        delimiter = log.delimiter or ","
        if log.comment:
            for line in ("simulated, not measured", f"Update Rate: {recording.rate}"):
                self._file.write(f"{log.comment} {line}\n".encode())
        self._file.write(b"\n" * log.skip_lines)
        if any(isinstance(source.column, str) for source in sources.values()):
            self._file.write((delimiter.join(self._names) + "\n").encode())
        self._options = pacsv.WriteOptions(
            include_header=False, delimiter=delimiter, quoting_style="none"
        )

    def __enter__(self) -> _Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _layout(self) -> list[str]:
        """Return the names of the columns of the file in order."""
        placed: dict[str | int, str] = {}
        if self._log.time is not None:
            placed[self._log.time.column] = "time"
        placed |= {source.column: name for name, source in self._sources.items()}
        if any(isinstance(column, str) for column in placed):
            return [str(column) for column in placed]
        width = max(column for column in placed if isinstance(column, int))
        return [str(number) for number in range(1, width + 1)]

    def write(self, block: dict[str, NDArray[np.float64]], start: int, rate: float) -> None:
        """Write the next samples, given in SI."""
        count = len(next(iter(block.values())))
        columns: dict[str, NDArray[Any]] = {}
        if self._log.time is not None:
            unit = self._log.time.unit
            if unit is None or unit == "samples" or self._log.time.wraps is not None:
                raise ConfigError(
                    "simulated logs have numeric time stamps in s, ms, us or ns that never wrap"
                )
            seconds = SECONDS[unit] * self._log.time.scale
            stamps = np.arange(start, start + count) / rate / seconds
            columns[str(self._log.time.column)] = np.round(stamps, 9)
        for channel, source in self._sources.items():
            factor, _ = conversion(source.unit, QUANTITIES[quantity_of(channel)])
            raw = block[channel] / (factor * source.scale) + source.offset
            # float32 has seven digits, far finer than the noise, and half the text of float64.
            columns[str(source.column)] = raw.astype(np.float32)
        empty = np.zeros(count, dtype=np.int8)
        table = pa.table({name: columns.get(name, empty) for name in self._names})
        pacsv.write_csv(table, self._file, self._options)
