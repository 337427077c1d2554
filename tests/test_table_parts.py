"""A joint table as a folder: a file for each sensor and month, left alone where it is the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pytest

from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.steps.tables import remove_parts, write_parts
from imubench_pipeline.tables.files import TableError, build, find_tables, read

STARTED = {"a": "2026-01-31T23:59:59", "b": "2026-02-01T00:00:00", "c": None}
RECORDINGS = [
    RecordingRow(
        sensor=sensor, device=name, recording=name, kind="static", started=started,
        simulated=False, status="ok",
    )
    for sensor in ("x", "y")
    for name, started in STARTED.items()
]  # fmt: skip
FINDINGS = [
    FindingRow(
        sensor=row.sensor, recording=row.recording, finding="gaps", severity="note",
        detail=f"{row.recording} {number}", value=float(number), affects=(),
    )
    for row in RECORDINGS
    for number in range(3)
]  # fmt: skip


def write(rows: list[FindingRow], folder: Path) -> pa.Table:
    table = build("findings", rows)
    write_parts(table, folder, build("recordings", RECORDINGS))
    return table


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    return {path.name: (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.iterdir()}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "tables/findings.parquet"


def test_parts_have_all_rows_and_any_program_reads_them(folder: Path) -> None:
    table = write(FINDINGS, folder)
    names = [
        f"{sensor}.{month}.parquet"
        for sensor in "xy"
        for month in ("2026-01", "2026-02", "undated")
    ]
    assert sorted(path.name for path in folder.iterdir()) == names
    (folder / ".snakemake_timestamp").touch()
    back = read("findings", [find_tables(folder.parents[1], ["findings"])["findings"]])
    assert back.equals(table)
    frame = pd.read_parquet(folder)
    assert frame["detail"].tolist() == table["detail"].to_pylist()


def test_only_the_part_of_a_changed_recording_is_written_again(folder: Path) -> None:
    write(FINDINGS, folder)
    before = stamps(folder)
    changed = [
        replace(row, value=9.0) if (row.sensor, row.recording) == ("y", "b") else row
        for row in FINDINGS
    ]
    table = write(changed, folder)
    after = stamps(folder)
    assert {name for name in after if after[name] != before[name]} == {"y.2026-02.parquet"}
    assert read("findings", [folder]).equals(table)


def test_parts_without_rows_and_lost_or_damaged_parts_do_not_stay(folder: Path) -> None:
    write(FINDINGS, folder)
    table = write([row for row in FINDINGS if row.sensor == "x"], folder)
    assert {path.name[0] for path in folder.iterdir()} == {"x"}
    stored = folder.parent / ".parts/findings"
    assert stamps(stored) == stamps(folder)
    part = folder / "x.2026-01.parquet"
    data = bytearray(part.read_bytes())
    data[len(data) // 2] ^= 1
    part.write_bytes(data)
    with pytest.raises(TableError, match=r"x\.2026-01\.parquet is damaged"):
        read("findings", [folder])
    write([row for row in FINDINGS if row.sensor == "x"], folder)
    assert read("findings", [folder]).equals(table)
    assert read("findings", [folder]).num_rows == 9
    remove_parts(folder)
    assert not folder.exists() and not stored.exists()
    write([], folder)
    assert read("findings", [folder]).num_rows == 0
