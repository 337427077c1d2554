"""The rooms of the package, and the arrows between them: docs/architecture.md."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import PROJECT, few

PACKAGE = PROJECT / "src/imubench_pipeline"
LINT = "import sys, importlinter.cli as cli; sys.exit(cli.lint_imports(no_cache=True))"

ROOMS = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
LEAVES = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__"}


def lint(source: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(source), "COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, "-c", LINT],
        cwd=PROJECT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_no_arrow_points_back() -> None:
    done = lint(PROJECT / "src")
    assert done.returncode == 0, done.stdout + done.stderr


# A module, what is written at its end, and what is said of it.
WRONG = {
    "back": (
        "noise/terms/flicker.py",
        "from imubench_pipeline.estimators.estimate import Estimate\n",
        "imubench_pipeline.noise is not allowed to import imubench_pipeline.estimators:",
    ),
    "files and models": (
        "readers/batch.py",
        "from imubench_pipeline.noise import NoiseModel\n",
        "imubench_pipeline.readers is not allowed to import imubench_pipeline.noise:",
    ),
    "settings of a run": (
        "navigation/ratios.py",
        "from imubench_pipeline.settings.config import Run\n",
        "imubench_pipeline.navigation is not allowed to import imubench_pipeline.settings.config:",
    ),
    "no room": ("flat.py", "\n", "- imubench_pipeline.flat\n"),
}


@pytest.mark.parametrize("names", few([list(WRONG)], [[name] for name in WRONG]), ids="-".join)
def test_an_arrow_back_or_a_module_in_no_room_is_found(names: list[str], tmp_path: Path) -> None:
    ignored = shutil.ignore_patterns("__pycache__", "*.nb?")
    shutil.copytree(PACKAGE, tmp_path / PACKAGE.name, ignore=ignored)
    for module, line, _ in map(WRONG.__getitem__, names):
        with (tmp_path / PACKAGE.name / module).open("a") as file:
            file.write(line)
    done = lint(tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Contracts: " in done.stdout and " 0 broken" not in done.stdout, done.stdout
    assert all(WRONG[name][2] in done.stdout for name in names), done.stdout


def test_the_house_has_few_rooms_and_four_leaves() -> None:
    assert len(ROOMS) + len(LEAVES) <= 22
    assert LEAVES == {"earth", "registry", "typing", "units"}


@pytest.mark.parametrize("page", ["README.md", "docs/architecture.md"])
def test_every_room_is_named_where_one_looks_for_it(page: str) -> None:
    text = (PROJECT / page).read_text()
    named = {room: rf"\b{room}/" for room in ROOMS} | {leaf: rf"\b{leaf}\b" for leaf in LEAVES}
    missing = [name for name, pattern in named.items() if not re.search(pattern, text)]
    assert not missing, f"{page} does not name {missing}"


def uses() -> dict[str, set[str]]:
    """The rooms that each room imports."""
    found: dict[str, set[str]] = {room: set() for room in ROOMS}
    for room in ROOMS:
        for path in (PACKAGE / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and node.module:
                    package, _, inside = node.module.partition(".")
                    if package == PACKAGE.name:
                        found[room].add(inside.partition(".")[0])
    return {room: names & ROOMS - {room} for room, names in found.items()}


def test_the_table_of_rooms_has_their_imports() -> None:
    text = (PROJECT / "docs/architecture.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+)/` \|.*\| ([^|]*) \|$", text, re.MULTILINE))
    layers = re.findall(r"^\| `(\w+)/` \|", text, re.MULTILINE)
    due = {
        room: ", ".join(sorted(names, key=layers.index)) or "–" for room, names in uses().items()
    }
    wrong = {room: due[room] for room in rows if rows[room] != due[room]}
    assert not wrong, f"docs/architecture.md: expected in the column 'uses': {wrong}"
