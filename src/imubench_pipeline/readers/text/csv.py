"""Read delimited text: find the layout of a log, then read it with pyarrow in large blocks."""

import re
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from imubench_pipeline.readers import file_format as formats
from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.readers.bounds import MAX_SEARCHED_COLUMNS
from imubench_pipeline.readers.stated_units import find_stated_unit
from imubench_pipeline.readers.text import header
from imubench_pipeline.readers.text import stamps as text_stamps
from imubench_pipeline.readers.text.cells import MISSING_CELLS, is_missing, is_number
from imubench_pipeline.readers.text.complete_lines import CompleteLines, Records, read_first_lines
from imubench_pipeline.readers.text.layout import TextLayout, find_layout
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.words.findings import files

_BLOCK_BYTES = 1 << 20  # pyarrow reads 32 of them ahead
_BLOCKS_AHEAD = 32  # parsed while a row group is compressed
_ADVICE = (
    "either the file is corrupt there (copy it again, or cut it before that line), or the sensor "
    "file does not describe it (delimiter, decimal, header, skip_lines, comment, column)"
)
_ARROW_EMPTY_FILE = "Empty CSV file"
_ARROW_OPEN_QUOTE = "out of sync"
_ARROW_ROW = re.compile(r"Row #(\d+)")
_ARROW_COLUMN = re.compile(r"In CSV column #(\d+)")
_ARROW_VALUE = re.compile(r"invalid value '(.*)'|zone offset in '(.*?)'", re.DOTALL)


class CsvFile(LogFile):
    """A log file of delimited text."""

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        figures = [source.column for source in self.sources.values()]
        layout = find_layout(
            self.path, self.log, figures, text_stamps.list_time_columns(self.log.time)
        )
        columns = {
            name: layout.position(source.column, name) for name, source in self.sources.items()
        }
        preamble, skipped = (
            [line.decode("utf-8", "replace") for line in lines]
            for lines in (layout.preamble, layout.skipped)
        )
        self.rate = header.find_stated_rate(preamble)
        self.started = header.find_stated_start(preamble)
        self.simulated = header.is_simulated([*preamble, *skipped])
        time = None if self.log.time is None else text_stamps.TextTime(self, layout)
        beside, _ = find_unit_line(layout)
        for name, at in columns.items():
            label = layout.names[at] if layout.header else ""
            where = f"the line of units, column {at + 1}"
            if unit := find_stated_unit(name, beside.get(at), where, label):
                self.units[name] = unit
            if time is not None and at in time.types:
                raise RecordingError(
                    f"{self.path.name}: column {layout.names[at]!r} is used both for time and for "
                    f"{name}; correct 'column' of one of them in the sensor file"
                )
        yield from self._batches(layout, columns, time)

    def _batches(
        self, layout: TextLayout, columns: Mapping[str, int], time: text_stamps.TextTime | None
    ) -> Iterator[Batch]:
        records = layout.records()
        rows = 0
        for part in _read_ahead(self._parts(layout, set(columns.values()), time, records)):
            try:
                stamps = None if time is None else time.seconds(part)
            except text_stamps.StampError as error:
                assert time is not None  # there are stamps
                line = self._line(rows + error.row + 1, layout, blank=False)
                column = layout.names[time.position]
                raise self._bad_cell(line, column, error.text, time.expected) from None
            rows += len(part)
            figures = {
                name: part.column(str(at)).to_numpy(zero_copy_only=False)
                for name, at in columns.items()
            }
            yield Batch(stamps, {name: self.to_si(name, raw) for name, raw in figures.items()})
        if rows == 0:
            raise RecordingError(f"{self.path.name}: no complete record; expected at least one")
        self._report(layout, records)

    def _parts(
        self,
        layout: TextLayout,
        figures: set[int],
        time: text_stamps.TextTime | None,
        records: Records,
    ) -> Iterator[pa.RecordBatch]:
        types = dict.fromkeys(figures, pa.float64()) | (time.types if time else {})
        fault = _WrongWidth()
        rows = 0
        with CompleteLines(self.path, self.findings, layout.bytes_before, records) as lines:
            try:
                reader = pacsv.open_csv(
                    lines,
                    read_options=pacsv.ReadOptions(
                        use_threads=False,
                        block_size=_BLOCK_BYTES,
                        column_names=[str(position) for position in range(len(layout.names))],
                    ),
                    parse_options=pacsv.ParseOptions(
                        delimiter=layout.split.delimiter,
                        # A single quote would join all lines up to the next one.
                        quote_char='"' if layout.quoted else False,
                        invalid_row_handler=fault.keep,
                    ),
                    convert_options=pacsv.ConvertOptions(
                        column_types={str(at): kind for at, kind in types.items()},
                        include_columns=[str(at) for at in types],
                        null_values=MISSING_CELLS,
                        decimal_point=layout.decimal,
                    ),
                )
                for part in reader:
                    rows += len(part)
                    if fault.row is not None and fault.record <= rows:
                        raise self._wrong_width(fault.row, layout)
                    if len(part):
                        yield part
            except pa.ArrowException as error:
                if lines.error is not None:
                    raise lines.error from None
                if _ARROW_EMPTY_FILE not in str(error):
                    raise self._explained(error, fault, layout, time) from None
            shifted = records.damaged > 0 and self.log.time is None
            if (finding := lines.zeros(records.damaged, shifted=shifted)) is not None:
                self.findings.append(finding)
        if fault.row is not None:
            data = files.IncompleteLastRecord(
                self.path.name,
                columns=fault.row.actual_columns,
                expected=fault.row.expected_columns,
            )
            self.note(data, 1, "note")

    def _report(self, layout: TextLayout, records: Records) -> None:
        if layout.passed_over:
            count, (number, text) = len(layout.passed_over), layout.passed_over[0]
            kind = files.NotRecords if layout.header else files.IncompleteFirstRecord
            self.note(kind(self.path.name, count, number, text[:60]), count, "note")
        if records.restarts:
            data = files.RestartedLog(self.path.name, records.restarts, records.cut)
            self.note(data, records.restarts, "note")

    def _wrong_width(self, row: pacsv.InvalidRow, layout: TextLayout) -> RecordingError:
        return RecordingError(
            f"{self.path.name}, line {self._line(row.number, layout, blank=True)}: found "
            f"{row.actual_columns} columns, expected {row.expected_columns}: {row.text[:80]!r}; "
            f"{_ADVICE}"
        )

    def _bad_cell(self, line: int, column: str, cell: str, expected: str) -> RecordingError:
        return RecordingError(
            f"{self.path.name}, line {line}, column {column!r}: found {cell[:40]!r}, expected "
            f"{expected}; {_ADVICE}"
        )

    def _line(self, row: int, layout: TextLayout, *, blank: bool) -> int:
        """Return the line number of a record; ``blank``: lines of spaces count as records."""
        stripped = b"\r\n" if blank else b"\r\n\t "
        records, count = layout.records(), 0
        for number, raw in enumerate(read_first_lines(self.path), start=1):
            if number > layout.lines_before:
                count += sum(bool(line.strip(stripped)) for line in records(raw).split(b"\n"))
            if count >= row:
                return number
        return row + layout.lines_before

    def _explained(
        self,
        error: pa.ArrowException,
        fault: "_WrongWidth",
        layout: TextLayout,
        time: text_stamps.TextTime | None,
    ) -> RecordingError:
        text = str(error)
        row, column = _ARROW_ROW.search(text), _ARROW_COLUMN.search(text)
        if fault.row is not None and (row is None or fault.row.number <= int(row[1])):
            return self._wrong_width(fault.row, layout)
        if _ARROW_OPEN_QUOTE in text:
            text = "a quote is opened that is not closed on its line; expected one record a line"
        value = _ARROW_VALUE.search(text)
        if row is None or column is None or value is None:
            return RecordingError(f"{self.path.name}: cannot be read: {text[:300]}; {_ADVICE}")
        position = int(column[1])
        expected = f"a number with the decimal sign {layout.decimal!r}, or an empty cell"
        if time is not None and position in time.types:
            expected = time.expected
        line = self._line(int(row[1]), layout, blank=True)
        return self._bad_cell(line, layout.names[position], value[1] or value[2] or "", expected)


def _read_ahead(parts: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    with ThreadPoolExecutor(1) as pool:
        waiting = deque(pool.submit(next, parts, None) for _ in range(_BLOCKS_AHEAD))
        while (part := waiting.popleft().result()) is not None:
            waiting.append(pool.submit(next, parts, None))
            yield part


class _WrongWidth:
    """The first record with a wrong number of columns; allowed if it is the last one."""

    def __init__(self) -> None:
        self.row: pacsv.InvalidRow | None = None
        self.record = 0  # number of the record from 1, without lines of spaces
        self._blank = 0

    def keep(self, row: pacsv.InvalidRow) -> str:
        """Continue after the first record with a wrong number of columns; stop at the second."""
        if not row.text.strip():
            self._blank += 1
            return "skip"
        if self.row is not None:
            return "error"
        self.row, self.record = row, row.number - self._blank
        return "skip"


def find_unit_line(layout: TextLayout) -> tuple[dict[int, str], bytes]:
    """Return the units in a line before the records, by column position, and the line."""
    for raw in layout.preamble:
        if raw == layout.header:
            continue
        text = raw.decode("utf-8", "replace")
        sign = next((sign for sign in layout.comments if text.startswith(sign)), "")
        cells = layout.split.names(text.lstrip(sign) if sign else text, len(layout.names))
        if header.complete_names(cells, layout.names) and header.has_units(cells):
            return {place: cell.strip("()[]{}<> ") for place, cell in enumerate(cells)}, raw
    return {}, b""


_MAX_NOTES = 12


def describe_table(path: Path, file_format: formats.FileFormat) -> list[formats.LogTable]:
    """Return the table of a text log as a list of one; `RecordingError` if it has no records."""
    layout = find_layout(path, formats.NOTHING_STATED, [], [])
    before = [line.decode("utf-8", "replace") for line in layout.preamble]
    units, units_line = find_unit_line(layout)
    rows = [
        row for row in layout.rows[: formats.MAX_EXAMINED_RECORDS] if len(row) >= len(layout.names)
    ]
    rows = rows[:-1] or rows  # the last one may be cut short
    named = layout.names != [str(number) for number in range(1, len(layout.names) + 1)]
    columns = []
    for place, label in enumerate(layout.names[:MAX_SEARCHED_COLUMNS]):
        name = label if named else ""
        addressed = name and layout.names.count(name) == 1 and name.isprintable()
        source = name if addressed else place + 1
        unit = units.get(place)
        unit = None if unit is None or is_missing(unit) else unit
        cells = [row[place] for row in rows]
        first = tuple(cell.strip() for cell in cells[: formats.MAX_SHOWN_VALUES])
        present = [cell for cell in cells if not is_missing(cell)]
        if present and all(is_number(cell, layout.decimal) for cell in present):
            figures = [
                np.nan if is_missing(cell) else float(cell.strip().replace(layout.decimal, "."))
                for cell in cells
            ]
            columns.append(
                formats.LogColumn(source, name, "number", first, np.array(figures), unit)
            )
        elif forms := text_stamps.find_stamp_forms(present):
            values = text_stamps.parse_stamps(forms[0], cells)
            columns.append(formats.LogColumn(source, name, "date", first, values, None, forms))
        else:
            columns.append(formats.LogColumn(source, name, "text", first, unit=unit))
    names = "with names" if named else "without names"
    names = names if layout.labels is None else "with a label before each value"
    return [
        formats.LogTable(
            file_format,
            columns=tuple(columns),
            rate=header.find_stated_rate(before),
            started=header.find_stated_start(before),
            about=f"delimiter {layout.split}, decimal sign {layout.decimal!r}, {names}",
            notes=tuple(
                text.strip().replace("\t", " ")
                for raw, text in zip(layout.preamble, before, strict=True)
                if raw not in (layout.header, units_line)
            )[:_MAX_NOTES],
        )
    ]
