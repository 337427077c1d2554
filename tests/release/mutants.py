"""How many small faults in the code the tests find: mutants, drawn at random.

Each is one operator, comparison, number or condition changed in a copy of the package. Against it
run the tests of every day that import its module, workflows and browsers apart: a dozen files at
most. What makes them comes with ``pip install -e '.[release]'``.

    python -m tests.release.mutants --room noise --mutants 60
"""

from __future__ import annotations

import argparse
import ast
import difflib
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from tests.conftest import PROJECT

PACKAGE = PROJECT / "src/imubench_pipeline"
ROOMS = {
    "allan": "allan/**/*.py",
    "noise": "noise/**/*.py",
    "units": "units.py",
    "estimators": "estimators/**/*.py",
}

_OPERATOR = re.compile(
    r"core/("
    r"ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|FloorDiv_Div|Mod_Mul)"
    r"|ReplaceComparisonOperator_(Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt|Eq_NotEq"
    r"|NotEq_Eq|Is_IsNot|IsNot_Is)|ReplaceUnaryOperator_USub_UAdd|ReplaceUnaryOperator_Delete_Not"
    r"|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceTrueWithFalse|ReplaceFalseWithTrue|AddNot"
    r"|ReplaceContinueWithBreak|ReplaceBreakWithContinue|NumberReplacer|ZeroIterationForLoop)"
)
_MOST = 12
"""Test files against one mutant."""

_PATIENCE = 5.0
"""A mutant whose tests take so many times longer than without it never ends: it is found."""


@dataclass(frozen=True)
class Mutant:
    """One change of a module."""

    module: Path
    operator: str
    occurrence: int

    def code(self) -> str | None:
        """Return the module with the change; None where there is none."""
        changed = mutate_code(
            self.module.read_text(), get_operator(self.operator)(), self.occurrence
        )
        return None if changed is None else str(changed)

    def difference(self) -> str:
        """Return the lines that change."""
        lines = self.module.read_text().splitlines(), (self.code() or "").splitlines()
        changed = [
            line
            for line in difflib.unified_diff(*lines, lineterm="", n=0)
            if line[:1] in "+-" and line[:3] not in ("+++", "---")
        ]
        return "\n".join(f"    {line}" for line in changed)


def mutants_of(module: Path) -> Iterator[Mutant]:
    """Yield the mutants of a module, those of annotations and texts apart."""
    text = module.read_text()
    tree, unread = get_ast(text), _unread(text)
    for name in filter(_OPERATOR.fullmatch, operator_names()):
        operator = get_operator(name)()
        places = (
            begin for node in ast_nodes(tree) for begin, _ in operator.mutation_positions(node)
        )
        for occurrence, begin in enumerate(places):
            if not any(first <= begin < last for first, last in unread):
                yield Mutant(module, name, occurrence)


Place = tuple[int, int]


def _unread(text: str) -> list[tuple[Place, Place]]:
    """Return where annotations and the exports of a module stand: nothing runs them."""
    found: list[ast.expr | ast.stmt | None] = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.arg | ast.AnnAssign):
            found.append(node.annotation)
        elif isinstance(node, ast.FunctionDef):
            found.append(node.returns)
    return [
        ((node.lineno, node.col_offset), (node.end_lineno or 0, node.end_col_offset or 0))
        for node in found
        if node is not None
    ]


@cache
def tests_of(module: Path) -> tuple[str, ...]:
    """Return the tests of a module: by its name, or that import it, or else what imports it."""
    names = {_dotted(module)}
    for _ in range(3):
        tests = [
            path
            for path in (PROJECT / "tests").rglob("test_*.py")
            if not {"workflow", "browser", "slurm", "release"} & set(path.parts)
            and any(_imports(path.read_text(), name) for name in names)
        ]
        if tests:
            break
        names |= {
            _dotted(path)
            for path in PACKAGE.rglob("*.py")
            if any(_imports(path.read_text(), name) for name in names)
        }
    by_name = sorted(tests, key=lambda path: (module.stem not in path.stem, path.stat().st_size))
    return tuple(str(path) for path in by_name[:_MOST])


def _dotted(module: Path) -> str:
    parts = module.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(text: str, name: str) -> bool:
    package, _, last = name.rpartition(".")
    direct = rf"^\s*from {re.escape(name)} import|^\s*import {re.escape(name)}\b"
    among = rf"^\s*from {re.escape(package)} import (\([^)]*\b{last}\b|.*\b{last}\b)"
    return re.search(f"{direct}|{among}", text, re.MULTILINE) is not None


def survives(mutant: Mutant) -> bool:
    """Tell whether all tests of its module pass with a mutant."""
    code, tests = mutant.code(), tests_of(mutant.module)
    assert code is not None
    limit = _PATIENCE * _seconds(tests)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, PACKAGE.name)
        shutil.copytree(PACKAGE, copy)  # with what numba has compiled
        (copy / mutant.module.relative_to(PACKAGE)).write_text(code)
        try:
            return _run(tests, Path(folder), limit) in (0, 5)
        except subprocess.TimeoutExpired:
            return False


@cache
def _seconds(tests: tuple[str, ...]) -> float:
    """Return how long tests take that all pass."""
    begin = time.monotonic()
    if _run(tests, PACKAGE.parent, None) not in (0, 5):
        raise SystemExit(f"without a mutant not all pass of {' '.join(tests)}")
    return max(time.monotonic() - begin, 10.0)


def _run(tests: tuple[str, ...], source: Path, limit: float | None) -> int:
    threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "NUMBA")}
    given = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not release"]
    return subprocess.run(
        [sys.executable, "-m", "pytest", *given, *tests],
        cwd=PROJECT,
        env=os.environ | threads | {"PYTHONPATH": str(source)},
        capture_output=True,
        check=False,
        timeout=limit,
    ).returncode


def main() -> int:
    """Print the mutants that survive, and how many were found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", nargs="+", choices=list(ROOMS), default=list(ROOMS))
    parser.add_argument("--mutants", type=int, default=60, help="of each room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    enough = True
    for room in arguments.room:
        modules = sorted(PACKAGE.glob(ROOMS[room]))
        every = [mutant for module in modules for mutant in mutants_of(module)]
        drawn = random.Random(arguments.seed).sample(every, min(arguments.mutants, len(every)))
        left = 0
        with ThreadPoolExecutor(arguments.jobs) as pool:
            for mutant, survived in zip(drawn, pool.map(survives, drawn), strict=True):
                left += survived
                if survived:
                    print(
                        f"{mutant.module.relative_to(PACKAGE)}:\n{mutant.difference()}", flush=True
                    )
        share = 1.0 - left / len(drawn)
        enough &= share >= 0.85
        print(f"{room}: {share:.1%} of {len(drawn)} mutants are found, of {len(every)}", flush=True)
    return int(not enough)


if __name__ == "__main__":
    sys.exit(main())
