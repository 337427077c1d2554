"""Which reader a file needs, told by its content and never by its name."""

from __future__ import annotations

import zipfile
from pathlib import Path

from imubench_pipeline.readers.batch import RecordingError
from imubench_pipeline.sensor import Reader

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
_COMPRESSED = (b"\x1f\x8b", b"\x28\xb5\x2f\xfd", b"\xfd7zXZ\0", b"BZh", b"PK\x03\x04")
"""gzip, zstd, xz, bzip2, zip: what is inside is text."""

_UBX = b"\xb5\x62"
_VECTORNAV = b"$VN"
_ROS_2_BAG = "metadata.yaml"


def is_ros_2_bag(path: Path) -> bool:
    """Tell whether a folder is a ROS 2 bag, which is one log and no folder of logs."""
    return path.is_dir() and (path / _ROS_2_BAG).is_file()


def reader_of(path: Path) -> Reader:
    """Return the reader that a file needs.

    Parameters
    ----------
    path : Path
        A log file, or the folder of a ROS 2 bag.

    Raises
    ------
    RecordingError
        If the file cannot be opened.
    """
    if is_ros_2_bag(path):
        return "rosbag"
    try:
        with path.open("rb") as file:
            begin = file.read(_SEEN)
        if begin.startswith(b"PK") and _holds_arrays(path):
            return "numpy"
    except OSError as error:
        raise RecordingError(f"{path.name}: cannot be opened ({error.strerror})") from None
    for magic, reader in _BEGINS:
        if begin.startswith(magic):
            return reader
    if begin.startswith(_COMPRESSED):
        return "csv"
    # The receiver may be in the middle of something else when the log begins.
    if _UBX in begin and b"\0" in begin:
        return "ubx"
    if _VECTORNAV in begin:
        return "vectornav"
    return "csv"


def _holds_arrays(path: Path) -> bool:
    """Tell whether a zip archive is one of NumPy's."""
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except zipfile.BadZipFile:
        return False
