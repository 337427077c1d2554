"""Read the text of a log as UTF-8 in blocks of complete lines, and keep its records."""

import codecs
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, closing
from pathlib import Path

import numpy as np

from imubench_pipeline.readers.bounds import MAX_LINE_LENGTH
from imubench_pipeline.readers.compressed import make_truncation_finding, open_bytes
from imubench_pipeline.readers.holes import ZeroRuns
from imubench_pipeline.readers.text.labels import Labels
from imubench_pipeline.tables.findings import Finding, RecordingError, find
from imubench_pipeline.words.findings.files import IncompleteLastRecord

_READ_BLOCK = 1 << 16
_ZERO_RUN = re.compile(rb"\0{2,}")
_BYTE_ORDER_MARKS: Mapping[bytes, str] = {
    codecs.BOM_UTF8: "",
    # Before UTF-16, whose mark is a prefix of this one.
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}


class _Text:
    """The text of a log as UTF-8, with line feeds, and runs of zeros reduced to one zero."""

    def __init__(self, path: Path, skipped: int, most: int | None) -> None:
        self.bytes = open_bytes(path)
        self._most = most
        self.zeros = ZeroRuns()
        self._returns = False
        try:
            begin = self.bytes.filled(_READ_BLOCK)
            mark = next((mark for mark in _BYTE_ORDER_MARKS if begin.startswith(mark)), b"")
            encoding = _BYTE_ORDER_MARKS.get(mark)
            self._decoder = (
                codecs.getincrementaldecoder(encoding)(errors="replace") if encoding else None
            )
            # Bytes of a letter in the file
            self.letter = len("\0".encode(encoding)) if encoding else 1
            text = self._utf_8(begin.removeprefix(mark))
            self._returns = b"\n" not in text and b"\r" in text[:-1]
            self._begin = self._taken(text)
            while skipped > 0 and (block := self.read(skipped)):
                self._begin = block[skipped:]
                skipped -= len(block)
        except BaseException:
            self.close()
            raise

    def read(self, size: int) -> bytes:
        """Return the next bytes, about ``size``; empty at the end."""
        block, self._begin = self._begin, b""
        while not block and (self._most is None or self.zeros.read <= self._most):
            read = self.bytes.read(size)
            if not read:
                return b""
            block = self._taken(self._utf_8(read))
        return block

    def close(self) -> None:
        self.bytes.close()

    def _utf_8(self, block: bytes) -> bytes:
        return self._decoder.decode(block).encode() if self._decoder else block

    def _taken(self, block: bytes) -> bytes:
        if self._returns:
            block = block.replace(b"\r", b"\n")
        goes_on = self.zeros.at_end
        self.zeros.add(block)
        if b"\0" not in block:
            return block
        if block == bytes(len(block)):
            return b"" if goes_on else b"\0"
        return _ZERO_RUN.sub(b"\0", block.lstrip(b"\0") if goes_on else block)


class CompleteLines(AbstractContextManager["CompleteLines"]):
    """A readable file object with the complete lines of a log, which may be cut or compressed.

    The text after the last line break may lack digits: it is left out with a finding. ``skipped``:
    bytes to skip. ``records``: function that converts complete lines to the text that `read`
    returns. ``most``: bytes after which reading stops.
    """

    closed = False

    def __init__(
        self,
        path: Path,
        findings: list[Finding],
        skipped: int = 0,
        records: Callable[[bytes], bytes] = bytes,
        most: int | None = None,
    ) -> None:
        self._path = path
        self._findings = findings
        self._records = records
        self._ready = b""
        self._ended = False
        self.rest = b""  # text after the last complete line
        # Stored as well as raised, since a parser in between may wrap the exception.
        self.error: RecordingError | None = None
        self._text = _Text(path, skipped, most)

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self.closed = True
        self._text.close()

    def readable(self) -> bool:
        """Return True: the file can be read."""
        return True

    def seekable(self) -> bool:
        """Return False: the file is read sequentially."""
        return False

    def read(self, size: int) -> bytes:
        """Return complete lines, up to ``size`` bytes, or one longer line; empty at the end."""
        try:
            while not self._ready and not self._ended:
                self._ready = self._records(self._lines(size))
        except RecordingError as error:
            self.error = error
            raise
        block = self._ready
        if len(block) > size:
            block = block[: block.rfind(b"\n", 0, size) + 1 or block.find(b"\n") + 1]
        self._ready = self._ready[len(block) :]
        return block

    def _lines(self, size: int) -> bytes:
        """Return the next complete lines; empty if the next line is not yet complete."""
        block = self._text.read(max(size - len(self.rest), _READ_BLOCK))
        if not block:
            # The lines after the last line feed that end in carriage returns
            self._ended = True
            cut = self.rest.rfind(b"\r", 0, len(self.rest.rstrip(b"\r"))) + 1
            if cut and self.rest.endswith(b"\r"):
                cut = len(self.rest)
            lines, self.rest = self.rest[:cut].replace(b"\r", b"\n"), self.rest[cut:]
            if self._text.bytes.ended_early:
                self._findings.append(make_truncation_finding(self._path))
            if self.rest.strip(b"\0\r\n\t "):
                shown = self.rest.strip(b"\0")[:60].decode("utf-8", "replace")
                self._findings.append(find(IncompleteLastRecord(self._path.name, shown), "note", 1))
            return lines
        cut = block.rfind(b"\n") + 1
        if not cut:
            self.rest += block
            if len(self.rest) > MAX_LINE_LENGTH:
                shown = self.rest[:40].decode("utf-8", "replace")
                raise RecordingError(
                    f"{self._path.name}: no line break in {MAX_LINE_LENGTH} bytes, which begin "
                    f"with {shown!r}; expected one record per line: export the log as CSV"
                )
            return b""
        lines = b"".join((self.rest, memoryview(block)[:cut]))
        self.rest = block[cut:]
        return lines

    def zeros(self, damaged: int, *, shifted: bool) -> Finding | None:
        """Return the finding about zero bytes, if any; ``damaged``: number of lines with them."""
        zeros = self._text.zeros
        total = zeros.count * self._text.letter + self._text.bytes.omitted
        where = f"line {zeros.first[1]}"
        return zeros.finding(self._path.name, where, total, damaged=damaged, shifted=shifted)


def describe_missing_text(path: Path) -> str:
    """Describe a file without a line of text, as the end of a sentence."""
    with closing(open_bytes(path)) as file:
        begin = file.filled(_READ_BLOCK)
    if not begin:
        return (
            "the compressed data end before any text" if file.ended_early else "the file is empty"
        )
    if not begin.strip(b"\0"):
        return "the file has zero bytes and no text: the logger wrote nothing, or data were lost"
    if not begin.strip(b"\0 \t\r\n"):
        return "the file has only blank lines"
    return "the file has no more lines"


def read_first_lines(path: Path, most: int | None = None) -> Iterator[bytes]:
    """Yield the lines in the first ``most`` bytes of a log; the last may lack its line break."""
    with CompleteLines(path, [], most=most) as lines:
        while block := lines.read(_READ_BLOCK):
            yield from (line + b"\n" for line in block[:-1].split(b"\n"))
        if lines.rest.strip(b"\0"):
            yield lines.rest


_NUMBER_BYTES = frozenset(b"0123456789+-.,;:|\t \"'eEnNaAiIfFtT/\r")
_NOT_A_COMMENT = rb"(?!#(?i:n/a|na|value!|num!|div/0!)[;,|\t ])"
"""Errors of a spreadsheet in a cell, which may be the first cell of a line and begin with #."""

_BLANK_BYTES = b" \t\r\n"
_BLANK_LINES = re.compile(rb"^[ \t\r]*+\n", re.MULTILINE)
_MISSING_CELL = b"nan\n"
_LINE_WITH_ZEROS = re.compile(rb"^[^\0\n]*+\0[^\0\n]*+\n", re.MULTILINE)
"""A line with one run of zero bytes. A line with several runs may be UTF-16."""
_MAX_BLANK_LINES = 1 << 24  # consecutive blank lines, limited for memory
_TAB_TO_SPACE = bytes.maketrans(b"\t", b" ")


class Records:
    """Removes everything but the records from the lines of a file.

    ``comments``: prefixes of comment lines. ``header``: the line of names. ``preamble``: lines
    before the first record, which a restarted logger repeats. ``runs``: whether runs of spaces or
    tabs become one space. ``blank_is_missing``: whether a blank line is a record with a missing
    value. ``labels``: names before the values of each record, to be removed.
    """

    def __init__(
        self,
        comments: Collection[bytes],
        header: bytes,
        preamble: Sequence[bytes],
        runs: bool,
        blank_is_missing: bool = False,
        labels: Labels | None = None,
    ) -> None:
        self._labels = labels
        self._comments = tuple(comments)
        alternatives = b"|".join(re.escape(sign) for sign in self._comments)
        # A pattern that begins with the line break is five times as fast as one with ^.
        self._comment_lines = re.compile(
            rb"\n" + _NOT_A_COMMENT + rb"(?:" + alternatives + rb")[^\n]*"
        )
        self._header = header
        # The search for one byte is ten times as fast as for several.
        self._telling = bytes(b for b in header if b not in _NUMBER_BYTES)[:1] or header[:1]
        self._preamble = frozenset(preamble)
        self._begins = tuple({*preamble[:1], header})
        self._runs = runs
        self._blank_is_missing = blank_is_missing
        self._blank = 0
        self.restarts = 0  # number of headers among the records
        self.cut = 0  # incomplete records with a restart of the log in the same line
        self.damaged = 0  # records that contain a run of zero bytes

    def __call__(self, lines: bytes) -> bytes:
        """Return the records of complete lines."""
        # Before the comments, since the header may be a comment.
        if self._header and self._telling in lines and self._header in lines:
            records = []
            for line in lines[:-1].split(b"\n"):
                text = line.rstrip(b"\r").lstrip(b"\0")
                if text == self._header:
                    self.restarts += 1
                elif text in self._preamble:
                    continue
                elif text.endswith(self._begins):
                    self.restarts += text.endswith(self._header)
                    self.cut += 1
                else:
                    records.append(line + b"\n")
            lines = b"".join(records)
        if b"\0" in lines:
            lines = _LINE_WITH_ZEROS.sub(self._left_out, lines)
        for sign in self._comments:
            if sign[:1] in lines and (lines.startswith(sign) or b"\n" + sign in lines):
                lines = self._comment_lines.sub(b"", b"\n" + lines)[1:]
                break
        if self._labels is not None:
            lines = self._labels.remove(lines)
        if self._runs:
            lines = _merge_spaces(lines)
        if self._blank_is_missing and lines:
            lines = self._with_missing(lines)
        # pyarrow reports a record of wrong width only if it is valid UTF-8.
        return lines if lines.isascii() else lines.decode("utf-8", "replace").encode()

    def _left_out(self, line: re.Match[bytes]) -> bytes:
        """Count a line with zero bytes; digits may be missing from it."""
        self.damaged += bool(line[0].strip(b"\0 \t\r\n"))
        return b""

    def _with_missing(self, lines: bytes) -> bytes:
        """Return the lines with missing cells for blank lines; final blank lines are held back."""
        ended = lines.rstrip(_BLANK_BYTES)
        after = lines[len(ended) :].count(b"\n")
        if not ended:
            self._blank += after
            return b""
        if self._blank > _MAX_BLANK_LINES:
            raise RecordingError(
                f"{self._blank} consecutive blank lines between two records; expected a log "
                "without blank lines: cut the file before them"
            )
        before = _MISSING_CELL * self._blank
        self._blank = after - 1
        return before + _BLANK_LINES.sub(_MISSING_CELL, ended) + b"\n"


def _merge_spaces(lines: bytes) -> bytes:
    if not lines:
        return lines
    if b"\t" in lines:
        lines = lines.translate(_TAB_TO_SPACE)
    signs = np.frombuffer(lines, np.uint8)
    is_space = signs == ord(" ")
    before = np.concatenate(([True], (is_space | (signs == ord("\n")))[:-1]))
    signs = signs[~(is_space & before)]
    at_end = (signs[1:] == ord("\n")) | (signs[1:] == ord("\r"))
    keep = np.ones(len(signs), bool)
    keep[:-1] = ~((signs[:-1] == ord(" ")) & at_end)
    return signs[keep].tobytes()
