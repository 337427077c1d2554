"""The fuzzer finds readers that fail, whichever way they do, and finds none that do not."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.settings.sensor import LogFormat
from tests.conftest import few
from tests.formats.test_ubx import raw, samples, truth
from tests.fuzz import target
from tests.fuzz.__main__ import main
from tests.fuzz.held import FAULT, Input
from tests.fuzz.inputs import READERS, seeds
from tests.fuzz.mutations import mutated
from tests.fuzz.supervision import HANG_S, Fuzzing

SECONDS = 1.0


def test_every_format_is_fuzzed() -> None:
    lacks = set(FILE_FORMATS) - set(READERS)
    assert set(READERS) == set(FILE_FORMATS), f"_SEEDS of tests/fuzz/inputs.py lacks {lacks}"


@pytest.mark.release
@pytest.mark.parametrize(
    ("bad", "faults"),
    few(
        [("raises_and_crashes", ["KeyError: 'no such field'", "signal 11"])],
        [
            ("hangs", ["no answer for 2 s"]),
            ("hogs", ["MemoryError: took 11"]),
            ("takes_all", ["Unable to allocate"]),
        ],
    ),
)
def test_a_bad_reader_is_caught(tmp_path: Path, bad: str, faults: list[str]) -> None:
    hang = 2.0 if bad == "hangs" else HANG_S
    name = f"tests.fuzz.bad_readers:{bad}"
    found = Fuzzing("numpy", SECONDS, tmp_path, target=name, hang=hang).run()
    assert len(found.failures) == len(faults)
    said = [(folder / FAULT).read_text() for folder in found.folders]
    assert all(any(fault in text for text in said) for fault in faults)
    assert all(any(fault in text for fault in faults) for text in said)
    for folder in found.folders:
        again = Input.kept(folder)
        assert again.path_in(folder).read_bytes() == again.files[again.path]


# Every day a reader that fails with some logs, above.
@pytest.mark.release
def test_a_reader_that_fails_with_every_log_is_caught(tmp_path: Path) -> None:
    found = Fuzzing("numpy", SECONDS, tmp_path, target="tests.fuzz.target:no_such_function").run()
    assert found.failures.total() == 1
    assert found.inputs == 0


@pytest.mark.parametrize("reader", few(["numpy"], [name for name in READERS if name != "numpy"]))
def test_readers_survive_a_moment_and_the_command_tells_what_it_did(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], reader: str
) -> None:
    given = ["--reader", reader, "--minutes", "0.005", "--failures", str(tmp_path)]
    assert main(given) == 0, list(tmp_path.iterdir())
    head, row = capsys.readouterr().out.splitlines()[-2:]  # before it, how far it is
    assert head.split() == ["reader", "inputs", "seconds", "outcomes", "failures"]
    name, inputs, _, outcomes, failures = row.split()
    assert name == reader and int(inputs) > 10 and int(outcomes) > 3 and int(failures) == 0


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
