"""The fuzzer finds readers that fail, whichever way they do, and finds none that do not."""

from __future__ import annotations

import ctypes
import random
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.settings.sensor import LogFormat
from tests.fuzz import target
from tests.fuzz.__main__ import main
from tests.fuzz.inputs import FAULT, READERS, Input, seeds
from tests.fuzz.mutations import mutated
from tests.fuzz.supervision import HANG_S, Fuzzing
from tests.readers.test_ubx import raw, samples, truth

SECONDS, MOMENT = 1.0, 0.3
QUICK = ("numpy",)
"""Readers that are fuzzed for a moment in every run of the tests, and the others in `release`."""

_read: Counter[str] = Counter()


def test_every_format_is_fuzzed() -> None:
    lacks = set(FILE_FORMATS) - set(READERS)
    assert set(READERS) == set(FILE_FORMATS), f"_SEEDS of tests/fuzz/inputs.py lacks {lacks}"


def _is_bad(path: Path) -> bool:
    """Tell whether a reader that is bad fails with this input: not with the first ones."""
    _read[path.name] += 1
    return _read[path.name] > 30


def raises(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        raise KeyError("no such field")
    return target.outcome(path, log)


def crashes(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        ctypes.string_at(0)
    return target.outcome(path, log)


def hangs(path: Path, log: LogFormat) -> str:
    while _is_bad(path):
        time.sleep(1.0)
    return target.outcome(path, log)


def hogs(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        held = np.ones(150_000_000)
        return f"{len(held)} figures"
    return target.outcome(path, log)


def takes_all(path: Path, log: LogFormat) -> str:
    if _is_bad(path):
        np.ones(1_000_000_000)
    return target.outcome(path, log)


@pytest.mark.parametrize(
    ("bad", "fault"),
    [
        ("raises", "KeyError: 'no such field'"),
        ("crashes", "signal 11"),
        pytest.param("hangs", "no answer for 2 s", marks=pytest.mark.release),
        pytest.param("hogs", "MemoryError: took 11", marks=pytest.mark.release),
        pytest.param("takes_all", "Unable to allocate", marks=pytest.mark.release),
    ],
)
def test_a_bad_reader_is_caught(tmp_path: Path, bad: str, fault: str) -> None:
    hang = 2.0 if bad == "hangs" else HANG_S
    found = Fuzzing("numpy", SECONDS, tmp_path, target=f"tests.test_fuzz:{bad}", hang=hang).run()
    assert found.failures
    assert found.folders
    for folder in found.folders:
        assert fault in (folder / FAULT).read_text()
        again = Input.kept(folder)
        assert again.path_in(folder).read_bytes() == again.files[again.path]


def test_a_reader_that_fails_with_every_log_is_caught(tmp_path: Path) -> None:
    found = Fuzzing("numpy", SECONDS, tmp_path, target="tests.test_fuzz:no_such_function").run()
    assert found.failures.total() == 1
    assert found.inputs == 0


@pytest.mark.parametrize(
    "reader",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.release) for name in READERS],
)
def test_readers_survive_a_moment(tmp_path: Path, reader: str) -> None:
    found = Fuzzing(reader, MOMENT, tmp_path).run()
    assert not found.failures, found.folders
    assert found.inputs > 10
    assert len(found.outcomes) > 3


def test_the_command_tells_what_it_did(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--reader", "numpy", "--minutes", "0.01", "--failures", str(tmp_path)]
    assert main(given) == 0
    head, row = capsys.readouterr().out.splitlines()[-2:]  # before it, how far it is
    assert head.split() == ["reader", "inputs", "seconds", "outcomes", "failures"]
    assert row.split()[0] == "numpy"


def test_a_reason_that_is_none_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RecordingError("no")

    monkeypatch.setattr(target, "read", refuse)
    with pytest.raises(target.WrongError, match="a reason of"):
        target.outcome(Path("a.csv"), next(seeds("numpy")).format())


def test_a_warning_that_a_reason_hides_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        try:
            raise RuntimeWarning("overflow")
        except RuntimeWarning:
            raise RecordingError("a.csv: corrupt data") from None

    monkeypatch.setattr(target, "read", refuse)
    with pytest.raises(target.WrongError, match="overflow"):
        target.outcome(Path("a.csv"), next(seeds("numpy")).format())


def test_mutations_follow_from_their_seed() -> None:
    data = next(seeds("csv")).files["log.csv"]
    one, same, other = (
        [mutated(data, [data], rng) for _ in range(100)]
        for rng in (random.Random(1), random.Random(1), random.Random(2))
    )
    assert one == same != other
    assert len(set(one)) > 90


def gyro_of(data: bytes, folder: Path) -> set[float]:
    """Return the figures that are read of a log of a receiver; none if it is rejected."""
    channels = {"gyro_x": {"column": "gyro_x", "unit": "deg/s"}}
    given = {"reader": "ubx", "rate": "100 Hz", "channels": channels}
    path = folder / "a.ubx"
    path.write_bytes(data)
    try:
        (file,) = read(path, LogFormat.model_validate(given))
        return {float(x) for batch in file.batches() for x in batch.columns["gyro_x"]}
    except RecordingError:
        return set()


def test_changed_messages_have_right_checksums_now_and_then(tmp_path: Path) -> None:
    data = raw(samples(truth(10), np.arange(10) * 256))
    rng = random.Random(1)
    written = gyro_of(data, tmp_path)
    changed = [gyro_of(mutated(data, [data], rng), tmp_path) for _ in range(60)]
    assert sum(not figures <= written for figures in changed) > 3
