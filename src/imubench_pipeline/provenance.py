"""Which code a result comes from."""

from __future__ import annotations

import ast
import hashlib
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

_PACKAGE = Path(__file__).parent
_NAME = _PACKAGE.name


def source_digest(*modules: str) -> str:
    """Return a digest of modules of this package and of all that they use of it.

    That is what they import, and what their texts name: another module in full, since some are
    imported by name when they are needed, or a file or folder beside the module, such as templates.

    Parameters
    ----------
    *modules : str
        Names below the package, such as ``allan`` or ``estimators.curve``.

    Raises
    ------
    ValueError
        If there is no such module.
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
    raise ValueError(f"no module {module!r} in {_NAME}")


@lru_cache(maxsize=256)
def _used(path: Path) -> tuple[Path, ...]:
    """Return the files of the package that a module uses by itself."""
    found: list[Path] = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            found += _named(node.value, path.parent)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == _NAME:
            base = ".".join((node.module or "").split(".")[1:])
            if base:
                found.append(_path(base))
            for alias in node.names:
                with suppress(ValueError):
                    found.append(_path(f"{base}.{alias.name}".lstrip(".")))
    return tuple(found)


def _named(text: str, folder: Path) -> Iterator[Path]:
    """Yield the modules, or the files in the folder of a module, that a text is the name of."""
    if text.startswith(_NAME + "."):
        with suppress(ValueError):
            yield _path(text.removeprefix(_NAME + "."))
    elif re.fullmatch(r"\w[\w.]*", text, re.ASCII):
        beside = folder / text
        if beside.is_file():
            yield beside
        elif beside.is_dir() and not (beside / "__init__.py").exists():
            yield from (path for path in beside.rglob("*") if path.is_file())
