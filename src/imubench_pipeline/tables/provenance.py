"""Digest of the code that computes a result."""

import hashlib
import re
from contextlib import suppress
from functools import cache
from pathlib import Path

from imubench_pipeline.registry import sources

_PACKAGE = Path(__file__).parents[1]
_NAME = _PACKAGE.name

# A whole tree of each module's syntax would take as long to read as all logs of a run.
_IMPORT = re.compile(r"^ *from (\w+)((?:\.\w+)*) import (\([^)]*\)|.*)$", re.MULTILINE)
_IMPORTED = re.compile(r"(\w+)(?: as \w+)?")
_EXTENSIONS = re.compile(r"""\b(Hook|with_blocks|blocks|files_of)\(["'](\w+)["']\)""")
_TEXT = re.compile(r"""["'](\w[\w.]*\*?)["']""", re.ASCII)


def digest_sources(*modules: str) -> str:
    """Return a digest of ``modules`` of this package and of all code and files that they use.

    They use the modules that they import, extensions (`imubench_pipeline.registry`), and whatever a
    string in the code names: a module in full, all modules of a package (by a name that ends in
    ``.*``), or a file or folder beside the module. ``modules`` are names such as
    ``estimators.curve``. Raises a ValueError for an unknown module.
    """
    todo, seen = [_path(module) for module in modules], set()
    while todo:
        path = todo.pop()
        if path not in seen:
            seen.add(path)
            todo += _used(path) if path.suffix == ".py" else ()
    digest = hashlib.sha256()
    for path in sorted(seen):
        digest.update(str(path.relative_to(_PACKAGE)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def _path(module: str) -> Path:
    base = _PACKAGE.joinpath(*module.split("."))
    for path in (base.with_suffix(".py"), base / "__init__.py"):
        if path.is_file():
            return path
    raise ValueError(f"no module {module!r} in {_NAME}; expected a name like 'estimators.curve'")


@cache
def _used(path: Path) -> tuple[Path, ...]:
    text = path.read_text("utf-8")
    files: list[Path] = []
    for package, base, names in _IMPORT.findall(text):
        if package != _NAME:
            continue
        if base:
            files.append(_path(base[1:]))
        for name in _IMPORTED.findall(names):
            with suppress(ValueError):
                files.append(_path(f"{base}.{name}"[1:]))
    for call in _EXTENSIONS.findall(text):
        files += sources(*call)
    for name in dict.fromkeys(_TEXT.findall(text)):
        beside = path.parent / name
        if name.startswith(_NAME + ".") and name.endswith(".*"):
            package = _path(name.removeprefix(_NAME + ".").removesuffix(".*")).parent
            files += [*package.glob("*.py"), *package.glob("*/__init__.py")]
        elif name.startswith(_NAME + "."):
            with suppress(ValueError):
                files.append(_path(name.removeprefix(_NAME + ".")))
        elif beside.is_file():
            files.append(beside)
        elif beside.is_dir() and not (beside / "__init__.py").exists():
            files += [file for file in beside.rglob("*") if file.is_file()]
    return tuple(files)
