import gzip
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.settings.sensor import LogFormat
from tests.conftest import few
from tests.readers import text_logs
from tests.readers.text_logs import columns, written

DEG = np.pi / 180
TWO = {"gyro_x": {"column": "wx", "unit": "deg/s"}, "accel_x": {"column": "ax", "unit": "g"}}
ROWS = "1,0.5\n2,0.25\n-3,1e-3\n"


def log_format(channels: dict[str, Any] | None = None, **keys: Any) -> LogFormat:
    return text_logs.log_format(channels or TWO, **keys)


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("wx,ax\n" + ROWS, {}),
        ("ax,other,wx\n0.5,x,1\n0.25,y,2\n1e-3,z,-3\n", {}),
        ("\ufeffwx,ax\r\n1,0.5\r\n2,0.25\r\n-3,1e-3\r\n", {}),
        ('"wx";"ax"\n1;0.5\n2;0.25\n-3;1e-3\n', {}),
        ("wx\tax\n1\t0.5\n2\t0.25\n-3\t1e-3\n", {}),
        ("wx|ax\n1|0.5\n2|0.25\n-3|1e-3\n", {}),
        ("wx ax\n1 0.5\n2 0.25\n-3 1e-3\n", {}),
        ("wx#ax\n1#0.5\n2#0.25\n-3#1e-3\n", {"delimiter": "#"}),
        ("// made by\n// a logger\nwx,ax\n" + ROWS, {"comment": "//"}),
        ("made by\n\nwx,ax\n" + ROWS, {"skip_lines": 1}),
        ("\n\nwx, ax\n" + ROWS, {}),
    ],
)
def test_layouts(tmp_path: Path, text: str, keys: dict[str, Any]) -> None:
    found, time, file = columns(written(tmp_path, text), log_format(**keys))
    np.testing.assert_allclose(found["gyro_x"], np.array([1, 2, -3]) * DEG)
    np.testing.assert_allclose(found["accel_x"], np.array([0.5, 0.25, 1e-3]) * 9.80665)
    assert time is None
    assert file.findings == []


@pytest.mark.parametrize("quotes", ['"a', 'b"c', '"'])
def test_a_stray_quote_swallows_nothing(tmp_path: Path, quotes: str) -> None:
    rows = [f"{i},0.5,{quotes if i in (50, 70) else 'x'}\n" for i in range(100)]
    found, _, _ = columns(written(tmp_path, "wx,ax,note\n" + "".join(rows)), log_format())
    np.testing.assert_allclose(found["gyro_x"], np.arange(100) * DEG)


@pytest.mark.parametrize(
    "text",
    [
        "Time (s),Gyro X (deg/s),Accel X\n0,1,2\n1,1,2\n",
        "Time (s)\tGyro X (deg/s)\tAccel X\n0\t1\t2\n1\t1\t2\n",
    ],
)
def test_spaces_in_names_are_no_delimiters(tmp_path: Path, text: str) -> None:
    channels = {"gyro_x": {"column": "Gyro X (deg/s)", "unit": "deg/s"}}
    found, _, _ = columns(written(tmp_path, text), log_format(channels))
    np.testing.assert_allclose(found["gyro_x"], [DEG, DEG])


def test_an_empty_first_cell_is_a_missing_sample(tmp_path: Path) -> None:
    channels = {"gyro_x": {"column": 1, "unit": "rad/s"}}
    found, _, _ = columns(written(tmp_path, ",0.1\n2,0.2\n"), log_format(channels))
    np.testing.assert_array_equal(found["gyro_x"], [np.nan, 2.0])


def test_many_lines_before_the_header(tmp_path: Path) -> None:
    text = "# a comment\n" * 3000 + "wx,ax\n" + ROWS
    found, _, _ = columns(written(tmp_path, text), log_format(comment="#"))
    assert len(found["gyro_x"]) == 3


@pytest.mark.parametrize("header", ["", "a,b\n"])
def test_columns_by_position_with_and_without_header(tmp_path: Path, header: str) -> None:
    channels = {"gyro_x": {"column": 2, "unit": "rad/s"}}
    found, _, _ = columns(written(tmp_path, header + "1,4\n2,5\n"), log_format(channels))
    assert found["gyro_x"].tolist() == [4.0, 5.0]


def test_gzip_is_seen_by_its_content(tmp_path: Path) -> None:
    text = gzip.compress(("wx,ax\n" + ROWS).encode())
    for name in ("a.csv.gz", "b.csv"):
        found, _, _ = columns(written(tmp_path, text, name), log_format())
        assert len(found["gyro_x"]) == 3


def test_raw_counts_have_scale_and_offset(tmp_path: Path) -> None:
    channels = {"gyro_x": {"column": 1, "unit": "deg/s", "scale": 0.5, "offset": 100}}
    found, _, _ = columns(written(tmp_path, "100\n104\n"), log_format(channels))
    np.testing.assert_allclose(found["gyro_x"], [0.0, 2 * DEG])


ISO = {"column": "t", "format": "iso8601"}
HALVES = ("00", "00.5", "01")


@pytest.mark.parametrize(
    ("time", "stamps"),
    [
        ({"column": "t", "unit": "s"}, ["10", "10.5", "11"]),
        ({"column": "t", "unit": "ms"}, ["1e6", "1000500", "1001000"]),
        (
            {"column": "t", "unit": "ns"},
            [str(1_700_000_000 * 10**9 + i * 10**9 // 2) for i in range(3)],
        ),
        (ISO, [f"2021-09-20T09:00:{second}" for second in HALVES]),
        (ISO, [f"2021-09-20 09:00:{second}Z" for second in HALVES]),
        (ISO, [f"2021-09-20T09:00:{second}+02:00" for second in HALVES]),
    ],
)
def test_times(tmp_path: Path, time: dict[str, str], stamps: list[str]) -> None:
    text = "t,wx,ax\n" + "".join(f"{stamp},1,2\n" for stamp in stamps)
    _, found, file = columns(written(tmp_path, text), log_format(time=time))
    assert found is not None
    np.testing.assert_allclose(found, [0.0, 0.5, 1.0], atol=1e-9)
    if time.get("format"):
        assert file.started.startswith("2021-09-20T0")


def test_missing_cells_are_nan(tmp_path: Path) -> None:
    found, _, _ = columns(written(tmp_path, "wx,ax\n1,2\n,3\nnan,4\n"), log_format())
    np.testing.assert_array_equal(np.isnan(found["gyro_x"]), [False, True, True])


@pytest.mark.parametrize("cut", ["4,0.", "4", "4,0.125"])
def test_a_last_record_cut_short_is_left_out_and_counted(tmp_path: Path, cut: str) -> None:
    found, _, file = columns(written(tmp_path, "wx,ax\n" + ROWS + cut), log_format())
    assert len(found["gyro_x"]) == 3
    assert [note.finding for note in file.findings] == ["incomplete_last_record"]
    assert "left out" in file.findings[0].detail


def test_a_short_last_line_is_left_out_and_counted(tmp_path: Path) -> None:
    found, _, file = columns(written(tmp_path, "wx,ax\n" + ROWS + "4\n"), log_format())
    assert len(found["gyro_x"]) == 3
    assert [note.finding for note in file.findings] == ["incomplete_last_record"]


def test_a_compressed_file_cut_short_is_read_as_far_as_it_goes(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    text = "wx,ax\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in rng.standard_normal((20_000, 2)))
    packed = gzip.compress(text.encode())
    found, _, file = columns(written(tmp_path, packed[: len(packed) // 2]), log_format())
    assert 8000 < len(found["gyro_x"]) < 12_000
    assert "truncated_file" in [note.finding for note in file.findings]


@pytest.mark.release
@pytest.mark.parametrize("kept", few([0.6], [0.0, 0.1, 1.0]))
def test_every_line_of_a_file_cut_short_that_can_be_read_is_kept(
    tmp_path: Path, rng: np.random.Generator, kept: float
) -> None:
    lines = [f"{a:.6f},{b:.6f}\n" for a, b in rng.standard_normal((150_000, 2))]
    packed = gzip.compress(("wx,ax\n" + "".join(lines)).encode(), compresslevel=1)
    cut = packed[: max(2000, int(kept * len(packed)) - 8)]
    readable = zlib.decompressobj(31).decompress(cut).count(b"\n") - 1
    found, _, _ = columns(written(tmp_path, cut), log_format())
    assert readable * 0.999 - 1500 <= len(found["gyro_x"]) <= readable


def test_what_cannot_be_opened_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").symlink_to(tmp_path / "none.csv")
    with pytest.raises(RecordingError, match=r"a\.csv: cannot be opened \(No such file"):
        columns(tmp_path / "a.csv", log_format())


def long(bad: str, behind: int = 1) -> Callable[[], str]:
    """Return what makes a log of more than one block of the reader, and a bad line behind it."""
    return lambda: "wx,ax\n" + "1.25,2.5\n" * 150_000 + bad + "1,2\n" * behind


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("wx,ax\n", "no record after the header"),
        ("wx,ay\n" + ROWS, r"no column 'ax' for accel_x; found wx, ay .*; correct 'column'"),
        ("wx,ax\n1,2\nx7,3\n1,2\n", r"a.csv, line 3, column 'wx': found 'x7', expected a number"),
        ("// c\nwx,ax\n1,2\n5,6,7\n1,2\n", r"line 4: found 3 columns, expected 2: '5,6,7'"),
        ("wx,ax\n1,2\n5\n1,2\n", r"line 3: found 1 columns, expected 2"),
        ("wx,ax\n1,2\n\n\n1,2\nx,2\n1,2\n", r"line 6, column 'wx'"),
        ("wx,wx,ax\n1,2,3\n", r"column 'wx' for gyro_x occurs twice .* its position instead"),
        (b"\x28\xb5\x2f\xfd" + bytes(100), r"a\.csv"),
        (long("1,oops\n"), r"line 150002, column 'ax': found 'oops'"),
        (long("1\n", 300_000), r"line 150002: found 1 columns"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + bytes(range(256)) * 20, "a.csv"),
        (lambda: b"x" * 3_000_000, "a.csv"),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, text: str | bytes | Callable[[], str | bytes], message: str
) -> None:
    path = written(tmp_path, text() if callable(text) else text)
    with pytest.raises(RecordingError, match=message):
        columns(path, log_format(comment="//"))


ONE = {"gyro_x": {"column": "wx", "unit": "rad/s"}}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("wx\n1\n2\n\n\n3\n", [1, 2, np.nan, np.nan, 3]),
        ("wx\r\n1\r\n2\r\n\r\n3\r\n", [1, 2, np.nan, 3]),
        ("wx\n1\n2\n \t \n3\n", [1, 2, np.nan, 3]),
        ("wx\n1\n2\n\n# said\n\n3\n", [1, 2, np.nan, np.nan, 3]),
        # What only sets records apart, or stands around them.
        ("wx\n1\n2\n3\n\n\n \n\n", [1, 2, 3]),
        ("\n\nwx\n\n\n1\n2\n3\n", [1, 2, 3]),
        ("wx\n\n1\n\n2\n\n3\n\n", [1, 2, 3]),
        ("wx\r\r\n1\r\r\n2\r\r\n3\r\r\n", [1, 2, 3]),
    ],
)
def test_a_blank_line_between_lines_of_one_column_is_a_missing_sample(
    tmp_path: Path, text: str, expected: list[float]
) -> None:
    found, _, file = columns(written(tmp_path, text), log_format(ONE))
    np.testing.assert_array_equal(found["gyro_x"], expected)
    assert file.findings == []


def test_blank_lines_over_blocks_of_one_column_are_each_a_missing_sample(tmp_path: Path) -> None:
    hole = 200_000  # lines, more than what is read at once
    parts = ["1.5\n" * 50_000, "\n" * hole, "2.5\n" * 50_000, "\n" * hole]
    found, _, _ = columns(written(tmp_path, "wx\n" + "".join(parts)), log_format(ONE))
    values = found["gyro_x"]
    assert len(values) == 100_000 + hole
    assert np.isnan(values[50_000 : 50_000 + hole]).all()
    assert np.isfinite(values).sum() == 100_000


def test_a_line_behind_missing_samples_of_one_column_is_named_by_its_number(tmp_path: Path) -> None:
    path = written(tmp_path, "wx\n1\n2\n\n\n3\nx\n4\n")
    with pytest.raises(RecordingError, match=r"line 7, column 'wx': found 'x'"):
        columns(path, log_format(ONE))


@pytest.mark.parametrize("column", ["angle", 3])
def test_a_position_that_is_missing_is_mended_where_it_is_stated(
    tmp_path: Path, column: str | int
) -> None:
    path = written(tmp_path, "wx,ax\n" + ROWS)
    with pytest.raises(RecordingError, match=r"for position; .* in the notes beside the log or"):
        columns(path, log_format(position={"column": column}))


@pytest.mark.parametrize("place", [100, 0.5])
def test_compressed_data_corrupt_inside_reject(
    tmp_path: Path, rng: np.random.Generator, place: float
) -> None:
    text = "wx,ax\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in rng.standard_normal((20_000, 2)))
    packed = bytearray(gzip.compress(text.encode()))
    begin = int(place if place > 1 else place * len(packed))
    packed[begin : begin + 64] = bytes(64)
    with pytest.raises(RecordingError, match=r"a\.csv"):
        columns(written(tmp_path, bytes(packed)), log_format())


def test_a_mixed_time_zone_is_named(tmp_path: Path) -> None:
    text = "t,wx,ax\n2021-09-20T09:00:00,1,2\n2021-09-20T09:00:01Z,1,2\n"
    time = {"column": "t", "format": "iso8601"}
    with pytest.raises(RecordingError, match=r"line 3, column 't': .*expected a time stamp"):
        columns(written(tmp_path, text), log_format(time=time))


def test_files_and_folders(tmp_path: Path) -> None:
    per_axis = {
        "gyro_x": {"file": "x.csv", "column": 1, "unit": "rad/s"},
        "gyro_y": {"file": "y.csv", "column": 1, "unit": "rad/s"},
    }
    folder = tmp_path / "r"
    folder.mkdir()
    written(folder, "1\n2\n", "x.csv")
    with pytest.raises(RecordingError, match=r"no file 'y.csv' for gyro_y; the folder has x.csv"):
        read(folder, log_format(per_axis))
    written(folder, "3\n4\n", "y.csv")
    files = read(folder, log_format(per_axis))
    assert [file.path.name for file in files] == ["x.csv", "y.csv"]
    with pytest.raises(RecordingError, match=r"expected one file, the folder has x.csv, y.csv"):
        read(folder, log_format())
    with pytest.raises(RecordingError, match=r"is a single file, but .file:. in the sensor"):
        read(folder / "x.csv", log_format(per_axis))
