"""Samples, tables and ``quality.json`` that are lost or damaged after they were kept are told."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.kept import (
    Quality,
    load_logs,
    load_static_logs,
    remove_old_samples,
)
from imubench_pipeline.recordings.recording import LogNames, read_metadata
from imubench_pipeline.run.faults import Faults
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat, RecordingNotes
from imubench_pipeline.tables.failures import Failure, read_failure
from imubench_pipeline.tables.files import TableError, read, write
from imubench_pipeline.tables.findings import RecordingError

LOG = LogFormat.model_validate(
    {
        "rate": "100 Hz",
        "header": False,
        "channels": {
            "gyro_x": {"column": 1, "unit": "rad/s"},
            "accel_x": {"column": 2, "unit": "m/s^2"},
        },
    }
)
NAMES = LogNames(sensor="s", device="r", recording="r")
OF = ("ingest", "s", "r")


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results with one recording."""
    folder = tmp_path_factory.mktemp("kept")
    rng = np.random.default_rng(1)
    np.savetxt(folder / "r.csv", rng.standard_normal((2000, 2)) * 1e-3, delimiter=",", fmt="%.9g")
    kept = folder / "results/recordings/s/r"
    found = ingest(folder / "r.csv", LOG, RecordingNotes(), QualitySettings(), kept, NAMES)
    found.quality().write(kept / "quality.json")
    return folder / "results"


@pytest.fixture
def results(ingested: Path, tmp_path: Path) -> Path:
    shutil.copytree(ingested, tmp_path / "results")
    return tmp_path / "results"


def flips(data: bytes, step: int) -> Iterator[bytes]:
    """Yield copies of a file with one bit of it changed."""
    for place in range(0, len(data), step):
        changed = bytearray(data)
        changed[place] ^= 1 << place % 8
        yield bytes(changed)


def samples(folder: Path) -> list[np.ndarray]:
    return [np.concatenate(list(log.blocks())) for log in load_static_logs(folder).values()]


def test_what_is_as_it_was_left_is_read(results: Path) -> None:
    assert [len(values) for values in samples(results / "recordings/s/r")] == [2000, 2000]
    assert Faults(results).attempt(OF) == 0


@pytest.mark.parametrize("damage", ["removed", "cut short", "another", "quality"])
def test_a_file_that_is_lost_or_cut_is_named_and_made_again(results: Path, damage: str) -> None:
    folder = results / "recordings/s/r"
    log, quality = folder / "log.parquet", folder / "quality.json"
    named = log
    match damage:
        case "removed":
            log.unlink()
        case "cut short":
            log.write_bytes(log.read_bytes()[:-100])
        case "another":
            named = folder / "log.copy.parquet"
            shutil.copy(log, named)
        case "quality":
            named = quality
            quality.write_text(quality.read_text().replace('"grid": 2000', '"grid": 2001'))
    with pytest.raises(RecordingError) as told:
        load_logs(folder)
    assert str(told.value).startswith(f"{named}: ")
    assert "the next run reads" in str(told.value) or "is read again" in str(told.value)
    if damage == "another":
        return  # it is for whoever put it there
    run = Faults(results)
    assert run.attempt(OF) == 1
    assert run.attempt(OF, again=False) == 0  # of a log that is held back
    assert run.attempt(("allan", "s", "r")) == 0
    run.succeeded(OF, 1)
    assert run.attempt(OF) == 1  # the same until the end of the run


def test_removed_samples_are_no_fault_and_no_step_takes_them_for_a_log(results: Path) -> None:
    folder = results / "recordings/s/r"
    log = folder / "log.parquet"
    data, about = log.read_bytes(), read_metadata(log)
    assert remove_old_samples([folder], keep=1) == (0, 0)
    assert log.read_bytes() == data
    assert remove_old_samples([folder], keep=0) == (1, len(data))
    assert remove_old_samples([folder], keep=0) == (0, 0)
    assert log.stat().st_size < len(data) / 5
    assert replace(read_metadata(log), removed="") == about
    quality = Quality.read(folder / "quality.json")
    assert quality.has_removed_samples(folder)
    assert quality.fault(folder, whole=True) is None
    assert Faults(results).attempt(OF) == 0
    with pytest.raises(RecordingError, match=r"samples were removed .*log in the drop zone"):
        load_logs(folder)
    for damaged in [*flips(log.read_bytes(), 97)][1:]:  # the first byte is of the format
        log.write_bytes(damaged)
        assert quality.fault(folder) is not None
    log.write_bytes(data)
    assert quality.fault(folder, whole=True) is None
    assert not quality.has_removed_samples(folder)


def test_the_latest_samples_of_a_device_stay(results: Path) -> None:
    folders = []
    for name, device, started in [
        ("a", "1", "2026-03-02"), ("b", "1", "2026-03-01"), ("c", "2", None),
        ("d", "d", None), ("e", "e", None), ("f", "f", None),  # no device is named
    ]:  # fmt: skip
        folder = results / f"recordings/s/{name}"
        shutil.copytree(results / "recordings/s/r", folder)
        quality = Quality.read(folder / "quality.json")
        row = replace(quality.recording, recording=name, device=device, started=started)
        replace(quality, recording=row).write(folder / "quality.json")
        folders.append(folder)
    assert remove_old_samples(folders, keep=1)[0] == 3
    kept = [f.name for f in folders if not read_metadata(f / "log.parquet").removed]
    assert kept == ["a", "c", "f"]


def test_an_ingest_that_mended_a_recording_is_not_run_once_more(results: Path) -> None:
    log = results / "recordings/s/r/log.parquet"
    data = log.read_bytes()
    log.unlink()
    run = Faults(results)
    attempt = run.attempt(OF)
    log.write_bytes(data)
    run.succeeded(OF, attempt)
    assert attempt == run.attempt(OF) == Faults(results).attempt(OF) == 1


@pytest.mark.release
def test_no_bit_of_the_samples_changes_unseen(results: Path) -> None:
    folder = results / "recordings/s/r"
    log = folder / "log.parquet"
    data = log.read_bytes()
    right = samples(folder)
    told = 0
    for changed in flips(data, 61):
        log.write_bytes(changed)
        try:
            found = samples(folder)
        except RecordingError as error:
            assert str(error).startswith(f"{log}: ")
            told += 1
        else:  # a bit of a header that is not read
            np.testing.assert_array_equal(found, right)
    assert told > 0.95 * len(data) / 61


def test_damage_that_a_step_has_found_is_mended_by_the_next_run(results: Path) -> None:
    log = results / "recordings/s/r/log.parquet"
    data = bytearray(log.read_bytes())
    data[1000:1008] = bytes(8)
    log.write_bytes(data)
    run = Faults(results)
    assert run.attempt(OF) == 0  # a plan does not read all samples of all logs
    with pytest.raises(RecordingError, match="damaged"):
        samples(results / "recordings/s/r")
    run.failed(Failure("s", "r", "allan", "error", "damaged"), 0, results / "allan.log")
    assert Faults(results).attempt(OF) == 1


def test_no_bit_of_quality_changes_unseen(results: Path) -> None:
    path = results / "recordings/s/r/quality.json"
    data = path.read_bytes()
    right = Quality.read(path)
    for changed in flips(data, 3):
        path.write_bytes(changed)
        try:
            assert Quality.read(path) == right
        except RecordingError as error:
            assert str(error).startswith(f"{path}: ")


def test_no_bit_of_a_table_changes_unseen(tmp_path: Path) -> None:
    path = tmp_path / "scores.parquet"
    rows = [
        {"sensor": "s", "recording": f"r{n}", "channel": "gyro_x", "method": "curve", "rms": n / 7}
        for n in range(50)
    ]
    write("scores", rows, path)
    data = path.read_bytes()
    right = read("scores", [path])
    told = 0
    for changed in flips(data, 7):
        path.write_bytes(changed)
        try:
            assert read("scores", [path]).equals(right)
        except TableError as error:
            assert str(error).startswith(f"{path} is damaged (")
            told += 1
    assert told > 0.8 * len(data) / 7
    path.write_bytes(data[:-9])
    assert read_failure(path) is None
    with pytest.raises(TableError, match=r"scores\.parquet is damaged .* remove it"):
        read("scores", [path])
