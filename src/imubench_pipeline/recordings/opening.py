"""Whether a log can be opened: tried in a process of its own, ended where it takes too long."""

from __future__ import annotations

from pathlib import Path

from imubench_pipeline.readers import log_files, read
from imubench_pipeline.readers.bounded import BoundError, run_bounded
from imubench_pipeline.recordings.availability import watch_log
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.tables.findings import RecordingError, UnavailableError

_MEMORY = 1 << 29  # bytes; the bounds of the readers take up to half of them
_SLOWEST = 5e6
"""Bytes/s. A bag without an index is searched to its end for a topic that it does not have: one of
511 MB, most of it in messages of 300 bytes, took 21 s on a busy core."""


def check_opening(source: Path, log: LogFormat, seconds: float) -> None:
    """Read the first records of each file of a recording (file or folder), and no more.

    ``seconds``: how long it may take, and a second more for each 5 MB of the log. Raises
    RecordingError if they cannot be read, or that takes longer or more than 512 MiB, or crashes;
    OSError if the log is not there, or its disk does not answer in that time.
    """
    size = sum(path.stat().st_size for path in log_files(source))
    try:
        run_bounded(seconds + size / _SLOWEST, _MEMORY, _read_first_records, source, log)
    except BoundError as error:
        if error.is_external:
            raise UnavailableError(f"{source.name}: to read its first records {error}") from None
        raise RecordingError(
            f"{source.name}: to read its first records {error}; expected the log of an "
            "inertial sensor: copy what it measured into a file of its own, or allow more in "
            "quality.opening"
        ) from None


def _read_first_records(source: Path, log: LogFormat) -> None:
    with watch_log(source):  # an error loses its causes on its way out of this process
        try:
            for file in read(source, log):
                next(iter(file.batches()), None)
        except (RecordingError, OSError, MemoryError):
            raise
        except Exception:
            return  # who reads it meets the same, and says where
