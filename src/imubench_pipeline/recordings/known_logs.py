"""Which logs were read: their digests, and the stamps by which it is known that they still are.

A log may be edited in place without another size, and its date may be set to what it was. Its
size and the stamps of its last change, of the content (mtime) and of anything (ctime, which nobody
sets), say cheaply that nothing was done to it. Where they differ, all of it is read: a log that was
touched alone has the digest that it had.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from imubench_pipeline.readers import log_files
from imubench_pipeline.recordings.drop_zone import Recording
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.digests import digest_of, read_sealed_json, write_sealed_json

KNOWN = "log.json"
"""What was read, beside ``quality.json``."""

_READ_WHOLE = 1 << 20  # bytes; of a larger file that was never read, blocks are
_BLOCKS = 16
_BLOCK = 4096  # bytes
_TICK = 2_000_000_000
"""ns; two changes within it may have one stamp (FAT has steps of 2 s, Linux of some ms)."""


@dataclass(frozen=True)
class KnownFile:
    """A file of a log as it was read."""

    size: int
    """Bytes."""
    sha256: str
    """Of the content."""
    steady: bool
    """Nothing was done to it while it was read."""
    stamps: tuple[int, int] | None
    """Last change of the content and of anything, ns since 1970; None: they were too young to tell
    a later change."""
    version: str = ""
    """What the plan calls this content; another text wherever it is another one."""

    @classmethod
    def of(cls, path: Path) -> KnownFile:
        """Read a file."""
        begun = time.time_ns()
        before = path.stat()
        # Nothing is read of what says that it is empty: a file of the kernel may never end.
        digest = digest_of(path) if before.st_size else hashlib.sha256().hexdigest()
        after = path.stat()
        steady = (before.st_size, _stamps(before)) == (after.st_size, _stamps(after))
        old = max(_stamps(before)) < begun - _TICK
        stamps = _stamps(before) if steady and old else None
        return cls(before.st_size, digest, steady, stamps)

    def same(self, now: KnownFile) -> bool:
        """Return whether a file has the content that was read."""
        return self.steady and (self.size, self.sha256) == (now.size, now.sha256)

    def unchanged(self, path: Path) -> bool:
        """Return whether nothing was done to a file since it was read."""
        now = path.stat()
        return (self.size, self.stamps) == (now.st_size, _stamps(now))


def read_known(folder: Path) -> dict[str, KnownFile] | None:
    """Return the files of a log as they were read; None where that is not known.

    ``folder``: of the recording.
    """
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        return {
            name: KnownFile(**{**file, "stamps": file["stamps"] and tuple(file["stamps"])})
            for name, file in read_sealed_json(folder / KNOWN)["files"].items()
        }
    return None


def write_known(files: Mapping[str, KnownFile], folder: Path) -> None:
    """Keep the files of a log as they were read.

    ``files``: by their place in the log.
    ``folder``: of the recording.
    """
    rows = {name: asdict(file) for name, file in sorted(files.items())}
    write_sealed_json({"files": rows}, folder / KNOWN)


def read_log(source: Path) -> dict[str, KnownFile]:
    """Return the files of a log, all of which is read, by their place in it.

    ``source``: the log file, or the folder of a recording.
    """
    return {name: KnownFile.of(file) for name, file in _places(source).items()}


def versions(source: Path, folder: Path) -> dict[str, str]:
    """Return what is another text for each file of a log whenever that has another content.

    Parameters
    ----------
    source : Path
        The log file, or the folder of a recording.
    folder : Path
        Of its results. What is known of files that were touched alone is renewed there.

    Returns
    -------
    dict of str to str
        Files that were never read have a digest of some blocks of them: it takes no time, and
        they are read in any case.

    Raises
    ------
    OSError
        If a file has gone.
    """
    files = read_known(folder)
    result, touched = {}, dict[str, KnownFile]()
    for name, path in _places(source).items():
        before = (files or {}).get(name)
        if before is None:
            result[name] = glimpse(path)
        elif before.unchanged(path):
            result[name] = before.version
        else:
            now = KnownFile.of(path)
            result[name] = f"{now.size} sha256 {now.sha256}"
            if before.same(now):
                result[name] = before.version
                touched[name] = replace(now, version=before.version)
    quality = folder / "quality.json"
    if files is None and quality.is_file():
        # It was read, and what that was is not known any more: it is read again.
        since = quality.stat().st_mtime_ns
        return {name: f"{version} {since}" for name, version in result.items()}
    if files and touched:
        with contextlib.suppress(OSError):  # of results that this user may only read
            write_known(files | touched, folder)
    return result


def versions_of(recording: Recording, results: Path) -> dict[str, str]:
    """Return the `versions` of the files of a recording; of one that is to be simulated, none.

    Raises
    ------
    ConfigError
        If one of them has gone.
    """
    if recording.simulated:
        return {}
    path = recording.path
    try:
        return versions(path, results / "recordings" / recording.sensor / recording.name)
    except OSError as error:
        raise ConfigError(f"{path.name!a} cannot be read ({error.strerror})") from None


def glimpse(path: Path) -> str:
    """Return the size of a file and a digest of it; of a large file, of blocks spread over it.

    The first and the last block are among them. A change that leaves the size and all 16 blocks of
    4 kB as they are is not seen, in a file above 1 MB.

    ``path``: a file.
    """
    digest = hashlib.sha256()
    with path.open("rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size
        if size <= _READ_WHOLE:
            digest.update(file.read(size))
        else:
            for number in range(_BLOCKS):
                place = (size - _BLOCK) * number // (_BLOCKS - 1)
                digest.update(os.pread(file.fileno(), _BLOCK, place))
    return f"{size} {digest.hexdigest()[:32]}"


def _places(source: Path) -> dict[str, Path]:
    return {file.relative_to(source).as_posix(): file for file in log_files(source)}


def _stamps(about: os.stat_result) -> tuple[int, int]:
    return about.st_mtime_ns, about.st_ctime_ns
