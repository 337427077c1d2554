"""Which format a file has, told by its content and never by its name."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from imubench_pipeline.readers.compressed import is_member, members, open_bytes
from imubench_pipeline.readers.decompression import LONGEST_MAGIC, compression_of
from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.readers.formats import FILE_FORMATS, TEXT
from imubench_pipeline.settings.sensor import Reader
from imubench_pipeline.tables.findings import RecordingError

_SEEN = 1 << 16
_ZIP = b"PK\x03\x04"


_NOT_READ = {
    "a log of PX4 (ULog)": (0, b"ULog\x01\x12\x35", "make CSV of it with 'ulog2csv' (pyulog)"),
    "a log of ArduPilot (DataFlash)": (
        *(0, b"\xa3\x95\x80\x80"),
        "make CSV of it with 'mavlogdump.py --format csv' (pymavlink)",
    ),
    "a tar archive": (257, b"ustar", "unpack it"),
}
"""Known files that are not read: place and bytes of their signature, and how to convert them."""


def format_of_folder(path: Path) -> FileFormat | None:
    """Return the format of a folder that is one log, such as a ROS 2 bag; None: it is not."""
    if not path.is_dir():
        return None
    for file_format in FILE_FORMATS.values():
        mark = file_format.signature.folder_has
        if mark is not None and (path / mark).is_file():
            return file_format
    return None


def is_endless(path: Path) -> bool:
    """Tell whether a path is a device or a named pipe, which may never answer."""
    return path.exists() and not path.is_file() and not path.is_dir()


def format_of(path: Path, stated: Reader | None = None) -> FileFormat:
    """Return the format of a file: the stated one, or what its content tells (`content_of`).

    ``stated``: what the sensor file says.
    """
    return content_of(path)[0] if stated is None else FILE_FORMATS[stated]


def content_of(path: Path) -> tuple[FileFormat, str]:
    """Return the format of what a log is inside, and how it is compressed; empty: it is not.

    Of a zip archive with several files this is the text that each of them may be.

    ``path``: a log file, the folder of a ROS 2 bag, or a member of a zip archive.

    Raises
    ------
    RecordingError
        If it cannot be opened, is compressed twice, or is of a format that is read only as it is.
    """
    if (of_folder := format_of_folder(path)) is not None:
        return of_folder, ""
    packed = _compression_of(path)
    if packed == "zip" and path.is_file():
        of_archive = _format_of_archive(path)
        return (TEXT, packed) if of_archive is None else (of_archive, "")
    with closing(open_bytes(path)) as stream:
        begin = stream.filled(_SEEN)
    if packed and (again := _named(begin)):
        raise RecordingError(
            f"{path.name}: is compressed twice, by {packed} and inside by {again}; expected once: "
            "unpack it"
        )
    for what, (place, mark, advice) in _NOT_READ.items():
        if begin.startswith(mark, place):
            raise RecordingError(
                f"{path.name}: is {what}, which is not read; expected a format that 'imubench "
                f"formats' lists: {advice}"
            )
    file_format = _format_of_bytes(begin)
    if packed and not file_format.streamed:
        raise RecordingError(
            f"{path.name}: holds a file of the reader {file_format.name!r}, compressed by "
            f"{packed}; expected it as it is: unpack it"
        )
    return file_format, packed


def _compression_of(path: Path) -> str:
    """Return how a file is compressed; empty where it is not."""
    if is_member(path):
        return "zip"
    if is_endless(path):
        raise RecordingError(f"{path.name}: is neither a file nor a folder; expected a log")
    try:
        with path.open("rb") as file:
            return _named(file.read(LONGEST_MAGIC))
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be opened ({error.strerror})") from None


def _named(begin: bytes) -> str:
    return "zip" if begin.startswith(_ZIP) else compression_of(begin)


def _format_of_bytes(begin: bytes) -> FileFormat:
    for file_format in FILE_FORMATS.values():
        if begin.startswith(file_format.signature.begins):
            return file_format
    for file_format in FILE_FORMATS.values():
        tells = file_format.signature.tells
        if tells is not None and tells(begin):
            return file_format
    return TEXT


def _format_of_archive(path: Path) -> FileFormat | None:
    """Return the format of a zip archive that is one log; the archive may be cut short."""
    endings = {member.suffix for member in members(path)}
    for file_format in FILE_FORMATS.values():
        if file_format.signature.archive_has in endings:
            return file_format
    return None
