from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.settings.validation import ConfigError, parse
from tests.readers.damage import examples
from tests.readers.text_logs import PLACED, TWO, columns, log_format, written

GYRO, ACCEL = [1.0, 2.0, -3.0], [0.5, 0.25, 1e-3]
ROWS = "1,0.5\n2,0.25\n-3,1e-3\n"
DEGREE = "wx (°/s);ax\r\n1;0.5\r\n2;0.25\r\n-3;1e-3\r\n"
IN_DEGREES = {"gyro_x": {"column": "wx (°/s)", "unit": "rad/s"}, "accel_x": TWO["accel_x"]}

LAYOUTS: dict[str, tuple[str | bytes, dict[str, Any]]] = {
    "aligned columns": (" wx      ax\n  1    0.5\n  2   0.25\n -3   1e-3  \n", {}),
    "aligned, names with spaces": (
        "Gyro X     Acc X\n     1      0.5\n     2     0.25\n    -3     1e-3\n",
        {
            "gyro_x": {"column": "Gyro X", "unit": "rad/s"},
            "accel_x": {"column": "Acc X", "unit": "m/s^2"},
        },
    ),
    "tabs and spaces": ("wx\t ax\n1 \t0.5\n2\t 0.25\n-3 \t 1e-3\n", {}),
    "tab": ("wx\tax\n1\t0.5\n2\t0.25\n-3\t1e-3\n", {}),
    "spaces after commas": ("wx, ax\n 1, 0.5\n 2, 0.25\n-3, 1e-3\n", {}),
    "semicolon, decimal comma": ("wx;ax\n1,0;0,5\n2,0;0,25\n-3,0;1e-3\n", {}),
    "tab, decimal comma": ("wx\tax\n1,0\t0,5\n2,0\t0,25\n-3,0\t1,0E-3\n", {}),
    "spaces, decimal comma": ("wx ax\n1,0 0,5\n2,0 0,25\n-3,0 1e-3\n", {}),
    "comma, decimal comma in quotes": ('wx,ax\n"1,0","0,5"\n"2","0,25"\n"-3","1e-3"\n', {}),
    "plus signs": ("wx,ax\n+1,+0.5\n+2,+2.5e-1\n-3,+1e-3\n", {}),
    "UTF-8 with mark": ("\ufeff" + DEGREE, IN_DEGREES),
    "Latin-1": (DEGREE.encode("latin-1"), IN_DEGREES),
    "UTF-16": (DEGREE.encode("utf-16"), IN_DEGREES),
    "UTF-16, big end first": (b"\xfe\xff" + DEGREE.encode("utf-16-be"), IN_DEGREES),
    "UTF-32": (DEGREE.encode("utf-32"), IN_DEGREES),
    "comments": ("# a\nwx,ax\n# b, c\n1,0.5\n#\n2,0.25\n-3,1e-3\n# end\n", {}),
    "comments //": ("// a: 1\nwx,ax\n1,0.5\n// b,c\n2,0.25\n-3,1e-3\n", {}),
    "comments %": ("% a\nwx,ax\n1,0.5\n%\n2,0.25\n-3,1e-3\n", {}),
    "comments ;": ("; a; b\nwx,ax\n1,0.5\n;b\n2,0.25\n-3,1e-3\n", {}),
    "header in a comment": ("# Logger\n# wx ax\n1 0.5\n2 0.25\n-3 1e-3\n", {}),
    "lines of text before": ("Logger X\nSerial,12\nRange: 5\n\nwx,ax\n" + ROWS, {}),
    "units below": ("wx,ax\n(rad/s),(m/s^2)\n" + ROWS, {}),
    "units and a rule below": ("wx;ax\nrad/s;m/s²\n----;----\n1;0.5\n2;0.25\n-3;1e-3\n", {}),
    "trailing delimiters": ("wx,ax,\n1,0.5,\n2,0.25,\n-3,1e-3,\n", {}),
    "trailing in records": ("wx,ax\n1,0.5,\n2,0.25,\n-3,1e-3,\n", {}),
    "trailing in the header": ("wx,ax,\n" + ROWS, {}),
    "blank lines": ("\nwx,ax\n\n1,0.5\n  \n2,0.25\n\n\n-3,1e-3\n \n\n", {}),
    "mixed line ends": ("wx,ax\r\n1,0.5\n2,0.25\r\r\n-3,1e-3\r\n", {}),
    "lone returns": ("wx,ax\r1,0.5\r2,0.25\r-3,1e-3\r", {}),
    "quoted text beside": ('wx,ax,n\n1,0.5,\n2,0.25,"a, b"\n-3,1e-3,"c"\n', {}),
    "first of two of one name": ("wx,ax,n,n\n1,0.5,7,8\n2,0.25,7,8\n-3,1e-3,7,8\n", {}),
    "by position, text before": ("Logger\nX,1\n1,0.5,a\n2,0.25,b\n-3,1e-3,c\n", PLACED),
    "by position, decimal comma": ("1,0;0,5\n2,0;0,25\n-3,0;1e-3\n", PLACED),
    "by position, aligned": ("    1   0.5\n    2  0.25\n   -3  1e-3\n", PLACED),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_are_found(tmp_path: Path, layout: str) -> None:
    text, channels = LAYOUTS[layout]
    found, _, file = columns(written(tmp_path, text), log_format(channels))
    np.testing.assert_allclose(found["gyro_x"], GYRO)
    np.testing.assert_allclose(found["accel_x"], ACCEL)
    assert file.findings == []


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("REM a\nwx,ax\n1,0.5\nREM b\n2,0.25\n-3,1e-3\n", {"comment": "REM"}),
        ("wx#ax\n1#0.5\n2#0.25\n-3#1e-3\n", {"delimiter": "#"}),
        ("wx ax\n1 0.5\n2  0.25\n-3 1e-3\n", {"delimiter": " "}),
        ("0;0\n1;0,5\n2;0,25\n-3;1e-3\n", {"decimal": ",", "skip_lines": 1, "channels": PLACED}),
        ("7,7\n" + ROWS, {"header": True, "channels": PLACED}),
        (ROWS, {"header": False, "channels": PLACED}),
    ],
)
def test_what_is_stated_is_taken(tmp_path: Path, text: str, keys: dict[str, Any]) -> None:
    found, _, _ = columns(written(tmp_path, text), log_format(**keys))
    np.testing.assert_allclose(found["gyro_x"], GYRO)
    np.testing.assert_allclose(found["accel_x"], ACCEL)


def six_digits(x: float) -> float:
    """What is so small that its square is 0 is read as 0."""
    return float(f"{x:.6g}") if abs(x) > 1e-70 else 0.0


NUMBERS = st.lists(
    st.tuples(*[st.floats(-1e6, 1e6, allow_nan=False).map(six_digits)] * 3),
    min_size=2,
    max_size=30,
)


@examples(60)
@given(
    NUMBERS,
    st.sampled_from([";", "\t", ",", "|", " ", "   "]),
    st.sampled_from([".", ","]),
    st.sampled_from(["", "# made by x\n", "// Key: 1, 2; 3\n", "% a b c\n", "Logger 7\n"]),
    st.sampled_from(["\n", "\r\n", "\r"]),
    st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    st.booleans(),
    st.booleans(),
)
def test_any_way_of_writing_is_the_same_log(
    tmp_path: Path,
    rows: list[tuple[float, ...]],
    delimiter: str,
    decimal: str,
    before: str,
    end: str,
    encoding: str,
    trailing: bool,
    units: bool,
) -> None:
    if decimal == delimiter:
        decimal = "."
    lines = ["t°,wx,ax".replace(",", delimiter)]
    lines += ["s,rad/s,m/s^2".replace(",", delimiter)] * units
    lines += [
        delimiter.join(f"{x:.6e}".replace(".", decimal) for x in row) + delimiter * trailing
        for row in rows
    ]
    text = before + "\n".join(lines) + "\n"
    path = written(tmp_path, text.replace("\n", end).encode(encoding))
    log = log_format(time={"column": "t°", "unit": "s"})
    found, time, _ = columns(path, log)
    truth = np.array(rows)
    np.testing.assert_array_equal(found["gyro_x"], truth[:, 1])
    np.testing.assert_array_equal(found["accel_x"], truth[:, 2])
    np.testing.assert_array_equal(time, truth[:, 0] - truth[0, 0])


@pytest.mark.release
def test_thousands_of_columns(tmp_path: Path, rng: np.random.Generator) -> None:
    data = rng.standard_normal((30, 5000))
    names = [f"c{n}" for n in range(5000)]
    text = ",".join(names) + "\n" + "".join(",".join(map(str, row)) + "\n" for row in data)
    channels = {"gyro_x": {"column": "c4999", "unit": "rad/s"}, "accel_z": PLACED["accel_x"]}
    found, _, _ = columns(written(tmp_path, text), log_format(channels))
    np.testing.assert_array_equal(found["gyro_x"], data[:, 4999])
    np.testing.assert_array_equal(found["accel_z"], data[:, 1])


@pytest.mark.parametrize(
    ("text", "kept", "restarts"),
    [
        ("wx,ax\n1,2\nwx,ax\n3,4\nwx,ax\n5,6\n", [1, 3, 5], 2),
        ("wx,ax\n1,2\nwx,ax\r\n3,4\n", [1, 3], 1),
        ("# log\nwx,ax\nu,v\n1,2\n# log\nwx,ax\nu,v\n3,4\n", [1, 3], 1),
        ("Logger X\nwx,ax\n1,2\nLogger X\nwx,ax\n3,4\n", [1, 3], 1),
        # The power was cut in the middle of a record.
        ("wx,ax\n1,2\n3,4.wx,ax\n5,6\n", [1, 5], 1),
        ("Logger X\nwx,ax\n1,2\n3,4.Logger X\nwx,ax\n5,6\n", [1, 5], 1),
        ("# wx ax\n1 2\n3 4\n# wx ax\n5 6\n", [1, 3, 5], 1),
        ("# log\n# wx,ax\n1,2\n3,4.# log\n# wx,ax\n5,6\n", [1, 5], 1),
        ("a  wx\n1  1\n2  2\na  wx\n3  3\n", [1, 2, 3], 1),
    ],
)
def test_a_header_in_the_middle_is_counted(
    tmp_path: Path, text: str, kept: list[float], restarts: int
) -> None:
    channels = {"gyro_x": TWO["gyro_x"]}
    found, _, file = columns(written(tmp_path, text), log_format(channels))
    assert found["gyro_x"].tolist() == kept
    (finding,) = file.findings
    assert (finding.finding, finding.value) == ("restarted_log", restarts)


@pytest.mark.release
def test_restarts_and_comments_in_a_long_log(tmp_path: Path) -> None:
    lines = ["wx,ax"]
    for row in range(100_000):
        lines += ["# note"] * (row % 1000 == 7) + ["wx,ax"] * (row % 50_000 == 49_999)
        lines.append(f"{row},0.125")
    path = written(tmp_path, "\n".join(lines) + "\n")
    found, _, file = columns(path, log_format())
    np.testing.assert_array_equal(found["gyro_x"], np.arange(100_000))
    assert [(f.finding, f.value) for f in file.findings] == [("restarted_log", 2)]
    bad = len(lines)
    lines[-1] = "oops,1"
    with pytest.raises(RecordingError, match=rf"line {bad}, column 'wx': found 'oops'"):
        columns(written(tmp_path, "\n".join(lines) + "\n"), log_format())


def test_a_short_log_with_much_after_it(tmp_path: Path) -> None:
    found, _, _ = columns(written(tmp_path, "wx,ax\n1,2\n" + "\n" * 600_000), log_format())
    assert found["gyro_x"].tolist() == [1]


def test_a_first_record_without_its_beginning_is_noted(tmp_path: Path) -> None:
    found, _, file = columns(written(tmp_path, ".5\n1,2\n3,4\n"), log_format(PLACED))
    assert found["gyro_x"].tolist() == [1, 3]
    assert [f.finding for f in file.findings] == ["incomplete_first_record"]


@pytest.mark.parametrize(
    ("lines", "rate"),
    [
        (["// Update Rate: 100.0Hz"], 100.0),
        (["# Sample rate: 1.6 kHz"], 1600.0),
        (["Sampling Frequency;200;Hz", "x"], None),
        (["Sampling frequency = 200,5 Hz"], 200.5),
        (["# Output data rate: 50 SPS"], 50.0),
        (["# gyro sample rate: 100 Hz", "# accel sample rate: 50 Hz"], None),
        (["# Sample rate: 100"], None),
        (["# Sample rate: 0 Hz"], None),
        (["# Baud rate: 9600"], None),
    ],
)
def test_a_rate_that_the_file_states(tmp_path: Path, lines: list[str], rate: float | None) -> None:
    text = "".join(line + "\n" for line in lines) + "wx,ax\n" + ROWS
    _, _, file = columns(written(tmp_path, text), log_format())
    assert file.rate == rate


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"delimiter": ",", "decimal": ","}, "'delimiter' and 'decimal' are both ','"),
        ({"decimal": ";"}, "decimal"),
    ],
)
def test_what_cannot_be_stated(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse(LogFormat, {"rate": "1 Hz", "channels": TWO} | keys, "s.yaml")


@pytest.mark.parametrize(
    ("first", "then"), [("\n", "\r"), ("\r\n", "\r"), ("\r\n", "\n"), ("\n", "\r\n")]
)
@pytest.mark.parametrize("cut", ["", "1.5"])
def test_line_breaks_that_change_lose_no_record(
    tmp_path: Path, first: str, then: str, cut: str
) -> None:
    values = np.arange(400).reshape(200, 2) / 8
    lines = [f"{a},{b}" for a, b in values]
    text = "wx,ax" + first + first.join(lines[:120]) + first + then.join(lines[120:]) + then + cut
    read, _, file = columns(written(tmp_path, text), log_format())
    assert read["gyro_x"].tolist() == values[:, 0].tolist()
    assert read["accel_x"].tolist() == values[:, 1].tolist()
    found = {finding.finding for finding in file.findings}
    assert found == ({"incomplete_last_record"} if cut else set())
