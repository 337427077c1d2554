"""Convert the lines of a text log to records for a parser of columns, block by block."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

import numpy as np

from imubench_pipeline.tables.findings import RecordingError

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
    """Removes from the lines of a file all that are no records.

    ``comments``: Prefixes of comment lines.
    ``header``: The line of names, without its line break; empty if there is none.
    ``preamble``: The lines before the first record, which a restarted logger repeats.
    ``runs``: Columns are separated by runs of spaces or tabs, which become one space.
    ``blank_is_missing``: A blank line between two records is a record with one empty cell.
    """

    def __init__(
        self,
        comments: Collection[bytes],
        header: bytes,
        preamble: Sequence[bytes],
        runs: bool,
        blank_is_missing: bool = False,
    ) -> None:
        self._comments = tuple(comments)
        alternatives = b"|".join(re.escape(sign) for sign in self._comments)
        # A pattern that begins with the line break is five times as fast as one that begins with
        # ^.
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
            lines = self._without_headers(lines)
        if b"\0" in lines:
            lines = _LINE_WITH_ZEROS.sub(self._left_out, lines)
        for sign in self._comments:
            if sign[:1] in lines and (lines.startswith(sign) or b"\n" + sign in lines):
                lines = self._comment_lines.sub(b"", b"\n" + lines)[1:]
                break
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
                f"{self._blank} blank lines follow each other among the records; expected a log "
                "without: cut the file there"
            )
        before = _MISSING_CELL * self._blank
        self._blank = after - 1
        return before + _BLANK_LINES.sub(_MISSING_CELL, ended) + b"\n"

    def _without_headers(self, lines: bytes) -> bytes:
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
        return b"".join(records)


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
