"""Output files and folders of commands, protected against accidental overwriting.

One rule for every option that names an output (`add_output`): an existing file is refused without
``--force``; a folder must be empty or an earlier output of the same kind. Only regular files are
replaced, each by a rename of a complete file. Symbolic links are followed, missing folders made.
Inputs and the places of a project (`Place`) are never overwritten; only commands whose output
belongs there add new files.
"""

import argparse
import errno
import os
import stat
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from imubench_pipeline.tables.files import make_folder, replace_file
from imubench_pipeline.tables.texts import escape_invisible


class OutputError(ValueError):
    """An output that cannot be written to the requested place; the text states the correction."""


@dataclass(frozen=True)
class Place:
    """A folder or file of a project in which other commands must not write."""

    path: Path
    kind: str  # such as ``logs``; an output that belongs there names it (`add_output`)
    holds: str  # in words, such as "the logs"

    def __str__(self) -> str:
        return f"{self.holds} ({escape_invisible(str(self.path))})"


@dataclass
class Output:
    """An output named by the user of a command."""

    path: Path  # as it was named
    adds_to: Collection[str] = ()  # kinds of places to which it may add new files
    force: bool = False  # replace regular files
    places: Callable[[Path], Iterable[Place]] = lambda _: ()  # protected ones around a path
    inputs: Sequence[Path] = ()  # files that the command reads

    def __str__(self) -> str:
        return escape_invisible(str(self.path))

    def check(self) -> Path:
        """Return the path with links resolved; raise an `OutputError` if it must not be written."""
        raise NotImplementedError

    def _resolve(self) -> tuple[Path, os.stat_result | None]:
        if not str(self.path).isprintable():
            raise OutputError(f"{self} contains invisible characters; choose a printable name")
        try:
            status = self.path.stat()
        except (FileNotFoundError, NotADirectoryError):
            status = None
        except OSError as error:
            raise OutputError(f"{self}: {explain(error)}") from None
        real = Path(os.path.realpath(self.path))
        if status is not None and not _is_at(real, status):
            raise OutputError(f"{self} leads to no named file, but to a pipe, say; choose a file")
        there = next(folder for folder in (real, *real.parents) if folder.exists())
        if status is None and not there.is_dir():
            raise OutputError(
                f"{self}: {escape_invisible(str(there))} is not a folder; choose another place"
            )
        if not os.access(there.parent if status is not None else there, os.W_OK | os.X_OK):
            raise OutputError(f"{self}: {explain(PermissionError(errno.EACCES, 'Not writable'))}")
        return real, status

    @contextmanager
    def _explaining(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            # An error of writing names nothing, a temporary file, or a folder that is not there;
            # any other error comes from an input.
            real, name = Path(os.path.realpath(self.path)), error.filename
            temporary = (f"{real.parent}/.".replace("//", "/"), f"{real}/.")
            if name is None or str(name).startswith(temporary) or real.is_relative_to(name):
                raise OutputError(f"{self}: {explain(error)}") from error
            raise

    def _check_place(self, real: Path, *, exists: bool) -> None:
        """Raise if a path is in a protected place, unless it is new and belongs there."""
        for place in self.places(real):
            if not _is_in(real, place.path) or (place.kind in self.adds_to and not exists):
                continue
            if place.kind in self.adds_to:
                raise OutputError(
                    f"{self} exists already, among {place.holds}, which no command replaces; "
                    "choose another name, or remove it first"
                )
            raise OutputError(
                f"{self} belongs to {place}, where this command writes nothing; choose a place "
                "outside"
            )


@dataclass
class OutputFile(Output):
    """A file that a command writes."""

    def check(self) -> Path:
        """Return the path with links resolved; raise an `OutputError` if it must not be written."""
        real, status = self._resolve()
        if status is not None and stat.S_ISDIR(status.st_mode):
            raise OutputError(f"{self} is a folder; choose a file in it")
        if status is not None and not stat.S_ISREG(status.st_mode):
            raise OutputError(f"{self} is a device, a pipe or a socket; choose a regular file")
        self._check_place(real, exists=status is not None)
        if status is None:
            return real
        if any(_is_at(path, status) for path in self.inputs):
            raise OutputError(f"{self} is an input of the command; choose another file")
        if not self.force:
            raise OutputError(f"{self} exists already; choose another file, or add --force")
        return real

    @contextmanager
    def replacing(self) -> Iterator[Path]:
        """Yield a temporary path; rename it to the output if the block succeeds."""
        with self._explaining(), replace_file(self.check()) as temporary:
            yield temporary
            self.check()

    def write(self, content: str | bytes) -> None:
        """Write a text or bytes."""
        with self.replacing() as temporary:
            temporary.write_bytes(content.encode() if isinstance(content, str) else content)

    def beside(self, path: Path) -> "OutputFile":
        """Return the output for another path, with the same rules."""
        return replace(self, path=path)


@dataclass
class OutputFolder(Output):
    """A folder that a command fills."""

    # whether a folder is an earlier output, which is replaced without ``--force``
    is_earlier: Callable[[Path], bool] = lambda _: False
    shared: bool = False  # it may have other files: only its own are refused where they exist

    def check(self) -> Path:
        """Return the path with links resolved; raise an `OutputError` if it must not be written."""
        real, status = self._resolve()
        if status is not None and not stat.S_ISDIR(status.st_mode):
            raise OutputError(f"{self} is a file; choose a folder")
        self._check_place(real, exists=False)
        if self.shared or status is None:
            return real
        for place in self.places(real):
            if place.path.exists() and _is_in(Path(os.path.realpath(place.path)), real):
                raise OutputError(f"{self} contains {place}; choose another folder")
        if not self.force and any(real.iterdir()) and not self.is_earlier(real):
            raise OutputError(
                f"{self} is not empty; choose another folder, or add --force, which replaces files "
                "of the same name and leaves all others"
            )
        return real

    def file(self, name: str) -> OutputFile:
        """Return the output for a file in the folder, with the same rules."""
        return OutputFile(self.path / name, self.adds_to, self.force, self.places, self.inputs)

    @contextmanager
    def filling(self) -> Iterator[Path]:
        """Yield a folder to fill; move its new or changed files to the output at the end."""
        real = self.check()
        if not real.exists():
            with self._explaining(), make_folder(real) as made:
                yield made
                self.check()
            return
        with (
            self._explaining(),
            tempfile.TemporaryDirectory(prefix=".", suffix=".part", dir=real) as scratch,
        ):
            yield Path(scratch)
            files = [path for path in sorted(Path(scratch).rglob("*")) if path.is_file()]
            # All are judged before the first is moved.
            moves = []
            for path in files:
                name = path.relative_to(scratch)
                target = replace(self.file(str(name)), force=True).check()
                if not target.is_relative_to(real):
                    raise OutputError(
                        f"{self}: {name} in it is a link to a place outside; remove the link"
                    )
                moves.append((path, target))
            for source, target in moves:
                if not target.is_file() or target.read_bytes() != source.read_bytes():
                    target.parent.mkdir(parents=True, exist_ok=True)
                    source.replace(target)


class StoreOutput(argparse.Action):
    """Parser action that stores the value of an option as an `Output`."""

    def __init__(self, *arguments: Any, make: Callable[[Path], Output], **keys: Any) -> None:
        super().__init__(*arguments, **keys)
        self.make = make

    def __call__(self, _: Any, namespace: argparse.Namespace, values: Any, *__: Any) -> None:
        """Store the output of a path."""
        setattr(namespace, self.dest, self.make(values))


def add_output(
    parser: argparse.ArgumentParser,
    name: str,
    make: Callable[[Path], Output] = OutputFile,
    **keys: Any,
) -> None:
    """Declare an argument that names an output; with an option, declare ``--force`` too.

    ``make`` returns the `Output` for a path; ``keys`` are passed on to
    `argparse.ArgumentParser.add_argument`.
    """
    parser.add_argument(name, type=Path, action=StoreOutput, make=make, **keys)
    if name.startswith("-"):
        with suppress(argparse.ArgumentError):  # another output of the command has declared it
            parser.add_argument(
                "--force", action="store_true", help="replace an output file that is there already"
            )


_MENDED = {
    errno.ENOSPC: "free space on the disk, or choose a place on another disk",
    errno.EDQUOT: "free space on the disk, or choose a place on another disk",
    errno.EFBIG: "the system allows no larger file: choose another place, or raise the limit",
    errno.EACCES: "choose a place that you may write to, or change the permissions",
    errno.EPERM: "choose a place that you may write to, or change the permissions",
    errno.EROFS: "choose a place that can be written to",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ELOOP: "remove the links that lead to each other, or choose another place",
}


def explain(error: OSError) -> str:
    """Return the reason of an error of the file system, and how to correct it, as one line."""
    mended = _MENDED.get(error.errno or 0, "choose another place")
    return f"{escape_invisible(error.strerror or str(error))}; {mended}"


def check_outputs(options: argparse.Namespace, places: Callable[[Path], Iterable[Place]]) -> None:
    """Check all outputs among the options of a command; raise an `OutputError` if one fails."""
    values = list(vars(options).values())
    listed = [one for value in values for one in (value if isinstance(value, list) else [value])]
    # A text counts as a file only with a suffix: a sensor may have the name of an output.
    texts = [Path(one) for one in listed if isinstance(one, str) and Path(one).suffix]
    inputs = [one for one in listed if isinstance(one, Path)] + texts
    for output in values:
        if isinstance(output, Output):
            output.force = getattr(options, "force", False)
            output.places, output.inputs = places, inputs
            output.check()


def _is_at(path: Path, status: os.stat_result) -> bool:
    """Return whether a path has this status, by any spelling or hard link."""
    try:
        return os.path.samestat(path.stat(), status)
    except (OSError, ValueError):
        return False


def _is_in(path: Path, folder: Path) -> bool:
    """Return whether a path without links is a folder or inside it; neither must exist."""
    try:
        status = folder.stat()
    except OSError:
        return path.is_relative_to(os.path.realpath(folder))
    return any(_is_at(above, status) for above in (path, *path.parents))
