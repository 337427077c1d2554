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
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path

import yaml
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from tests.release.mutant_runs import PACKAGE, PROJECT, copied, prepare, run, seen

ROOMS = {
    "allan": "allan/**/*.py",
    "noise": "noise/**/*.py",
    "units": "units.py",
    "estimators": "estimators/**/*.py",
}
KILLED, TIMED_OUT, SURVIVED, NOT_COVERED, EQUIVALENT = OUTCOMES = (
    "killed",
    "timed out",
    "survived",
    "not covered",
    "equivalent",
)
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
_FAR = (4, 0)
"""From here on tests neither have a name like that of a module, nor use what it defines."""

ELSEWHERE = {"workflow", "browser", "slurm", "release", "report", "benchmarks"}
"""Folders of tests of what is far above, and slow."""

_PATIENCE, _GRACE, _COMPILING = 5.0, 5.0, 60.0
"""A test that takes so many times longer than without the mutant, and some seconds, never ends: it
is found. Kernels that are compiled anew have a minute more."""

_QUICK = 0.3
"""Seconds of a test that runs before the others."""

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
    `most` seconds altogether is left out.
    """
    lines, imported, compiled = _statement(module, line)
    own = str(module.relative_to(PACKAGE))
    near = {own}
    if compiled:  # which nothing sees: what calls it
        near |= {str(path.relative_to(PACKAGE)) for path in _importers({_dotted(module)})}
    ranked: list[tuple[int, float, str, float]] = []
    for path in files:
        file = seen(path, source)
        run = {
            name
            for name, (_, rows) in file.tests.items()
            if (near & set(rows) if imported or compiled else set(lines) & set(rows.get(own, ())))
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


@cache
def _all_importers(module: Path) -> list[Path]:
    """Return the modules that import one, directly or not."""
    found, names = set[Path](), {_dotted(module)}
    while (further := set(_importers(names))) - found:
        found |= further
        names = {_dotted(path) for path in further}
    return sorted(found)


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
