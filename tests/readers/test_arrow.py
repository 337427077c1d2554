import re
import subprocess
import sys
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq
import pytest
from hypothesis import given

from imubench_pipeline.readers.arrays import file as arrays
from imubench_pipeline.settings.sensor import LogFormat
from tests.conftest import PROJECT
from tests.readers.array_files import (
    FIRST,
    STEP,
    Damage,
    contents,
    cut_everywhere,
    damages,
    log_format,
    refused,
    survives,
)
from tests.readers.damage import examples

KINDS = ["parquet", "feather", "stream"]
ROWS = 60


def saved(path: Path, table: pa.Table, kind: str = "parquet", **keys: Any) -> Path:
    if kind == "parquet":
        pq.write_table(table, path, **{"row_group_size": 25} | keys)
    elif kind == "feather":
        feather.write_feather(table, str(path), **{"chunksize": 25} | keys)
    else:
        with pa.ipc.new_stream(str(path), table.schema) as stream:
            stream.write_table(table, 25)
    return path


def sample() -> pa.Table:
    stamps = FIRST + np.arange(ROWS) * np.timedelta64(STEP, "ns")
    counts = [None if row % 7 == 3 else row for row in range(ROWS)]
    return pa.table(
        {
            "stamp": pa.array(stamps),
            "wx": np.arange(ROWS) / 8,
            "wx.raw": pa.array(counts, pa.int16()),
            "ns": pa.array([None if row == 2 else 2**60 + row for row in range(ROWS)], pa.int64()),
            "u8": np.arange(ROWS).astype(np.uint8),
            "half": np.arange(ROWS).astype(np.float16),
            "money": pa.array([Decimal(row) / 4 for row in range(ROWS)]),
            "class": pa.array([row // 20 for row in range(ROWS)]).dictionary_encode(),
            "gap": pa.array([None if row == 5 else float(row) for row in range(ROWS)]),
            "none": pa.nulls(ROWS),
            "note": ["x"] * ROWS,
            "list": [[1.0, 2.0]] * ROWS,
            "flag": [True] * ROWS,
        }
    )


def log(channels: dict[str, Any], **keys: Any) -> LogFormat:
    return log_format(channels, **{"reader": "arrow"} | keys)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("rows_a_block", [7, 1 << 18])
def test_columns_of_every_numeric_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, rows_a_block: int
) -> None:
    monkeypatch.setattr(arrays, "_MAX_BLOCK_ROWS", rows_a_block)
    path = saved(tmp_path / "a", sample(), kind)
    rows = np.arange(float(ROWS))
    nulls = np.where(np.arange(ROWS) % 7 == 3, np.nan, rows)
    expected = {
        "wx": rows / 8,
        "wx.raw": nulls,
        "u8": rows,
        "half": rows,
        "money": rows / 4,
        "class": rows // 20,
        "gap": np.where(rows == 5, np.nan, rows),
        "none": np.full(ROWS, np.nan),
    }
    names = list(sample().column_names)
    for name, values in expected.items():
        channels = {"gyro_x": {"column": name}, "gyro_y": {"column": names.index(name) + 1}}
        found, time, _ = contents(path, log(channels))
        np.testing.assert_array_equal(found["gyro_x"], values)
        np.testing.assert_array_equal(found["gyro_y"], values)
        assert time is None


@pytest.mark.parametrize("kind", ["parquet", "feather"])
def test_the_format_is_told_by_content(tmp_path: Path, kind: str) -> None:
    path = saved(tmp_path / "a.csv", sample(), kind)
    found, _, _ = contents(path, log_format({"gyro_x": {"column": "wx"}}))
    np.testing.assert_array_equal(found["gyro_x"], np.arange(ROWS) / 8)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "stamps",
    [
        pa.timestamp("s"),
        pa.timestamp("ms"),
        pa.timestamp("us", "UTC"),
        pa.timestamp("ns", "America/Sao_Paulo"),
    ],
)
def test_timestamps(tmp_path: Path, kind: str, stamps: pa.DataType) -> None:
    seconds = [datetime(2024, 5, 1, 10, 0, second, tzinfo=UTC) for second in (0, 1, 2, 3)]
    column = pa.array([*seconds[:2], None, seconds[3]], pa.timestamp("s", "UTC")).cast(stamps)
    table = pa.table({"t": column, "wx": [1.0, 2, 3, 4]})
    time = {"column": "t", "format": "iso8601"}
    _, found, file = contents(
        saved(tmp_path / "a", table, kind), log({"gyro_x": {"column": "wx"}}, time=time)
    )
    np.testing.assert_array_equal(found, [0, 1, np.nan, 3])
    assert file.started == "2024-05-01T10:00:00.000"


@pytest.mark.parametrize("kind", KINDS)
def test_nanoseconds_lose_no_digit_beside_a_null(tmp_path: Path, kind: str) -> None:
    path = saved(tmp_path / "a", sample(), kind)
    channels = {"gyro_x": {"column": "wx"}}
    _, time, _ = contents(path, log(channels, time={"column": "ns", "unit": "ns"}))
    expected = np.arange(ROWS) * 1e-9
    expected[2] = np.nan
    np.testing.assert_allclose(time, expected, rtol=1e-12)
    _, time, file = contents(path, log(channels, time={"column": 1, "format": "iso8601"}))
    np.testing.assert_allclose(time, np.arange(ROWS) * 0.01, rtol=1e-12)
    assert file.started == "2024-05-01T10:00:00.000"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("channels", "keys", "message"),
    [
        ({"gyro_x": {"column": "note"}}, {}, "column 'note' of the table for gyro_x holds string"),
        ({"gyro_x": {"column": "list"}}, {}, "'list' .* for gyro_x holds list<.*expected numbers"),
        ({"gyro_x": {"column": "flag"}}, {}, "'flag' .* for gyro_x holds bool; expected numbers"),
        ({"gyro_x": {"column": "stamp"}}, {}, r"holds timestamp\[ns\]; expected numbers"),
        ({"gyro_x": {"column": "w"}}, {}, "no variable or column 'w' .* has column stamp, column"),
        ({"gyro_x": {"column": 14}}, {}, "no column 14 for gyro_x; the table has 13 columns"),
        (
            {"gyro_x": {"column": "wx", "variable": "v"}},
            {},
            "of gyro_x is 'v', .* drop 'variable:'",
        ),
        (
            {"gyro_x": {"column": "wx"}},
            {"time": {"column": "stamp", "unit": "s"}},
            r"'stamp' of the table for time holds timestamp\[ns\].*give 'format: iso8601'",
        ),
        (
            {"gyro_x": {"column": "wx"}},
            {"time": {"column": "note", "format": "iso8601"}},
            "'note' of the table for time holds string; expected dates",
        ),
        (
            {"gyro_x": {"column": "wx"}},
            {"time": {"column": "none", "unit": "s"}},
            "no time stamp in the first",
        ),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, kind: str, channels: dict[str, Any], keys: dict[str, Any], message: str
) -> None:
    refused(saved(tmp_path / "a", sample(), kind), log(channels, **keys), message)


@pytest.mark.parametrize("kind", KINDS)
def test_a_name_that_stands_twice(tmp_path: Path, kind: str) -> None:
    names = ["wx", "t", "wx"]
    table = pa.table([np.ones(3), np.arange(3.0), np.full(3, 2.0)], names=names)
    path = saved(tmp_path / "a", table, kind) if kind != "feather" else tmp_path / "a"
    if kind == "feather":  # its own writer refuses this
        with pa.ipc.new_file(str(path), table.schema) as file:
            file.write_table(table)
    refused(path, log({"gyro_x": {"column": "wx"}}), "'wx' for gyro_x occurs twice .* position")
    found, _, _ = contents(path, log({"gyro_x": {"column": 3}, "gyro_y": {"column": 1}}))
    assert found["gyro_x"].tolist() == [2, 2, 2]
    assert found["gyro_y"].tolist() == [1, 1, 1]


@pytest.mark.parametrize("kind", KINDS)
def test_no_record_and_no_column(tmp_path: Path, kind: str) -> None:
    channels = {"gyro_x": {"column": "wx"}}
    refused(saved(tmp_path / "a", sample()[:0], kind), log(channels), "no rows")
    refused(
        saved(tmp_path / "b", pa.table({}), kind), log({"gyro_x": {"column": 1}}), "has no column"
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"FEA1" + bytes(100), "is Feather version 1; expected version 2"),
        (b"PAR1" + bytes(100) + b"PAR1", "corrupt data, or cut short"),
        (b"ARROW1" + bytes(100), "corrupt data, or cut short"),
        (b"\xff" * 100, "corrupt data, or cut short"),
        (b"some text", "not a Parquet, Feather or Arrow file"),
        (b"", "the file is empty"),
    ],
)
def test_what_is_no_such_file(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "a.parquet"
    path.write_bytes(data)
    refused(path, log({"gyro_x": {"column": 1}}), message)


def test_a_record_batch_that_promises_too_much(tmp_path: Path) -> None:
    table = pa.table({"wx": np.arange(ROWS, dtype=float)})
    path = saved(tmp_path / "a", table, "feather", compression="uncompressed", chunksize=ROWS)
    for promised in (10**15, 10**6, ROWS + 8):
        data = path.read_bytes().replace(ROWS.to_bytes(8, "little"), promised.to_bytes(8, "little"))
        path.with_name("b").write_bytes(data)
        refused(path.with_name("b"), log({"gyro_x": {"column": 1}}), "corrupt data")


def test_a_page_with_a_wrong_checksum(tmp_path: Path, rng: np.random.Generator) -> None:
    table = pa.table({"wx": rng.standard_normal(5000)})
    path = saved(
        tmp_path / "a", table, compression="none", use_dictionary=False, write_page_checksum=True
    )
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    refused(path, log({"gyro_x": {"column": 1}}), "corrupt data.*CRC")


def test_rows_that_are_left_out_are_no_log(tmp_path: Path, rng: np.random.Generator) -> None:
    table = pa.table({"wx": rng.standard_normal(1000)})
    path = saved(tmp_path / "a", table, row_group_size=1000)
    data = path.read_bytes()
    footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    # The first integer of the footer that is 1000 is the number of all rows; twice that, in Thrift.
    before, stated, after = data[footer:].partition(b"\x16\xd0\x0f")
    assert stated
    path.write_bytes(data[:footer] + before + b"\x16\xd2\x0f" + after)
    refused(path, log({"gyro_x": {"column": "wx"}}), "found 1000 rows, expected 1001")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("arrow")
    plain = {"compression": "none", "use_dictionary": False, "write_page_checksum": True}
    return [
        saved(folder / "a", sample()),
        saved(folder / "b", sample(), **plain),
        saved(folder / "c", sample(), data_page_version="2.0", compression="zstd"),
        saved(folder / "d", sample(), "feather", compression="lz4"),
        saved(folder / "e", sample(), "feather", compression="zstd"),
        saved(folder / "f", sample(), "feather", compression="uncompressed"),
        saved(folder / "g", sample(), "stream"),
    ]


EVERY = {
    "gyro_x": {"column": "wx"},
    "gyro_y": {"column": "wx.raw"},
    "gyro_z": {"column": "class"},
    "accel_x": {"column": "money", "unit": "g"},
}
STAMPED = {"column": "stamp", "format": "iso8601"}


@pytest.mark.release
def test_cut_files_are_refused(whole: list[Path]) -> None:
    for path in whole[:-1]:
        assert cut_everywhere(path, log(EVERY, time=STAMPED)) == 0
    # A stream says nowhere how long it is: it may be cut between two batches.
    assert cut_everywhere(whole[-1], log(EVERY, time=STAMPED)) <= 2


@examples(40)
@given(damage=damages)
def test_damaged_files_never_crash(whole: list[Path], damage: Damage) -> None:
    for path in whole:
        data = damage(path.read_bytes())
        survives(path.with_name("damaged"), data, log(EVERY, time=STAMPED))


@pytest.mark.parametrize("kind", ["parquet", "feather"])
def test_a_block_that_takes_more_memory_than_permitted_is_not_read(
    tmp_path: Path, kind: str
) -> None:
    zeros = pa.table({"wx": np.zeros(1 << 23)})
    keys: dict[str, Any] = {"compression": "zstd", "chunksize": len(zeros)}
    if kind == "parquet":
        keys = {"compression": "zstd", "use_dictionary": False, "data_page_size": 1 << 30}
        keys |= {"write_batch_size": len(zeros), "row_group_size": len(zeros)}
    path = saved(tmp_path / "a", zeros, kind, **keys)
    # A process of its own: memory that this one has freed would be used again, and not counted.
    code = (
        "import sys; from pathlib import Path; from tests.readers.test_arrow import contents, log\n"
        "from imubench_pipeline.readers.bounded import run_bounded\n"
        "asked = log({'gyro_x': {'column': 1}})\n"
        "run_bounded(60.0, 48 << 20, contents, Path(sys.argv[1]), asked)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, path], cwd=PROJECT, capture_output=True, text=True, check=False
    )
    assert done.returncode and re.search(
        "(BoundError|RecordingError):.*(memory|alloc)", done.stderr
    )
