"""Which tests look at a changed line, nearest first, and what becomes of the change under them."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path

from tests.release.mutant_runs import PACKAGE, PROJECT, run, seen

KILLED, TIMED_OUT, SURVIVED, NOT_COVERED, EQUIVALENT = OUTCOMES = (
    "killed",
    "timed out",
    "survived",
    "not covered",
    "equivalent",
)

_FAR = (4, 0)
"""From here on tests neither have a name like that of a module, nor use what it defines."""

ELSEWHERE = {"workflow", "browser", "slurm", "release", "report", "benchmarks"}
"""Folders of tests of what is far above, and slow."""

_PATIENCE, _GRACE, _COMPILING = 5.0, 5.0, 60.0
"""A test that takes so many times longer than without the mutant, and some seconds, never ends: it
is found. Kernels that are compiled anew have a minute more."""

_QUICK = 0.3
"""Seconds of a test that runs before the others."""


@cache
def tests_of(module: Path) -> tuple[Path, ...]:
    """Return tests that import a module, or what imports it, those nearest to it first."""
    names = {_dotted(module)}
    for handed_on in True, True, False, True, True:  # by packages, and by what imports it
        importers = _importers(names)
        names |= {_dotted(path) for path in importers if path.stem == "__init__" or not handed_on}
    tests = [
        path
        for path in (PROJECT / "tests").rglob("test_*.py")
        if not ELSEWHERE & set(path.parts)
        and any(_imports(path.read_text(), name) for name in names)
        and _distance(path, module) < _FAR
    ]
    return tuple(sorted(tests, key=lambda path: (*_distance(path, module), path.stat().st_size)))


@cache
def _distance(tests: Path, module: Path) -> tuple[int, int]:
    """Return how far tests are from a module: by its name, its room, and what they use of it."""
    name, text = tests.stem.removeprefix("test_"), tests.read_text()
    by_name = (name == module.stem) + bool(set(name.split("_")) & set(module.stem.split("_")))
    words = set(re.findall(r"\w+", text))
    used = len(words & _names(module))
    direct = used > 0 and _imports(text, _dotted(module))
    through = sum(len(words & _names(path)) for path in _importers({_dotted(module)}))
    rooms = set(module.relative_to(PACKAGE).parts[:-1])
    return 4 - by_name - direct - bool(rooms & {name, *tests.parts}), -2 * used - through


@cache
def _names(module: Path) -> frozenset[str]:
    """Return what a module defines for others."""
    return frozenset(
        node.name
        for node in ast.parse(module.read_text()).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name[0] != "_"
    )


def _importers(names: set[str]) -> list[Path]:
    return [path for path in sorted(PACKAGE.rglob("*.py")) if any(map(_of(path), names))]


@cache
def _of(path: Path) -> Callable[[str], bool]:
    return cache(partial(_imports, path.read_text()))


def _dotted(module: Path) -> str:
    parts = module.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(text: str, name: str) -> bool:
    package, _, last = name.rpartition(".")
    direct = rf"^\s*from {re.escape(name)} import|^\s*import {re.escape(name)}\b"
    among = rf"^\s*from {re.escape(package)} import (\([^)]*\b{last}\b|.*\b{last}\b)"
    return re.search(f"{direct}|{among}", text, re.MULTILINE) is not None


def _statement(module: Path, line: int) -> tuple[range, bool, bool]:
    """Return the lines of a statement, and whether importing runs it, or compiled code."""
    lines, imported, compiled = range(line, line + 1), True, False
    for node in ast.walk(ast.parse(module.read_text())):  # the outer ones first
        if not isinstance(node, ast.stmt) or not node.lineno <= line <= (node.end_lineno or 0):
            continue
        body = getattr(node, "body", None)
        last = body[0].lineno if body and body[0].lineno > node.lineno else node.end_lineno or 0
        lines = range(node.lineno, last + 1) if line <= last else lines
        if isinstance(node, ast.FunctionDef) and line >= node.body[0].lineno:
            imported = False
            compiled |= any("njit" in ast.unparse(one) for one in node.decorator_list)
    return lines, imported, compiled


def tests_against(
    module: Path, line: int, files: Sequence[Path], source: Path, most: float
) -> dict[str, float]:
    """Return the tests that run a line, the quickest first, with their seconds.

    Of a file whose tests share what they compute, the others come last. What takes longer than
    `most` seconds altogether is left out. Of compiled code nothing sees which lines run: all tests
    count of a file that imports its module, or that run lines of a module that does.
    """
    lines, imported, compiled = _statement(module, line)
    own = str(module.relative_to(PACKAGE))
    near = {own}
    if compiled:
        near |= {str(path.relative_to(PACKAGE)) for path in _importers({_dotted(module)})}
    ranked: list[tuple[int, float, str, float]] = []
    for path in files:
        file = seen(path, source)
        direct = compiled and _imports(path.read_text(), _dotted(module))
        run = {
            name
            for name, (_, rows) in file.tests.items()
            if direct
            or (near & set(rows) if imported or compiled else set(lines) & set(rows.get(own, ())))
        }
        if imported and own in file.imported and not run:
            run = set(file.tests)
        cost = sum(file.tests[name][0] for name in run)
        for name, (seconds, _) in file.tests.items():
            if name in run or (run and file.shares):
                phase = 2 if name not in run else int(seconds > _QUICK)
                ranked.append((phase, cost, name, seconds))
    ranked.sort(key=lambda one: (*one[:2], one[2].partition("::")[0], one[3]))
    taken, total = {}, 0.0
    for *_, name, seconds in ranked:
        total += seconds
        if taken and total > most:
            break
        taken[name] = seconds
    return taken


def judged_as(
    module: Path, line: int, code: str, source: Path, most: float, further: int = 4
) -> tuple[str, str]:
    """Return what becomes of a module with a changed line, and which test has found it.

    The tests nearest to it run first, those of further files if these do not find it, and as many
    files again, one by one, while none of them runs the line.
    """
    files = tests_of(module)
    nearest = [
        path for path in files if _distance(path, module)[0] == _distance(files[0], module)[0]
    ][:3]
    kernels = "njit" in code
    stale = [str(path.relative_to(PACKAGE)) for path in _all_importers(module)] if kernels else []
    outcome = NOT_COVERED
    others = [path for path in files if path not in nearest]
    stages = [nearest, others[:further], *([path] for path in others[further : 2 * further])]
    for place, stage in enumerate(stages):
        if place > 1 and outcome == SURVIVED:
            break
        tests = tests_against(module, line, stage, source, most)
        if not tests:
            continue
        slowest: Counter[str] = Counter()
        for name, seconds in tests.items():
            file = name.partition("::")[0]
            slowest[file] = max(slowest[file], seconds)  # a fixture may be made by any test
        besides = _COMPILING if kernels else _GRACE
        limits = [(name, _PATIENCE * slowest[name.partition("::")[0]] + besides) for name in tests]
        ended = run(module.relative_to(PACKAGE), code, limits, source, stale)
        if ended.failed:
            return TIMED_OUT if ended.timed_out else KILLED, ended.last
        outcome = SURVIVED
    return outcome, ""


@cache
def _all_importers(module: Path) -> list[Path]:
    """Return the modules that import one, directly or not."""
    found, names = set[Path](), {_dotted(module)}
    while (further := set(_importers(names))) - found:
        found |= further
        names = {_dotted(path) for path in further}
    return sorted(found)
