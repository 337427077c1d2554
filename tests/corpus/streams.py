"""Binary and sentences of receivers, inertial units and flight controllers."""

from __future__ import annotations

import gzip
from functools import cache
from typing import Any

import numpy as np

from tests.corpus.entry import Entry, Rejected, file, flipped, kept, part
from tests.corpus.signals import RATE, ROWS, rest
from tests.formats.flight_logs import dataflash, ulog
from tests.formats.test_novatel import rawimus
from tests.formats.test_ubx import NMEA, RTCM, meas, nav_pvt, raw, samples
from tests.formats.test_vectornav import logged, sentence

# -------------------------------------------------------------------------------------- UBX

SIX = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
UNITS = {"gyro": "deg/s", "accel": "m/s^2"}
COUNTS = np.round(np.random.default_rng(4).standard_normal((ROWS, 6)) * 300).astype(int)
COUNTS[:, 5] += 10_042
TAGS = np.arange(ROWS) * 256


def ubx(channels: tuple[str, ...] = SIX, **time: Any) -> dict[str, Any]:
    """Return the log format of a receiver."""
    return {
        "time": {"column": "time_tag", "unit": "ms"} | time,
        "channels": {name: {"column": name, "unit": UNITS[name[:-2]]} for name in channels},
    }


def of_raw(tags: np.ndarray, size: int = 10) -> list[bytes]:
    each = samples(COUNTS, tags)
    return [raw(each[start : start + size]) for start in range(0, ROWS, size)]


@cache
def raws() -> list[bytes]:
    return of_raw(TAGS)


@cache
def all_meas() -> bytes:
    return b"".join(
        meas(10 * row, {14: int(COUNTS[row, 0]), 16: int(COUNTS[row, 3]), 12: 2500})
        for row in range(ROWS)
    )


def all_raw() -> bytes:
    return b"".join(raws())


def wrong() -> bytes:
    return b"".join([*raws()[:40], flipped(raws()[40], 0.5), *raws()[41:]])


RECEIVERS = [
    Entry("ubx of ESF-RAW", file(all_raw, "log.ubx"), ubx(), kept(ROWS)),
    Entry("ubx of ESF-MEAS", file(all_meas, "log.ubx"), ubx(("gyro_x", "accel_x")), kept(ROWS)),
    Entry("ubx in gzip", file(lambda: gzip.compress(all_raw()), "log.ubx.gz"), ubx(), kept(ROWS)),
    Entry(
        "ubx with a wrong checksum",
        file(wrong, "log.ubx"),
        ubx(),
        kept(ROWS - 10, "wrong_checksum", "missing_samples"),
    ),
    Entry(
        "ubx cut in a message",
        file(lambda: all_raw()[:-20], "log.ubx"),
        ubx(),
        kept(ROWS - 10, "incomplete_last_record"),
    ),
    Entry(
        "ubx in gzip cut short",
        file(lambda: part(gzip.compress(all_raw()), 0.5), "log.ubx.gz"),
        ubx(),
        kept(500, "truncated_file", "incomplete_last_record"),
    ),
    Entry(
        "ubx between NMEA and RTCM",
        file(
            lambda: b"".join(
                b for message in raws() for b in (NMEA, message, RTCM, nav_pvt(valid=0))
            ),
            "log.ubx",
        ),
        ubx(),
        kept(ROWS),
    ),
    Entry(
        "ubx with counters that wrap",
        file(lambda: b"".join(of_raw((TAGS + 2**24 - 1000) % 2**24)), "log.ubx"),
        ubx(),
        kept(ROWS),
    ),
    Entry(
        "ubx without sensors",
        file(lambda: nav_pvt() * 50, "log.ubx"),
        ubx(),
        Rejected(r"log\.ubx: found no ESF-MEAS and no ESF-RAW among 50 UBX messages"),
    ),
    Entry(
        "ubx without an axis",
        file(all_meas, "log.ubx"),
        ubx(),
        Rejected(r"log\.ubx: .*data types 12, 14, 16.*expected .* 13 \(gyro_y\)"),
    ),
    Entry(
        "ubx of both messages",
        file(lambda: all_raw() + all_meas(), "log.ubx"),
        ubx(("gyro_x",)),
        Rejected("both ESF-MEAS and ESF-RAW have the columns; select one"),
    ),
    Entry(
        "ubx of nothing",
        file(b"", "log.ubx"),
        ubx() | {"reader": "ubx"},
        Rejected(r"log\.ubx: found no ESF-MEAS and no ESF-RAW among 0 UBX messages"),
    ),
    Entry(
        "ubx of syncs alone",
        file(b"\xb5\x62" * 50_000, "log.ubx"),
        ubx() | {"reader": "ubx"},
        Rejected("among 0 UBX messages"),
    ),
    Entry(
        "ubx of the beginnings of long messages",
        file(lambda: b"\xb5\x62\x10\x02\xff\xff" * 50_000 + bytes(70_000), "log.ubx"),
        ubx() | {"reader": "ubx"},
        Rejected(r"log\.ubx: found no ESF-MEAS and no ESF-RAW .* 50000 with a wrong checksum"),
    ),
    Entry(
        "ubx after a restart",
        file(lambda: all_raw() + b"".join(raws()[:50]), "log.ubx"),
        ubx(),
        kept(ROWS + 500, "segments", "log_twice"),
    ),
]

# -------------------------------------------------------------------------------- VectorNav


def vectornav(**keys: Any) -> dict[str, Any]:
    """Return the log format of a VectorNav sensor."""
    given: dict[str, Any] = {} if "time" in keys else {"rate": f"{RATE} Hz"}
    return (
        {
            "channels": {
                "gyro_x": {"column": "gyro_x", "unit": "rad/s"},
                "accel_z": {"column": "accel_z", "unit": "m/s^2"},
            }
        }
        | given
        | keys
    )


@cache
def sentences(appended: bool = False) -> list[bytes]:
    lines = []
    for row, (wx, az) in enumerate(zip(rest()["wx"], rest()["az"], strict=True)):
        figures = [0.0] * 8 + [float(az), float(wx), 0.0, 0.0]
        lines.append(sentence("VNYMR", figures, f",T{10 * row:010d}" if appended else ""))
    return lines


def damaged() -> list[bytes]:
    lines = sentences()
    return [*lines[:500], lines[500].replace(b"VNYMR,+", b"VNYMR,-"), *lines[501:]]


HOST = {"column": "host_time", "unit": "s"}

TEXTS = [
    Entry("vectornav", file(lambda: logged(sentences()), "log.txt"), vectornav(), kept(ROWS)),
    Entry(
        "vectornav with a wrong checksum",
        file(lambda: logged(damaged()), "log.txt"),
        vectornav(),
        kept(ROWS, "wrong_checksum", "empty_cells"),
    ),
    Entry(
        "vectornav with a wrong checksum and stamps",
        file(
            lambda: logged([b"%.2f " % (row / RATE) + line for row, line in enumerate(damaged())]),
            "log.txt",
        ),
        vectornav(time=HOST),
        kept(ROWS - 1, "wrong_checksum", "missing_samples"),
    ),
    Entry(
        "vectornav with a counter",
        file(lambda: logged(sentences(appended=True)), "log.txt"),
        vectornav(time={"column": "counter", "unit": "ms"}),
        kept(ROWS),
    ),
    Entry(
        "vectornav cut in a sentence",
        file(lambda: logged(sentences())[:-20], "log.txt"),
        vectornav(),
        kept(ROWS - 1, "incomplete_last_record"),
    ),
    Entry(
        "vectornav with other sentences",
        file(
            lambda: logged(
                [b for line in sentences() for b in (line, b"$VNYPR,+010.071,+000.278,-002.026*60")]
            ),
            "log.txt",
        ),
        vectornav(),
        kept(ROWS, "other_sentences"),
    ),
    Entry(
        "vectornav with garbage",
        file(
            lambda: logged(
                [*sentences()[:300], b"\xfa\x01\x29\0\x80", b"ready", *sentences()[300:]]
            ),
            "log.txt",
        ),
        vectornav(),
        kept(ROWS, "not_sentences"),
    ),
    Entry(
        "vectornav with every checksum wrong",
        file(lambda: logged([line[:-2] + b"zz" for line in sentences()]), "log.txt"),
        vectornav(),
        Rejected(r"log\.txt: found no sentence with a right checksum"),
    ),
    Entry(
        "vectornav of other sentences",
        file(lambda: logged([b"$VNYPR,+010.071,+000.278,-002.026*60"] * ROWS), "log.txt"),
        vectornav(),
        Rejected(r"log\.txt: found VNYPR; expected one of VNYMR"),
    ),
    Entry(
        "vectornav without the stamps that are named",
        file(lambda: logged(sentences()), "log.txt"),
        vectornav(time=HOST),
        Rejected(r"none of the first \d+ sentences has a stamp that can be read"),
    ),
]

# ---------------------------------------------------------------------------------- NovAtel

SCALES = {"gyro": 1e-9 * RATE, "accel": 2e-8 * RATE}
NOVATEL: dict[str, Any] = {
    "time": {"column": "gnss_time", "unit": "ns"},
    "channels": {
        "gyro_x": {"column": "gyro_x", "unit": "rad/s", "scale": SCALES["gyro"]},
        "accel_z": {"column": "accel_z", "unit": "m/s^2", "scale": SCALES["accel"]},
    },
}


@cache
def raw_imu() -> list[bytes]:
    counts = np.column_stack(
        [COUNTS[:, :3], COUNTS[:, 3:5], 9.80665 / SCALES["accel"] + COUNTS[:, 5]]
    )
    return rawimus(np.rint(counts).astype(int), RATE)


TEXTS += [
    Entry("novatel", file(lambda: logged(raw_imu()), "log.asc"), NOVATEL, kept(ROWS)),
    Entry(
        "novatel with a wrong checksum",
        file(
            lambda: logged([*raw_imu()[:9], raw_imu()[9][:-1] + b"x", *raw_imu()[10:]]), "log.asc"
        ),
        NOVATEL,
        kept(ROWS - 1, "not_sentences", "missing_samples"),
    ),
]

# ------------------------------------------------------------------------ flight controllers


@cache
def figures() -> dict[str, np.ndarray]:
    noise = np.random.default_rng(9).standard_normal((7, ROWS)).astype(np.float32) * 0.01
    names = [*SIX, "temperature"]
    found = dict(zip(names, noise.astype(float), strict=True))
    return found | {"accel_z": found["accel_z"] + 9.8, "temperature": found["temperature"] + 25}


ULOG: dict[str, Any] = {
    "time": {"column": "timestamp", "unit": "us"},
    "channels": {
        "gyro_x": {"variable": "sensor_combined_0", "column": "gyro_rad[0]", "unit": "rad/s"},
        "accel_z": {
            "variable": "sensor_combined_0",
            "column": "accelerometer_m_s2[2]",
            "unit": "m/s^2",
        },
    },
}
DATAFLASH: dict[str, Any] = {
    "time": {"column": "TimeUS", "unit": "us"},
    "channels": {
        "gyro_x": {"variable": "IMU_0", "column": "GyrX", "unit": "rad/s"},
        "accel_z": {"variable": "IMU_0", "column": "AccZ", "unit": "m/s^2"},
    },
}


def overwritten(data: bytes) -> bytes:
    return data[:50_000] + b"\xff" * 100 + data[50_100:]


FLIGHT = [
    Entry("ulog", file(lambda: ulog(figures()), "log.ulg"), ULOG, kept(ROWS)),
    Entry("ulog in gzip", file(lambda: gzip.compress(ulog(figures())), "log.gz"), ULOG, kept(ROWS)),
    Entry(
        "ulog that is damaged",  # to the next mark of a place, in less than 100 records
        file(lambda: overwritten(ulog(figures())), "log.ulg"),
        ULOG,
        kept(944, "damaged_bytes", "missing_samples"),
    ),
    Entry(
        "ulog without the topic",
        file(lambda: ulog(figures()).replace(b"sensor_combined", b"sensor_combine_"), "log.ulg"),
        ULOG,
        Rejected(r"log\.ulg: expected one kind of message with .* called sensor_combined_0"),
    ),
    Entry("dataflash", file(lambda: dataflash(figures()), "log.bin"), DATAFLASH, kept(ROWS)),
    Entry(
        "dataflash that is damaged",
        file(lambda: overwritten(dataflash(figures())), "log.bin"),
        DATAFLASH,
        kept(ROWS - 1, "damaged_bytes", "missing_samples"),
    ),
    Entry(
        "dataflash cut short",
        file(lambda: dataflash(figures())[:-30], "log.bin"),
        DATAFLASH,
        kept(ROWS, "incomplete_last_record"),
    ),
]

PACKED = [
    Entry(
        "vectornav in gzip cut short",
        file(lambda: part(gzip.compress(logged(sentences())), 0.5), "log.txt.gz"),
        vectornav(),
        kept(487, "truncated_file", "incomplete_last_record"),
    ),
    Entry(
        "vectornav in gzip",
        file(lambda: gzip.compress(logged(sentences())), "log.txt.gz"),
        vectornav(),
        kept(ROWS),
    ),
]

BINARY = [*RECEIVERS, *FLIGHT, *PACKED]
