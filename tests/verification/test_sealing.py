"""A run makes again what is not as its steps left it, and nothing else."""

from __future__ import annotations

import os
import shutil
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.run.sealing import digest_settings, find_unsound_jobs
from imubench_pipeline.tables.seals import (
    Seal,
    SealedFile,
    SealError,
    list_places,
    name_seal_file,
    read_seal,
    read_sealed_json,
    write_sealed_json,
)
from tests.verification.finished import Finished

pytestmark = [pytest.mark.workflow, pytest.mark.release]

A = "recordings/one/a"
JOINED = "sensors/one/sensor_tables"


@pytest.fixture
def results(done: Finished, tmp_path: Path) -> Path:
    shutil.copytree(done.results, tmp_path / "results")
    return tmp_path / "results"


def jobs(results: Path) -> dict[str, str]:
    """The jobs of the run, with the settings that they had."""
    steps = [place for place in list_places(results) if not place.startswith("nightly/")]
    return {place: read_seal(results, place).settings for place in steps}


def test_a_run_that_is_complete_has_nothing_to_make_again(results: Path) -> None:
    settings = jobs(results)
    assert len(settings) > 25 and all(settings.values())
    assert list(find_unsound_jobs(results, settings)) == []
    for path in results.rglob("*"):
        os.utime(path, (1e9, 1e9))  # as git and rsync without -t leave it
    assert list(find_unsound_jobs(results, settings)) == []


@pytest.mark.parametrize(
    ("name", "place"),
    [
        (f"{A}/scores.parquet", f"{A}/reconstruct"),
        (f"{A}/curve.parquet", f"{A}/allan"),
        ("sensors/two/drift.parquet", "sensors/two/sensor_tables"),
        ("tables/allan.csv", "tables"),
        ("report/recordings/one/a.html", "report"),
        ("exports/one/kalibr/imu.yaml", "exports"),
        ("simulated/two/sim_a", "recordings/two/sim_a/simulate"),
    ],
)
@pytest.mark.parametrize("damage", ["removed", "edited"])
def test_what_was_removed_or_edited_is_made_again(
    results: Path, name: str, place: str, damage: str
) -> None:
    settings = jobs(results)
    path = results / name
    if path.is_dir():
        path = next(path.glob("[!.]*"))
    data = path.read_bytes()
    path.unlink()
    if damage == "edited":
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    assert list(find_unsound_jobs(results, settings)) == [place]


@pytest.mark.parametrize("damage", ["removed", "cut", "exchanged", "older form", "other settings"])
def test_a_step_without_its_seal_is_run_again(results: Path, damage: str) -> None:
    settings = jobs(results)
    path = results / name_seal_file(f"{A}/datasheet")
    match damage:
        case "removed":
            path.unlink()
        case "cut":
            path.write_bytes(path.read_bytes()[:-2])
        case "exchanged":
            shutil.copy(results / name_seal_file("recordings/one/b/datasheet"), path)
        case "older form":
            write_sealed_json(read_sealed_json(path) | {"form": "0"}, path)
        case "other settings":
            settings[f"{A}/datasheet"] = digest_settings({"settings": "{}", "code": "0"})
    found = set(find_unsound_jobs(results, settings))
    assert f"{A}/datasheet" in found
    # Without it, what its files are is not known, of which others were made.
    assert found <= {f"{A}/datasheet", JOINED}


def test_what_was_made_of_another_file_is_made_again(results: Path) -> None:
    settings = jobs(results)
    path = results / f"{A}/scores.parquet"
    path.write_bytes((results / "recordings/one/b/scores.parquet").read_bytes())
    seal = results / name_seal_file(f"{A}/reconstruct")
    data = read_sealed_json(seal)
    about = SealedFile.of(path)
    data["outputs"][f"{A}/scores.parquet"] = {
        "size": about.size, "sha256": about.sha256, "changed": about.changed,
    }  # fmt: skip
    write_sealed_json(data, seal)
    assert list(find_unsound_jobs(results, settings)) == [JOINED]


FILE = {"size": 1, "sha256": "0", "changed": 0}


@pytest.mark.parametrize(
    "change",
    [
        {"inputs": ["a"]},
        {"form": {}},
        {"outputs": {"a": FILE | {"size": "1"}}},
        {"outputs": {"a": FILE | {"changed": None}}},
        {"outputs": {"../../a": FILE}},
        {"inputs": {"/etc/passwd": "0"}},
    ],
)
def test_read_seal_refuses_wrong_types_and_outside_paths(
    tmp_path: Path, change: dict[str, Any]
) -> None:
    seal = Seal("allan", "form", {"b": "0"}, {"a": SealedFile(**FILE)})
    seal.write(tmp_path)
    assert read_seal(tmp_path, "allan") == seal
    write_sealed_json(asdict(seal) | change, tmp_path / name_seal_file("allan"))
    with pytest.raises(SealError, match="is not as it was written"):
        read_seal(tmp_path, "allan")


def test_how_often_a_step_was_tried_is_no_setting() -> None:
    assert digest_settings({"code": "1", "attempt": 2}) == digest_settings({"code": "1"})
    assert digest_settings({"code": "1"}) != digest_settings({"code": "2"})
