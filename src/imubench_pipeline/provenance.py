"""Which code a result comes from."""

from __future__ import annotations

import ast
import hashlib
from functools import lru_cache
from pathlib import Path

_PACKAGE = Path(__file__).parent
_NAME = _PACKAGE.name


def source_digest(*modules: str) -> str:
    """Return a digest of modules of this package and of all that they import from it.

    Of a package of which a module is used, its other files count too: templates, texts.

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
            todo += _imports(path)
    folders = {path.parent for path in seen} - {_PACKAGE}
    seen |= {path for folder in folders for path in _data_files(folder)}
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


@lru_cache(maxsize=64)
def _data_files(folder: Path) -> tuple[Path, ...]:
    """Return the files of a package that are no modules."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return tuple(path for path in files if path.suffix != ".py" and "__pycache__" not in path.parts)


@lru_cache(maxsize=256)
def _imports(path: Path) -> tuple[Path, ...]:
    found = []
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == _NAME:
            base = ".".join((node.module or "").split(".")[1:])
            if base:
                found.append(_path(base))
            for alias in node.names:
                name = f"{base}.{alias.name}".lstrip(".")
                try:
                    found.append(_path(name))
                except ValueError:
                    continue
    return tuple(found)
