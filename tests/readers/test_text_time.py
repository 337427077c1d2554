from __future__ import annotations

from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.settings.validation import ConfigError, parse
from tests.readers.damage import examples
from tests.readers.text_logs import TWO, columns, log_format, written

ISO = {"column": "t", "format": "iso8601"}


def read_stamps(
    tmp_path: Path, stamps: list[str], time: dict[str, Any], **keys: Any
) -> tuple[np.ndarray, Any]:
    text = "t;wx;ax\n" + "".join(f"{stamp};1;2\n" for stamp in stamps)
    _, found, file = columns(written(tmp_path, text), log_format(time=time, **keys))
    assert found is not None
    return found, file


@pytest.mark.parametrize(
    ("form", "stamps", "started"),
    [
        ("iso8601", "2021-09-20T09:00:00.5 2021-09-20T09:00:01.25", "09:00:00.500"),
        ("iso8601", "2021-09-20T09:00:00.5Z 2021-09-20T09:00:01.25Z", "09:00:00.500"),
        ("iso8601", "2021-09-20_09:00:00.5+02:00 2021-09-20_09:00:01.25+02:00", "07:00:00.500"),
        ("iso8601", "2021-09-20_09:00:00.5-0130 2021-09-20_09:00:01.25-0130", "10:30:00.500"),
        ("iso8601", "2021-09-20T09:00:00,5 2021-09-20T09:00:01,25", "09:00:00.500"),
        ("iso8601", "2021-09-20T09:00:00,5_+02:00 2021-09-20T10:00:01,25_+03:00", "07:00:00.500"),
        ("iso8601", "_2021-09-20__09:00:00.5_ 2021-09-20_09:00:01.250000000000", "09:00:00.500"),
        ("iso8601", '"2021-09-20_09:00:00.5" "2021-09-20_09:00:01.25"', "09:00:00.500"),
        ("%d.%m.%Y %H:%M:%S.%f", "20.09.2021_09:00:00.5 20.9.2021_9:00:01.25", "09:00:00.500"),
        ("%d.%m.%Y %H:%M:%S.%f", "20.09.2021_09:00:00,5 20.09.2021_09:00:01,25", "09:00:00.500"),
        ("%Y/%m/%d %T.%f", "2021/09/20_09:00:00.5 2021/09/20_09:00:01.25", "09:00:00.500"),
        ("%m/%d/%y %I:%M:%S.%f %p", "09/20/21_12:59:59.5_PM 9/20/21_1:00:00.25_pm", "12:59:59.500"),
        ("%m/%d/%y %I:%M:%S.%f %p", "09/20/21_12:00:59.5_AM 9/20/21_0:01:00.25_am", "00:00:59.500"),
        ("%d %b %Y %R:%S.%f", "20_Sep_2021_09:00:00.5 20_sep_2021_09:00:01.25", "09:00:00.500"),
        ("%Y %j %H:%M:%S.%f", "2021_263_09:00:00.5 2021_263_09:00:01.25", "09:00:00.500"),
        ("%FT%T.%f%z", "2021-09-20T09:00:00.5+01 2021-09-20T08:00:01.25Z", "08:00:00.500"),
        ("[%Y%m%d-%H%M%S.%f]", "[20210920-090000.5] [20210920-090001.25]", "09:00:00.500"),
    ],
)
def test_stamps_in_text(tmp_path: Path, form: str, stamps: str, started: str) -> None:
    texts = (
        stamps.replace("_", " ").split(" ")
        if "_" not in stamps
        else [stamp.replace("_", " ") for stamp in stamps.split(" ")]
    )
    found, file = read_stamps(tmp_path, texts, {"column": "t", "format": form})
    assert found.tolist() == [0.0, 0.75]
    assert file.started == f"2021-09-20T{started}"


@examples(40)
@given(
    st.lists(st.datetimes(datetime(1971, 1, 1), datetime(2199, 12, 31)), min_size=1, max_size=8),
    st.sampled_from(
        [
            ("iso8601", "%Y-%m-%dT%H:%M:%S.%f"),
            ("iso8601", "%Y-%m-%d %H:%M:%S,%f"),
            ("%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f"),
            ("%j/%Y %I:%M:%S.%f %p", "%j/%Y %I:%M:%S.%f %p"),
            ("%d %b %Y %H:%M:%S.%f", "%d %b %Y %H:%M:%S.%f"),
        ]
    ),
    st.integers(-14 * 60, 14 * 60),
)
def test_every_date_is_read_as_python_does(
    tmp_path: Path, dates: list[datetime], forms: tuple[str, str], offset: int
) -> None:
    form, pattern = forms
    zone = timezone(timedelta(minutes=offset))
    zoned = [date.replace(tzinfo=zone) for date in dates]
    if form == "iso8601":
        pattern += "%z"
    found, _ = read_stamps(
        tmp_path, [date.strftime(pattern) for date in zoned], {"column": "t", "format": form}
    )
    truth = [(date - zoned[0]) / timedelta(seconds=1) for date in zoned]
    np.testing.assert_allclose(found, truth, rtol=1e-15, atol=1e-9)


def test_a_fraction_of_zero_may_be_left_out(tmp_path: Path) -> None:
    time = {"column": "t", "format": "%Y/%m/%d %H:%M:%S.%f"}
    stamps = ["2021/09/20 09:00:00", "2021/09/20 09:00:00.500000"]
    assert read_stamps(tmp_path, stamps, time)[0].tolist() == [0.0, 0.5]
    stamps = ["2021-09-20 09:00:00", "2021-09-20 09:00:00.500000"]
    assert read_stamps(tmp_path, stamps, ISO)[0].tolist() == [0.0, 0.5]


def test_the_time_of_day_goes_on_at_midnight(tmp_path: Path) -> None:
    time = {"column": "t", "format": "%H:%M:%S.%f"}
    found, file = read_stamps(tmp_path, ["23:59:59.5", "00:00:00.5", "00:00:01"], time)
    assert found.tolist() == [0.0, 1.0, 1.5]
    assert file.started is None


def test_date_and_time_in_two_columns(tmp_path: Path) -> None:
    text = "Date,Time,wx,ax\n2024-02-28,23:59:59.5,1,2\n2024-02-29,00:00:00.5,1,2\n"
    time = {"date": "Date", "column": "Time", "format": "iso8601"}
    _, found, file = columns(written(tmp_path, text), log_format(time=time))
    assert found.tolist() == [0.0, 1.0]
    assert file.started == "2024-02-28T23:59:59.500"
    text = "28.02.2024  23:59:59,5  1,5\n29.02.2024  00:00:00,5  2,5\n"
    time = {"date": 1, "column": 2, "format": "%d.%m.%Y %H:%M:%S.%f"}
    channels = {"gyro_x": {"column": 3, "unit": "rad/s"}}
    gyro, found, _ = columns(written(tmp_path, text), log_format(channels, time=time))
    assert found.tolist() == [0.0, 1.0]
    assert gyro["gyro_x"].tolist() == [1.5, 2.5]


def test_missing_stamps_are_nan(tmp_path: Path) -> None:
    for time, stamps in (
        ({"column": "t", "format": "%H:%M:%S"}, ["", "00:00:01", "N/A", "00:00:03"]),
        (ISO, ["", "2021-01-01 00:00:01", "N/A", "2021-01-01 00:00:03"]),
        (ISO, ["", "2021-01-01 00:00:01,0", "N/A", "2021-01-01 00:00:03,0"]),
        ({"column": "t", "unit": "s"}, ["", "1", "inf", "3"]),
        ({"column": "t", "unit": "ns"}, ["", str(10**18), "-", str(10**18 + 2 * 10**9)]),
    ):
        found, _ = read_stamps(tmp_path, stamps, time)
        np.testing.assert_array_equal(found, [np.nan, 0.0, np.nan, 2.0])


def test_nanoseconds_lose_no_digit(tmp_path: Path) -> None:
    stamps = ["1700000000000000001", "", "1700000000000000003", "1700000000999999999"]
    found, file = read_stamps(tmp_path, stamps, {"column": "t", "unit": "ns"})
    np.testing.assert_array_equal(found, [0.0, np.nan, 2e-9, 999_999_998 * 1e-9])
    assert file.started == "2023-11-14T22:13:20.000"


@pytest.mark.parametrize(
    ("unit", "stamp", "started"),
    [
        ("s", "1700000000.5", "2023-11-14T22:13:20.500"),
        ("ms", "1700000000500", "2023-11-14T22:13:20.500"),
        ("us", "1700000000500000", "2023-11-14T22:13:20.500"),
        ("ns", "1700000000500000000", "2023-11-14T22:13:20.500"),
        ("ns", "1.7000000005e18", "2023-11-14T22:13:20.500"),
        ("s", "12.5", None),
        ("ms", "1700000000", None),
        ("s", "4200000000", None),
    ],
)
def test_stamps_since_1970_say_when_the_log_began(
    tmp_path: Path, unit: str, stamp: str, started: str | None
) -> None:
    assert read_stamps(tmp_path, [stamp], {"column": "t", "unit": unit})[1].started == started


@pytest.mark.release
def test_counters_that_start_again(tmp_path: Path, rng: np.random.Generator) -> None:
    count = np.arange(150_000)
    kept = np.sort(rng.choice(count, 145_000, replace=False))
    time = {"column": "t", "unit": "samples", "wraps": 65536}
    found, _ = read_stamps(tmp_path, [f"{c % 65536:05d}" for c in kept], time, rate="100 Hz")
    np.testing.assert_array_equal(found, (kept - kept[0]) / 100)
    time = {"column": "t", "unit": "ms", "scale": 0.1, "wraps": 2**32}
    ticks = (4_294_000_000 + kept * 100) % 2**32
    found, file = read_stamps(tmp_path, [str(tick) for tick in ticks], time)
    np.testing.assert_allclose(found, (kept - kept[0]) / 100, rtol=1e-12)
    assert file.started is None


@pytest.mark.parametrize(
    ("stamps", "time", "message"),
    [
        (["2021/01/01 00:00", "2021/13/01 00:00"], "%Y/%m/%d %H:%M", r"line 3.*2021/13/01"),
        (["2021/02/28 00:00", "2021/02/29 00:00"], "%Y/%m/%d %H:%M", r"line 3.*2021/02/29"),
        (["2021/02/28 00:00", "x"], "%Y/%m/%d %H:%M", r"line 3, column 't': found 'x'.*in '%Y"),
        (["25:00", "x"], "%H:%M", r"line 2, column 't': found '25:00', expected a time stamp"),
        (["2021-01-01T00:00:00Z", "x"], "iso8601", r"line 3, column 't': found 'x'"),
        (["2021-01-01 00:00Z", "2021-01-01 00:01"], "iso8601", r"line 3, column 't'"),
        (["2021-01-01 00:00", "2021-01-01 00:01Z"], "iso8601", r"line 3, column 't'"),
        (["-", "nan", "nan"], "%H:%M", r"no time stamp in the first 3 records; correct 'column'"),
        (["0", "1", "x"], "ns", r"line 4, column 't': found 'x', expected a time stamp"),
    ],
)
def test_bad_stamps_are_named(tmp_path: Path, stamps: list[str], time: str, message: str) -> None:
    source = {"column": "t", "unit" if time == "ns" else "format": time}
    with pytest.raises(RecordingError, match=message):
        read_stamps(tmp_path, stamps, source)


@pytest.mark.release
def test_a_bad_stamp_late_in_a_log_is_named_by_its_line(tmp_path: Path) -> None:
    lines = (
        ["t;wx;ax", "# c"] + ["10:00:00;1;2"] * 100_000 + ["", "  ", "10:00;1;2", "10:00:01;1;2"]
    )
    path = written(tmp_path, "\n".join(lines) + "\n")
    time = {"column": "t", "format": "%H:%M:%S"}
    with pytest.raises(RecordingError, match=r"line 100005, column 't': found '10:00'"):
        columns(path, log_format(time=time))


@pytest.mark.parametrize(
    ("time", "message"),
    [
        ({"column": "t", "format": "DD.MM.YYYY"}, "found format 'DD.MM.YYYY'; expected iso8601"),
        ({"column": "t", "format": "%Y-%m-%d"}, "with the hour"),
        ({"column": "t", "format": "%H:%M:%Q"}, "has %Q; expected fields of %Y"),
        ({"column": "t", "format": "%H:%M:%"}, "has %;"),
        ({"column": "t", "format": "%H:%H"}, "has %H twice"),
        ({"column": "t", "format": "%T", "wraps": 5}, "need numeric stamps; drop 'format'"),
        ({"column": "t", "unit": "s", "date": "d"}, "'date' is given without 'format'"),
        ({"column": "t", "format": "%T", "date": 0}, "columns are counted from 1"),
        ({"column": "t"}, "expected exactly one of 'unit'"),
    ],
)
def test_what_cannot_be_stated(time: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse(LogFormat, {"time": time, "channels": TWO}, "s.yaml")


def test_a_stamp_beyond_every_date_is_no_date(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,wx\n1e305,1\n1.1e305,2\n")
    channels = {"gyro_x": {"column": "wx", "unit": "rad/s"}}
    log = LogFormat.model_validate({"time": {"column": "t", "unit": "s"}, "channels": channels})
    (file,) = read(path, log)
    assert sum(len(batch) for batch in file.batches()) == 2
    assert file.started is None
