"""The registry of the programs: none that is declared is forgotten."""

from __future__ import annotations

import pkgutil
from importlib import import_module

import pytest

from imubench_pipeline import export
from imubench_pipeline.export.target import Target
from imubench_pipeline.export.targets import TARGETS
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.run.cli import main


def test_every_program_that_a_module_declares_can_be_exported_for() -> None:
    declared = [
        value
        for module in pkgutil.iter_modules(export.__path__, f"{export.__name__}.")
        for value in vars(import_module(module.name)).values()
        if isinstance(value, Target)
    ]
    forgotten = [target.name for target in declared if TARGETS.get(target.name) is not target]
    assert not forgotten, f"export/targets.py lacks {forgotten}, or has another of this name"
    assert len({target.file_name for target in declared}) == len(declared) == len(TARGETS)


def test_every_format_and_every_program_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["formats"]) == 0
    read, exported = capsys.readouterr().out.split("\n\n")
    for name, known in FILE_FORMATS.items():
        (line,) = (text for text in read.splitlines() if text.split()[0] == name)
        words = (known.title, *known.endings, *known.time_columns, *known.settings)
        assert all(word in line for word in words)
    for target in TARGETS.values():
        (line,) = (text for text in exported.splitlines() if text.split()[0] == target.name)
        assert all(word in line for word in (target.program, target.file_name, target.family))
