"""Verify that the results of runs are unchanged and consistent with each other."""

import json
import os
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.known_logs import KNOWN
from imubench_pipeline.run.project import find_own_snakefile
from imubench_pipeline.run.recovery import find_unfinished
from imubench_pipeline.tables import seals as sealing
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.seals import read_sealed_json

_SEALED_FOLDERS = ("recordings", "sensors", "tables", "simulated", "report", "exports")
"""Folders in which every file has a seal, except files with their own digest."""

_SAMPLE_FILES = "log*.parquet"
_NO_SEAL = "expected the seal of its step, found none"


@dataclass(frozen=True)
class Fault:
    """A file that was changed, or is missing or unexpected."""

    path: str  # below the results
    found: str  # the expected and the found state
    mend: str  # the command that makes the file again, or another action


@dataclass
class Results:
    """Verifies the files in a folder of results; `read` is called with the number of bytes read."""

    folder: Path
    read: Callable[[int], None] = lambda _: None
    seals: dict[str, sealing.Seal] = field(default_factory=dict, init=False)
    _broken: dict[str, str] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        for place in sealing.list_places(self.folder):
            try:
                self.seals[place] = sealing.read_seal(self.folder, place)
            except (FileNotFoundError, sealing.SealError) as error:
                self._broken[place] = str(error)

    @cached_property
    def size(self) -> int:
        """Number of bytes that `faults` reads."""
        samples = self.folder.glob(f"recordings/*/*/{_SAMPLE_FILES}")
        return sum(file.size for file in self._left.values()) + sum(
            path.stat().st_size for path in samples if path.is_file()
        )

    @property
    def files(self) -> int:
        """Number of files with a seal."""
        return len(self._left)

    @cached_property
    def run_again(self) -> str:
        """The command that runs the workflow again, with the settings that the report states."""
        config: list[str] = []
        try:
            settings = json.loads((self.folder / "report/settings.json").read_text("utf-8"))
            config = [str(entry) for entry in settings["given"]]
        except (OSError, ValueError, KeyError, TypeError):
            pass  # `faults` reports that this file is damaged
        flags = ["--config", *config] if config else []
        own = find_own_snakefile(Path()) or not Path("config/config.yaml").is_file()
        called = ["snakemake", "-c2"] if own else ["imubench", "run", *(["--"] if flags else [])]
        return shlex.join([*called, *flags])

    def faults(self) -> Iterator[Fault]:
        """Yield the files that are changed, missing or unexpected, each once."""
        named = set()
        for fault in self._every():
            if fault.path not in named:
                named.add(fault.path)
                yield fault

    def waiting(self) -> list[str]:
        """Return the steps that the next run repeats anyway, because their inputs are newer."""
        return [
            place
            for place in self._current
            if any(newer for _, newer in self._others_now(self.seals[place]))
        ]

    def _every(self) -> Iterator[Fault]:
        for place, error in self._broken.items():
            words = f"expected the seal of {place}, found one that {error}"
            yield self._fault(sealing.name_seal_file(place), words, place)
        form = sealing.compute_form_digest()
        if older := sum(seal.form != form for seal in self.seals.values()):
            words = f"expected the form {form}, found {older} steps of another version"
            yield Fault("seals", words, self.run_again)
        for place, seal in self.seals.items():
            yield from self._changed(place, seal)
        for path in sorted(self.folder.glob("recordings/*/*/quality.json")):
            yield from self._samples(path)
        own = [*self.folder.glob(f"recordings/*/*/{KNOWN}"), *self.folder.glob("faults/**/*.json")]
        for path in sorted(own):
            name = path.relative_to(self.folder).as_posix()
            try:
                read_sealed_json(path)
            except (OSError, ValueError) as error:
                yield Fault(name, f"expected the file of a run, {_of(error)}", self._removed(name))
        for place in self._current:  # made from other inputs that are not newer
            others = [name for name, newer in self._others_now(self.seals[place]) if not newer]
            if others:
                first = next(iter(self.seals[place].outputs), sealing.name_seal_file(place))
                words = (
                    f"expected a file made from the present {others[0]}, found one of another input"
                )
                yield self._fault(first, words, place)
        yield from self._unsealed()
        for path in find_unfinished(self.folder):
            place = path.relative_to(self.folder).as_posix()
            words = "expected nothing, found an incomplete output of a killed run"
            yield Fault(place, words, f"where no run goes on: rm -r {self._quoted(place)}")

    def _changed(self, place: str, seal: sealing.Seal) -> Iterator[Fault]:
        left = any(os.path.lexists(self.folder / name) for name in seal.outputs)
        last = place in (f"{sealing.NIGHTS}/latest", f"{sealing.NIGHTS}/state")
        if not (left or last or place in self._current):
            return  # all of a recording was removed, or of a night that is long past
        for name, file in seal.outputs.items():
            if words := file.fault(self.folder / name, whole=True):
                yield self._fault(name, words, place)
            self.read(file.size)

    def _samples(self, path: Path) -> Iterator[Fault]:
        place = path.parent.relative_to(self.folder).as_posix()
        step, name = f"{place}/ingest", f"{place}/{path.name}"
        try:
            quality = Quality.read(path)
        except (RecordingError, OSError) as error:
            yield self._fault(name, f"expected the output of the ingest, {_of(error)}", step)
            return
        of = f"{quality.recording.sensor}/{quality.recording.recording}"
        if f"recordings/{of}" != place:
            yield self._fault(name, f"expected the file of {place}, found the file of {of}", step)
        samples = quality.kept or {}
        for file, stated in samples.items():
            if stated.is_removed(path.with_name(file)):
                continue
            expected = sealing.SealedFile(stated.size, stated.sha256, 0)
            if words := expected.fault(path.with_name(file), whole=True):
                yield self._fault(f"{place}/{file}", words, step)
            self.read(expected.size)
        for other in sorted(path.parent.glob(_SAMPLE_FILES)):
            if other.name not in samples:
                yield self._stray(f"{place}/{other.name}")
        if samples and not quality.recording.simulated and not path.with_name(KNOWN).exists():
            words = "expected the file identities of the log, found no such file"
            yield Fault(f"{place}/{KNOWN}", words, self.run_again)

    def _others_now(self, seal: sealing.Seal) -> list[tuple[str, bool]]:
        """Return the changed inputs of a step, and whether they are newer."""
        made = min((file.changed for file in seal.outputs.values()), default=0)
        now = ((name, digest, self._left.get(name)) for name, digest in seal.inputs.items())
        return [
            (name, file is not None and file.changed > made)
            for name, digest, file in now
            if file is None or file.sha256 != digest
        ]

    @cached_property
    def _left(self) -> dict[str, sealing.SealedFile]:
        return {name: file for seal in self.seals.values() for name, file in seal.outputs.items()}

    @cached_property
    def _current(self) -> list[str]:
        """The steps that contribute to the comparison, without steps of removed logs."""
        by = {name: place for place, seal in self.seals.items() for name in seal.outputs}
        current: set[str] = set()
        todo = [place for place in self.seals if "/" not in place]
        while todo:
            place = todo.pop()
            if place not in current:
                current.add(place)
                todo += [by[name] for name in self.seals[place].inputs if name in by]
        return sorted(current)

    def _unsealed(self) -> Iterator[Fault]:
        for folder in _SEALED_FOLDERS:
            for path in sorted((self.folder / folder).rglob("*")):
                place = path.relative_to(self.folder)
                own = any(place.match(f"recordings/*/*/{name}") for name in (KNOWN, _SAMPLE_FILES))
                declared = own or path.is_dir() or place.as_posix() in self._left
                if not declared and sealing.is_visible(place):
                    yield self._stray(place.as_posix())
        # The latest, and the state.
        for path in sorted((self.folder / sealing.NIGHTS).glob("[ls]*.*")):
            name = path.relative_to(self.folder).as_posix()
            if name not in self._left:
                yield self._fault(name, _NO_SEAL, sealing.NIGHTS + "/")

    def _stray(self, name: str) -> Fault:
        return Fault(name, _NO_SEAL, self._removed(name))

    def _fault(self, name: str, found: str, place: str) -> Fault:
        mend = self._removed(name)
        if place.startswith(f"{sealing.NIGHTS}/"):
            files = (
                [name]
                if place == f"{sealing.NIGHTS}/"
                else dict.fromkeys([name, sealing.name_seal_file(place)])
            )
            rm = " ".join(["rm -f", *map(self._quoted, files)])
            mend = f"restore it, or {rm}: the next night writes its own"
        elif place.startswith("recordings/") and place not in self._current:
            folder = self._quoted("/".join(place.split("/")[:3]))
            mend = f"restore it, or rm -r {folder}: its log is in no comparison any more"
        return Fault(name, found, mend)

    def _removed(self, name: str) -> str:
        path = self.folder / name
        if not os.path.lexists(path):
            return self.run_again
        rm = "rm -r" if path.is_dir() and not path.is_symlink() else "rm"
        return f"{rm} {self._quoted(name)} && {self.run_again}"

    def _quoted(self, name: str) -> str:
        return shlex.quote(str(self.folder / name))


def _of(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"found a file that cannot be read ({error.strerror})"
    return "found other content"
