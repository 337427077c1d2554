"""Distinguish errors of a log from errors of the system: mounts, disks, permissions.

An error of a log rejects it until it changes. The state of the system may change within an hour:
the ingest fails without a verdict, and the next run tries again.
"""

import errno
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from imubench_pipeline.readers import log_files, read
from imubench_pipeline.readers.bounded import BoundError, run_bounded
from imubench_pipeline.recordings.known_logs import read_identity
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.tables.findings import RecordingError, UnavailableError

OF_RESULTS = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EMFILE, errno.ENFILE})
"""Errors that any other recording would meet as well: the run stops."""

_OF_SURROUNDINGS = frozenset(
    {
        *(errno.EACCES, errno.EPERM, errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.ENOMEM),
        *(errno.ENODEV, errno.ENXIO, errno.ENOTCONN, errno.EHOSTDOWN, errno.EBUSY, errno.EAGAIN),
    }
)
_ABSENT = frozenset({errno.ENOENT, errno.ENOTDIR})


@contextmanager
def watch_log(source: Path, planned: Collection[str] = ()) -> Iterator[Callable[[], bool]]:
    """Pass on a `RecordingError` only if the log causes it, and not its disk or a change meanwhile.

    Yields a function that returns whether the log is unchanged. ``planned``: files that the plan
    found. Raises RecordingError if the path itself cannot be used; UnavailableError if the log is
    not there, cannot be read for a reason outside of it, or changed while it was rejected; OSError
    if a disk is full, or there are too many open files.
    """
    try:
        before = read_identity(source)
    except OSError as error:
        if error.errno in _OF_SURROUNDINGS | _ABSENT:
            raise _unavailable(source, error) from None
        raise RecordingError(f"{source.name}: cannot be read ({error.strerror})") from None
    if absent := sorted({*planned} - {*before}):
        raise UnavailableError(f"{source.name}: {absent[0]} is not there any more; run again")
    if before.keys() == {"."} and source.is_dir():
        raise RecordingError(f"the folder {source.name!a} has no files; expected a log in it")
    try:
        yield lambda: _identity(source) == before
    except (RecordingError, OSError) as raised:
        cause: BaseException | None = raised
        while cause is not None:
            if isinstance(cause, OSError) and cause.errno in OF_RESULTS:
                raise cause from None
            if isinstance(cause, OSError) and cause.errno in _OF_SURROUNDINGS | _ABSENT:
                # A file that was not there before either may be missing in the log.
                name = cause.filename
                if name is None or any(Path(name) == source / file for file in before):
                    raise _unavailable(source, cause) from None
            cause = cause.__cause__ or cause.__context__
        if isinstance(raised, RecordingError) and _identity(source) != before:
            reason = f"{source.name}: was changed, replaced or absent while it was read; run again"
            raise UnavailableError(reason) from None
        raise


def _identity(source: Path) -> dict[str, tuple[int, ...]] | None:
    try:
        return read_identity(source)
    except OSError:
        return None


def _unavailable(source: Path, error: OSError) -> UnavailableError:
    return UnavailableError(f"{source.name}: cannot be read ({error.strerror})")


_MEMORY = 1 << 29  # bytes; the bounds of the readers take up to half of them
_SLOWEST = 5e6
"""Bytes/s. A bag without an index is searched to its end for a topic that it does not have: one of
511 MB, most of it in messages of 300 bytes, took 21 s on a busy core."""


def check_opening(source: Path, log: LogFormat, seconds: float) -> None:
    """Check that the first records of each file of a recording (file or folder) can be read.

    ``seconds``: time limit, to which 1 s is added for each 5 MB of the log. Raises RecordingError
    if the records cannot be read, or reading takes longer, takes more than 512 MiB, or crashes;
    OSError if the log is not there, or its disk does not answer in time.
    """
    size = sum(path.stat().st_size for path in log_files(source))
    try:
        run_bounded(seconds + size / _SLOWEST, _MEMORY, _read_first_records, source, log)
    except BoundError as error:
        if error.is_external:
            raise UnavailableError(f"{source.name}: reading its first records {error}") from None
        raise RecordingError(
            f"{source.name}: reading its first records {error}; expected the log of an inertial "
            "sensor: copy its data into a separate file, or increase quality.opening in the "
            "configuration"
        ) from None


def _read_first_records(source: Path, log: LogFormat) -> None:
    with watch_log(source):  # an error loses its causes on its way out of this process
        try:
            for file in read(source, log):
                next(iter(file.batches()), None)
        except (RecordingError, OSError, MemoryError):
            raise
        except Exception:
            return  # the ingest meets the same error, and reports it
