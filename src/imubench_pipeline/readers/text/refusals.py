"""Reject text logs of other formats, with binary data, or with ambiguous commas."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from imubench_pipeline.tables.findings import RecordingError

_MARKUP_PREFIXES = (b"<!doctype", b"<html", b"<head", b"<?xml", b"<svg")
_JSON_PREFIXES = (b'{"', b"[{", b"[[", b"{'")
_JSON_BRACKETS = (b"{", b"[")
_MIN_ZERO_SHARE_UTF_16 = 0.4
"""Least share of zero bytes of a line of UTF-16."""

_CONTROL_CHARACTERS = bytes({*range(1, 32)} - set(b"\t\n\r\f\x1a\x1b"))
_MAX_CONTROLS, _MAX_CONTROL_SHARE = 4, 0.05
"""Largest number of control characters of a text, and their largest share; one in ten random bytes
is a control character."""

_INTEGER = re.compile(r"\s*[-+]?\d+")


def refuse_other_formats(file: str, line: bytes) -> None:
    """Raise `RecordingError` if a log begins like a web page or JSON.

    ``file``: name of the log.
    ``line``: first line of the log.
    """
    begin = line.strip().lower()
    shown = line.strip()[:40].decode("utf-8", "replace")
    if begin.startswith(_MARKUP_PREFIXES):
        raise RecordingError(
            f"{file}: is a page of HTML or XML, which begins with {shown!r}; expected the lines of "
            "a log: download it again, perhaps after a login"
        )
    if begin.startswith(_JSON_PREFIXES) or begin in _JSON_BRACKETS:
        raise RecordingError(
            f"{file}: is JSON, which begins with {shown!r}; expected a line a record: export the "
            "log as CSV"
        )


def refuse_control_characters(file: str, number: int, begin: bytes) -> None:
    """Raise `RecordingError` if a log begins with many control characters, unlike text.

    ``number``: number of its first line, from 1.
    """
    controls = len(begin) - len(begin.translate(None, _CONTROL_CHARACTERS))
    if controls > max(_MAX_CONTROLS, _MAX_CONTROL_SHARE * len(begin)):
        raise RecordingError(
            f"{file}, line {number}: holds binary data of no known format, the bytes "
            f"{begin[:8].hex(' ')} (hexadecimal) and so on; expected text, or a log of a format "
            "that 'imubench formats' lists: export it as CSV"
        )


def refuse_binary(file: str, number: int, line: bytes) -> None:
    """Raise `RecordingError` if a line contains zero bytes.

    ``number``: number of the line, from 1.
    """
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
            f"{file}, line {number}: looks like UTF-16 without the mark that says so; expected "
            "UTF-8, or UTF-16 with its mark: save the text so"
        )
    raise RecordingError(
        f"{file}, line {number}: holds {zeros} zero byte{'s' if zeros > 1 else ''}, as binary data "
        "do; expected text: state the 'reader' of the file, or, if zeros hide the beginning of a "
        "log, cut the file behind that line"
    )


def refuse_decimals_apart(file: str, number: int, line: str, rows: Sequence[Sequence[str]]) -> None:
    """Raise `RecordingError` if commas may be delimiters as well as decimal signs.

    Decimals have no sign and sometimes begin with 0, unlike integers, unless all integers are
    padded with zeros.

    ``number``: Line number of the first record.
    ``line``: The first record.
    ``rows``: Cells of the first records, split at commas.
    """
    if {len(row) % 2 for row in rows} != {0}:
        return
    pairs = [pair for row in rows for pair in zip(row[::2], row[1::2], strict=True)]
    if not all(_INTEGER.fullmatch(whole) and part.isdecimal() for whole, part in pairs):
        return
    if _are_padded(part for _, part in pairs) and not _are_padded(whole for whole, _ in pairs):
        raise RecordingError(
            f"{file}, line {number}: {line[:60]!r} is whole numbers between commas, or has decimal "
            "commas; expected 'decimal: \",\"' in the sensor file for these, and "
            "'delimiter: \",\"' for those"
        )


def _are_padded(figures: Iterable[str]) -> bool:
    return any(len(figure) > 1 and figure.startswith("0") for figure in figures)
