"""What is said of a log is the same wherever it lies and whenever it is read."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.settings.sensor import LogFormat
from tests.conftest import few
from tests.corpus import ENTRIES, Rejected
from tests.readers.hostile import ATTACKS
from tests.readers.test_text_hostile import FILES
from tests.readers.text_logs import PLACED, log_format

Case = tuple[Callable[[Path], Path], LogFormat]
_ADDRESS = re.compile(r"\b0x[0-9a-f]{6,}")


def cases() -> Iterator[tuple[str, Case]]:
    """Yield every log that a test of the readers rejects or finds fault with."""
    for name, entry in ENTRIES.items():
        if entry.skip is None:
            yield f"entry: {name}", (entry.write, LogFormat.model_validate(dict(entry.log)))
    for name, attack in ATTACKS.items():
        channels = {key: {"unit": "rad/s"} | source for key, source in attack.channels.items()}
        yield f"attack: {name}", (attack.write, log_format(channels))
    for name, make in FILES.items():

        def write(folder: Path, make: Callable[[], bytes] = make) -> Path:
            path = folder / "a.csv"
            path.write_bytes(make())
            return path

        yield f"text: {name}", (write, log_format(PLACED))


CASES = dict(cases())
DEAR = ("bomb", "thousands")
REJECTED = [
    f"entry: {name}"
    for name, entry in ENTRIES.items()
    if isinstance(entry.expected, Rejected)
    and entry.skip is None
    and not any(word in name for word in DEAR)
]


def said_of(path: Path, log: LogFormat) -> list[str]:
    """Return what is said of a log by who lists it and who reads it."""
    said = []
    try:
        said += [table.fault or table.about for table in list_contents(path).tables]
    except RecordingError as error:
        said.append(str(error))
    try:
        for file in read(path, log):
            said.append(f"{sum(map(len, file.batches()))} records")
            said += [finding.detail for finding in file.findings]
    except RecordingError as error:
        said.append(str(error))
    return said


# The others take minutes.
@pytest.mark.parametrize(
    "name", few(REJECTED[::3], [name for name in CASES if name not in REJECTED[::3]])
)
def test_a_reason_is_the_same_in_another_folder(tmp_path: Path, name: str) -> None:
    write, log = CASES[name]
    said = []
    for place in ("one", "another/and/deeper"):
        folder = tmp_path / place
        folder.mkdir(parents=True)
        said.append(said_of(write(folder), log))
    assert said[0] == said[1]
    for text in said[0]:
        assert str(tmp_path) not in text and tmp_path.parent.name not in text
        assert not _ADDRESS.search(text)
        assert f"{os.getpid()}" not in text.split()


def test_an_address_of_an_object_is_left_out() -> None:
    error = RecordingError(f"a.npy: cannot read {object()!r}; copy it again")
    assert str(error) == "a.npy: cannot read <object object>; copy it again"
