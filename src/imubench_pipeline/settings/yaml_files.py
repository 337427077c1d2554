"""The one way in which a file of YAML is read; such files come from strangers, too.

What is read is bounded before anything is built of it: size, depth, and nodes, those that stand
behind aliases counted each time. A key that stands twice is an error, whichever would win.

Text stays text. YAML 1.1 takes 0017 for 15, 12:30:45 for 45045, 2026-01-01 for a date and ``no``
for false. Here a plain word is a text, unless it is null or a decimal or hexadecimal number, and a
number keeps how it is written: a setting that is declared as text gets that (`validation.Strict`).
Where a setting is true or false, pydantic makes it of the word. A key is a text.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import yaml
from pydantic import BaseModel

from imubench_pipeline.settings.validation import (
    ConfigError,
    UnavailableSettingsError,
    cut,
    parse,
)

LARGEST = 4 << 20
"""Bytes of a file."""

DEEPEST = 40
"""Lists and mappings in each other."""

MOST = 200_000
"""Keys and values of a file; what an alias stands for counts where it stands."""

LONGEST_FIGURE = 100
"""Letters of a number."""

if TYPE_CHECKING:
    _SAFE = yaml.SafeLoader
else:
    # The same loader, ten times as fast where it is compiled.
    _SAFE = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_Model = TypeVar("_Model", bound=BaseModel)

_TAG = "tag:yaml.org,2002:"
_MERGED = f"{_TAG}merge"
_TEXTS = {f"{_TAG}str", f"{_TAG}binary"}


class Integer(int):
    """A whole number that keeps how it is written."""

    written: str

    def __str__(self) -> str:
        return self.written

    __repr__ = __str__  # errors show what the file has


class Decimal(float):
    """A number with decimals that keeps how it is written."""

    written: str

    def __str__(self) -> str:
        return self.written

    __repr__ = __str__  # errors show what the file has


class _Loader(_SAFE):
    """Builds plain values; refuses a key that stands twice."""

    yaml_implicit_resolvers = {}  # noqa: RUF012  # PyYAML declares it as one of an instance

    def construct_integer(self, node: yaml.ScalarNode) -> Integer:
        """Return a whole number in base 10 or 16."""
        text = node.value.replace("_", "")
        number = Integer(text, 16 if text.lstrip("+-")[:2] == "0x" else 10)
        number.written = node.value
        return number

    def construct_decimal(self, node: yaml.ScalarNode) -> Decimal:
        """Return a number with decimals."""
        number = Decimal(self.construct_yaml_float(node))
        number.written = node.value
        return number

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            if key_node.tag == _MERGED:
                continue
            if isinstance(key_node, yaml.ScalarNode):
                key_node.tag = f"{_TAG}str"
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable):
                if key in seen:
                    raise _fault(key_node, f"the key {cut(key)} stands twice; remove one")
                seen.add(key)
        return super().construct_mapping(node, deep=deep)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        figure = isinstance(node, yaml.ScalarNode) and node.tag not in _TEXTS
        if figure and len(node.value) > LONGEST_FIGURE:
            kind = cut(node.tag.rpartition(":")[2], str)
            raise _fault(node, f"{len(node.value)} letters are no {kind}; expected a shorter one")
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, LookupError, AttributeError) as error:
            # What the constructors make of a text that is not what its tag says.
            if not isinstance(node, yaml.ScalarNode):
                raise
            kind = node.tag.rpartition(":")[2]
            problem = f"{cut(node.value)} is no {cut(kind, str)}"
            raise _fault(node, problem) from error


_Loader.add_constructor(f"{_TAG}int", _Loader.construct_integer)
_Loader.add_constructor(f"{_TAG}float", _Loader.construct_decimal)
for _kind, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("int", r"[-+]?(0x[0-9a-fA-F_]+|[0-9][0-9_]*)", list("-+0123456789")),
    (
        "float",
        r"[-+]?[0-9][0-9_]*(\.[0-9_]*)?([eE][-+]?[0-9]+)?|[-+]?\.[0-9][0-9_]*([eE][-+]?[0-9]+)?"
        r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+0123456789."),
    ),
    ("merge", "<<", ["<"]),
):
    _Loader.add_implicit_resolver(f"{_TAG}{_kind}", re.compile(rf"^(?:{_pattern})$"), _first)


def _fault(at: Any, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=at.start_mark)


def read_yaml(path: Path) -> object:
    """Read one YAML file.

    Raises
    ------
    ConfigError
        If it is not there, no regular file, not YAML, too large, too deep, or has a key twice; the
        text names the line.
    """
    try:
        text = _text_of(path)
        if unseen := yaml.reader.Reader.NON_PRINTABLE.search(text):
            line = text.count("\n", 0, unseen.start()) + 1
            problem = f"U+{ord(unseen[0]):04X} is no printable character; remove it"
            raise ConfigError(f"{path}, line {line}: not readable as YAML: {problem}")
        _check(text)
        return yaml.load(text, Loader=_Loader)
    except ConfigError:
        raise
    except FileNotFoundError:
        reason = f"{path}: no such file; expected one of YAML: mend its name"
        raise UnavailableSettingsError(reason) from None
    except OSError as error:
        raise UnavailableSettingsError(f"{path}: cannot be read ({error.strerror})") from None
    except yaml.MarkedYAMLError as error:
        where = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        problem = cut(error.problem, str)
        raise ConfigError(f"{path}{where}: not readable as YAML: {problem}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{path}: not readable as YAML: {cut(error, str)}") from None


def read_settings(model: type[_Model], path: Path) -> _Model:
    """Read one YAML file as a model; raises `ConfigError`."""
    return parse(model, read_yaml(path), str(path))


def read_folder(
    model: type[_Model], folders: Path | Iterable[Path], each: str
) -> dict[str, _Model | ConfigError]:
    """Read every ``.yaml`` file of a folder, by name; of one that is of no use return why.

    Of several folders, a file takes the place of one of its name in a folder before.

    Raises
    ------
    ConfigError
        If there is no folder.
    """
    return {name: _read(model, path) for name, path in files_in(folders, each).items()}


def files_in(folders: Path | Iterable[Path], each: str) -> dict[str, Path]:
    """Return the ``.yaml`` files that `read_folder` reads, by name; raises `ConfigError`."""
    files: dict[str, Path] = {}
    for folder in [folders] if isinstance(folders, Path) else folders:
        if not folder.is_dir():
            raise ConfigError(f"{folder}: no such folder; expected one YAML file a {each}")
        files |= {path.stem: path for path in folder.glob("*.yaml")}
    return dict(sorted(files.items(), key=lambda file: file[1].name))


def _read(model: type[_Model], path: Path) -> _Model | ConfigError:
    try:
        return read_settings(model, path)
    except ConfigError as error:
        return error


def usable(read: Mapping[str, _Model | ConfigError]) -> dict[str, _Model]:
    """Return what `read_folder` has read, if all of it is of use; else raise the first error."""
    models = {}
    for name, model in read.items():
        if isinstance(model, ConfigError):
            raise model
        models[name] = model
    return models


def _text_of(path: Path) -> str:
    """Return the text of a regular file; what else there may be never ends, or does something."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise ConfigError(f"{path}: no regular file; expected one of YAML")
    with os.fdopen(descriptor, "rb") as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise ConfigError(
            f"{path}: larger than {LARGEST >> 20} MB; expected settings, not a log: check its name"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{path}, line {line}: byte 0x{content[error.start]:02X} is not UTF-8; save the file "
            "in that encoding"
        ) from None


def _check(text: str) -> None:
    """Refuse YAML that is deeper or larger than settings are, from its events alone."""
    sizes: dict[str, int] = {}
    open_nodes: list[tuple[str | None, int]] = []  # anchor and nodes before it
    nodes = 0
    for event in yaml.parse(text, Loader=_SAFE):
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in (anchor for anchor, _ in open_nodes):
                raise _fault(event, f"*{cut(event.anchor, str)} holds itself")
            nodes += sizes.get(event.anchor or "", 1)
        elif isinstance(event, yaml.CollectionStartEvent):
            open_nodes.append((event.anchor, nodes))
            nodes += 1
            if len(open_nodes) > DEEPEST:
                raise _fault(event, f"more than {DEEPEST} lists and mappings in each other")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = nodes - before
        elif isinstance(event, yaml.ScalarEvent):
            nodes += 1
            if event.anchor is not None:
                sizes[event.anchor] = 1
        if nodes > MOST:
            raise _fault(event, f"more than {MOST} keys and values, aliases counted")
