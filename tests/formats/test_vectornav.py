from __future__ import annotations

import gzip
import time
from binascii import crc_hqx
from collections.abc import Callable
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.extensions.formats.vectornav import (
    FIELDS,
    Sentences,
    VectorNavFile,
    verify_checksums,
)
from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.settings.sensor import LogFormat
from tests.readers.damage import Damage, damaged, damages, examples

UNITS = {"gyro": "rad/s", "accel": "m/s^2"}
ALL = [f"{quantity}_{axis}" for quantity in UNITS for axis in "xyz"]

# What sensors wrote, as published, each with its figures.
YMR = (
    b"$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
    b"-00.000018,+00.001122,-00.000551*69"
)
IMU = (
    b"$VNIMU,-00.0350,+00.4222,-00.6643,-00.015,+00.019,+09.948,+00.002066,-00.008442,"
    b"-00.044656,+20.7,+084.322*66"
)
QMR = (
    b"$VNQMR,+0.021375,-0.049923,+0.797361,-0.601055,-0.2354,+0.8029,+1.8875,+00.795,-00.412,"
    b"-09.709,-00.0201,-00.0055,-00.0149*76"
)
WITH_COUNTER = (
    b"$VNQMR,+0.004183,+0.001149,+0.089285,+0.995997,+00.0113,-00.2384,+00.1800,+00.020,-00.092,"
    b"-09.683,-00.000272,+00.000824,+00.000073,T0000000543*3D"
)
PUBLISHED = [
    (YMR, [-0.000018, 0.001122, -0.000551, -1.258, -0.1, -9.701]),
    (IMU, [0.002066, -0.008442, -0.044656, -0.015, 0.019, 9.948]),
    (QMR, [-0.0201, -0.0055, -0.0149, 0.795, -0.412, -9.709]),
    (WITH_COUNTER, [-0.000272, 0.000824, 0.000073, 0.02, -0.092, -9.683]),
]


def log_format(names: list[str] = ALL, prefix: str = "", **keys: Any) -> LogFormat:
    channels = {
        name: {"column": prefix + name, "unit": UNITS[name.split("_")[0]]} for name in names
    }
    given = {"rate": None if "time" in keys else "100 Hz"} | keys
    return LogFormat.model_validate({"reader": "vectornav", "channels": channels} | given)


def sentence(kind: str, figures: list[float], appended: str = "", crc: bool = False) -> bytes:
    body = (f"{kind}," + ",".join(f"{figure:+012.6f}" for figure in figures) + appended).encode()
    check = f"{crc_hqx(body, 0):04X}" if crc else f"{reduce(xor, body):02X}"
    return b"$" + body + b"*" + check.encode()


def logged(lines: list[bytes], end: bytes = b"\r\n") -> bytes:
    return b"".join(line + end for line in lines)


def columns(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], np.ndarray | None, LogFile]:
    (file,) = read(path, log)
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in file.sources}
    times = [b.time for b in batches if b.time is not None]
    return joined, np.concatenate(times) if times else None, file


def written(tmp_path: Path, text: bytes) -> Path:
    path = tmp_path / "a.txt"
    path.write_bytes(text)
    return path


def counts(file: LogFile) -> dict[str, float]:
    return {finding.finding: finding.value for finding in file.findings}


def ramp(kind: str, rows: int) -> np.ndarray:
    return np.round(np.arange(rows * len(FIELDS[kind])).reshape(rows, -1) * 1e-4 - 3, 6)


# -------------------------------------------------------------------------------- what is right


@pytest.mark.parametrize("body", ["*60", ",T1162704*2F", ",S0000*1F"])
def test_the_checksums_of_the_manual_are_right(body: str) -> None:
    text, _, check = f"VNYPR,+010.071,+000.278,-002.026{body}".partition("*")
    assert verify_checksums([text.encode()], [check.encode()]) == [True]
    assert verify_checksums([text.encode()], [b"00"]) == [False]


def test_the_crc_is_that_of_its_reference_text() -> None:
    # CRC-16/XMODEM, the manual's algorithm, of the text that catalogues of CRCs use.
    assert verify_checksums([b"123456789", b"123456789"], [b"31C3", b"31C4"]) == [True, False]


@pytest.mark.parametrize(("line", "figures"), PUBLISHED)
def test_sentences_that_sensors_wrote(tmp_path: Path, line: bytes, figures: list[float]) -> None:
    found, time, file = columns(written(tmp_path, logged([line] * 3)), log_format())
    assert time is None and counts(file) == {}
    for name, figure in zip(ALL, figures, strict=True):
        assert found[name].tolist() == [figure] * 3


@pytest.mark.parametrize("kind", FIELDS)
@pytest.mark.parametrize("crc", [False, True])
def test_every_field_of_every_sentence(tmp_path: Path, kind: str, crc: bool) -> None:
    truth = ramp(kind, 50)
    path = written(tmp_path, logged([sentence(kind, list(row), crc=crc) for row in truth]))
    for position, field in enumerate(FIELDS[kind]):
        for column in (f"{kind}.{field}", field, position + 1):
            channels = {"gyro_x": {"column": column, "unit": "rad/s"}}
            log = LogFormat.model_validate(
                {"reader": "vectornav", "rate": "1 Hz", "channels": channels}
            )
            found, _, _ = columns(path, log)
            np.testing.assert_array_equal(found["gyro_x"], truth[:, position])


def test_temperature_and_units(tmp_path: Path) -> None:
    log = log_format(["gyro_x"], temperature={"column": "temperature", "unit": "degC"})
    found, _, _ = columns(written(tmp_path, logged([IMU])), log)
    assert found["temperature"].tolist() == pytest.approx([20.7])
    in_degrees = {"gyro_x": {"column": "gyro_x", "unit": "deg/s"}}
    log = LogFormat.model_validate({"reader": "vectornav", "rate": "1 Hz", "channels": in_degrees})
    found, _, _ = columns(written(tmp_path, logged([IMU])), log)
    assert found["gyro_x"].tolist() == pytest.approx([0.002066 * np.pi / 180])


def test_many_blocks_with_status_and_lower_case(tmp_path: Path) -> None:
    truth = ramp("VNYMR", 7000)  # 1.2 MB: more than a block
    lines = [sentence("VNYMR", list(row), ",S00ff,T12") for row in truth]
    lines = [line[:-2] + line[-2:].lower() for line in lines]
    found, _, file = columns(written(tmp_path, logged(lines, b"\n")), log_format())
    np.testing.assert_array_equal(found["gyro_z"], truth[:, -1])
    assert counts(file) == {}


def test_gzip_also_when_it_ends_early(tmp_path: Path) -> None:
    truth = ramp("VNGYR", 8000)
    packed = gzip.compress(logged([sentence("VNGYR", list(row)) for row in truth]))
    log = log_format(["gyro_x"])
    found, _, _ = columns(written(tmp_path, packed), log)
    np.testing.assert_array_equal(found["gyro_x"], truth[:, 0])
    found, _, file = columns(written(tmp_path, packed[: len(packed) // 2]), log)
    rows = len(found["gyro_x"])
    assert 2000 < rows < 6000
    np.testing.assert_array_equal(found["gyro_x"], truth[:rows, 0])
    assert counts(file)["truncated_file"] == 1


# ------------------------------------------------------------------------------ what is damaged

FLIP = YMR.replace(b"-007.330", b"-007.331")


@pytest.mark.parametrize(
    "damaged",
    [
        FLIP,
        YMR[:-2] + b"70",
        YMR[:60],
        YMR[:-3],
        YMR.replace(b"VNYMR", b"VNYMS"),
        YMR.replace(b"VNYMR", b"VN\xffMR"),
        YMR.replace(b"*", b"\0"),
        YMR[:-1],
        YMR + b"1",
    ],
)
def test_a_damaged_sentence_is_a_missing_sample(tmp_path: Path, damaged: bytes) -> None:
    found, _, file = columns(written(tmp_path, logged([YMR, damaged, YMR])), log_format())
    assert found["gyro_y"].tolist() == pytest.approx([0.001122, np.nan, 0.001122], nan_ok=True)
    (finding,) = file.findings
    assert (finding.finding, finding.severity, finding.value) == ("wrong_checksum", "warning", 1)
    assert "missing samples" in finding.detail


def test_a_damaged_sentence_is_left_out_where_there_are_stamps(tmp_path: Path) -> None:
    lines = [b"%d.5 " % second + line for second, line in enumerate([YMR, FLIP, YMR])]
    time = {"column": "host_time", "unit": "s"}
    found, stamps, file = columns(written(tmp_path, logged(lines)), log_format(time=time))
    assert stamps is not None and stamps.tolist() == [0.0, 2.0]
    assert found["gyro_y"].tolist() == [0.001122, 0.001122]
    assert "left out" in file.findings[0].detail


def test_sentences_that_ran_together_are_told_apart(tmp_path: Path) -> None:
    text = logged([YMR + YMR, YMR[:40] + YMR, YMR])
    found, _, file = columns(written(tmp_path, text), log_format())
    assert np.isnan(found["gyro_x"]).tolist() == [False, False, True, False, False]
    assert counts(file) == {"wrong_checksum": 1}


def test_other_sentences_and_garbage_are_passed_over_and_counted(tmp_path: Path) -> None:
    other = b"$VNYPR,+010.071,+000.278,-002.026*60"
    lines = [b"VN-100 ready", other, YMR, b"\xfa\x01\x29\x00\x80", b"", other, b"$%&", YMR, b"\0\0"]
    found, _, file = columns(written(tmp_path, logged(lines)), log_format())
    assert found["gyro_y"].tolist() == [0.001122, 0.001122]
    assert counts(file) == {"other_sentences": 2, "not_sentences": 3}
    assert {finding.severity for finding in file.findings} == {"note"}
    assert "VNYPR" in file.findings[0].detail


def test_names_and_pieces_without_end_cost_nothing() -> None:
    bodies = [b"X%07d" % number for number in range(5000)]
    text = b"".join(b"$%s*%02X\r\n" % (body, reduce(xor, body)) for body in bodies)
    sentences = Sentences("VNIMU", stamped=False)
    begin = time.process_time()
    rows = sentences.add(IMU + b"\r\n" + text + b"$a" * 5_000_000 + b"\n" + IMU + b"\n")
    assert time.process_time() - begin < 2.0  # 0.15; a piece at a time, 8
    assert len(rows) == sentences.right == 2
    assert sentences.others.total() == 5000 and len(sentences.others) == 1001
    assert sentences.garbage == 5_000_000 and not sentences.wrong


@pytest.mark.parametrize("appended", [",x", ",1,2", ",T", ",T5,S0000", ",S00", ",T" + "9" * 30])
def test_too_many_fields_are_a_missing_sample(tmp_path: Path, appended: str) -> None:
    figures = [1.0] * 12
    lines = [sentence("VNYMR", figures), sentence("VNYMR", figures, appended)]
    found, _, file = columns(written(tmp_path, logged(lines)), log_format())
    assert np.isnan(found["gyro_x"]).tolist() == [False, True]
    assert counts(file) == {"unreadable_sentence": 1}


@pytest.mark.parametrize("figure", ["", "x", "1 2", "0x1", "\r"])
def test_what_is_no_number_is_missing(tmp_path: Path, figure: str) -> None:
    body = f"VNGYR,{figure},2.5,3.5".encode()
    line = b"$" + body + b"*%02X" % reduce(xor, body)
    lines = [sentence("VNGYR", [1.0, 2.0, 3.0]), line]
    found, _, _ = columns(written(tmp_path, logged(lines)), log_format(["gyro_x", "gyro_y"]))
    assert found["gyro_x"].tolist() == pytest.approx([1.0, np.nan], nan_ok=True)
    assert found["gyro_y"][0] == 2.0


def test_the_last_line_needs_no_line_break_if_its_checksum_is_right(tmp_path: Path) -> None:
    found, _, file = columns(written(tmp_path, YMR + b"\n" + YMR), log_format())
    assert len(found["gyro_x"]) == 2 and counts(file) == {}
    found, _, file = columns(written(tmp_path, YMR + b"\n" + YMR[:-1]), log_format())
    assert len(found["gyro_x"]) == 1 and counts(file) == {"incomplete_last_record": 1}
    found, _, file = columns(written(tmp_path, YMR + b"\n" + b"\0" * 500), log_format())
    assert len(found["gyro_x"]) == 1 and counts(file) == {"zero_bytes": 500}


# ----------------------------------------------------------------------------------------- time

EPOCH = 1_700_000_000


@pytest.mark.parametrize(
    ("before", "time"),
    [
        (lambda i: f"{EPOCH + i / 100:.3f} ", {"unit": "s"}),
        (lambda i: f"{EPOCH + i / 100:.3f},", {"unit": "s"}),
        (lambda i: f"[{EPOCH * 1000 + i * 10}] ", {"unit": "ms"}),
        (lambda i: f"{EPOCH * 10**6 + i * 10_000}\t", {"unit": "us"}),
        (lambda i: f"{EPOCH * 10**9 + i * 10**7}: ", {"unit": "ns"}),
        (lambda i: f"2023-11-14T22:13:20.{i * 10:03d} ", {"format": "iso8601"}),
        (lambda i: f"2023-11-14 22:13:20.{i * 10:03d}Z, ", {"format": "iso8601"}),
        (lambda i: f"2023-11-15T00:13:20.{i * 10:03d}+02:00 ", {"format": "iso8601"}),
    ],
)
def test_host_stamps(tmp_path: Path, before: Callable[[int], str], time: dict[str, str]) -> None:
    lines = [before(i).encode() + YMR for i in range(50)]
    log = log_format(time={"column": "host_time"} | time)
    found, stamps, file = columns(written(tmp_path, logged(lines)), log)
    assert stamps is not None and len(found["gyro_x"]) == 50
    np.testing.assert_allclose(stamps, np.arange(50) / 100, atol=3e-7)
    assert file.started == "2023-11-14T22:13:20.000"


def test_nanoseconds_lose_no_digit(tmp_path: Path) -> None:
    lines = [f"{EPOCH * 10**9 + i} ".encode() + YMR for i in range(9)]
    lines[4] = YMR
    log = log_format(time={"column": "host_time", "unit": "ns"})
    _, stamps, _ = columns(written(tmp_path, logged(lines)), log)
    expected = [np.nan if i == 4 else i * 1e-9 for i in range(9)]
    assert stamps is not None
    np.testing.assert_allclose(stamps, expected, rtol=1e-12)


def test_a_counter_that_wraps(tmp_path: Path) -> None:
    counts_written = (np.arange(200) * 10_000 + 2**32 - 995_000) % 2**32
    lines = [sentence("VNGYR", [1.0] * 3, f",S0000,T{count:010d}") for count in counts_written]
    log = log_format(["gyro_x"], time={"column": "counter", "unit": "us", "wraps": 2**32})
    _, stamps, file = columns(written(tmp_path, logged(lines)), log)
    assert stamps is not None and file.started is None
    np.testing.assert_allclose(stamps, np.arange(200) / 100, atol=1e-12)
    log = log_format(["gyro_x"], time={"column": "counter", "unit": "samples"}, rate="100 Hz")
    _, stamps, _ = columns(written(tmp_path, logged(lines[:20])), log)
    assert stamps is not None and stamps[1] == pytest.approx(100.0)


# --------------------------------------------------------------------------------------- faults


@pytest.mark.parametrize(
    ("text", "log", "message"),
    [
        (b"", log_format(), r"a\.txt: found no sentence with a right checksum; expected one of"),
        (b"", log_format(prefix="VNYMR."), r"no \$VNYMR sentence with a right checksum, 0 with"),
        (logged([FLIP] * 3), log_format(prefix="VNYMR."), "3 with a wrong one"),
        (logged([YMR]), log_format(prefix="VNIMU."), r"no \$VNIMU sentence"),
        (
            logged([YMR]),
            log_format(prefix="VNXYZ."),
            "no VectorNav sentence has all of the columns",
        ),
        (
            logged([b"$VNYPR,+010.071,+000.278,-002.026*60"]),
            log_format(),
            r"found VNYPR; expected one of VNYMR.*registers 6 and 30",
        ),
        (
            logged([YMR, IMU]),
            log_format(),
            r"VNYMR and VNIMU both have the columns; .* 'column: VNYMR\.gyro_z'",
        ),
        (
            logged([YMR]),
            log_format(time={"column": "t", "unit": "s"}),
            "no time column 't'; a VectorNav log has 'host_time'",
        ),
        (
            logged([YMR]),
            log_format(time={"column": "host_time", "unit": "s"}),
            r"none of the first 1 sent.* expected one before the '\$'; the first has '' before",
        ),
        (
            logged([b"noon " + YMR]),
            log_format(time={"column": "host_time", "format": "iso8601"}),
            "the first has 'noon ' before",
        ),
        (logged([YMR]), log_format(time={"column": "counter", "unit": "us"}), "'T' and a count"),
        (b"x" * 3_000_000, log_format(), "no line break in"),
        (bytes(range(256)) * 50, log_format(), r"a\.txt"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: bytes, log: LogFormat, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        columns(written(tmp_path, text), log)


def test_the_one_of_two_sentences_that_is_named_is_taken(tmp_path: Path) -> None:
    path = written(tmp_path, logged([YMR, IMU] * 5))
    found, _, file = columns(path, log_format(prefix="VNIMU."))
    assert found["gyro_x"].tolist() == [0.002066] * 5
    assert counts(file) == {"other_sentences": 5}
    channels = {
        "gyro_x": {"column": "VNIMU.gyro_x", "unit": "rad/s"},
        "accel_x": {"column": "VNYMR.accel_x", "unit": "m/s^2"},
    }
    log = LogFormat.model_validate({"reader": "vectornav", "rate": "1 Hz", "channels": channels})
    with pytest.raises(RecordingError, match=r"no VectorNav sentence has all of"):
        columns(path, log)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    log = log_format()
    sources = {str(name): source for name, source in log.channels.items()}
    with pytest.raises(RecordingError, match=r"none\.txt: cannot be opened"):
        list(VectorNavFile(tmp_path / "none.txt", log, sources).batches())


LOGS = [log_format(), log_format(time={"column": "host_time", "unit": "s"})]
WHOLE = logged([b"%d.25 " % i + sentence("VNYMR", [i / 8] * 12) for i in range(40)])


@given(damages(len(WHOLE), 30), st.sampled_from(LOGS))
@examples(150)
def test_no_damage_gives_a_wrong_figure_or_another_error(
    tmp_path: Path, damage: Damage, log: LogFormat
) -> None:
    try:
        found, _, _ = columns(written(tmp_path, damaged(WHOLE, damage)), log)
    except RecordingError as error:
        assert "a.txt" in str(error)
        return
    present = found["gyro_x"][~np.isnan(found["gyro_x"])]
    # Two flips of the same bit in one sentence pass a checksum of 8 bits.
    if len(damage[1]) <= 1:
        assert set(present * 8) <= set(range(40))
        assert list(present) == sorted(present)


@given(st.binary(max_size=400))
@examples(100)
def test_any_bytes_give_no_other_error(tmp_path: Path, text: bytes) -> None:
    for prefix in (b"", YMR + b"\n", b"$VNYMR,"):
        try:
            columns(written(tmp_path, prefix + text), log_format(prefix="VNYMR."))
        except RecordingError as error:
            assert "a.txt" in str(error)
