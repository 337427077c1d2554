"""Delimited text: any delimiter, with or without header, numeric or ISO 8601 time, gzip."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from imubench_pipeline.findings import Finding
from imubench_pipeline.readers.batch import Batch, LogFile, RecordingError
from imubench_pipeline.readers.complete_lines import CompleteLines, first_lines, open_text

_BLOCK_BYTES = 4 << 20
_DELIMITERS = ";\t|, "
_MISSING = {"", "nan", "na", "n/a", "null"}
_ZONE = re.compile(r"(Z|[+-]\d\d:?\d\d)$")
_ADVICE = (
    "either the file is corrupt there (copy it again, or cut it before that line), or the sensor "
    "file does not describe it (delimiter, header, skip_lines, comment, column)"
)
_ARROW_ROW = re.compile(r"Row #(\d+)")
_ARROW_COLUMN = re.compile(r"In CSV column #(\d+)")


@dataclass(frozen=True)
class _Layout:
    """How a file is laid out: found from its first lines and its sensor file."""

    lines_before: int
    bytes_before: int
    delimiter: str
    quoted: bool
    names: list[str]
    first_record: list[str]


class CsvFile(LogFile):
    """A log file of delimited text."""

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        layout = self._layout()
        columns = self._columns(layout)
        types = {layout.names[position]: pa.float64() for position in columns.values()}
        time_name = None
        if self.log.time is not None:
            time_name = layout.names[self._position(layout, self.log.time.column, "time")]
            types[time_name] = self._time_type(layout, time_name)
        invalid: list[pacsv.InvalidRow] = []

        def keep(row: pacsv.InvalidRow) -> str:
            invalid.append(row)
            return "skip"

        rows = 0
        first_stamp: np.int64 | np.float64 | None = None
        with open_text(self.path) as stream:
            stream.read(layout.bytes_before)
            lines = CompleteLines(self.path, stream, self.findings)
            try:
                reader = pacsv.open_csv(
                    lines,
                    read_options=pacsv.ReadOptions(
                        use_threads=False, block_size=_BLOCK_BYTES, column_names=layout.names
                    ),
                    parse_options=pacsv.ParseOptions(
                        delimiter=layout.delimiter,
                        # A stray quote would swallow the lines up to the next one.
                        quote_char='"' if layout.quoted else False,
                        invalid_row_handler=keep,
                    ),
                    convert_options=pacsv.ConvertOptions(
                        column_types=types, include_columns=list(types)
                    ),
                )
                for part in reader:
                    if len(part) == 0:
                        continue
                    if invalid and invalid[0].number <= rows + len(part):
                        raise self._wrong_width(invalid[0], layout)
                    rows += len(part)
                    time = None
                    if time_name is not None:
                        stamps = _stamps(part.column(time_name))
                        if first_stamp is None:
                            first_stamp = self._first(stamps)
                        time = self.seconds(stamps, first_stamp)
                    yield Batch(
                        time,
                        {
                            name: self.to_si(name, _numbers(part, layout, position))
                            for name, position in columns.items()
                        },
                    )
            except pa.ArrowInvalid as error:
                raise lines.error or self._explained(error, layout, types) from None
            except UnicodeDecodeError as error:
                raise RecordingError(f"{self.path.name}: not UTF-8 text ({error})") from None
        if len(invalid) > 1:
            raise self._wrong_width(invalid[0], layout)
        if invalid:
            self.findings.append(
                Finding(
                    "incomplete_last_record",
                    "note",
                    f"{self.path.name}: the last record has {invalid[0].actual_columns} of "
                    f"{invalid[0].expected_columns} columns; left out",
                    1,
                )
            )
        if rows == 0:
            raise RecordingError(f"{self.path.name}: no complete record")

    # ------------------------------------------------------------------ the first lines

    def _layout(self) -> _Layout:
        before, size, header_size = 0, 0, 0
        head: list[str] = []
        for number, raw in enumerate(first_lines(self.path)):
            text = raw.decode("utf-8", "replace").rstrip("\r\n")
            text = text.removeprefix("\ufeff") if number == 0 else text
            passed_over = (
                number < self.log.skip_lines
                or not text.strip()
                or (self.log.comment is not None and text.startswith(self.log.comment))
            )
            if not passed_over:
                self._check_text(raw, text)
                head.append(text)
            if len(head) == 2:
                break
            if head:
                header_size += len(raw)
            else:
                before, size = before + 1, size + len(raw)
        if not head:
            raise RecordingError(f"{self.path.name}: the file is empty")
        delimiter = self.log.delimiter or _delimiter(head)
        rows = [self._split(text, delimiter) for text in head]
        header = self._has_header(rows[0])
        names = [name.strip() for name in rows[0]]
        if header:
            before, size = before + 1, size + header_size
        else:
            names = [str(number) for number in range(1, len(names) + 1)]
        records = rows[1:] if header else rows
        if not records:
            raise RecordingError(f"{self.path.name}: no record after the header")
        quoted = '"' in (head[-1] if header else head[0])
        # A name that stands twice can still be taken by its position.
        names = [
            name if names.count(name) == 1 else f"{name} (column {number})"
            for number, name in enumerate(names, start=1)
        ]
        return _Layout(before, size, delimiter, quoted, names, records[0])

    def _check_text(self, raw: bytes, text: str) -> None:
        if b"\0" in raw:
            raise RecordingError(f"{self.path.name}: holds binary data, expected text")
        if "\r" in text:
            raise RecordingError(
                f"{self.path.name}: lines end with a carriage return alone; expected line feeds "
                "(tr '\\r' '\\n' mends it)"
            )

    def _split(self, text: str, delimiter: str) -> list[str]:
        try:
            return next(csv.reader([text], delimiter=delimiter))
        except csv.Error as error:
            raise RecordingError(
                f"{self.path.name}: cannot be read as columns ({error}): {text[:40]!r}"
            ) from None

    def _has_header(self, row: list[str]) -> bool:
        if self.log.header is not None:
            return self.log.header
        wanted = [source.column for source in self.sources.values()]
        if any(isinstance(column, str) for column in wanted):
            return True
        positions = [column - 1 for column in wanted if isinstance(column, int)]
        cells = [row[position] for position in positions if position < len(row)]
        return not all(_is_number_or_missing(cell) for cell in cells)

    # ------------------------------------------------------------------------- columns

    def _columns(self, layout: _Layout) -> dict[str, int]:
        return {
            name: self._position(layout, source.column, name)
            for name, source in self.sources.items()
        }

    def _position(self, layout: _Layout, column: str | int, key: str) -> int:
        found = ", ".join(layout.names[:20]) + (", ..." if len(layout.names) > 20 else "")
        if isinstance(column, int):
            if column > len(layout.names):
                raise RecordingError(
                    f"{self.path.name}: no column {column} for {key}; found "
                    f"{len(layout.names)} columns ({found}) with delimiter {layout.delimiter!r}"
                )
            return column - 1
        if f"{column} (column" in found:
            raise RecordingError(
                f"{self.path.name}: column {column!r} for {key} stands twice in the header "
                f"({found}); take it by its position, as a number"
            )
        if column not in layout.names:
            raise RecordingError(
                f"{self.path.name}: no column {column!r} for {key}; found {found} with "
                f"delimiter {layout.delimiter!r}; mend 'column' of {key} in the sensor file"
            )
        return layout.names.index(column)

    def _time_type(self, layout: _Layout, name: str) -> pa.DataType:
        assert self.log.time is not None
        if self.log.time.format == "iso8601":
            position = layout.names.index(name)
            text = layout.first_record[position] if position < len(layout.first_record) else ""
            return pa.timestamp("ns", "UTC" if _ZONE.search(text.strip()) else None)
        # Nanoseconds since 1970 do not fit into the 53 bits of a float64.
        return pa.int64() if self.log.time.unit == "ns" else pa.float64()

    def _first(self, stamps: NDArray[Any]) -> Any:
        valid = stamps[~np.isnan(stamps)] if stamps.dtype.kind == "f" else stamps
        if not len(valid):
            raise RecordingError(f"{self.path.name}: no time stamp in the first records")
        assert self.log.time is not None
        if self.log.time.format == "iso8601":
            self.started = str(np.datetime64(int(valid[0]), "ns"))[:23]
        return valid[0]

    # --------------------------------------------------------------------------- faults

    def _wrong_width(self, row: pacsv.InvalidRow, layout: _Layout) -> RecordingError:
        return RecordingError(
            f"{self.path.name}, line {self._line(row.number, layout)}: found "
            f"{row.actual_columns} columns, expected {row.expected_columns}: {row.text[:80]!r}; "
            f"{_ADVICE}"
        )

    def _line(self, row: int, layout: _Layout) -> int:
        """Return the line of a record in the file; blank lines are no records."""
        records = 0
        for number, raw in enumerate(first_lines(self.path), start=1):
            records += number > layout.lines_before and bool(raw.strip(b"\r\n"))
            if records == row:
                return number
        return row + layout.lines_before

    def _explained(
        self, error: pa.ArrowInvalid, layout: _Layout, types: dict[str, pa.DataType]
    ) -> RecordingError:
        text = str(error)
        row, column = _ARROW_ROW.search(text), _ARROW_COLUMN.search(text)
        where = f", line {self._line(int(row[1]), layout)}" if row else ""
        name = layout.names[int(column[1])] if column and int(column[1]) < len(layout.names) else ""
        expected = "a time stamp" if name in types and types[name] != pa.float64() else "a number"
        found = re.search(
            r"invalid value '(.*)'|expected .* zone offset in '(.*)'", text, re.DOTALL
        )
        if not name or not found:
            return RecordingError(
                f"{self.path.name}{where}: cannot be read as text columns: {text}"
            )
        value = (found[1] or found[2] or "")[:40]
        return RecordingError(
            f"{self.path.name}{where}, column {name!r}: found {value!r}, expected {expected}; "
            f"{_ADVICE}"
        )


def _delimiter(head: list[str]) -> str:
    """Return the likeliest delimiter: the most telling one that stands as often in both lines."""
    for sign in _DELIMITERS:
        if 0 < head[0].count(sign) == head[-1].count(sign):
            return sign
    return max(_DELIMITERS, key=lambda sign: (head[-1].count(sign), -_DELIMITERS.index(sign)))


def _is_number_or_missing(text: str) -> bool:
    if text.strip().lower() in _MISSING:
        return True
    try:
        float(text)
    except ValueError:
        return False
    return True


def _numbers(part: pa.RecordBatch, layout: _Layout, position: int) -> NDArray[np.float64]:
    column = part.column(layout.names[position])
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _stamps(column: pa.Array) -> NDArray[Any]:
    if pa.types.is_timestamp(column.type):
        column = column.cast(pa.int64())
    if pa.types.is_integer(column.type) and column.null_count:
        # An integer column with a gap: the gap becomes NaN.
        return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)
    return np.asarray(column.to_numpy(zero_copy_only=False))
