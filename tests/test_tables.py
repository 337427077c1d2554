from pathlib import Path

import pyarrow.parquet as pq
import pytest

from imubench_pipeline import tables
from imubench_pipeline.tables import TableError, build, read, replacing, write

SCORE = {"sensor": "s", "recording": "r", "channel": "gyro_x", "method": "curve", "rms": 1.0}


def test_rows_are_checked() -> None:
    assert build("scores", [SCORE]).num_rows == 1
    with pytest.raises(TableError, match=r"unknown columns \['rmse'\]"):
        build("scores", [SCORE | {"rmse": 1.0}])
    with pytest.raises(TableError, match="column channel has 1 nulls"):
        build("scores", [SCORE | {"channel": None}])


def test_a_value_that_is_not_there_is_null(tmp_path: Path) -> None:
    write("scores", [SCORE | {"rms": float("nan")}], tmp_path / "a.parquet")
    assert pq.read_table(tmp_path / "a.parquet")["rms"].null_count == 1


def test_columns_carry_unit_and_meaning(tmp_path: Path) -> None:
    write("allan", [], tmp_path / "a.parquet")
    field = pq.read_schema(tmp_path / "a.parquet").field("tau")
    assert field.metadata == {b"unit": b"s", b"meaning": b"cluster length, cluster_size / rate"}


@pytest.mark.parametrize("table", tables.TABLES)
def test_every_column_of_every_table_is_explained(table: str) -> None:
    for column in tables.TABLES[table]:
        assert column.meaning and column.unit, column
    assert read(table, []).num_rows == 0


def test_joining_refuses_another_table(tmp_path: Path) -> None:
    write("scores", [SCORE], tmp_path / "a.parquet")
    assert read("scores", [tmp_path / "a.parquet"] * 3).num_rows == 3
    with pytest.raises(TableError, match=r"a.parquet: columns"):
        read("allan", [tmp_path / "a.parquet"])


def test_a_write_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(RuntimeError), replacing(path) as temporary:
        temporary.write_text("new")
        raise RuntimeError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
