"""`imubench verify` names every file that is not as it was left, and no other."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.run.cli import main
from imubench_pipeline.run.verification.results import Results
from imubench_pipeline.tables.files import read, write_arrow
from imubench_pipeline.tables.seals import (
    SealedFile,
    name_seal_file,
    read_seal,
    read_sealed_json,
    write_sealed_json,
)
from tests.conftest import few
from tests.verification.finished import Finished

pytestmark = [pytest.mark.workflow, pytest.mark.release]

LOGS = ("logs", "nightly/lock", "nightly/held_back.yaml")
"""What steps printed, and what stands for the moment: no results."""

A, B = "recordings/one/a", "recordings/one/b"


@pytest.fixture(scope="module")
def whole(done: Finished) -> dict[str, bytes]:
    """All files that are kept, by their places."""
    found = {
        path.relative_to(done.results).as_posix(): path.read_bytes()
        for path in sorted(done.results.rglob("*"))
        if path.is_file() and not any(one.startswith(".") for one in path.parts[-2:])
    }
    kept = {name: data for name, data in found.items() if not name.startswith(LOGS)}
    assert {name.split("/")[0] for name in kept} == {
        "recordings", "sensors", "tables", "simulated", "report", "exports", "seals", "nightly",
    }  # fmt: skip
    return kept


@pytest.fixture
def results(done: Finished, tmp_path: Path) -> Path:
    shutil.copytree(done.results, tmp_path / "results")
    return tmp_path / "results"


def told(results: Path) -> set[str]:
    return {fault.path for fault in Results(results).faults()}


def verified(results: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, list[str]]:
    status = main(["verify", str(results)])
    return status, capsys.readouterr().out.splitlines()


def flipped(data: bytes, place: int, bit: int) -> bytes:
    changed = bytearray(data)
    changed[place] ^= 1 << bit
    return bytes(changed)


def test_results_of_a_run_are_as_they_were_left(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, lines = verified(results, capsys)
    assert status == 0
    assert len(lines) == 1 and lines[0].endswith(": all as they were left")


@pytest.mark.release
@given(data=st.data())
def test_a_flipped_bit_is_named_in_any_file(
    done: Finished, whole: dict[str, bytes], data: st.DataObject
) -> None:
    name = data.draw(st.sampled_from([name for name, content in whole.items() if content]))
    place = data.draw(st.integers(0, len(whole[name]) - 1))
    path = done.results / name
    stamp = path.stat().st_mtime_ns
    path.write_bytes(flipped(whole[name], place, data.draw(st.integers(0, 7))))
    os.utime(path, ns=(stamp, stamp))
    try:
        assert name in told(done.results)
    finally:
        path.write_bytes(whole[name])
        os.utime(path, ns=(stamp, stamp))


@pytest.mark.parametrize("seals", [False, True], ids=["results", "seals"])
@pytest.mark.parametrize("damage", few(["flip", "cut", "removed"], ["longer", "empty", "folder"]))
def test_every_file_that_is_damaged_is_named_at_once(
    results: Path, whole: dict[str, bytes], damage: str, seals: bool
) -> None:
    rng = np.random.default_rng(7)
    chosen = {name: data for name, data in whole.items() if name.startswith("seals/") == seals}
    for name, data in chosen.items():
        path = results / name
        match damage:
            case "flip" if data:
                path.write_bytes(flipped(data, int(rng.integers(len(data))), int(rng.integers(8))))
            case "cut" | "empty" if data:
                path.write_bytes(data[:-1] if damage == "cut" else b"")
            case "removed" | "folder":
                path.unlink()
                if damage == "folder":
                    path.mkdir()
            case _:
                path.write_bytes(data + b"\n")
    found = told(results)
    if not seals:
        # What the samples are, quality.json tells; a night that is long past may be removed.
        left = {name for name in chosen if not name.endswith(("log.parquet", "log.json"))}
        assert found >= {name for name in left if damage != "removed" or "/2" not in name}
    elif damage in ("removed", "folder"):
        own = ("seals/", "nightly/2", "log.parquet", "log.json")
        left = {name for name in found if not name.startswith("seals/")}
        assert left == {name for name in whole if not name.startswith(own[:2])} - {
            name for name in whole if name.endswith(own[2:])
        }
    else:
        assert found >= chosen.keys()


def exchange(results: Path, one: str, other: str) -> None:
    held = results / "held"
    (results / one).rename(held)
    (results / other).rename(results / one)
    held.rename(results / other)


@pytest.mark.parametrize(
    ("one", "other"),
    few(
        [
            (f"{A}/parameters.parquet", f"{B}/parameters.parquet"),
            (f"seals/{A}/estimate.json", f"seals/{B}/estimate.json"),
            ("report/recordings/one/a.html", "report/recordings/one/b.html"),
        ],
        [
            (f"{A}/log.parquet", f"{B}/log.parquet"),
            (f"{A}/quality.json", f"{B}/quality.json"),
            (f"{A}/lines.parquet", f"{A}/models.parquet"),
            ("tables/allan.csv", "tables/lines.csv"),
            ("sensors/one/allan.parquet", "sensors/two/allan.parquet"),
        ],
    ),
)
def test_files_that_were_exchanged_are_named(results: Path, one: str, other: str) -> None:
    exchange(results, one, other)
    assert told(results) >= {one, other}


def test_recordings_that_were_exchanged_with_their_seals_are_named(results: Path) -> None:
    exchange(results, A, B)
    exchange(results, f"seals/{A}", f"seals/{B}")
    assert told(results) >= {f"seals/{A}/estimate.json", f"{B}/quality.json"}


@pytest.mark.parametrize(
    "place",
    few(
        [".report.part"],
        ["report/.figures.ab12cd_9.part/figures/x.svg", f"{A}/.q.json.abcdefgh.part"],
    ),
)
def test_what_was_not_completed_is_named(results: Path, place: str) -> None:
    path = results / place
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("half")
    expected = {"report/.figures.ab12cd_9.part"} if "figures" in place else {place}
    assert told(results) == (expected if "." + "report" + ".part" != place else set())


def test_a_file_of_nobody_is_named(results: Path) -> None:
    strays = [
        "tables/other.parquet",
        f"{A}/log.copy.parquet",
        "report/notes.html",
        "exports/x.yaml",
    ]
    for name in strays:
        (results / name).write_text("other")
    assert told(results) == set(strays)


def test_a_link_to_nowhere_is_named(results: Path) -> None:
    (results / "tables/allan.csv").unlink()
    (results / "tables/allan.csv").symlink_to("nowhere")
    assert told(results) == {"tables/allan.csv"}


def forge(results: Path, name: str, place: str) -> None:
    """Seal a file as if its step had left it so."""
    path = results / name_seal_file(place)
    data = read_sealed_json(path)
    about = SealedFile.of(results / name)
    data["outputs"][name] = {"size": about.size, "sha256": about.sha256, "changed": about.changed}
    write_sealed_json(data, path)


def test_rows_of_a_recording_that_was_not_compared_are_named(results: Path) -> None:
    path = results / "tables/parameters.parquet"
    table = read("parameters", [path])
    names = pa.array(["gone"] * len(table))
    column = table.schema.get_field_index("recording")
    gone = table.set_column(column, table.schema.field("recording"), names)
    write_arrow(pa.concat_tables([table, gone]), path)
    forge(results, "tables/parameters.parquet", "tables")
    (fault,) = [one for one in Results(results).faults() if one.path == "tables/parameters.parquet"]
    assert "one/gone" in fault.found


def test_half_of_a_backup_is_named(results: Path, tmp_path: Path) -> None:
    # Another state of a recording, sound in itself, with its seals and its old dates.
    path = results / f"{A}/parameters.parquet"
    table = read("parameters", [path])
    write_arrow(table.slice(1), path)
    os.utime(path, (1e9, 1e9))
    forge(results, f"{A}/parameters.parquet", f"{A}/estimate")
    found = told(results)
    assert "sensors/one/allan.parquet" in found  # of the step that joins them
    assert f"{A}/reconstruction.parquet" in found


def test_what_the_next_run_does_by_itself_is_no_fault(results: Path) -> None:
    # As a run for one file alone leaves it.
    path = results / f"{A}/parameters.parquet"
    write_arrow(read("parameters", [path]).slice(1), path)
    forge(results, f"{A}/parameters.parquet", f"{A}/estimate")
    made = Results(results)
    assert list(made.faults()) == []
    assert set(made.waiting()) >= {f"{A}/reconstruct", "sensors/one/sensor_tables"}


def test_what_may_be_removed_is_no_fault(results: Path) -> None:
    for path in results.glob("nightly/2*Z.*"):
        path.unlink()
    shutil.rmtree(results / "logs")
    (results / "notes.txt").write_text("mine")
    (results / "report/.DS_Store").write_text("")
    # A log that was removed leaves the comparison; what is left of it may stay, or be removed.
    shutil.copytree(results / A, results / "recordings/old/x")
    shutil.copytree(results / f"seals/{A}", results / "seals/recordings/old/x")
    shutil.rmtree(results / "recordings/old/x")
    for path in (results / "seals/recordings/old/x").iterdir():
        data = read_sealed_json(path)
        data["place"] = data["place"].replace(A, "recordings/old/x")
        data["outputs"] = {
            name.replace(A, "recordings/old/x"): one for name, one in data["outputs"].items()
        }
        write_sealed_json(data, path)
    assert told(results) == set()


def test_another_umask_and_other_dates_are_no_fault(results: Path) -> None:
    for path in results.rglob("*"):
        if path.is_file():
            path.chmod(0o640)
            os.utime(path, (1e9, 1e9))
    assert told(results) == set()


def test_an_older_form_is_told_in_one_line(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in (results / "seals").rglob("*.json"):
        write_sealed_json(read_sealed_json(path) | {"form": "0"}, path)
    status, lines = verified(results, capsys)
    assert status == 1 and len(lines) == 2
    assert "steps of another version; to correct it: snakemake -c2 --config" in lines[0]
    shutil.rmtree(results / "seals")
    status, lines = verified(results, capsys)
    assert status == 1 and len(lines) == 1
    assert "an older version" in lines[0] and "snakemake -c2 --config" in lines[0]


def older(results: Path) -> Iterator[str]:
    """Take a column out of each table, as of a version that did not have it."""
    for path in sorted(results.glob("tables/*.parquet")):
        table = pq.read_table(path)
        name = table.schema.names[-1]
        pq.write_table(table.drop_columns([name]), path)
        yield name


COMMANDS = (
    ["show"],
    ["report"],
    ["figures"],
    ["export", "--sensor", "one", "--target", "kalibr"],
    ["verify"],
)


@pytest.mark.parametrize("command", few(COMMANDS[:2], COMMANDS[2:]), ids=lambda command: command[0])
def test_a_command_tells_tables_of_another_version(
    results: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(list(older(results))) > 20
    status = main([command[0], str(results), *command[1:]])
    said = "".join(capsys.readouterr())
    assert status == (1 if command == ["verify"] else 2)
    if command != ["verify"]:
        assert "was made by another version of imubench_pipeline: it has no" in said
    assert "snakemake -c2" in said


def test_the_command_of_a_fault_names_the_file_and_the_run(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = results / "tables/allan.csv"
    path.write_bytes(path.read_bytes()[:-1])
    status, lines = verified(results, capsys)
    assert status == 1
    expected = read_seal(results, "tables").outputs["tables/allan.csv"].size
    assert lines[0].startswith(
        f"{path}: expected {expected} bytes, found {expected - 1}; "
        f"to correct it: rm {path} && snakemake -c2 --config sensors=sensors"
    )
    assert lines[1].endswith(": 1 faults")


def test_a_folder_without_results_is_no_good_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["verify", str(tmp_path)]) == 2
    assert "found no results" in capsys.readouterr().err


@pytest.mark.parametrize("lost", [f"{A}/log.parquet", f"{B}/envelope.parquet"])
def test_a_report_is_not_written_without_what_it_shows(
    results: Path, lost: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (results / lost).unlink()
    (results / "report/pages.json").unlink()  # all pages are written again
    assert main(["report", str(results)]) == 2
    assert f"{lost}: missing, and the report needs it" in capsys.readouterr().err


def test_a_report_that_is_written_again_is_as_it_was_left(
    results: Path, whole: dict[str, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    page = results / "report/sensors/one.html"
    page.write_bytes(page.read_bytes().replace(b"one", b"two"))
    assert main(["report", str(results)]) == 0
    assert page.read_bytes() == whole["report/sensors/one.html"]
    assert told(results) == set()
