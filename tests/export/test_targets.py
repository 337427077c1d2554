"""The programs that a noise model can be exported to, and the list of them."""

from __future__ import annotations

import pytest

from imubench_pipeline.export.targets import TARGETS
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.run.cli import main


def test_names_and_files_of_programs_differ() -> None:
    assert all(target.name == name for name, target in TARGETS.items())
    assert len({target.file_name for target in TARGETS.values()}) == len(TARGETS)


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
