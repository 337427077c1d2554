"""What is refused of a text log at first sight: other formats, and commas of two meanings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from imubench_pipeline.tables.findings import RecordingError

_MARKUP = (b"<!doctype", b"<html", b"<head", b"<?xml", b"<svg")
_JSON = (b'{"', b"[{", b"[[", b"{'")
_ALONE = (b"{", b"[")
_UTF_16 = 0.4
"""Part of zero bytes from which a line is text of two bytes a letter."""

_CONTROLS = bytes({*range(1, 32)} - set(b"\t\n\r\f\x1a\x1b"))
_FEW_CONTROLS, _PART_CONTROLS = 4, 0.05
"""Control characters that a text may have, and part of its bytes; of bytes of chance 1 in 10 is
one."""

_WHOLE = re.compile(r"\s*[-+]?\d+")


def refuse_other_formats(file: str, line: bytes) -> None:
    """Raise `RecordingError` if a log begins as a page of the web or JSON does.

    ``file``: its name.
    ``line``: its first line.
    """
    begin = line.strip().lower()
    shown = line.strip()[:40].decode("utf-8", "replace")
    if begin.startswith(_MARKUP):
        raise RecordingError(
            f"{file}: is a page of HTML or XML, which begins with {shown!r}; expected the lines of "
            "a log: download it again, perhaps after a login"
        )
    if begin.startswith(_JSON) or begin in _ALONE:
        raise RecordingError(
            f"{file}: is JSON, which begins with {shown!r}; expected a line a record: export the "
            "log as CSV"
        )


def refuse_control_characters(file: str, number: int, begin: bytes) -> None:
    """Raise `RecordingError` if a log begins with many control characters, which no text has.

    ``number``: of its first line, counted from 1.
    """
    controls = len(begin) - len(begin.translate(None, _CONTROLS))
    if controls > max(_FEW_CONTROLS, _PART_CONTROLS * len(begin)):
        raise RecordingError(
            f"{file}, line {number}: holds binary data of no known format, the bytes "
            f"{begin[:8].hex(' ')} (hexadecimal) and so on; expected text, or a log of a format "
            "that 'imubench formats' lists: export it as CSV"
        )


def refuse_binary(file: str, number: int, line: bytes) -> None:
    """Raise `RecordingError` if a line holds zero bytes.

    ``number``: of the line, counted from 1.
    """
    zeros = line.count(b"\0")
    if not zeros:
        return
    if line.isascii() and _UTF_16 * len(line) < zeros < (1 - _UTF_16) * len(line) + 2:
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
    """Raise `RecordingError` if what a comma divides may be a figure and its decimals.

    Decimals have no sign, and begin with 0 now and then, which whole numbers do not, unless they
    are all written with so many digits.

    Parameters
    ----------
    number : int
        Of the first record.
    line : str
        The first record.
    rows : sequence of sequence of str
        What commas divide the first records into.
    """
    if {len(row) % 2 for row in rows} != {0}:
        return
    pairs = [pair for row in rows for pair in zip(row[::2], row[1::2], strict=True)]
    if not all(_WHOLE.fullmatch(whole) and part.isdecimal() for whole, part in pairs):
        return
    if _are_padded(part for _, part in pairs) and not _are_padded(whole for whole, _ in pairs):
        raise RecordingError(
            f"{file}, line {number}: {line[:60]!r} is whole numbers between commas, or has decimal "
            "commas; expected 'decimal: \",\"' in the sensor file for these, and "
            "'delimiter: \",\"' for those"
        )


def _are_padded(figures: Iterable[str]) -> bool:
    return any(len(figure) > 1 and figure.startswith("0") for figure in figures)
