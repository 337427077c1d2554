"""A log whose content changed is read again, whatever its size and its date say; no other is."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.recordings import known_logs
from imubench_pipeline.recordings.known_logs import (
    KNOWN,
    identify_log_files,
    plan_versions,
    read_known,
    write_known,
)
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.steps.ingest import write_recording
from tests.workflow.project import put_log, put_sensor

SIZE = 3_000_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log that was read, and the folder of its results."""
    folder = tmp_path_factory.mktemp("known")
    (folder / "log.bin").write_bytes(np.random.default_rng(1).bytes(SIZE))
    return folder


def ingested(folder: Path) -> dict[str, str]:
    """Read the log as an ingest does; return what the plan called it."""
    log = folder / "log.bin"
    said = plan_versions(log, folder)
    read = identify_log_files(log)
    write_known(read, folder, said)
    (folder / "quality.json").touch()
    return said


@given(place=st.integers(0, SIZE - 1), bit=st.integers(0, 7), dated=st.booleans())
def test_no_bit_of_a_large_log_changes_unseen(
    folder: Path, place: int, bit: int, dated: bool
) -> None:
    log = folder / "log.bin"
    said = ingested(folder)
    assert plan_versions(log, folder) == said
    date = log.stat().st_mtime_ns
    with log.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 1 << bit]))
    if dated:  # as it was before, as rsync and careful people do
        os.utime(log, ns=(date, date))
    changed = plan_versions(log, folder)
    assert changed != said
    assert ingested(folder) == changed


def test_what_was_touched_alone_is_read_once_and_keeps_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "log.bin"
    log.write_bytes(bytes(5000))
    said = ingested(tmp_path)
    monkeypatch.setattr(known_logs, "_STAMP_RESOLUTION", 0)  # none is too young
    time.sleep(0.05)
    os.utime(log, (1e9, 1e9))
    time.sleep(0.05)
    assert plan_versions(log, tmp_path) == said
    monkeypatch.setattr(known_logs, "_digest", lambda *_: pytest.fail("it is read again"))
    assert plan_versions(log, tmp_path) == said
    log.chmod(0o600)  # another stamp of anything
    with pytest.raises(pytest.fail.Exception):
        plan_versions(log, tmp_path)


def test_stamps_that_are_too_young_are_not_trusted(tmp_path: Path) -> None:
    log = tmp_path / "log.bin"
    log.write_bytes(bytes(5000))
    ingested(tmp_path)
    known = read_known(tmp_path)
    assert known is not None and known["."].stamps is None


def test_a_log_that_changes_while_it_is_read_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "log.bin"
    log.write_bytes(bytes(5000))
    read = known_logs._digest

    def changed_after(path: Path, *others: Any) -> str | None:
        digest = read(path, *others)
        path.write_bytes(bytes(5001))
        return digest

    monkeypatch.setattr(known_logs, "_digest", changed_after)
    said = ingested(tmp_path)
    monkeypatch.undo()
    assert plan_versions(log, tmp_path) != said
    log.write_bytes(bytes(5000))  # and also if it is again what was begun
    assert plan_versions(log, tmp_path) != said


@pytest.mark.parametrize("damage", ["removed", "edited"])
def test_without_what_is_known_the_log_is_read_again(tmp_path: Path, damage: str) -> None:
    log = tmp_path / "log.bin"
    log.write_bytes(bytes(5000))
    said = ingested(tmp_path)
    kept = tmp_path / KNOWN
    if damage == "removed":
        kept.unlink()
    else:
        kept.write_text(kept.read_text().replace("5000", "5001"))
    again = plan_versions(log, tmp_path)
    assert again != said and again == plan_versions(log, tmp_path)
    assert ingested(tmp_path) == again == plan_versions(log, tmp_path)


@pytest.mark.parametrize("good", [True, False])
def test_an_ingest_keeps_what_it_read(tmp_path: Path, good: bool) -> None:
    put_sensor(tmp_path / "sensors/s.yaml")
    put_log(tmp_path / "logs/s/a.csv", 1, samples=2000 if good else 1)
    places = {name: str(tmp_path / name) for name in ("logs", "sensors", "results")}
    plan = Plan(places | {"simulated": "false"})
    folder = tmp_path / "results/recordings/s/a"
    settings = plan.ingest_settings("s", "a")
    write_recording(plan.recordings["s", "a"].path, settings, "s", "a", folder)
    again = Plan(places | {"simulated": "false"})
    assert again.ingest_settings("s", "a") == settings
    log = tmp_path / "logs/s/a.csv"
    text = log.read_text()
    log.write_text(text[:-2] + str((int(text[-2]) + 1) % 10) + "\n")
    assert Plan(places | {"simulated": "false"}).ingest_settings("s", "a") != settings
