"""Seals: what a step left and what of, kept apart from it, so that no other file passes for it.

A file that is whole may still be the wrong one: that of another recording, of a backup, of another
version of this package. Each step seals its outputs with their digests, and those of what it read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path, PurePosixPath

from imubench_pipeline.tables.digests import digest_of, read_sealed_json, write_sealed_json
from imubench_pipeline.tables.schemas import PARTS_OF, TABLES

FOLDER = "seals"
NIGHTS = "nightly"
_LAYOUT = 1
"""Is another number when what a run leaves beside its tables is of another form."""


@cache
def form() -> str:
    """Return what is another text whenever a table, or what else is kept, has another form."""
    columns = {
        name: [(column.name, str(column.type), column.unit) for column in table]
        for name, table in TABLES.items()
    }
    text = json.dumps([_LAYOUT, columns, PARTS_OF], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class SealedFile:
    """A file as it was left: its size in bytes, its digest, its last change in ns since 1970."""

    size: int
    sha256: str
    changed: int

    @classmethod
    def of(cls, path: Path) -> SealedFile:
        """Read a file."""
        about = path.stat()
        return cls(about.st_size, digest_of(path), about.st_mtime_ns)

    def fault(self, path: Path, *, whole: bool) -> str | None:
        """Return what is wrong with a file; None where nothing is seen.

        Parameters
        ----------
        whole : bool
            All of it is read, and not only where it was changed since.
        """
        try:
            about = path.stat()
            if about.st_size != self.size:
                return f"expected {self.size} bytes, found {about.st_size}"
            if not whole and about.st_mtime_ns == self.changed:
                return None
            if (digest := digest_of(path)) != self.sha256:
                return f"expected SHA-256 {self.sha256[:12]}…, found {digest[:12]}…"
        except (FileNotFoundError, NotADirectoryError):
            return f"expected {self.size} bytes, found no such file"
        except OSError as error:
            return f"expected {self.size} bytes, found what cannot be read ({error.strerror})"
        return None


@dataclass(frozen=True)
class Seal:
    """What a step left."""

    place: str
    """Of the seal: the step, after the recording or sensor that it is of."""
    form: str
    """As `form` gave it."""
    inputs: dict[str, str]
    """Digests of what it read, by their places below the results."""
    outputs: dict[str, SealedFile]
    """Likewise, what it wrote."""
    settings: str = ""
    """Digest of the settings and the code that it ran with."""

    def write(self, results: Path) -> None:
        """Keep it, atomically."""
        write_sealed_json(asdict(self), _path(results, self.place))


class SealError(ValueError):
    """A seal that is not as it was written."""


def place_of(step: str, sensor: str | None = None, recording: str | None = None) -> str:
    """Return the place of the seal of a step, of a recording, a sensor, or all of them."""
    if recording is not None:
        return f"recordings/{sensor}/{recording}/{step}"
    return f"sensors/{sensor}/{step}" if sensor is not None else step


def night_place(name: str) -> str:
    """Return the place of the seal of what a nightly run said."""
    return f"{NIGHTS}/{name}"


def seal_files(
    results: Path,
    place: str,
    outputs: Iterable[Path],
    inputs: Mapping[str, str],
    settings: str = "",
) -> None:
    """Seal what a step left.

    Parameters
    ----------
    place : str
        As of `place_of`.
    outputs : iterable of Path
        Files, and folders of which all files are meant.
    inputs : mapping of str to str
        As `digests` gave them.
    settings : str
        Digest of the settings and the code of the step.
    """
    left = {name: SealedFile.of(path) for name, path in sorted(_below(results, outputs))}
    Seal(place, form(), dict(inputs), left, settings).write(results)


def seal_again(results: Path, place: str, outputs: Iterable[Path]) -> None:
    """Seal what a command has written in the place of a step, of the files that the step read.

    Parameters
    ----------
    place : str
        Where there is no seal, none is made.
    """
    try:
        before = read_seal(results, place)
    except (FileNotFoundError, SealError):
        return
    inputs = digests(results, (results / name for name in before.inputs))
    seal_files(results, place, outputs, inputs, before.settings)


def lost_inputs(results: Path, place: str) -> list[str]:
    """Return what a step read and is no longer there; nothing where there is no seal of it."""
    try:
        inputs = read_seal(results, place).inputs
    except (FileNotFoundError, SealError):
        return []
    return [name for name in inputs if not (results / name).is_file()]


def digests(results: Path, paths: Iterable[Path]) -> dict[str, str]:
    """Return the digests of files below the results, by their places there.

    Parameters
    ----------
    paths : iterable of Path
        Files, and folders of which all files are meant; others than of results are left out.
    """
    return {name: digest_of(path) for name, path in sorted(_below(results, paths))}


def read_seal(results: Path, place: str) -> Seal:
    """Return the seal of a place.

    Raises
    ------
    FileNotFoundError
        If there is none.
    SealError
        If it is damaged, or that of another place.
    """
    path = _path(results, place)
    try:
        data = read_sealed_json(path)
        outputs = {name: SealedFile(**file) for name, file in data["outputs"].items()}
        seal = Seal(**{**data, "outputs": outputs})
        _check(seal)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise SealError(f"cannot be read ({error.strerror})") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SealError("is not as it was written") from error
    if seal.place != place:
        raise SealError(f"is that of {seal.place}")
    return seal


def _check(seal: Seal) -> None:
    """Raise `ValueError` unless all in a seal is of its type, and names what is in the results."""
    texts = [seal.place, seal.form, seal.settings, *seal.inputs.values()]
    texts += [file.sha256 for file in seal.outputs.values()]
    numbers = [n for file in seal.outputs.values() for n in (file.size, file.changed)]
    names = [PurePosixPath(name) for name in (*seal.inputs, *seal.outputs)]
    if (
        not all(isinstance(text, str) for text in texts)
        or not all(type(number) is int for number in numbers)
        or any(name.is_absolute() or ".." in name.parts for name in names)
    ):
        raise ValueError("no seal")


def places(results: Path) -> list[str]:
    """Return the places of all seals, in order."""
    folder = results / FOLDER
    files = (
        path.relative_to(folder).as_posix() for path in folder.rglob("*.json") if path.is_file()
    )
    return sorted(name.removesuffix(".json") for name in files)


def visible(path: Path) -> bool:
    """Return whether no part of a place is hidden: what begins with a dot is no result."""
    return not any(part.startswith(".") for part in path.parts)


def seal_file(place: str) -> str:
    """Return where below the results a seal is kept."""
    return f"{FOLDER}/{place}.json"


def _path(results: Path, place: str) -> Path:
    return results / seal_file(place)


def _below(results: Path, paths: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    """Yield the files of paths below the results, with their places there."""
    for path in paths:
        if path.is_relative_to(results):
            inside = path.rglob("*") if path.is_dir() else [path]
            for file in inside:
                if visible(file.relative_to(path)) and not file.is_dir():
                    yield file.relative_to(results).as_posix(), file
