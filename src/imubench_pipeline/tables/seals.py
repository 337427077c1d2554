"""Digests of files, and seals: files with the digests of the inputs and outputs of a step.

An intact file may still be the wrong one, for example from another recording or a backup.
"""

import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path, PurePosixPath

from pydantic import TypeAdapter

from imubench_pipeline.tables.files import write_content
from imubench_pipeline.tables.schemas import PARTS_OF, TABLES
from imubench_pipeline.typing import JsonObject

_END = "\n}"
_LAST_LINE = re.compile(r',\n "digest": "[0-9a-f]{64}"\n\}\n\Z')


def write_sealed_json(data: Mapping[str, object], path: Path) -> None:
    """Write a mapping of JSON values without NaN, with its digest, atomically."""
    text = json.dumps(dict(data), indent=1, allow_nan=False)
    write_content(text.removesuffix(_END) + _last_line(text), path)


def read_sealed_json(path: Path) -> JsonObject:
    """Return the data that `write_sealed_json` wrote; ValueError if any byte has changed."""
    # All letters count, and not only what they mean.
    with open(path, "rb", opener=open_without_waiting) as file:
        text = file.read().decode()
    seal = _LAST_LINE.search(text)
    rest = text[: seal.start()] + _END if seal else text
    if seal is None or seal[0] != _last_line(rest):
        raise ValueError(f"{path}: its digest does not match its content; restore or remove it")
    try:
        data: JsonObject = json.loads(rest)
    except RecursionError:
        raise ValueError(f"{path}: its content is nested too deeply to be read") from None
    return data


def open_without_waiting(path: str, flags: int) -> int:
    """Open a file, as the ``opener`` of `open`, without waiting for the writer of a pipe."""
    return os.open(path, flags | os.O_NONBLOCK)


def compute_digest(path: Path) -> str:
    """Return the SHA-256 of the content of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _last_line(text: str) -> str:
    """Return the last line of a file: the digest of the text of a JSON object."""
    return f',\n "digest": "{hashlib.sha256(text.encode()).hexdigest()}"{_END}\n'


FOLDER = "seals"
NIGHTS = "nightly"
_LAYOUT = 1  # version of the layout of results other than tables


@cache
def compute_form_digest() -> str:
    """Return a digest of the columns of all tables and of the layout of other results."""
    columns = {
        name: [(column.name, str(column.type), column.unit) for column in table]
        for name, table in TABLES.items()
    }
    text = json.dumps([_LAYOUT, columns, PARTS_OF], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class SealedFile:
    """State of an output file: size in bytes, digest, time of modification in ns since 1970."""

    size: int
    sha256: str
    changed: int

    @classmethod
    def of(cls, path: Path) -> "SealedFile":
        """Return the present state of a file."""
        about = path.stat()
        return cls(about.st_size, compute_digest(path), about.st_mtime_ns)

    def fault(self, path: Path, *, whole: bool) -> str | None:
        """Return how a file differs from this state, in words; None if it does not.

        Unless ``whole``, the content is read only if the time of modification differs.
        """
        try:
            about = path.stat()
            if about.st_size != self.size:
                return f"expected {self.size} bytes, found {about.st_size}"
            if not whole and about.st_mtime_ns == self.changed:
                return None
            if (digest := compute_digest(path)) != self.sha256:
                return f"expected SHA-256 {self.sha256[:12]}…, found {digest[:12]}…"
        except (FileNotFoundError, NotADirectoryError):
            return f"expected {self.size} bytes, found no such file"
        except OSError as error:
            return f"expected {self.size} bytes, but the file cannot be read ({error.strerror})"
        return None


@dataclass(frozen=True)
class Seal:
    """Digests of the inputs and outputs of a step, with its settings and version."""

    place: str  # from `name_place`
    form: str  # as `compute_form_digest` gave it
    inputs: dict[str, str]  # digests by place below the results
    outputs: dict[str, SealedFile]
    settings: str = ""  # digest of the settings and the code
    version: str = ""  # of the program that made the outputs

    def write(self, results: Path) -> None:
        """Write the seal below the results, atomically."""
        write_sealed_json(asdict(self), results / name_seal_file(self.place))


_SEAL = TypeAdapter(Seal)


class SealError(ValueError):
    """A damaged or altered seal."""


def name_place(step: str, sensor: str | None = None, recording: str | None = None) -> str:
    """Return the place of the seal of a step: of a recording, a sensor, or the whole run."""
    if recording is not None:
        return f"recordings/{sensor}/{recording}/{step}"
    return f"sensors/{sensor}/{step}" if sensor is not None else step


def seal_files(
    results: Path,
    place: str,
    outputs: Iterable[Path],
    inputs: Mapping[str, str],
    settings: str = "",
    made_by: str = version("imubench_pipeline"),
) -> None:
    """Seal the outputs of a step: files, or folders with all their files.

    ``place`` is from `name_place`, ``inputs`` from `compute_digests`; ``settings`` is a digest of
    the settings and code of the step, ``made_by`` the version of the program.
    """
    left = {name: SealedFile.of(path) for name, path in sorted(_below(results, outputs))}
    Seal(place, compute_form_digest(), dict(inputs), left, settings, made_by).write(results)


def seal_again(results: Path, place: str, outputs: Iterable[Path]) -> None:
    """Update the seal of files that a command has rewritten; do nothing without a seal."""
    try:
        before = read_seal(results, place)
    except (FileNotFoundError, SealError):
        return
    inputs = compute_digests(results, (results / name for name in before.inputs))
    seal_files(results, place, outputs, inputs, before.settings, before.version)


def list_missing_inputs(results: Path, place: str) -> list[str]:
    """Return the missing inputs of a step, by path below the results; empty without a seal."""
    try:
        inputs = read_seal(results, place).inputs
    except (FileNotFoundError, SealError):
        return []
    return [name for name in inputs if not (results / name).is_file()]


def compute_digests(results: Path, paths: Iterable[Path]) -> dict[str, str]:
    """Return the digests of files and of files in folders, by path below the results."""
    return {name: compute_digest(path) for name, path in sorted(_below(results, paths))}


def read_seal(results: Path, place: str) -> Seal:
    """Return the seal of a place; FileNotFoundError without one, `SealError` if it is damaged."""
    try:
        text = json.dumps(read_sealed_json(results / name_seal_file(place)))
        seal = _SEAL.validate_json(text, strict=True)
        names = map(PurePosixPath, (*seal.inputs, *seal.outputs))
        if any(name.is_absolute() or ".." in name.parts for name in names):
            raise ValueError("a path leads out of the results")
    except FileNotFoundError:
        raise
    except OSError as error:
        raise SealError(f"cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise SealError("is not as it was written") from error
    if seal.place != place:
        raise SealError(f"belongs to {seal.place}")
    return seal


def list_places(results: Path) -> list[str]:
    """Return the places of all seals, in order."""
    folder = results / FOLDER
    files = (
        path.relative_to(folder).as_posix() for path in folder.rglob("*.json") if path.is_file()
    )
    return sorted(name.removesuffix(".json") for name in files)


def is_visible(path: Path) -> bool:
    """Return whether no part of a path begins with a dot."""
    return not any(part.startswith(".") for part in path.parts)


def name_seal_file(place: str) -> str:
    """Return the path of a seal below the results."""
    return f"{FOLDER}/{place}.json"


def _below(results: Path, paths: Iterable[Path]) -> Iterator[tuple[str, Path]]:
    for path in paths:
        if path.is_relative_to(results):
            inside = path.rglob("*") if path.is_dir() else [path]
            for file in inside:
                if is_visible(file.relative_to(path)) and not file.is_dir():
                    yield file.relative_to(results).as_posix(), file
