import hashlib
import json
import math
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.model.verdicts import DoubtMark, Share
from imubench_pipeline.tables.files import (
    TableError,
    build,
    make_folder,
    read,
    replace_file,
    write,
    write_arrow,
    write_content,
    write_json,
)
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from imubench_pipeline.tables.seals import read_sealed_json

SCORE = {"sensor": "s", "recording": "r", "channel": "gyro_x", "method": "curve", "rms": 1.0}


def test_rows_are_checked() -> None:
    assert build("scores", [SCORE]).num_rows == 1
    with pytest.raises(TableError, match=r"unknown columns \['rmse'\]"):
        build("scores", [SCORE | {"rmse": 1.0}])
    with pytest.raises(TableError, match="column channel has 1 nulls"):
        build("scores", [SCORE | {"channel": None}])


NOT_FINITE = (math.nan, math.inf, -math.inf)


def a_row(table: str) -> dict[str, Any]:
    """A row of a table that has a value in every column."""
    values = {"string": "gyro_x", "double": 1.5, "float": 1.5, "int64": 1, "bool": True}
    return {
        column.name: column.values[0]
        if column.values
        else ()
        if column.is_list
        else values[str(column.type)]
        for column in TABLES[table]
    }


@pytest.mark.parametrize("table", TABLES)
def test_a_number_that_is_not_finite_becomes_null_or_is_refused(table: str) -> None:
    numbers = [one for one in TABLES[table] if pa.types.is_floating(one.type)]
    optional = [one.name for one in numbers if not one.required]
    rows = [a_row(table) | {name: value} for name in optional for value in NOT_FINITE]
    made = build(table, rows).to_pylist()
    assert [row[name] for name, row in zip(np.repeat(optional, 3), made, strict=True)] == (
        [None] * len(rows)
    )
    for column in numbers:
        if column.required:
            with pytest.raises(TableError, match=f"column {column.name} has 3 nulls"):
                build(table, [a_row(table) | {column.name: value} for value in NOT_FINITE])


@pytest.mark.parametrize("value", NOT_FINITE)
@pytest.mark.parametrize("column", ["tau", "lower"])
def test_no_file_holds_a_number_that_is_not_finite(
    column: str, value: float, tmp_path: Path
) -> None:
    path = tmp_path / "a.parquet"
    made = build("allan", [a_row("allan")] * 2)
    place = made.column_names.index(column)
    wrong = made.set_column(place, made.schema.field(place), pa.array([1.5, value]))
    fault = rf"a\.parquet: {column} of row 2 is {value}; expected a finite number or null"
    with pytest.raises(TableError, match=fault):
        write_arrow(wrong, path)
    assert not path.exists()
    pq.write_table(wrong, path)
    with pytest.raises(TableError, match=f"{fault}; remove the file"):
        read("allan", [path])


def test_texts_show_each_of_their_signs() -> None:
    made = build("scores", [SCORE | {"recording": "a\x1b[2J\n\u202eb"}])
    assert made["recording"].to_pylist() == ["a\\x1b[2J\n\\u202eb"]


def test_columns_carry_unit_and_meaning(tmp_path: Path) -> None:
    write("allan", [], tmp_path / "a.parquet")
    field = pq.read_schema(tmp_path / "a.parquet").field("tau")
    assert field.metadata == {b"unit": b"s", b"meaning": b"cluster length, cluster_size / rate"}


@pytest.mark.parametrize("table", TABLES)
def test_every_column_of_every_table_is_explained(table: str) -> None:
    for column in TABLES[table]:
        assert column.meaning and column.unit, column
    assert read(table, []).num_rows == 0


def test_tables_of_one_recording_are_tables() -> None:
    assert set(OF_ONE_RECORDING) < set(TABLES)


def test_names_of_columns_stand_once_in_a_table() -> None:
    for name, columns in TABLES.items():
        assert len({column.name for column in columns}) == len(columns), name


def test_a_table_is_written_as_parquet_or_csv(tmp_path: Path) -> None:
    made = build("scores", [SCORE])
    for kind in ("parquet", "csv"):
        write_arrow(made, tmp_path / f"new/scores.{kind}")
    assert read("scores", [tmp_path / "new/scores.parquet"]).equals(made)
    head, row = (tmp_path / "new/scores.csv").read_text().splitlines()
    assert head.startswith('"sensor","recording","channel","method","rms"')
    assert row.startswith('"s","r","gyro_x","curve",1')


def test_texts_and_json_are_written_as_they_are(tmp_path: Path) -> None:
    write_content("µ\n", tmp_path / "a.txt")
    write_content(b"\x00\r\n", tmp_path / "a.bin")
    write_json({"a": [1, None]}, tmp_path / "a.json")
    assert (tmp_path / "a.txt").read_bytes() == b"\xc2\xb5\n"
    assert (tmp_path / "a.bin").read_bytes() == b"\x00\r\n"
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": [1, None]}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json({"a": float("nan")}, tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": [1, None]}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bin", "a.json", "a.txt"]


def test_joining_refuses_another_table(tmp_path: Path) -> None:
    write("scores", [SCORE], tmp_path / "a.parquet")
    assert read("scores", [tmp_path / "a.parquet"] * 3).num_rows == 3
    with pytest.raises(
        TableError, match=r"a\.parquet was made by another version .* it has no tau"
    ):
        read("allan", [tmp_path / "a.parquet"])


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replace_file(path) as temporary:
        temporary.write_text("new")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_appears_with_all_that_is_in_it(tmp_path: Path) -> None:
    folder = tmp_path / "new/made"
    with make_folder(folder) as inside:
        write_content("a", inside / "of/a.txt")
        assert not folder.exists()
    assert [path.name for path in folder.rglob("*")] == ["of", "a.txt"]
    assert folder.stat().st_mode == folder.parent.stat().st_mode
    with pytest.raises(RuntimeError), make_folder(tmp_path / "new/other") as inside:
        write_content("a", inside / "a.txt")
        raise RuntimeError
    assert list(folder.parent.iterdir()) == [folder]


def test_sealed_json_deeper_than_python_reads_is_refused(tmp_path: Path) -> None:
    text = '{\n "a": ' + "[" * 100_000 + "]" * 100_000
    digest = hashlib.sha256(f"{text}\n}}".encode()).hexdigest()
    (tmp_path / "a.json").write_text(f'{text},\n "digest": "{digest}"\n}}\n')
    with pytest.raises(ValueError, match="is nested too deeply"):
        read_sealed_json(tmp_path / "a.json")


def test_a_pipe_for_a_file_is_damaged(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.parquet")
    with pytest.raises(TableError, match=r"a.parquet is damaged \(it is not a regular file\)"):
        read("parameters", [tmp_path / "a.parquet"])
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(ValueError, match="digest"):
        read_sealed_json(tmp_path / "a.json")


def test_texts_in_lists_and_structs_show_each_character() -> None:
    about = {"sensor": "s", "recording": "a", "device": "d", "kind": "static", "simulated": False,
             "status": "ok"}  # fmt: skip
    mark = DoubtMark("a\x1b", "motion", ("gyro\x1b_x",))
    shown = {"recording": "a\\x1b", "code": "motion", "channels": ["gyro\\x1b_x"]}
    for doubts in ((mark,), [asdict(mark)]):
        (row,) = build("recordings", [about | {"doubts": doubts}]).to_pylist()
        assert row["doubts"] == [shown]


def test_numbers_in_structs_are_finite_or_null() -> None:
    row = {"requirement": "r", "sensor": "s", "verdict": "meets", "decides": True, "unit": "rad",
           "error": "heading", "time": 1.0, "limit_verdict": "meets"}  # fmt: skip
    parts = tuple(Share("N", "gyro", share=share) for share in (0.5, *NOT_FINITE))
    (made,) = build("ranking", [row | {"parts": parts}]).to_pylist()
    assert [part["share"] for part in made["parts"]] == [0.5, None, None, None]
