"""Registry of the extensions, which the core never imports directly.

Each declares one `Extension`, as ``EXTENSION``. Its contributions are named by references, such as
``"aided.limits:yield_outage_rows"``: an object of a module in `extensions/`, imported when the core
asks for it through a `Hook`, which states its type. So each process of a run imports only what it
needs.
"""

import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

FOLDER = Path(__file__).with_name("extensions")
"""Folder of the extensions; without it there are none."""

T = TypeVar("T")

Place = Literal["run", "notes", "simulated"]
"""Files that have blocks of settings: the configuration, the notes beside a log, a simulated
recording."""


@dataclass(frozen=True)
class Block:
    """A block of settings that an extension adds to one kind of file."""

    place: Place
    key: str  # of the block in the file
    model: str  # reference to its pydantic class
    description: str = ""


@dataclass(frozen=True)
class Extension:
    """Contributions of one extension; references are relative to the folder `extensions/`."""

    name: str
    needs: tuple[str, ...] = ()  # other extensions, without which it is not used
    tables: str | None = None  # the module with the classes of its rows
    blocks: tuple[Block, ...] = ()  # blocks of settings
    rules: str | None = None  # file of its rules for Snakemake
    motions: Mapping[str, str] = field(default_factory=dict)  # simulated motions, by block
    simulations: Mapping[str, str] = field(default_factory=dict)  # simulated sensors, by block
    formats: Mapping[str, str] = field(default_factory=dict)  # formats of log files, by `reader`
    limits: Mapping[str, str] = field(default_factory=dict)  # errors to judge, by their table
    sensor_tables: Mapping[str, str] = field(default_factory=dict)  # tables of one sensor, by name
    drawings: tuple[str, ...] = ()  # figures of all sensors for print
    theory_figure: str | None = None  # figure for the page of theory
    commands: Mapping[str, str] = field(default_factory=dict)  # commands of `imubench`, by name
    library: Mapping[str, str] = field(default_factory=dict)  # functions of the library, by name
    sensor_commands: tuple[str, ...] = ()  # commands shown on the page of a sensor
    listings: tuple[str, ...] = ()  # further tables of `imubench formats`
    pages: tuple[str, ...] = ()  # pages that a report has once
    recording_pages: Mapping[str, str] = field(default_factory=dict)  # by kind of recording
    sections: tuple[str, ...] = ()  # sections of pages that a report has once
    recording_sections: tuple[str, ...] = ()  # sections of the page of a static recording
    search: tuple[str, ...] = ()  # names that the search of the report finds
    templates: str | None = None  # folder
    static: str | None = None  # folder with scripts of the pages


@cache
def installed_extensions() -> tuple[Extension, ...]:
    """Return the installed extensions whose needs are installed too, in alphabetical order."""
    names = sorted(module.name for module in pkgutil.iter_modules([str(FOLDER)]) if module.ispkg)
    found: list[Extension] = [
        import_module(f"{__package__}.extensions.{name}").EXTENSION for name in names
    ]
    return tuple(one for one in found if set(one.needs) <= set(names))


File = Literal["rules", "templates", "static"]
"""Files and folders that an extension may have."""


def files_of(what: File) -> list[Path]:
    """Return the path of one kind of file or folder, in each extension that has it."""
    stated = ((one.name, getattr(one, what)) for one in installed_extensions())
    return [FOLDER / name / file for name, file in stated if file is not None]


class Hook(Generic[T]):
    """A hook of the core, to which extensions add objects of one type.

    ``name`` is a field of `Extension`. A digest of the code of a step includes the modules to which
    the references in this field lead (`sources`).
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def objects(self) -> list[T]:
        """Return the objects of all extensions."""
        return list(self.by_key().values())

    def by_key(self) -> dict[str, T]:
        """Return the objects of all extensions by key; the default key is the reference."""
        return {key: load(reference) for key, reference in references(self._name).items()}


def references(hook: str) -> dict[str, str]:
    """Return the references of all extensions for a hook by key, by default the reference."""
    found: dict[str, str] = {}
    for extension in installed_extensions():
        stated = getattr(extension, hook)
        if isinstance(stated, Mapping):
            found |= stated
        elif stated is not None:
            found |= {one: one for one in ([stated] if isinstance(stated, str) else stated)}
    return found


def blocks(place: Place) -> dict[str, Block]:
    """Return the blocks of settings that extensions add to one kind of file, by key."""
    every = (block for extension in installed_extensions() for block in extension.blocks)
    return {block.key: block for block in every if block.place == place}


def load(reference: str) -> Any:
    """Import the object that a reference names, or its module if it names no object."""
    module, _, name = reference.partition(":")
    loaded = import_module(f"{__package__}.extensions.{module}")
    return getattr(loaded, name) if name else loaded


def find_function(name: str) -> Any:
    """Return a library function that an extension adds; raise ImportError if none adds it."""
    added = references("library")
    if name not in added:
        raise ImportError(
            f"{__package__}.{name} belongs to an extension that is not installed; reinstall the "
            "package with all folders of extensions/"
        )
    return load(added[name])


def sources(of: str, name: str) -> list[Path]:
    """Return the files of extensions that a module loads through the registry.

    ``of`` is the call in the module, ``Hook``, ``blocks``, ``with_blocks`` or ``files_of``;
    ``name`` is the argument of this call.
    """
    used = installed_extensions()
    if of == "files_of":
        files = (getattr(one, name) and FOLDER / one.name / getattr(one, name) for one in used)
        inside = ([path, *path.rglob("*")] for path in files if path)
        return [path for path in chain.from_iterable(inside) if path.is_file()]
    if of == "Hook":
        stated = list(references(name).values())
    else:
        stated = [block.model for one in used for block in one.blocks if block.place == name]
    return [FOLDER / f"{one.partition(':')[0].replace('.', '/')}.py" for one in stated]
