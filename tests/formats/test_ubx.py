from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyubx2 import GET, UBXMessage, UBXReader

from imubench_pipeline.extensions.formats import ubx
from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.settings.sensor import LogFormat
from tests.readers.damage import Damage, damaged, damages, examples

DEG = np.pi / 180
TYPES = {"gyro_x": 14, "gyro_y": 13, "gyro_z": 5, "accel_x": 16, "accel_y": 17, "accel_z": 18}
SCALES = {"gyro": DEG * 2.0**-12, "accel": 2.0**-10}
UNITS = {"gyro": "deg/s", "accel": "m/s^2"}
TAGGED = {"column": "time_tag", "unit": "ms"}


def log_format(
    names: list[str] | None = None, variable: str | None = None, **keys: Any
) -> LogFormat:
    chosen = names or list(TYPES)
    where = {"variable": variable} if variable else {}
    channels = {
        name: {"column": name, "unit": UNITS[name.split("_")[0]]} | where for name in chosen
    }
    given = {"rate": None if "time" in keys else "100 Hz"} | keys
    return LogFormat.model_validate({"reader": "ubx", "channels": channels} | given)


def word(data_type: int, count: int) -> bytes:
    return struct.pack("<I", data_type << 24 | count & 0xFFFFFF)


def meas(tag: int, counts: dict[int, int], calib: int | None = None, number: bool = True) -> bytes:
    """An ESF-MEAS message as the receiver writes it."""
    flags = (len(counts) << 11 if number else 0) | (8 if calib is not None else 0)
    payload = struct.pack("<IHH", tag, flags, 0)
    payload += b"".join(word(*pair) for pair in counts.items())
    payload += b"" if calib is None else struct.pack("<I", calib)
    return bytes(UBXMessage("ESF", "ESF-MEAS", GET, payload=payload).serialize())


def raw(samples: list[tuple[int, dict[int, int]]]) -> bytes:
    """An ESF-RAW message of several samples, each with its tag."""
    payload = bytes(4) + b"".join(
        word(*pair) + struct.pack("<I", tag) for tag, counts in samples for pair in counts.items()
    )
    return bytes(UBXMessage("ESF", "ESF-RAW", GET, payload=payload).serialize())


def nav_pvt(second: int = 20, valid: int = 3) -> bytes:
    message = UBXMessage(
        "NAV", "NAV-PVT", GET, year=2023, month=11, day=14, hour=22, min=13, second=second,
        validDate=valid & 1, validTime=valid >> 1,
    )  # fmt: skip
    return bytes(message.serialize())


def columns(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], np.ndarray | None, LogFile]:
    (file,) = read(path, log)
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in file.sources}
    times = [b.time for b in batches if b.time is not None]
    return joined, np.concatenate(times) if times else None, file


def written(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "a.ubx"
    path.write_bytes(data)
    return path


def counts_of(file: LogFile) -> dict[str, float]:
    return {finding.finding: finding.value for finding in file.findings}


def truth(rows: int) -> np.ndarray:
    """Counts of every column, of either sign and up to 24 bits."""
    rng = np.random.default_rng(5)
    return rng.integers(-(2**23), 2**23, (rows, len(TYPES)))


def expected(name: str, counts: np.ndarray) -> np.ndarray:
    return counts[:, list(TYPES).index(name)] * SCALES[name.split("_")[0]]


def samples(counts: np.ndarray, tags: np.ndarray) -> list[tuple[int, dict[int, int]]]:
    return [
        (int(tag), {12: 2500} | dict(zip(TYPES.values(), map(int, row), strict=True)))
        for tag, row in zip(tags, counts, strict=True)
    ]


# ------------------------------------------------------------------------------- what is right

# A log that a user of a receiver published, in its order: the gyro's tag is before that of the
# accelerometer, and its message after it.
PUBLISHED = b"".join(
    bytes(UBXMessage("ESF", "ESF-MEAS", GET, payload=payload).serialize())
    for payload in (
        struct.pack("<I", 514162) + b"\x18\x18\0\0K\xfd\xff\x10@\x02\x00\x11#(\x00\x12"
        + struct.pack("<I", 514162),
        struct.pack("<I", 514157) + b"\x18 \0\0\xcd\x06\x00\x0e\xe4\xfe\xff\r\x03\xfa\xff\x05"
        b"\t\x0b\x00\x0cm\xd8\x07\x00",
        struct.pack("<I", 514261) + b"\x18\x18\0\0M\xfd\xff\x10E\x02\x00\x11\x1f(\x00\x12"
        + struct.pack("<I", 514261),
        struct.pack("<I", 514256) + b"\x18 \0\0|\x06\x00\x0e\xcb\xfe\xff\r\xac\xf9\xff\x05"
        b"\t\x0b\x00\x0c\xd0\xd8\x07\x00",
    )
)  # fmt: skip


def test_a_published_log(tmp_path: Path) -> None:
    log = log_format(time=TAGGED, temperature={"column": "temperature", "unit": "degC"})
    found, time, file = columns(written(tmp_path, PUBLISHED), log)
    assert time is not None and time.tolist() == pytest.approx([0.0, 0.099])
    for name, figures in {
        "gyro_x": [1741, 1660],
        "gyro_y": [-284, -309],
        "gyro_z": [-1533, -1620],
        "accel_x": [-693, -691],
        "accel_y": [576, 581],
        "accel_z": [10275, 10271],
    }.items():
        scale = SCALES[name.split("_")[0]]
        np.testing.assert_allclose(found[name], np.array(figures) * scale, rtol=1e-14)
    assert found["temperature"].tolist() == pytest.approx([28.25, 28.25])
    assert counts_of(file) == {}


def test_the_words_are_those_that_the_library_reads(tmp_path: Path) -> None:
    (_, first), (_, second), *_ = list(UBXReader(io.BytesIO(PUBLISHED)))
    found, _, _ = columns(written(tmp_path, PUBLISHED), log_format())
    signed = (second.dataField_02 ^ 1 << 23) - (1 << 23)
    assert (second.dataType_02, found["gyro_y"][0]) == (13, pytest.approx(signed * DEG / 4096))
    assert (first.dataType_03, found["accel_z"][0]) == (18, first.dataField_03 / 1024)


@pytest.mark.parametrize("per_message", [1, 10])
@pytest.mark.parametrize("names", [["gyro_x"], ["accel_z", "gyro_y"], list(TYPES)])
def test_every_sample_of_esf_raw(tmp_path: Path, per_message: int, names: list[str]) -> None:
    figures = truth(400)
    each = samples(figures, np.arange(400) * 256)
    data = b"".join(raw(each[i : i + per_message]) for i in range(0, 400, per_message))
    found, time, file = columns(written(tmp_path, data), log_format(names, time=TAGGED))
    assert time is not None
    np.testing.assert_allclose(time, np.arange(400) / 100, rtol=1e-14)
    for name in names:
        np.testing.assert_allclose(found[name], expected(name, figures), rtol=1e-14)
    assert counts_of(file) == {} and file.started is None


@pytest.mark.parametrize("number", [True, False])
def test_the_receivers_time_in_esf_meas_is_no_measurement(tmp_path: Path, number: bool) -> None:
    # From 23.3 h on its upper bits read as data type 5, from 60.6 h on as 13.
    data = b"".join(
        meas(i * 10, {14: i, 16: -i}, calib=5 << 24 | i, number=number) for i in range(30)
    )
    log = log_format(["gyro_x", "accel_x"], time=TAGGED)
    found, time, _ = columns(written(tmp_path, data), log)
    np.testing.assert_allclose(found["accel_x"], -np.arange(30) / 1024)
    assert time is not None and time[-1] == pytest.approx(0.29)
    with pytest.raises(RecordingError, match=r"data types 14, 16.*; expected 5 \(gyro_z\)"):
        columns(written(tmp_path, data), log_format(["gyro_x", "gyro_z"]))


def test_many_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ubx, "_BATCH_WORDS", 1 << 12)
    figures = truth(2500)
    tags = np.arange(len(figures)) * 256
    data = b"".join(raw(samples(figures[i : i + 10], tags[i : i + 10])) for i in range(0, 2500, 10))
    found, time, _ = columns(written(tmp_path, data), log_format(["gyro_z"], time=TAGGED))
    np.testing.assert_allclose(found["gyro_z"], expected("gyro_z", figures), rtol=1e-14)
    assert time is not None
    np.testing.assert_allclose(time, tags / 25_600, rtol=1e-14)


NMEA = b"$GNGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,*5B\r\n"
RTCM = bytes.fromhex("d300133ed7d30202980edeef34b4bd62ac0941986f33360b98")


def test_other_messages_are_passed_over(tmp_path: Path) -> None:
    between = [NMEA, RTCM, nav_pvt(valid=0), b"\xb5", b"\xb5\x62\xb5", b"$GN\xff\xfe\n", b"\0" * 99]
    data = b"".join(
        between[i % len(between)] + raw(samples(truth(1), np.array([i * 256]))) for i in range(50)
    )
    found, _, file = columns(written(tmp_path, data), log_format())
    assert len(found["gyro_x"]) == 50
    assert counts_of(file) == {}


def test_the_date_is_that_of_the_first_sample(tmp_path: Path) -> None:
    parts = [raw(samples(truth(1), np.array([i * 256]))) for i in range(1000)]
    parts.insert(100, nav_pvt(valid=1))
    parts.insert(501, nav_pvt(second=25))
    _, _, file = columns(written(tmp_path, b"".join(parts)), log_format(time=TAGGED))
    assert file.started == "2023-11-14T22:13:20.000"


# ----------------------------------------------------------------------------------------- tags


@pytest.mark.parametrize(
    ("bits", "start", "keys"),
    [
        (32, 2**32 - 50_000, {}),
        (24, 2**24 - 50_000, {}),
        (24, 2**24 - 50_000, {"wraps": 2**24 / 25.6}),
        (20, 2**20 - 50_000, {"wraps": 2**20 / 25.6}),
        (32, 0, {}),
    ],
)
def test_tags_that_start_again_from_0(
    tmp_path: Path, bits: int, start: int, keys: dict[str, float]
) -> None:
    tags = (start + np.arange(400) * 256) % 2**bits
    data = raw(samples(truth(400)[:250], tags[:250])) + raw(samples(truth(400)[250:], tags[250:]))
    _, time, _ = columns(written(tmp_path, data), log_format(time=TAGGED | keys))
    assert time is not None
    np.testing.assert_allclose(time, np.arange(400) / 100, atol=1e-9)


def test_a_receiver_that_was_restarted_is_not_taken_for_a_new_start_of_the_tags(
    tmp_path: Path,
) -> None:
    tags = np.concatenate([10_000_000 + np.arange(50) * 256, np.arange(50) * 256])
    _, time, _ = columns(written(tmp_path, raw(samples(truth(100), tags))), log_format(time=TAGGED))
    assert time is not None and time[50] < -300


def test_tags_of_esf_meas_start_again_at_32_bits(tmp_path: Path) -> None:
    # The accelerometer comes 5 ms after the gyro, and its tag starts again first.
    data = b"".join(
        meas((2**32 - 512 + 100 * i) % 2**32, {16: 1})
        + meas((2**32 - 517 + 100 * i) % 2**32, {14: 2})
        for i in range(20)
    )
    log = log_format(["gyro_x", "accel_x"], time=TAGGED)
    found, time, _ = columns(written(tmp_path, data), log)
    assert time is not None and not np.isnan(found["gyro_x"]).any()
    np.testing.assert_allclose(time, np.arange(20) / 10, atol=1e-12)


def test_tags_as_written(tmp_path: Path) -> None:
    data = raw(samples(truth(20), np.arange(20) * 10_000))
    log = log_format(time={"column": "sTtag", "unit": "us"})
    _, time, _ = columns(written(tmp_path, data), log)
    assert time is not None
    np.testing.assert_allclose(time, np.arange(20) / 100, rtol=1e-12)


# ------------------------------------------------------------------------------ what is damaged


def test_damaged_messages_are_left_out_and_counted(tmp_path: Path) -> None:
    messages = [
        bytearray(raw(samples(truth(50)[i : i + 1], np.array([i * 256])))) for i in range(50)
    ]
    messages[10][30] ^= 1
    messages[20][-1] ^= 1
    messages[30][5] = 255  # the length: the messages behind it are still found
    data = b"".join(messages)
    found, time, file = columns(written(tmp_path, data), log_format(time=TAGGED))
    kept = np.array([i for i in range(50) if i not in (10, 20, 30)])
    assert time is not None
    np.testing.assert_allclose(time, kept / 100)
    np.testing.assert_allclose(found["gyro_x"], expected("gyro_x", truth(50)[kept]), rtol=1e-14)
    assert sum(counts_of(file).values()) == 3
    assert {f.finding: f.severity for f in file.findings}["wrong_checksum"] == "warning"
    _, _, file = columns(written(tmp_path, data), log_format())
    assert "State 'time'" in file.findings[0].detail


def test_a_message_that_was_lost_shifts_no_other(tmp_path: Path) -> None:
    parts = [meas(100 * (i // 2), {(14, 16)[i % 2]: i // 2}) for i in range(40)]
    del parts[31], parts[20], parts[7]
    log = log_format(["gyro_x", "accel_x"], time=TAGGED)
    found, time, _ = columns(written(tmp_path, b"".join(parts)), log)
    gyro, accel = np.arange(20.0), np.arange(20.0)
    accel[3] = gyro[10] = accel[15] = np.nan
    np.testing.assert_allclose(found["gyro_x"], gyro * SCALES["gyro"])
    np.testing.assert_allclose(found["accel_x"], accel * SCALES["accel"])
    assert time is not None
    np.testing.assert_allclose(time, np.arange(20) / 10)


@pytest.mark.parametrize("cut", [1, 7, 30, 62])
def test_a_last_message_cut_short_is_left_out(tmp_path: Path, cut: int) -> None:
    message = raw(samples(truth(1), np.array([0])))
    found, _, file = columns(written(tmp_path, message * 3 + message[:-cut]), log_format())
    assert len(found["gyro_x"]) == 3
    assert counts_of(file) == {"incomplete_last_record": 1}


ONE = raw(samples(truth(1), np.array([0])))


@pytest.mark.parametrize(
    ("data", "log", "message"),
    [
        (b"", log_format(), r"a\.ubx: found no ESF-MEAS and no ESF-RAW among 0 UBX messages"),
        (nav_pvt() * 3 + NMEA, log_format(), r"among 3 UBX messages \(class and id 01 07 \(3\)\)"),
        (ONE[:-1] + b"\0", log_format(), "1 with a wrong checksum; expected the data types of 14"),
        (meas(1, {10: 5}), log_format(), r"ESF-MEAS with data types 10 .*switch ESF-RAW or"),
        (ONE + meas(1, {14: 5}), log_format(), "both ESF-MEAS and ESF-RAW .*'variable: ESF-RAW'"),
        (ONE, log_format(variable="ESF-MEAS"), "found 0 ESF-MEAS messages"),
        (ONE, log_format(variable="/imu"), "'variable' is /imu; expected ESF-RAW or ESF-MEAS"),
        (ONE, log_format(time={"column": "iTOW", "unit": "ms"}), "no time column 'iTOW'"),
        (
            ONE,
            log_format(time={"column": "time_tag", "unit": "us"}),
            "time_tag of ESF-RAW is us in the sensor file; expected 'unit: ms'",
        ),
        (meas(1, {14: 5}), log_format(["gyro_x", "gyro_y"]), r"expected 13 \(gyro_y\)"),
        (raw([]), log_format(), "found no ESF-MEAS and no ESF-RAW"),
        (b"\xb5\x62" * 60_000, log_format(), "among 0 UBX messages"),
        (b"$VNYMR,1,2,3*00\r\n" * 50, log_format(), r"a\.ubx"),
        (b"\x1f\x8b" + bytes(range(256)), log_format(), r"a\.ubx"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, data: bytes, log: LogFormat, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        columns(written(tmp_path, data), log)


def test_a_column_that_is_none_is_named(tmp_path: Path) -> None:
    channels = {"gyro_x": {"column": 1, "unit": "deg/s"}}
    log = LogFormat.model_validate({"reader": "ubx", "rate": "1 Hz", "channels": channels})
    with pytest.raises(RecordingError, match="no column 1 for gyro_x; a UBX log has gyro_x"):
        columns(written(tmp_path, ONE), log)


def test_one_column_for_two_channels(tmp_path: Path) -> None:
    channels = {
        "gyro_x": {"column": "gyro_x", "unit": "deg/s"},
        "gyro_y": {"column": "gyro_x", "unit": "deg/s", "scale": -1},
    }
    log = LogFormat.model_validate({"reader": "ubx", "rate": "1 Hz", "channels": channels})
    found, _, _ = columns(written(tmp_path, ONE), log)
    assert found["gyro_x"][0] == -found["gyro_y"][0]


def test_the_message_that_is_named_is_taken(tmp_path: Path) -> None:
    path = written(tmp_path, (ONE + meas(1, {14: 4096})) * 5)
    found, _, _ = columns(path, log_format(["gyro_x"], variable="ESF-MEAS"))
    assert found["gyro_x"].tolist() == pytest.approx([DEG] * 5)
    found, _, _ = columns(path, log_format(["gyro_x"], variable="ESF-RAW"))
    np.testing.assert_allclose(found["gyro_x"], expected("gyro_x", np.repeat(truth(1), 5, 0)))


WHOLE = b"".join(
    (nav_pvt() if i == 5 else b"")
    + raw(samples(truth(20)[i : i + 1], np.array([i * 256])))
    + meas(i, {14: i})
    for i in range(20)
)
LOGS = [
    log_format(variable="ESF-RAW"),
    log_format(variable="ESF-RAW", time=TAGGED),
    log_format(["gyro_x"], variable="ESF-MEAS", time=TAGGED),
    log_format(),
]


@given(damages(len(WHOLE), 20), st.sampled_from(LOGS))
@examples(150)
def test_no_damage_gives_another_error(tmp_path: Path, damage: Damage, log: LogFormat) -> None:
    try:
        found, _, _ = columns(written(tmp_path, damaged(WHOLE, damage)), log)
    except RecordingError as error:
        assert "a.ubx" in str(error)
        return
    if "accel_x" in found and len(damage[1]) <= 1:
        assert set(found["accel_x"]) <= set(expected("accel_x", truth(20)))


@given(st.binary(max_size=300))
@examples(100)
def test_any_payload_gives_no_other_error(tmp_path: Path, payload: bytes) -> None:
    for key in ("ESF-MEAS", "ESF-RAW"):
        size = struct.pack("<H", len(payload))
        body = bytes([0x10, 2 + (key == "ESF-RAW")]) + size + payload
        first = sum(body) & 0xFF
        second = sum((len(body) - i) * byte for i, byte in enumerate(body)) & 0xFF
        data = b"\xb5\x62" + body + bytes([first, second])
        for log in (log_format(["gyro_x"]), log_format(["gyro_x"], time=TAGGED, variable=key)):
            try:
                columns(written(tmp_path, data + payload), log)
            except RecordingError as error:
                assert "a.ubx" in str(error)
