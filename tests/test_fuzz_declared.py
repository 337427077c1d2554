"""Changed settings, notes and tables are taken or refused in the words of the project."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from imubench_pipeline.settings.validation import ConfigError
from tests.fuzz import declared
from tests.fuzz.declared import SEEDS, Subject, changed, fuzz, subjects, tried

SUBJECTS = subjects()
SECONDS, MOST = 0.4, 20


@pytest.mark.parametrize("name", SUBJECTS)
def test_what_is_changed_is_taken_or_refused(name: str, tmp_path: Path) -> None:
    outcomes, failed = fuzz(name, SECONDS, random.Random(1), tmp_path, MOST)
    assert not failed, sorted(tmp_path.iterdir())
    assert outcomes.total() > 0


@pytest.mark.parametrize("name", SUBJECTS)
def test_what_is_as_it_should_be_is_taken(name: str, tmp_path: Path) -> None:
    subject = SUBJECTS[name]
    assert tried(subject, subject.seeds[0], tmp_path) == ""


KEPT = [path for path in sorted(SEEDS.glob("*/*")) if path.is_file()]


@pytest.mark.parametrize("path", KEPT, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_former_failing_inputs_are_accepted_or_refused(path: Path, tmp_path: Path) -> None:
    tried(SUBJECTS[path.parent.name], path.read_bytes(), tmp_path)


def refuse(path: Path) -> None:
    raise ConfigError("no file is named in this")


def end(path: Path) -> None:
    raise KeyError("no")


@pytest.mark.parametrize(
    ("take", "kind"), [(refuse, "WrongError at declared.py"), (end, "KeyError at")]
)
def test_other_errors_are_failures(take: declared.Take, kind: str, tmp_path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        bad = Subject("a.yaml", take, [b"a: 1\n"])
        patch.setattr(declared, "subjects", lambda: {"bad": bad})
        outcomes, failed = fuzz("bad", 5.0, random.Random(1), tmp_path, 3)
    assert outcomes == {"failed": 3}
    assert [name.startswith(kind) for name in failed] == [True]
    assert (tmp_path / "bad_0").is_file()


def test_changes_follow_from_their_seed() -> None:
    subject = SUBJECTS["notes"]
    one, same = ([changed(subject, rng) for _ in range(50)] for rng in map(random.Random, (1, 1)))
    assert one == same and len(set(one)) > 40
