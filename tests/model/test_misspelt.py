"""A misspelt column or state, or a column taken by its name, is an error of mypy."""

import ast
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from imubench_pipeline.tables.schemas import TABLES
from tests.conftest import PROJECT

SITES = 40

WRONG = '''"""Mistakes that mypy finds."""

from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.words.findings.samples import TooShort


def mistakes(row: RecordingRow, finding: TooShort) -> None:
    """Take a column by its name, compare with a misspelt state, misspell data of a finding."""
    print(row["rate"])
    print(row.status == "okk")
    print(row.doubts[0].cod)
    print(finding.presnt)
'''
"""A module in which each of the last four lines is wrong."""
ROW = re.compile(r"row|rows|finding|first|last|parameter|budget")


def columns_of_rows(path: Path) -> list[ast.Attribute]:
    """Return where a module takes a column of a row."""
    columns = {column.name for of in TABLES.values() for column in of}
    return [
        node
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and node.attr in columns
        and isinstance(node.value, ast.Name)
        and ROW.fullmatch(node.value.id)
    ]


@pytest.mark.release
def test_a_misspelt_column_is_an_error_of_mypy(tmp_path: Path) -> None:
    source = tmp_path / "src"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PROJECT / "src/imubench_pipeline", source / "imubench_pipeline", ignore=ignored)
    shutil.copy(PROJECT / "pyproject.toml", tmp_path)
    draw = random.Random(20261127)
    modules = [
        path
        for path in sorted(source.rglob("*.py"))
        if "readers" not in path.parts and columns_of_rows(path)  # rows of text have no class
    ]
    chosen = draw.sample(modules, min(SITES, len(modules)))
    wrong = {}
    for path in chosen:
        node = draw.choice(columns_of_rows(path))
        lines = path.read_text(encoding="utf-8").split("\n")
        line = lines[node.end_lineno - 1].encode()
        end = node.end_col_offset
        lines[node.end_lineno - 1] = (line[:end] + b"_" + line[end:]).decode()
        path.write_text("\n".join(lines), encoding="utf-8")
        wrong[path.relative_to(tmp_path).as_posix()] = node.end_lineno
    (source / "imubench_pipeline/wrong.py").write_text(WRONG)
    command = [sys.executable, "-m", "mypy", "src", "--cache-dir", str(tmp_path / "cache")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = set(re.findall(r'^(\S+?):(\d+): error: .*has no attribute "\w+_"', done.stdout, re.M))
    silent = {f"{path}:{line}" for path, line in wrong.items() if (path, str(line)) not in found}
    assert len(wrong) >= 20 and not silent, done.stdout[-2000:]
    mistakes = re.findall(r"^src/imubench_pipeline/wrong.py:(\d+): error", done.stdout, re.M)
    assert len(set(mistakes)) == 4, done.stdout[-2000:]
