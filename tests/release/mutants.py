"""How many small faults in the code the tests find: mutants, drawn at random.

Each is one operator, comparison, number or condition changed in a copy of the package. Against it
run the tests of every day that run its line, workflows and browsers apart: of the files nearest to
its module first, the quickest first, to the first that fails. What changes no result is not drawn:
annotations, exports, what a decorator keeps or compiles, the words of errors. What was looked at
and changes no value is in ``equivalent_mutants.yaml``, and counted apart. What makes the mutants
comes with ``pip install -e '.[release]'``.

    python -m tests.release.mutants --room noise --mutants 40 --kept /tmp/mutants
    python -m tests.release.mutants --again /tmp/mutants/noise-1-120000.jsonl --kept /tmp/mutants

A mutant that no test finds is printed with its change. ``--kept`` has all of them as JSON, and what
tests do without mutants, so that another run begins at once; ``--again`` runs those of an earlier
run that were not found.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import json
import multiprocessing
import random
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path

import yaml
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from tests.release.mutant_runs import PACKAGE, copied, prepare
from tests.release.mutant_tests import (
    EQUIVALENT,
    KILLED,
    NOT_COVERED,
    OUTCOMES,
    SURVIVED,
    TIMED_OUT,
    judged_as,
)

ROOMS = {
    "allan": "allan/**/*.py",
    "noise": "noise/**/*.py",
    "units": "units.py",
    "estimators": "estimators/**/*.py",
}
EQUIVALENTS = Path(__file__).with_name("equivalent_mutants.yaml")
ENOUGH = 0.85

_OPERATOR = re.compile(
    r"core/("
    r"ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|FloorDiv_Div|Mod_Mul)"
    r"|ReplaceComparisonOperator_(Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt|Eq_NotEq"
    r"|NotEq_Eq|Is_IsNot|IsNot_Is)|ReplaceUnaryOperator_USub_UAdd|ReplaceUnaryOperator_Delete_Not"
    r"|ReplaceAndWithOr|ReplaceOrWithAnd|ReplaceTrueWithFalse|ReplaceFalseWithTrue|AddNot"
    r"|ReplaceContinueWithBreak|ReplaceBreakWithContinue|NumberReplacer|ZeroIterationForLoop)"
)

Place = tuple[int, int]


@dataclass(frozen=True)
class Mutant:
    """One change of a module."""

    module: Path
    operator: str
    occurrence: int
    place: Place

    def code(self) -> str | None:
        """Return the module with the change; None where it is no Python, or no change."""
        text = self.module.read_text()
        changed = mutate_code(text, get_operator(self.operator)(), self.occurrence)
        try:
            tree = ast.parse(str(changed))
        except SyntaxError:
            return None
        return None if ast.dump(tree) == ast.dump(ast.parse(text)) else str(changed)

    def change(self) -> tuple[str, str, str]:
        """Return the module, and its lines that change, as they were and as they become."""
        lines = [line.strip() for line in self.difference().splitlines()]
        was, becomes = (
            " ".join(word for line in lines if line[0] == sign for word in line[1:].split())
            for sign in "-+"
        )
        return str(self.module.relative_to(PACKAGE)), was, becomes

    def difference(self) -> str:
        """Return the lines that change."""
        lines = self.module.read_text().splitlines(), (self.code() or "").splitlines()
        changed = [
            line
            for line in difflib.unified_diff(*lines, lineterm="", n=0)
            if line[:1] in "+-" and line[:3] not in ("+++", "---")
        ]
        return "\n".join(f"    {line}" for line in changed)


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant."""

    module: str
    operator: str
    occurrence: int
    line: int
    change: str
    outcome: str
    test: str
    """The test that found it."""
    seconds: float


@cache
def mutants_of(module: Path) -> tuple[Mutant, ...]:
    """Return the mutants of a module, those without any effect apart."""
    text = module.read_text()
    nodes, without = list(ast_nodes(get_ast(text))), list(_without_effect(text))
    found = []
    for name in filter(_OPERATOR.fullmatch, operator_names()):
        operator = get_operator(name)()
        places = (begin for node in nodes for begin, _ in operator.mutation_positions(node))
        for occurrence, begin in enumerate(places):
            if not any(first <= begin < last for first, last in without):
                found.append(Mutant(module, name, occurrence, begin))
    return tuple(found)


_TYPES = {"TypeVar", "NewType"}
_CHECKS = {"strict", "check_finite", "overwrite_a", "overwrite_b", "repr"}
"""Arguments that check what always holds, save memory, or tell what is shown."""


def _without_effect(text: str) -> Iterator[tuple[Place, Place]]:
    """Yield where what is written changes no result."""
    lines = text.splitlines()

    def place(line: int, column: int) -> Place:
        return line, len(lines[line - 1].encode()[:column].decode())  # Python counts bytes

    for node in ast.walk(ast.parse(text)):
        for part in _parts_without_effect(node):
            end = part.end_lineno or 0, part.end_col_offset or 0
            yield place(part.lineno, part.col_offset), place(*end)


def _parts_without_effect(node: ast.AST) -> Iterator[ast.expr | ast.stmt | ast.keyword]:
    match node:
        case ast.arg(annotation=ast.expr() as annotation):
            yield annotation
        case ast.AnnAssign():
            yield node.annotation
        case ast.FunctionDef():
            if node.returns is not None:
                yield node.returns
            yield from (one for one in node.decorator_list if isinstance(one, ast.Call))
        case ast.ClassDef():
            yield from (one for one in node.decorator_list if isinstance(one, ast.Call))
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            if name in _TYPES:
                yield node
            if name == "cast":
                yield node.args[0]
            yield from (one for one in node.keywords if one.arg in _CHECKS)
        case ast.Raise(exc=ast.Call(args=words)):
            yield from words
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            yield node


@cache
def equivalents() -> frozenset[tuple[str, str, str]]:
    """Return the changes that are known to change no value.

    Raises
    ------
    ValueError
        If a line is no longer in its module.
    """
    found = set()
    for module, changes in yaml.safe_load(EQUIVALENTS.read_text()).items():
        text = " ".join((PACKAGE / module).read_text().split())
        for one in changes:
            was, becomes = (" ".join(one[key].split()) for key in ("was", "becomes"))
            if was not in text:
                raise ValueError(f"{EQUIVALENTS.name}: {module} has no line {was!r} any more")
            found.add((module, was, becomes))
    return frozenset(found)


def judged(mutant: Mutant, source: Path, most: float, further: int) -> Outcome:
    """Return what becomes of a mutant."""
    begin = time.monotonic()
    code = mutant.code()
    assert code is not None
    outcome, test = EQUIVALENT, ""
    if mutant.change() not in equivalents():
        outcome, test = judged_as(mutant.module, mutant.place[0], code, source, most, further)
    return Outcome(
        str(mutant.module.relative_to(PACKAGE)),
        mutant.operator,
        mutant.occurrence,
        mutant.place[0],
        mutant.difference(),
        outcome,
        test,
        round(time.monotonic() - begin, 1),
    )


def drawn(room: str, number: int, seed: int) -> list[Mutant]:
    """Return mutants of a room drawn at random."""
    every = [
        mutant for module in sorted(PACKAGE.glob(ROOMS[room])) for mutant in mutants_of(module)
    ]
    random.Random(seed).shuffle(every)
    taken = []
    for mutant in every:
        if len(taken) == number:
            break
        if mutant.code() is not None:
            taken.append(mutant)
    return taken


def left_in(report: Path) -> list[Mutant]:
    """Return the mutants that an earlier run did not find, where the module is as it was."""
    outcomes = [Outcome(**json.loads(line)) for line in report.read_text().splitlines()]
    left = {
        (one.module, one.operator, one.occurrence)
        for one in outcomes
        if one.outcome in (SURVIVED, NOT_COVERED)
    }
    modules = [PACKAGE / name for name in sorted({name for name, _, _ in left})]
    return [
        mutant
        for module in modules
        for mutant in mutants_of(module)
        if (str(module.relative_to(PACKAGE)), mutant.operator, mutant.occurrence) in left
    ]


def main() -> int:
    """Print the mutants that survive, and how many were found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", nargs="+", choices=list(ROOMS), default=list(ROOMS))
    parser.add_argument("--mutants", type=int, default=40, help="of each room")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="at a time, of one core each")
    parser.add_argument("--seconds", type=float, default=60.0, help="of tests against one mutant")
    parser.add_argument("--further", type=int, default=4, help="files of tests besides the nearest")
    parser.add_argument("--kept", type=Path, help="folder for what tests do without mutants")
    parser.add_argument("--again", type=Path, help="JSON of a run: those that it did not find")
    arguments = parser.parse_args()
    folder = arguments.kept or Path(tempfile.mkdtemp(prefix="mutants-"))
    folder.mkdir(parents=True, exist_ok=True)
    prepare()
    source = copied(folder)
    if arguments.again:
        samples = {arguments.again.stem: left_in(arguments.again)}
    else:
        samples = {room: drawn(room, arguments.mutants, arguments.seed) for room in arguments.room}
    table, enough = [], True
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(arguments.jobs, mp_context=context) as pool:
        for room, sample in samples.items():
            counts: Counter[str] = Counter()
            report = folder / f"{room}-{arguments.seed}-{time.strftime('%H%M%S')}.jsonl"
            for one in pool.map(
                partial(judged, source=source, most=arguments.seconds, further=arguments.further),
                sample,
            ):
                counts[one.outcome] += 1
                with report.open("a") as lines:
                    lines.write(f"{json.dumps(asdict(one))}\n")
                if one.outcome in (SURVIVED, NOT_COVERED):
                    print(f"{one.module}:{one.line} {one.outcome}\n{one.change}", flush=True)
            table.append(_row(room, counts))
            enough &= _share(counts)[0] >= ENOUGH
    print(f"{'room':<11} drawn {'  '.join(OUTCOMES)}  found of the others (95 %)")
    print("\n".join(table))
    return int(not enough)


def _share(counts: Counter[str]) -> tuple[float, float, float]:
    """Return the part found of what can be found, and the limits of its Wilson interval."""
    from scipy.stats import binomtest

    can, found = counts.total() - counts[EQUIVALENT], counts[KILLED] + counts[TIMED_OUT]
    if not can:
        return 1.0, 0.0, 1.0
    interval = binomtest(found, can).proportion_ci(method="wilson")
    return found / can, interval.low, interval.high


def _row(room: str, counts: Counter[str]) -> str:
    numbers = "  ".join(f"{counts[outcome]:>{len(outcome)}}" for outcome in OUTCOMES)
    share, low, high = _share(counts)
    return f"{room:<11} {counts.total():>5} {numbers}  {share:.0%} ({low:.0%} to {high:.0%})"


if __name__ == "__main__":
    sys.exit(main())
