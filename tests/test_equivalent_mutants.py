"""The list of changes to the code that no test can find."""

import yaml

from tests.conftest import PROJECT

LIST = PROJECT / "tests/release/equivalent_mutants.yaml"


def test_every_entry_changes_a_line_of_the_code() -> None:
    lost = [
        f"{file}: {entry['was']}"
        for file, entries in yaml.safe_load(LIST.read_text(encoding="utf-8")).items()
        for entry in entries
        if entry["was"]
        not in (PROJECT / "src/imubench_pipeline" / file).read_text(encoding="utf-8")
    ]
    assert not lost
