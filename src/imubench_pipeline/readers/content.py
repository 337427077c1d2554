"""Which reader a file needs, told by its content and never by its name."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from imubench_pipeline.readers.compressed import is_member, members, open_bytes
from imubench_pipeline.settings.sensor import Reader
from imubench_pipeline.tables.findings import RecordingError

_SEEN = 1 << 16
_BEGINS: tuple[tuple[bytes, Reader], ...] = (
    (b"MATLAB 5.0 MAT-file", "matlab"),
    (b"MATLAB 7.3 MAT-file", "matlab"),
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"\x93NUMPY", "numpy"),
    (b"PAR1", "arrow"),
    (b"ARROW1", "arrow"),
    (b"FEA1", "arrow"),
    (b"#ROSBAG V", "rosbag"),
    (b"\x89MCAP", "rosbag"),
    (b"SQLite format 3", "rosbag"),
)
_COMPRESSED = {
    b"\x1f\x8b": "gzip",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\xfd7zXZ\0": "xz",
    b"BZh": "bzip2",
    b"PK\x03\x04": "zip",
}
"""What is inside is text."""

_LONGEST_MAGIC = 6
_UBX = b"\xb5\x62"
_VECTORNAV = b"$VN"
_ROS_2_BAG = "metadata.yaml"


def is_ros_2_bag(path: Path) -> bool:
    """Tell whether a folder is a ROS 2 bag, which is one log and no folder of logs."""
    return path.is_dir() and (path / _ROS_2_BAG).is_file()


def is_endless(path: Path) -> bool:
    """Tell whether a path is a device or a named pipe, which may never answer."""
    return path.exists() and not path.is_file() and not path.is_dir()


def reader_of(path: Path) -> Reader:
    """Return the reader that a file needs (see `content_of`).

    Parameters
    ----------
    path : Path
    """
    return content_of(path)[0]


def content_of(path: Path) -> tuple[Reader, str]:
    """Return the reader of what a log is inside, and how it is compressed; empty: it is not.

    Of a zip archive with several files this is the text that each of them may be.

    Parameters
    ----------
    path : Path
        A log file, the folder of a ROS 2 bag, or a member of a zip archive.

    Raises
    ------
    RecordingError
        If it cannot be opened, is compressed twice, or is of a format that is read only as it is.
    """
    if is_ros_2_bag(path):
        return "rosbag", ""
    packed = _compression_of(path)
    if packed == "zip" and path.is_file():
        return ("numpy", "") if _holds_arrays(path) else ("csv", packed)
    with closing(open_bytes(path)) as stream:
        begin = b""
        while len(begin) < _SEEN and (block := stream.read(_SEEN - len(begin))):
            begin += block
    if packed and (again := _named(begin)):
        raise RecordingError(
            f"{path.name}: is compressed twice, by {packed} and inside by {again}; expected once: "
            "unpack it"
        )
    reader = _reader_of_bytes(begin)
    if packed and reader not in ("csv", "ubx", "vectornav"):
        raise RecordingError(
            f"{path.name}: holds a file of the reader {reader!r}, compressed by {packed}; "
            "expected it as it is: unpack it"
        )
    return reader, packed


def _compression_of(path: Path) -> str:
    """Return how a file is compressed; empty where it is not."""
    if is_member(path):
        return "zip"
    if is_endless(path):
        raise RecordingError(f"{path.name}: is neither a file nor a folder; expected a log")
    try:
        with path.open("rb") as file:
            return _named(file.read(_LONGEST_MAGIC))
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be opened ({error.strerror})") from None


def _named(begin: bytes) -> str:
    return next((name for magic, name in _COMPRESSED.items() if begin.startswith(magic)), "")


def _reader_of_bytes(begin: bytes) -> Reader:
    for magic, reader in _BEGINS:
        if begin.startswith(magic):
            return reader
    # The receiver may be in the middle of something else when the log begins.
    if _UBX in begin and b"\0" in begin:
        return "ubx"
    if _VECTORNAV in begin:
        return "vectornav"
    return "csv"


def _holds_arrays(path: Path) -> bool:
    """Tell whether a zip archive, which may be cut short, is one of NumPy's."""
    return any(member.suffix == ".npy" for member in members(path))
