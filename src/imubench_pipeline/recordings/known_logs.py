"""Identity of the files that an ingest read.

The plan must see every change of a log and still be cheap: it compares sizes, mtime, ctime (which
nobody can set), and a few blocks of a file. It reads a whole file only if its size is moderate and
its stamps have changed. The ingest reads whole files, and is repeated as soon as they have changed.
"""

import contextlib
import hashlib
import io
import os
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

from pydantic import TypeAdapter

from imubench_pipeline.readers import log_files
from imubench_pipeline.readers.holes import FileWithoutHoles
from imubench_pipeline.tables import seals

KNOWN = "log.json"  # the file of the evidence, beside `quality.json`
MAX_DIGESTED_SIZE = 1 << 26
"""Bytes. A file up to this size is read in the plan where only its stamps may have changed (0.1 s);
a larger one goes through the ingest again."""

_MAX_WHOLE_GLIMPSE = 1 << 20  # bytes
_BLOCKS = 16
_BLOCK_SIZE = 4096  # bytes
_CHUNK_SIZE = 1 << 20  # bytes
_STAMP_RESOLUTION = 2_000_000_000  # ns; changes within it may have the same stamp (FAT: 2 s)
Stamps = tuple[int, int]  # last change of the content and of anything, ns since 1970


@dataclass(frozen=True)
class KnownFile:
    """Identity of a file of a log at its ingest."""

    size: int | None  # bytes; None: it was not there
    sha256: str | None  # of the content; None: not read to its end, or changed meanwhile
    stamps: Stamps | None  # None: changed while it was read, or shortly before
    version: str = ""  # the name of this content in the settings of the ingest
    inode: int = 0
    """The number of the file. Two files may have the same size and stamps. Some network disks give
    other numbers each time: then only the content of a file of moderate size is compared."""

    @classmethod
    def of(cls, path: Path, is_stopped: Callable[[], bool] = lambda: False) -> "KnownFile":
        """Return the identity of a file, which may be missing; ``is_stopped`` ends a long read."""
        try:
            begin = time.time_ns()
            before = path.stat()
            digest = _digest(path, before.st_size, is_stopped)
            after = path.stat()
        except OSError:
            return cls(None, None, None)
        if (before.st_size, _stamps(before)) != (after.st_size, _stamps(after)):
            return cls(before.st_size, None, None)
        old = all(abs(begin - stamp) > _STAMP_RESOLUTION for stamp in _stamps(before))
        return cls(before.st_size, digest, _stamps(before) if old else None, inode=before.st_ino)


@cache
def _make_adapter() -> TypeAdapter[dict[str, KnownFile]]:
    return TypeAdapter(dict[str, KnownFile])


def read_known(folder: Path) -> dict[str, KnownFile] | None:
    """Read the file identities of the last ingest of a recording; None if there are none."""
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        return _make_adapter().validate_python(seals.read_sealed_json(folder / KNOWN)["files"])
    return None


def write_known(
    files: Mapping[str, KnownFile], folder: Path, versions: Mapping[str, str] | None = None
) -> None:
    """Write the file identities of an ingest to the results of a recording.

    ``versions``: of the files in the plan; those that are not in ``files`` are written as absent.
    """
    if versions is not None:
        absent = {name: KnownFile(None, None, None) for name in versions}
        files = {
            name: replace(file, version=versions.get(name, ""))
            for name, file in (absent | dict(files)).items()
        }
    rows = {name: asdict(file) for name, file in sorted(files.items())}
    seals.write_sealed_json({"files": rows}, folder / KNOWN)


def identify_log_files(
    source: Path, is_stopped: Callable[[], bool] = lambda: False
) -> dict[str, KnownFile]:
    """Read all files of a log (file or folder); return their identities, by relative path.

    ``is_stopped``: whether digests of large files are not needed any more. Raises OSError.
    """
    return {name: KnownFile.of(file, is_stopped) for name, file in _places(source).items()}


def read_identity(source: Path) -> dict[str, tuple[int, ...]]:
    """Return size, times and inode of the files of a log and of their folder, by relative path.

    It differs whenever a file was changed, replaced, renamed, or moved away and back. Raises
    OSError.
    """
    paths = {".": source} | _places(source)
    return {
        name: (about.st_size, *_stamps(about), about.st_ino)
        for name, path in paths.items()
        for about in [path.stat()]
    }


def plan_versions(source: Path, folder: Path) -> dict[str, str]:
    """Return a version of each file of a log; a changed version requires an ingest.

    A version stays while the file agrees with its identity at the last ingest, in ``folder``. New
    stamps of an unchanged file are written there.
    """
    known = read_known(folder)
    places: dict[str, Path] = {}
    versions: dict[str, str] = {}
    try:
        places = _places(source)
    except OSError as error:
        versions["."] = _unreadable(error)
    touched = dict[str, KnownFile]()
    for name, path in places.items():
        before = (known or {}).get(name)
        try:
            now = None if before is None else _now(path, before)
            versions[name] = now.version if now else digest_blocks(path)
            if now and now != before:
                touched[name] = now
        except OSError as error:
            versions[name] = _unreadable(error)
            if before is not None and before.size is None:
                continue  # as the last ingest found it
            now = None
        if before is not None and now is None and versions[name] == before.version:
            versions[name] += " again"
    quality = folder / "quality.json"
    if known is None and quality.is_file():
        # There is a result, but its evidence was lost: the log is read again.
        since = quality.stat().st_mtime_ns
        return {name: f"{version} {since}" for name, version in versions.items()}
    if known and touched:
        with contextlib.suppress(OSError):  # results that this user may only read
            write_known(known | touched, folder)
    return versions


def _now(path: Path, before: KnownFile) -> KnownFile | None:
    """Return a file with its present times if its content is unchanged, else None."""
    about = path.stat()
    same_file = before.inode == about.st_ino or about.st_size > MAX_DIGESTED_SIZE
    if same_file and (before.size, before.stamps) == (about.st_size, _stamps(about)):
        return before
    if before.sha256 is None or not before.size == about.st_size <= MAX_DIGESTED_SIZE:
        return None
    now = KnownFile.of(path)
    return replace(now, version=before.version) if now.sha256 == before.sha256 else None


def digest_blocks(path: Path) -> str:
    """Return the size of a file and a digest of it; above 1 MB, of 16 blocks from first to last."""
    digest = hashlib.sha256()
    with _opened(path) as file:
        size = os.fstat(file.fileno()).st_size
        if size <= _MAX_WHOLE_GLIMPSE:
            digest.update(file.read(size))
        else:
            for number in range(_BLOCKS):
                place = (size - _BLOCK_SIZE) * number // (_BLOCKS - 1)
                digest.update(os.pread(file.fileno(), _BLOCK_SIZE, place))
    return f"{size} {digest.hexdigest()[:32]}"


def _digest(path: Path, size: int, is_stopped: Callable[[], bool]) -> str | None:
    """Return the SHA-256 of the first `size` bytes, of long holes only the end; None if stopped."""
    digest, is_large = hashlib.sha256(), size > MAX_DIGESTED_SIZE
    is_sparse = is_large and 512 * path.stat().st_blocks < size - MAX_DIGESTED_SIZE
    with closing(FileWithoutHoles(path)) if is_sparse else _opened(path) as file:
        while size > 0 and (chunk := file.read(min(size, _CHUNK_SIZE))):
            if is_large and is_stopped():
                return None
            digest.update(chunk)
            size -= len(chunk)
    return digest.hexdigest()


def _opened(path: Path) -> io.FileIO:
    return open(path, "rb", buffering=0, opener=seals.open_without_waiting)


def _places(source: Path) -> dict[str, Path]:
    return {file.relative_to(source).as_posix(): file for file in log_files(source)}


def _stamps(about: os.stat_result) -> Stamps:
    return about.st_mtime_ns, about.st_ctime_ns


def _unreadable(error: OSError) -> str:
    return f"cannot be read ({error.strerror})"
