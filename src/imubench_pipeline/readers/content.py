"""Recognise the format of a file by its content, never by its name."""

from contextlib import closing
from itertools import chain
from pathlib import Path

from imubench_pipeline.readers import compressed
from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.readers.formats import FILE_FORMATS, TEXT
from imubench_pipeline.readers.other_formats import EXTENSION_MARKS, find_other_format
from imubench_pipeline.settings.sensor import Reader
from imubench_pipeline.tables.findings import RecordingError

_PROBE_BYTES = 1 << 16
_ZIP_MAGIC = b"PK\x03\x04"


def recognise_folder(path: Path) -> FileFormat | None:
    """Return the format of a folder that is one log, such as a ROS 2 bag; else None."""
    if (path / "metadata.yaml").is_file():
        _refuse_missing_extension(path, "rosbag")
    marks = ((found, found.signature.folder_has) for found in FILE_FORMATS.values())
    return next((found for found, mark in marks if mark and (path / mark).is_file()), None)


def is_endless(path: Path) -> bool:
    """Return whether a path is a device or a named pipe, which may block forever."""
    return path.exists() and not path.is_file() and not path.is_dir()


def find_format(path: Path, stated: Reader | None = None) -> FileFormat:
    """Return the format that a sensor file states (``reader``), or if None, by the content."""
    if stated is None:
        return recognise_content(path)[0]
    _refuse_missing_extension(path, stated)
    return FILE_FORMATS[stated]


def recognise_content(path: Path) -> tuple[FileFormat, str]:
    """Return the format of a log, and its compression; empty if it is not compressed.

    ``path``: a file, the folder of a ROS 2 bag, or a member of an archive. A zip archive is text,
    except for formats that are zip files, such as .npz. Raises `RecordingError` if the file cannot
    be opened, has an unsupported format, or must not be compressed.
    """
    if (of_folder := recognise_folder(path)) is not None:
        return of_folder, ""
    packed = "zip"
    if not compressed.is_member(path):
        if is_endless(path):
            raise RecordingError(f"{path.name}: is neither a file nor a folder; expected a log")
        try:
            with path.open("rb") as file:
                begin = file.read(_PROBE_BYTES)
        except OSError as error:
            raise RecordingError(f"{path.name}: cannot be opened ({error.strerror})") from None
        packed = _name_compression(begin)
        _refuse_other_format(path, begin)
    if packed == "zip" and path.is_file():
        endings = {member.suffix for member in compressed.list_members(path)}
        for file_format in FILE_FORMATS.values():
            if file_format.signature.archive_has in endings:
                return file_format, ""
        return TEXT, packed
    with closing(compressed.open_bytes(path)) as stream:
        begin = stream.filled(_PROBE_BYTES)
    if packed and (again := _name_compression(begin)):
        raise RecordingError(
            f"{path.name}: is compressed twice, by {packed} and inside by {again}; expected once: "
            "unpack it"
        )
    _refuse_other_format(path, begin)
    signatures = [(each, each.signature) for each in FILE_FORMATS.values()]
    begun = (each for each, its in signatures if begin.startswith(its.begins))
    matching = (each for each, its in signatures if its.tells is not None and its.tells(begin))
    file_format = next(chain(begun, matching), TEXT)
    if packed and not file_format.streamed:
        raise RecordingError(
            f"{path.name}: is compressed by {packed}, but the reader {file_format.name!r} expects "
            "an uncompressed file: unpack it"
        )
    return file_format, packed


def _name_compression(begin: bytes) -> str:
    return "zip" if begin.startswith(_ZIP_MAGIC) else compressed.recognise_compression(begin)


def _refuse_other_format(path: Path, begin: bytes) -> None:
    for reader, marks in EXTENSION_MARKS.items():
        if begin.startswith(marks):
            _refuse_missing_extension(path, reader)
    if (other := find_other_format(begin)) is not None:
        raise RecordingError(
            f"{path.name}: is {other.name}, which is not read; expected a format that 'imubench "
            f"formats' lists: {other.advice}"
        )


def _refuse_missing_extension(path: Path, reader: Reader) -> None:
    if reader not in FILE_FORMATS:
        raise RecordingError(
            f"{path.name}: needs the reader {reader!r} of the extension 'formats', which is not "
            "installed; restore the folder extensions/formats, or record the log as text"
        )
