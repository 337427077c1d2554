"""The time of the records of a text log, from its columns of stamps."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.stamps import Clock, date_of_nanoseconds, date_of_stamp
from imubench_pipeline.readers.text.cells import is_missing
from imubench_pipeline.readers.text.layout import TextLayout
from imubench_pipeline.readers.text.stamps import DAY, TextStamps, arrow_type
from imubench_pipeline.settings.sensor import TimeSource

_WHOLE = re.compile(r"-?\d{1,19}")


class TextTime:
    """Makes seconds of the stamps of a text log.

    Parameters
    ----------
    file : LogFile
        Gets ``started`` with the first stamp.

    Attributes
    ----------
    types : dict of int to DataType
        What pyarrow is to read, by position; a date in a column of its own first.
    position : int
        That of the stamps.
    expected : str
        What a stamp is, for messages.
    """

    def __init__(self, file: LogFile, layout: TextLayout) -> None:
        assert file.log.time is not None  # made where there are stamps
        source = file.log.time
        self._source = source
        self._text: TextStamps | None = None
        positions = [layout.position(column, "time") for column in time_columns(source)]
        self.position = positions[-1]
        stamps = [row[self.position] for row in layout.rows if self.position < len(row)]
        present = [stamp for stamp in stamps if not is_missing(stamp)]
        self.types = dict.fromkeys(positions, self._type(present))
        daily = self._text is not None and not self._text.dated
        self._clock = Clock(file, DAY if daily else source.wraps, self._started)
        self.expected = f"a time stamp as {source.format or source.unit!r}"
        if present:
            self.expected += f", like {present[0]!r}"

    def _type(self, stamps: list[str]) -> pa.DataType:
        if self._source.format is None:
            # Nanoseconds since 1970 do not fit into the 53 bits of a float64.
            whole = self._source.unit == "ns" and all(_WHOLE.fullmatch(s.strip()) for s in stamps)
            return pa.int64() if whole else pa.float64()
        if self._source.format == "iso8601" and self._source.date is None:
            kind = arrow_type(stamps)
            if kind is not None:
                return kind
        self._text = TextStamps(self._source.format)
        return pa.string()

    def seconds(self, part: pa.RecordBatch) -> NDArray[np.float64]:
        """Return s since the first stamp of the file; NaN where the stamp is missing.

        Raises
        ------
        StampError
            If a stamp cannot be read.
        RecordingError
            If the first records have no stamp.
        """
        columns = [part.column(str(position)) for position in self.types]
        return self._clock.seconds(*self._stamps(columns))

    def _stamps(self, columns: list[pa.Array]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Return the stamps as numbers, and which of them are there."""
        if self._text is not None:
            texts = columns[0] if len(columns) == 1 else pc.binary_join_element_wise(*columns, " ")
            return self._text.nanoseconds(texts)
        (column,) = columns
        present = np.asarray(column.is_valid())
        if pa.types.is_timestamp(column.type):
            column = column.cast(pa.int64())
        stamps = np.asarray(column.fill_null(0) if column.null_count else column)
        if stamps.dtype.kind == "f":
            present &= np.isfinite(stamps)
        return stamps, present

    def _started(self, first: Any) -> str | None:
        if self._source.format is not None:
            return date_of_nanoseconds(first) if self._text is None or self._text.dated else None
        return date_of_stamp(first, self._source)


def time_columns(source: TimeSource | None) -> list[str | int]:
    """Return the columns that stamps are taken from."""
    if source is None:
        return []
    return [column for column in (source.date, source.column) if column is not None]
