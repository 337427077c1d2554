"""Find the layout of a text log: delimiter, decimal sign, comments, header and first record.

Everything is detected from the first lines; statements of the sensor file are used unchanged.
"""

import re
from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from imubench_pipeline.readers import bounds
from imubench_pipeline.readers.batch import name_settings_file
from imubench_pipeline.readers.text import complete_lines
from imubench_pipeline.readers.text.cells import (
    MAX_COLUMNS,
    Decimal,
    Split,
    are_figures,
    is_datum,
    is_number,
)
from imubench_pipeline.readers.text.header import are_units, complete_names, find_header, is_heading
from imubench_pipeline.readers.text.labels import Labels, find_labels, find_sentence
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.tables.findings import RecordingError

Column = str | int
_COMMENT_SIGNS = ("#", "//", "%", ";", "!")
_CANDIDATE_SPLITS = (*map(Split, ";\t|,"), Split(" ", runs=True), Split(" "))
_MAX_HEAD_LINES, _MAX_HEAD_BYTES, _MAX_UNIT_LINES = 500, 1 << 20, 3
_SCORED_LINES, _SCORED_CELLS, _MAX_SHOWN_NAMES, _MAX_SHOWN_LENGTH = 50, 50, 20, 40


@dataclass(frozen=True)
class TextLayout:
    """Layout of a text log."""

    file: str  # name of the file, for messages
    lines_before: int
    bytes_before: int  # number of lines and bytes before the first record
    split: Split
    quoted: bool
    decimal: Decimal
    names: list[str]  # names of the columns; their positions if there is no header
    rows: list[list[str]]  # cells of the first records; the last record may be incomplete
    comments: tuple[str, ...]  # prefixes of comment lines
    skipped: tuple[bytes, ...]  # the first lines that are skipped because of `skip_lines`
    header: bytes  # the line of names; empty if there is none
    preamble: tuple[bytes, ...]  # the lines before the first record, with the comments
    passed_over: tuple[tuple[int, str], ...]  # lines before the first record without meaning
    blank_is_missing: bool  # a blank line among the records is a record with one empty cell
    labels: Labels | None = None  # labels before the values of each record

    def position(self, column: Column, key: str) -> int:
        """Return the position of a column, from 0; `RecordingError` if missing or ambiguous."""
        shown = [name[:_MAX_SHOWN_LENGTH] for name in self.names[:_MAX_SHOWN_NAMES]]
        present = ", ".join(shown) + (", ..." if len(self.names) > _MAX_SHOWN_NAMES else "")
        if isinstance(column, int):
            if column > len(self.names):
                raise RecordingError(
                    f"{self.file}: no column {column} for {key}; found {len(self.names)} columns "
                    f"({present}) with delimiter {self.split}; correct 'column' of {key}, or "
                    f"'delimiter', in {name_settings_file(key)}"
                )
            return column - 1
        if column not in self.names:
            raise RecordingError(
                f"{self.file}: no column {column!r} for {key}; found {present} with delimiter "
                f"{self.split}; correct 'column' of {key} in {name_settings_file(key)}"
            )
        if self.names.count(column) > 1:
            raise RecordingError(
                f"{self.file}: column {column!r} for {key} occurs twice in the header ({present}); "
                "give its position instead, as a number"
            )
        return self.names.index(column)

    def records(self) -> complete_lines.Records:
        """Return the converter of lines, from the first record on, to records."""
        runs, blank = self.split.runs, self.blank_is_missing
        signs = [sign.encode() for sign in self.comments]
        return complete_lines.Records(signs, self.header, self.preamble, runs, blank, self.labels)


@dataclass(frozen=True)
class _Line:
    """A line at the beginning of a file; ``start``: number of bytes before it."""

    number: int
    start: int
    raw: bytes
    text: str


def find_layout(
    path: Path, log: LogFormat, figures: Sequence[Column], times: Sequence[Column]
) -> TextLayout:
    """Return the layout of a text log; raise `RecordingError` if the file is not text.

    ``figures``, ``times``: required columns of numbers and of time, by name or position. If both
    are empty, the most plausible layout is returned.
    """
    return _Search(path, log, figures, times).layout()


class _Search:
    def __init__(
        self, path: Path, log: LogFormat, figures: Sequence[Column], times: Sequence[Column]
    ) -> None:
        self._file = path.name
        self._skipped: list[bytes] = []
        self._log = log
        self._figures = figures
        self._wanted = [*figures, *times]
        self._names = [column for column in self._wanted if isinstance(column, str)]
        unquoted = (re.escape(name.replace('"', "")) for name in self._names)
        self._any_name = re.compile("|".join(unquoted))
        self._last = max((place for place in self._wanted if isinstance(place, int)), default=1)
        self._comments, self._lines = self._head(path)
        if not self._comments and not self._lines:
            skipped = f" after {log.skip_lines} lines (skip_lines)" if log.skip_lines else ""
            fault = complete_lines.describe_missing_text(path)
            raise RecordingError(f"{self._file}: {fault}; expected lines of a log{skipped}")
        self._labels = None if log.delimiter is not None else self._find_labels()

    def _find_labels(self) -> Labels | None:
        """Remove the labels before values from the lines; return them. RecordingError for prose."""
        texts = [line.text for line in self._lines]
        if (labels := find_labels(texts)) is None:
            if (sentence := find_sentence(texts)) is not None:
                raise RecordingError(
                    f"{self._file}: its lines are text for people, such as "
                    f"{sentence.strip()[:60]!r}, as Adafruit's examples and 'rostopic echo' print "
                    "them; expected one record per line: print CSV in the sketch "
                    "(Serial.print(micros()); Serial.print(','); Serial.print(g.gyro.x, 6); ... "
                    "Serial.println()), or read the bag itself"
                )
            return None
        removed = [labels.remove(text.encode()).decode() for text in texts]
        first = next((n for n, text in enumerate(removed) if text != texts[n]), None)
        if first is None:
            return None
        self._comments += self._lines[:first]  # what the sketch printed before
        lines = [replace(line, text=t) for line, t in zip(self._lines, removed, strict=True)]
        self._lines = [_Line(0, 0, b"", labels.header), *lines[first:]]
        return labels

    def layout(self) -> TextLayout:
        if self._lines:
            refuse_other_formats(self._file, self._lines[0].raw)
            begin = b"\n".join(line.raw for line in self._lines[:_SCORED_LINES])
            controls = len(begin) - len(begin.translate(None, _CONTROL_CHARACTERS))
            if controls > max(_MAX_CONTROLS, _MAX_CONTROL_SHARE * len(begin)):
                raise RecordingError(
                    f"{self._file}, line {self._lines[0].number}: holds binary data of no known "
                    f"format, with the first bytes {begin[:8].hex(' ')} (hexadecimal); expected "
                    "text, or a log of a format that 'imubench formats' lists: export it as CSV"
                )
        split = max(self._splits(), key=self._likelihood)
        comments, lines = self._parted(split)
        if not lines:
            raise RecordingError(
                f"{self._file}: no record after the comments; correct 'comment' in the sensor file"
            )
        header, first = self._header_and_first(split, comments, lines)
        for line in lines[: first + 1]:
            refuse_binary(self._file, line.number, line.raw)
        record = lines[first]
        rows = [split.cells(line.text) for line in lines[first:]]
        if split.delimiter == "," and not (self._names or self._log.delimiter or self._log.decimal):
            refuse_decimals_apart(self._file, record.number, record.text, rows)
        names = self._column_names(split, header, rows[0])
        if len(names) > MAX_COLUMNS:
            raise RecordingError(
                f"{self._file}, line {record.number}: more than {MAX_COLUMNS} columns with "
                f"delimiter {split}; expected one record per line: write the log again, or correct "
                "'delimiter' in the sensor file"
            )
        passed_over = self._passed_over(split, header, lines[:first])
        return TextLayout(
            file=self._file,
            lines_before=record.number - 1,
            bytes_before=record.start,
            split=split,
            quoted=any(split.quotes(line.text) for line in lines[first:]),
            decimal=self._log.decimal or self._decimal(names, rows),
            names=names,
            rows=rows,
            comments=self._signs(split),
            skipped=tuple(self._skipped),
            header=b"" if header is None or (passed_over and not self._names) else header.raw,
            preamble=tuple(
                line.raw for line in [*comments, *lines[:first]] if line.number < record.number
            ),
            passed_over=tuple((line.number, line.text) for line in passed_over),
            labels=self._labels,
            blank_is_missing=len(names) == 1
            and any(after.number == line.number + 1 for line, after in pairwise(lines[first:])),
        )

    def _signs(self, split: Split | None) -> tuple[str, ...]:
        if self._log.comment is not None:
            return (self._log.comment,)
        delimiter = split.delimiter if split else self._log.delimiter
        return tuple(sign for sign in _COMMENT_SIGNS if sign != delimiter)

    def _head(self, path: Path) -> tuple[list[_Line], list[_Line]]:
        comments: deque[_Line] = deque()
        lines: list[_Line] = []
        number, start, line_bytes, comment_bytes = 0, 0, 0, 0
        # A semicolon may begin a comment or be the delimiter, which is not yet known.
        signs = tuple(sign for sign in self._signs(None) if sign != ";")
        for raw in complete_lines.read_first_lines(path, bounds.MAX_BYTES_BEFORE):
            number, here, start = number + 1, start, start + len(raw)
            if number > bounds.MAX_LINES_BEFORE + self._log.skip_lines:
                break
            if number <= min(self._log.skip_lines, bounds.MAX_COMMENT_LINES):
                self._skipped.append(raw.rstrip(b"\r\n"))
            if number <= self._log.skip_lines or not raw.strip(b"\0 \t\r\n"):
                continue
            stripped = raw.rstrip(b"\r\n")
            try:
                text = stripped.decode()
            except UnicodeDecodeError:
                text = stripped.decode("latin-1")
            line = _Line(number, here, stripped, text)
            if line.text.startswith(signs):
                comments.append(line)
                comment_bytes += len(line.raw)
                while (
                    len(comments) > bounds.MAX_COMMENT_LINES
                    or comment_bytes > bounds.MAX_COMMENT_BYTES
                ):
                    comment_bytes -= len(comments.popleft().raw)
                continue
            lines.append(line)
            line_bytes += len(raw)
            if len(lines) >= _MAX_HEAD_LINES or (
                line_bytes > _MAX_HEAD_BYTES and len(lines) > _MAX_UNIT_LINES
            ):
                break
        if not lines and (number > bounds.MAX_LINES_BEFORE or start > bounds.MAX_BYTES_BEFORE):
            raise RecordingError(
                f"{self._file}: no record in the first {number} lines, which are blank or "
                "comments; expected some: correct 'comment' in the sensor file"
            )
        return list(comments), lines

    def _parted(self, split: Split) -> tuple[list[_Line], list[_Line]]:
        """Return the comments and the other lines for a given delimiter."""
        if ";" not in self._signs(split):
            return self._comments, self._lines
        comments = [line for line in self._lines if line.text.startswith(";")]
        lines = [line for line in self._lines if not line.text.startswith(";")]
        return self._comments + comments, lines

    def _splits(self) -> Sequence[Split]:
        stated = "," if self._labels is not None else self._log.delimiter
        if stated is not None:
            return [split for split in _CANDIDATE_SPLITS if split.delimiter == stated] or [
                Split(stated)
            ]
        if self._log.decimal != ",":
            return _CANDIDATE_SPLITS
        return [
            split
            for split in _CANDIDATE_SPLITS
            if split.delimiter != "," or any(split.quotes(line.text) for line in self._lines)
        ]

    def _likelihood(self, split: Split) -> tuple[float, ...]:
        """Return a score of a delimiter: required names, even width, several columns, numbers."""
        comments, lines = self._parted(split)
        rows = [split.cells(line.text) for line in lines[-_SCORED_LINES:]]
        if not rows:
            return (-1,)
        width = Counter(map(len, rows)).most_common(1)[0][0]
        even = [row for row in rows if len(row) == width]
        shown, fits = 0, False
        for line in filter(self._may_have_names, [*lines, *comments]) if self._names else []:
            names = self._names_in(split, line, width)
            count = sum(name in names for name in self._names)
            if count > shown:
                shown, fits = count, any(complete_names(names, row) for row in even)
            if count == len(self._names):
                break
        cells = [cell for row in even for cell in row[:_SCORED_CELLS]]
        alike = len(even) / len(rows) * sum(map(is_datum, cells)) / max(len(cells), 1)
        return (shown, fits, width > 1, round(alike, 2))

    def _may_have_names(self, line: _Line) -> bool:
        return self._any_name.search(line.text.replace('"', "")) is not None

    def _names_in(self, split: Split, line: _Line, width: int | None = None) -> list[str]:
        names = split.names(line.text, width)
        sign = next((sign for sign in self._signs(split) if line.text.startswith(sign)), None)
        if sign is None or (names and names[0] in self._names):
            return names
        return split.names(line.text.lstrip(sign).lstrip(), width)

    def _column_names(self, split: Split, header: _Line | None, record: list[str]) -> list[str]:
        """Return the names of all columns; positions if no names are required and none fit."""
        if header is not None:
            names = self._names_in(split, header, len(record))
            whole = complete_names(names, record)
            if whole or self._names:
                return whole or names
        return [str(number) for number in range(1, len(record) + 1)]

    def _header_and_first(
        self, split: Split, comments: list[_Line], lines: list[_Line]
    ) -> tuple[_Line | None, int]:
        if self._log.header is False:
            return None, 0
        rows = [split.cells(line.text) for line in lines]
        alike = [index for index, row in enumerate(rows) if self._is_record(row)]
        widths = Counter(len(rows[index]) for index in alike[-_SCORED_LINES:])
        width = widths.most_common(1)[0][0] if widths else 0
        first = next((index for index in alike if len(rows[index]) == width), 1)
        if not self._wanted:
            if not alike:
                raise RecordingError(
                    f"{self._file}: no line of numbers; expected a log with one record per line"
                )
            record = rows[first]
            near = [line for line in comments if line.number < lines[first].number] + lines[:first]
            place = find_header(
                [complete_names(self._names_in(split, line, len(record)), record) for line in near]
            )
            return (None if place is None else near[place]), first
        if self._names:
            wanted = set(self._names)
            candidates = filter(self._may_have_names, [*lines, *reversed(comments)])
            named = (x for x in candidates if wanted.issubset(self._names_in(split, x, width)))
            header = next(named, None)
            if header is not None and header in comments:
                return header, 0
            if header is not None:
                first = end = lines.index(header) + 1
                names = self._names_in(split, header, len(rows[first])) if first < len(rows) else []
                places = self._places(names)
                while first < min(end + _MAX_UNIT_LINES, len(rows)) and are_units(
                    rows[first], places
                ):
                    first += 1
        else:
            header = None
        if self._log.header and header is None and first == 0:
            before = [line for line in comments if line.number < lines[0].number]
            if before and len(self._names_in(split, before[-1])) == width:
                return before[-1], 0
            first = 1
        if first >= len(lines):
            raise RecordingError(
                f"{self._file}: no record after the header {lines[-1].text[:80]!r}; expected some"
            )
        if header is None and (first > 0 or self._names):
            header = lines[max(first - 1, 0)]
        return header, first

    def _is_record(self, row: list[str]) -> bool:
        """Return whether a line may be a record: numbers in the required columns, or in most."""
        if self._names or not self._wanted:
            return 2 * sum(map(is_datum, row)) >= len(row)
        cells = [row[int(column) - 1] for column in self._figures if int(column) <= len(row)]
        return len(row) >= self._last and are_figures(cells)

    def _passed_over(self, split: Split, header: _Line | None, before: list[_Line]) -> list[_Line]:
        """Return the lines directly before the first record that are neither names nor units."""
        rows = [split.cells(line.text) for line in before]
        if self._names and header in before:
            first = before.index(header) + 1
            return [before[n] for n in range(first, len(rows)) if not is_heading(rows[n])]
        if self._names or self._log.header:
            return []
        others = [number for number, row in enumerate(rows) if not are_figures(row)]
        return before[max(others, default=-1) + 1 :]

    def _places(self, names: list[str]) -> set[int]:
        return {
            column - 1 if isinstance(column, int) else names.index(column)
            for column in self._figures
            if isinstance(column, int) or column in names
        }

    def _decimal(self, names: list[str], rows: list[list[str]]) -> Decimal:
        """Return the decimal sign of the required numbers, or else of all numbers."""
        places = self._places(names)
        wanted = [row[place] for row in rows for place in places if place < len(row)]
        for cells in (wanted, [cell for row in rows for cell in row[:_SCORED_CELLS]]):
            figures = [cell for cell in cells if is_number(cell)]
            commas = sum("," in cell for cell in figures)
            points = sum("." in cell for cell in figures)
            if commas or points:
                return "," if commas > points else "."
        return "."


_MARKUP_PREFIXES = (b"<!doctype", b"<html", b"<head", b"<?xml", b"<svg")
_JSON_PREFIXES = (b'{"', b"[{", b"[[", b"{'")
_JSON_BRACKETS = (b"{", b"[")
_MIN_ZERO_SHARE_UTF_16 = 0.4  # least share of zero bytes of a line of UTF-16
_CONTROL_CHARACTERS = bytes({*range(1, 32)} - set(b"\t\n\r\f\x1a\x1b"))
_MAX_CONTROLS, _MAX_CONTROL_SHARE = 4, 0.05  # of a text; random bytes have a share of 0.1
_INTEGER = re.compile(r"\s*[-+]?\d+")


def refuse_other_formats(file: str, line: bytes) -> None:
    """Raise `RecordingError` if the first line of a log belongs to a web page or to JSON."""
    begin = line.strip().lower()
    shown = line.strip()[:40].decode("utf-8", "replace")
    if begin.startswith(_MARKUP_PREFIXES):
        raise RecordingError(
            f"{file}: is a page of HTML or XML, which begins with {shown!r}; expected the lines of "
            "a log: download it again, perhaps after a login"
        )
    if begin.startswith(_JSON_PREFIXES) or begin in _JSON_BRACKETS:
        raise RecordingError(
            f"{file}: is JSON, which begins with {shown!r}; expected one record per line: export "
            "the log as CSV"
        )


def refuse_binary(file: str, number: int, line: bytes) -> None:
    """Raise `RecordingError` if a line contains zero bytes; ``number``: its number, from 1."""
    zeros = line.count(b"\0")
    if not zeros:
        return
    if (
        line.isascii()
        and _MIN_ZERO_SHARE_UTF_16 * len(line)
        < zeros
        < (1 - _MIN_ZERO_SHARE_UTF_16) * len(line) + 2
    ):
        raise RecordingError(
            f"{file}, line {number}: looks like UTF-16 without a byte order mark; expected UTF-8, "
            "or UTF-16 with its mark: save the text in one of these"
        )
    raise RecordingError(
        f"{file}, line {number}: has {zeros} zero byte{'s' if zeros > 1 else ''}, as binary data "
        "do; expected text: state 'reader' in the sensor file or, if a text log begins after the "
        "zeros, delete the lines up to this one"
    )


def refuse_decimals_apart(file: str, number: int, line: str, rows: Sequence[Sequence[str]]) -> None:
    """Raise `RecordingError` if commas may be delimiters or decimal signs, as in ``1,05,2,37``.

    Decimals have no sign and sometimes begin with 0. Integers do not, unless they are padded.
    """
    if {len(row) % 2 for row in rows} != {0}:
        return
    pairs = [pair for row in rows for pair in zip(row[::2], row[1::2], strict=True)]
    if not all(_INTEGER.fullmatch(whole) and part.isdecimal() for whole, part in pairs):
        return
    if _are_padded(part for _, part in pairs) and not _are_padded(whole for whole, _ in pairs):
        raise RecordingError(
            f"{file}, line {number}: {line[:60]!r} has integers between commas, or numbers with "
            "decimal commas; state 'delimiter: \",\"' in the sensor file for integers, or "
            "'decimal: \",\"' for decimal commas"
        )


def _are_padded(figures: Iterable[str]) -> bool:
    return any(len(figure) > 1 and figure.startswith("0") for figure in figures)
