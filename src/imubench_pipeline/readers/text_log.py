"""Write simulated logs as text, in the format of the logger of their sensor."""

from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import DTypeLike, NDArray

from imubench_pipeline.readers.batch import SECONDS
from imubench_pipeline.readers.text.header import SIMULATED
from imubench_pipeline.settings import sensor
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.units import find_conversion

_DECIMALS = 12  # more are rounding errors, and would double the size of the file


class TextLog(AbstractContextManager["TextLog"]):
    """Writes a text file in the layout of the logs of a sensor; ``rate`` is in Hz.

    ``sources`` are the columns of the channels and of ``temperature`` in this file. ``remarks`` are
    comments at the top, below the mark of a simulated log, if the layout has comments. ``kind`` is
    the type of the numbers: float32 has seven digits, far finer than the noise, and halves the
    text. Raises `ConfigError` if the layout has stamps that are not simple numbers.
    """

    def __init__(
        self,
        path: Path,
        log: sensor.LogFormat,
        sources: Mapping[str, sensor.ColumnSource],
        rate: float,
        remarks: Iterable[str] = (),
        kind: DTypeLike = np.float64,
    ) -> None:
        self._log, self._sources, self._rate, self._kind = log, sources, rate, kind
        self._written = 0
        self._stamp_unit = 1.0  # s
        placed: dict[str | int, str] = {}
        if (time := log.time) is not None:
            if time.unit is None or time.unit == "samples" or time.wraps is not None:
                raise ConfigError(
                    "a simulated log needs numeric time stamps in s, ms, us or ns that never wrap; "
                    "correct 'unit' of 'time' in the sensor file, and drop 'format' and 'wraps'"
                )
            self._stamp_unit = SECONDS[time.unit] * time.scale
            placed[time.column] = "time"
        placed |= {source.column: name for name, source in sources.items()}
        numbers = [column for column in placed if isinstance(column, int)]
        all_numbered = len(numbers) == len(placed)
        self._names = [str(c) for c in (range(1, max(numbers) + 1) if all_numbered else placed)]
        delimiter = log.delimiter or ","
        self._options = pacsv.WriteOptions(
            include_header=False, delimiter=delimiter, quoting_style="none"
        )
        self._file = path.open("wb")
        if log.comment:
            for line in (SIMULATED, *remarks):
                self._file.write(f"{log.comment} {line}\n".encode())
        self._file.write(b"\n" * log.skip_lines)
        if any(isinstance(source.column, str) for source in sources.values()):
            self._file.write((delimiter.join(self._names) + "\n").encode())

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def write(self, block: Mapping[str, NDArray[np.float64]]) -> None:
        """Write the next samples, given in SI (temperature: °C), shape (block,) each."""
        count = len(next(iter(block.values())))
        columns: dict[str, NDArray[Any]] = {}
        if self._log.time is not None:
            stamps = np.arange(self._written, self._written + count) / self._rate / self._stamp_unit
            columns[str(self._log.time.column)] = np.round(stamps, 9)
        for name, source in self._sources.items():
            dimension = (
                "temperature"
                if name == sensor.TEMPERATURE
                else sensor.QUANTITIES[sensor.quantity_of(name)]
            )
            factor, zero = find_conversion(source.unit, dimension)
            raw = (block[name] - zero) / (factor * source.scale) + source.offset
            columns[str(source.column)] = np.round(raw, _DECIMALS).astype(self._kind)
        empty = np.zeros(count, dtype=np.int8)
        table = pa.table({name: columns.get(name, empty) for name in self._names})
        pacsv.write_csv(table, self._file, self._options)
        self._written += count
