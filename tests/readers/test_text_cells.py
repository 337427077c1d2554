from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from tests.readers.text_logs import columns, log_format, written

MISSING = [
    *("", " ", "   ", "nan", "NaN", "NAN", "-nan", " nan", "NaN ", "-nan(ind)", "na", "NA"),
    *("N/A", "n/a", "#N/A", "null", "NULL", "None", "-", "--", "-----", "----------", "***"),
    *("************", "?", "1.#QNAN", "-1.#IND", "1.#QNAN00", "-1.#IND000000", "1.#INF00"),
    *("-1.#INF", "OVERFLOW", "Overflow", "OVL", "OL", "ERR", "Error", "#VALUE!", "#DIV/0!"),
]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_what_loggers_write_for_no_number_is_missing(tmp_path: Path, delimiter: str) -> None:
    rows = [("1.5", "2")] + [(cell, "2") for cell in MISSING] + [("2.5", "2")]
    text = "".join(delimiter.join(row) + "\n" for row in [("wx", "ax"), *rows])
    found, _, file = columns(written(tmp_path, text), log_format())
    assert found["gyro_x"][[0, -1]].tolist() == [1.5, 2.5]
    assert np.isnan(found["gyro_x"][1:-1]).all()
    assert len(found["gyro_x"]) == len(MISSING) + 2
    assert file.findings == []


@pytest.mark.parametrize("cell", ["inf", "Inf", "INF", "Infinity", "infinity", "1e999"])
@pytest.mark.parametrize("sign", ["", "-"])
def test_infinity_is_infinite(tmp_path: Path, cell: str, sign: str) -> None:
    found, _, _ = columns(written(tmp_path, f"wx,ax\n1,2\n{sign}{cell},2\n"), log_format())
    assert found["gyro_x"][1] == (-np.inf if sign else np.inf)


@pytest.mark.parametrize(
    "cell", ["x", "0x1F", "1.2.3", "1,5", "12:30", "1_000", "1d5", "1 2", "µ", "1e", "--1"]
)
def test_anything_else_is_named(tmp_path: Path, cell: str) -> None:
    text = f"wx;ax\n1.5;2\n\n# c\n2.5;{cell}\n3.5;4\n"
    with pytest.raises(
        RecordingError,
        match=r"a\.csv, line 5, column 'ax': found .*, expected a number with the decimal "
        r"sign '\.', or an empty cell; either the file is corrupt there \(copy it again",
    ):
        columns(written(tmp_path, text), log_format())


def test_the_decimal_sign_of_the_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match=r"found '1\.5', expected a number with the decimal sign ','"
    ):
        columns(written(tmp_path, "wx;ax\n1,5;2\n2,5;2\n3,5;1.5\n"), log_format())


def test_latin_1_in_a_cell_is_named(tmp_path: Path) -> None:
    text = "wx,ax\n1,2\n3,4\xb0\n".encode("latin-1")
    with pytest.raises(RecordingError, match=r"line 3, column 'ax': found '4"):
        columns(written(tmp_path, text), log_format())


@pytest.mark.parametrize("junk", [b"\xfe\xff", b"\xb0,\xb0,\xb0", b"\x80"])
def test_bytes_that_are_no_text_are_a_record_of_wrong_width(tmp_path: Path, junk: bytes) -> None:
    text = b"wx,ax\n1,2\n" + junk + b"\n"
    found, _, file = columns(written(tmp_path, text), log_format())
    assert found["gyro_x"].tolist() == [1.0]
    assert [finding.finding for finding in file.findings] == ["incomplete_last_record"]
    with pytest.raises(RecordingError, match=r"line 3: found [13] columns, expected 2"):
        columns(written(tmp_path, text + b"1,2\n"), log_format())


def test_latin_1_beside_the_columns_is_passed_over(tmp_path: Path) -> None:
    text = "wx,ax,Temp (\xb0C)\n1,2,25\xb0\n3,4,\xb5\n".encode("latin-1")
    found, _, _ = columns(written(tmp_path, text), log_format())
    assert found["accel_x"].tolist() == [2, 4]


def test_a_number_keeps_all_its_digits(tmp_path: Path, rng: np.random.Generator) -> None:
    truth = rng.standard_normal(2000) * 10.0 ** rng.integers(-300, 300, 2000)
    text = "wx;ax\n" + "".join(f"{float(x)!r};0\n".replace(".", ",") for x in truth)
    found, _, _ = columns(written(tmp_path, text), log_format())
    np.testing.assert_array_equal(found["gyro_x"], truth)
