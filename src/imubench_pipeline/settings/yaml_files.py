"""Read YAML files, which may be untrusted: size, depth and number of nodes are limited.

Text is not converted, as YAML 1.1 does (0017 is 15, ``no`` is false): a plain word is a text,
unless it is null or a number. A number keeps its notation, for settings of type text
(`validation.Strict`). A key is a text, and a duplicate key an error.
"""

import os
import re
import stat
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import yaml
from pydantic import BaseModel

from imubench_pipeline.settings.validation import ConfigError, UnavailableSettingsError, cut, parse

MAX_BYTES = 4 << 20  # largest size of a file, bytes
MAX_DEPTH = 40  # largest depth of nested lists and mappings

MAX_NODES = 200_000
"""Largest number of keys and values of a file; the nodes of an alias count at each use."""

MAX_NUMBER_LENGTH = 100  # largest number of characters of a number

if TYPE_CHECKING:
    _SAFE = yaml.SafeLoader
else:
    # The same loader in C, which is ten times as fast.
    _SAFE = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_Model = TypeVar("_Model", bound=BaseModel)
_TAG_PREFIX = "tag:yaml.org,2002:"
_MERGE_TAG = f"{_TAG_PREFIX}merge"
_TEXT_TAGS = {f"{_TAG_PREFIX}str", f"{_TAG_PREFIX}binary"}


class _Written:
    """A number that keeps its notation, which errors show."""

    written: str

    def __str__(self) -> str:
        return self.written

    __repr__ = __str__


class Integer(_Written, int):
    """An integer that keeps its notation."""


class Decimal(_Written, float):
    """A number with decimals that keeps its notation."""


class _Loader(_SAFE):
    yaml_implicit_resolvers = {}  # noqa: RUF012  # PyYAML declares it as one of an instance

    def construct_integer(self, node: yaml.ScalarNode) -> Integer:
        """Return an integer in base 10 or 16."""
        text = node.value.replace("_", "")
        number = Integer(text, 16 if text.lstrip("+-")[:2] == "0x" else 10)
        number.written = node.value
        return number

    def construct_decimal(self, node: yaml.ScalarNode) -> Decimal:
        number = Decimal(self.construct_yaml_float(node))
        number.written = node.value
        return number

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            if key_node.tag == _MERGE_TAG:
                continue
            if isinstance(key_node, yaml.ScalarNode):
                key_node.tag = f"{_TAG_PREFIX}str"
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable):
                if key in seen:
                    raise _make_fault(key_node, f"the key {cut(key)} occurs twice; remove one")
                seen.add(key)
        return super().construct_mapping(node, deep=deep)

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        figure = isinstance(node, yaml.ScalarNode) and node.tag not in _TEXT_TAGS
        if figure and len(node.value) > MAX_NUMBER_LENGTH:
            kind = cut(node.tag.rpartition(":")[2], str)
            raise _make_fault(
                node,
                f"{kind} of {len(node.value)} characters; expected at most {MAX_NUMBER_LENGTH}",
            )
        try:
            return super().construct_object(node, deep=deep)
        except (ValueError, LookupError, AttributeError) as error:
            # Errors of the constructors for a text that does not match its tag.
            if not isinstance(node, yaml.ScalarNode):
                raise
            kind = node.tag.rpartition(":")[2]
            raise _make_fault(node, f"{cut(node.value)} is no {cut(kind, str)}") from error


_Loader.add_constructor(f"{_TAG_PREFIX}int", _Loader.construct_integer)
_Loader.add_constructor(f"{_TAG_PREFIX}float", _Loader.construct_decimal)
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
    _Loader.add_implicit_resolver(f"{_TAG_PREFIX}{_kind}", re.compile(rf"^(?:{_pattern})$"), _first)


def _make_fault(at: Any, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=at.start_mark)


def read_yaml(path: Path) -> object:
    """Read one YAML file; raises a `ConfigError` with the line of the fault."""
    try:
        text = _read_text(path)
        if unseen := yaml.reader.Reader.NON_PRINTABLE.search(text):
            line = text.count("\n", 0, unseen.start()) + 1
            problem = f"U+{ord(unseen[0]):04X} is no printable character; remove it"
            raise ConfigError(f"{path}, line {line}: not readable as YAML: {problem}")
        # The limits of depth and size are checked on the events, before any object is built.
        sizes: dict[str, int] = {}
        open_nodes: list[tuple[str | None, int]] = []  # anchor and nodes before it
        nodes = 0
        for event in yaml.parse(text, Loader=_SAFE):
            if isinstance(event, yaml.AliasEvent):
                if event.anchor in (anchor for anchor, _ in open_nodes):
                    raise _make_fault(
                        event, f"*{cut(event.anchor, str)} contains itself; remove it"
                    )
                nodes += sizes.get(event.anchor or "", 1)
            elif isinstance(event, yaml.CollectionStartEvent):
                open_nodes.append((event.anchor, nodes))
                nodes += 1
                if len(open_nodes) > MAX_DEPTH:
                    depth = f"more than {MAX_DEPTH} levels deep; use fewer levels"
                    raise _make_fault(event, f"lists and mappings are nested {depth}")
            elif isinstance(event, yaml.CollectionEndEvent):
                anchor, before = open_nodes.pop()
                if anchor is not None:
                    sizes[anchor] = nodes - before
            elif isinstance(event, yaml.ScalarEvent):
                nodes += 1
                if event.anchor is not None:
                    sizes[event.anchor] = 1
            if nodes > MAX_NODES:
                raise _make_fault(event, f"found more than {MAX_NODES} keys and values; split it")
        return yaml.load(text, Loader=_Loader)
    except ConfigError:
        raise
    except FileNotFoundError:
        reason = f"{path}: no such file; expected a YAML file: check its name"
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
    """Return all ``.yaml`` files of folders as models by name, with errors for invalid ones.

    A later folder has precedence; a missing one raises a `ConfigError`. ``each``: what a file
    describes, such as ``sensor``, for errors.
    """
    models: dict[str, _Model | ConfigError] = {}
    for name, path in list_files(folders, each).items():
        try:
            models[name] = read_settings(model, path)
        except ConfigError as error:
            models[name] = error
    return models


def list_files(folders: Path | Iterable[Path], each: str) -> dict[str, Path]:
    """Return the paths of the files of `read_folder` by name; raises `ConfigError`."""
    files: dict[str, Path] = {}
    for folder in [folders] if isinstance(folders, Path) else folders:
        if not folder.is_dir():
            raise ConfigError(f"{folder}: no such folder; expected a YAML file for each {each}")
        files |= {path.stem: path for path in folder.glob("*.yaml")}
    return dict(sorted(files.items(), key=lambda file: file[1].name))


def require_valid(read: Mapping[str, _Model | ConfigError]) -> dict[str, _Model]:
    """Return the models of `read_folder` if all are valid; else raise the first error."""
    models = {}
    for name, model in read.items():
        if isinstance(model, ConfigError):
            raise model
        models[name] = model
    return models


def _read_text(path: Path) -> str:
    """Return the text of a regular file; devices and pipes are rejected, since they may block."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise ConfigError(f"{path}: is not a regular file; expected a YAML file")
    with os.fdopen(descriptor, "rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise ConfigError(
            f"{path}: larger than {MAX_BYTES >> 20} MB; expected settings, not a log: check its "
            "name"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{path}, line {line}: byte 0x{content[error.start]:02X} is not UTF-8; save the file "
            "as UTF-8"
        ) from None
