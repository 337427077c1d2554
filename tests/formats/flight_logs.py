"""Writers of ULog and DataFlash by their published specifications, independent of the readers."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

# ---------------------------------------------------------------------------------- ULog
# docs.px4.io, "ULog File Format": every message is size (uint16), type (char), payload.

SYNC = bytes.fromhex("2f731320250cbb12")
COMBINED = (
    "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
    "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
    "uint32_t accelerometer_integral_dt;uint8_t accelerometer_clipping;uint8_t[3] _padding0;"
)
GYRO = (
    "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;"
    "float temperature;uint32_t error_count;uint8_t[3] clip_counter;uint8_t samples;"
)
FIFO = (
    "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;"
    "int16_t[32] x;int16_t[32] y;int16_t[32] z;uint8_t samples;uint8_t[3] _padding0;"
)
NESTED = "uint64_t timestamp;esc_report[2] esc;bool armed;char[8] name;"
REPORT = "int32_t rpm;float voltage;"


def message(kind: str, payload: bytes) -> bytes:
    return struct.pack("<Hc", len(payload), kind.encode()) + payload


def declared(name: str, fields: str) -> bytes:
    return message("F", f"{name}:{fields}".encode())


def subscribed(number: int, name: str, instance: int = 0) -> bytes:
    return message("A", struct.pack("<BH", instance, number) + name.encode())


def data(number: int, payload: bytes) -> bytes:
    return message("D", struct.pack("<H", number) + payload)


def ulog_header(appended: Sequence[int] = ()) -> bytes:
    offsets = [*appended, 0, 0, 0][:3]
    flags = struct.pack("<16B3Q", *[0] * 8, bool(appended), *[0] * 7, *offsets)
    return b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 112_000) + message("B", flags)


def definitions() -> bytes:
    layouts = {"sensor_combined": COMBINED, "sensor_gyro": GYRO, "sensor_gyro_fifo": FIFO,
               "esc_report": REPORT, "esc_status": NESTED}  # fmt: skip
    info = message("I", b"\x0cchar[4] sys_".replace(b"\x0c", b"\x0f") + b"name" + b"PX4x")
    parameter = message("P", b"\x09int32_t X" + struct.pack("<i", 3))
    return b"".join(declared(*each) for each in layouts.items()) + info + parameter


def combined(stamp: int, gyro: Sequence[float], accel: Sequence[float]) -> bytes:
    return struct.pack("<Q3fIi3fIB", stamp, *gyro, 4000, 0, *accel, 4000, 0)


def gyro(stamp: int, rates: Sequence[float], temperature: float) -> bytes:
    return struct.pack("<QQI3ffI3BB", stamp + 150, stamp, 7, *rates, temperature, 0, 0, 0, 0, 1)


def fifo(stamp: int, interval: float, scale: float, counts: np.ndarray) -> bytes:
    """``stamp`` is of the last sample; ``counts``: shape (samples, 3)."""
    axes = np.zeros((3, 32), "<i2")
    axes[:, : len(counts)] = counts.T
    head = struct.pack("<QQIff", stamp + 99, stamp, 7, interval, scale)
    return head + axes.tobytes() + struct.pack("<B", len(counts))


def ulog(figures: Mapping[str, np.ndarray], *, interval: int = 4000) -> bytes:
    """A log of sensor_combined, and of two sensor_gyro, the second at half the rate."""
    parts = [ulog_header(), definitions(), subscribed(0, "sensor_combined"),
             subscribed(5, "sensor_gyro", 0), subscribed(6, "sensor_gyro", 1),
             subscribed(9, "esc_status")]  # fmt: skip
    rates = np.column_stack([figures[f"gyro_{axis}"] for axis in "xyz"])
    forces = np.column_stack([figures[f"accel_{axis}"] for axis in "xyz"])
    for row, (rate, force) in enumerate(zip(rates, forces, strict=True)):
        stamp = 5_000_000 + row * interval
        parts.append(data(0, combined(stamp, rate, force)))
        parts.append(data(5, gyro(stamp, rate, figures["temperature"][row])))
        if row % 2 == 0:
            parts.append(data(6, gyro(stamp, -rate, 20.0)))
        if row % 100 == 50:
            parts.append(data(9, struct.pack("<Qifif?8s", stamp, 1, 2.0, 3, 4.0, True, b"abc")))
            parts.append(message("S", SYNC))
            parts.append(message("L", struct.pack("<BQ", 6, stamp) + b"all is well"))
            parts.append(message("O", struct.pack("<H", 3)))
    return b"".join(parts)


# -------------------------------------------------------------------------------- DataFlash
# ArduPilot, libraries/AP_Logger: 0xA3 0x95, type, fields; FMT declares a type.


def fmt(number: int, name: str, form: str, labels: str, length: int) -> bytes:
    return b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", number, length, name.encode(), form.encode(), labels.encode()
    )


_CODES = {"b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d",
          "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i",
          "M": "B", "q": "q", "Q": "Q", "a": "64s"}  # fmt: skip


class DataFlash:
    """The messages of a log, each declared before it is used."""

    def __init__(self) -> None:
        self.parts = [fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)]
        self._kinds: dict[str, tuple[int, struct.Struct]] = {}

    def declare(self, number: int, name: str, form: str, labels: str) -> None:
        layout = struct.Struct("<" + "".join(_CODES[sign] for sign in form))
        self._kinds[name] = number, layout
        self.parts.append(fmt(number, name, form, labels, 3 + layout.size))

    def add(self, name: str, *values: Any) -> None:
        number, layout = self._kinds[name]
        self.parts.append(b"\xa3\x95" + bytes([number]) + layout.pack(*values))

    def __bytes__(self) -> bytes:
        return b"".join(self.parts)


IMU = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"


def dataflash(figures: Mapping[str, np.ndarray], *, interval: int = 4000) -> bytes:
    """A log of two IMUs, the second with rates of the other sign, and other messages."""
    log = DataFlash()
    log.declare(129, "IMU", "QBffffffIIfBBHH", IMU)
    log.declare(130, "PARM", "QNff", "TimeUS,Name,Value,Default")
    log.declare(131, "BAT", "QBcCeEL", "TimeUS,Inst,Volt,Curr,A,B,Lat")
    names = [f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz"]
    rows = np.column_stack([figures[name] for name in names])
    for row, values in enumerate(rows):
        stamp = 7_000_000 + row * interval
        for instance, sign in ((0, 1), (1, -1)):
            own = [*(sign * values[:3]), *values[3:]]
            rest = (0, 0, figures["temperature"][row], 1, 1, 1000, 1000)
            log.add("IMU", stamp, instance, *own, *rest)
        if row % 50 == 10:
            log.add("PARM", stamp, b"INS_GYR_FILTER", 20.0, 20.0)
            log.add("BAT", stamp, 0, -123, 456, -78_901, 23_456, 473_977_420)
    return bytes(log)


def batch_sampler(counts: np.ndarray, *, multiplier: int, rate: float, first: int) -> bytes:
    """The batch of a gyro; ``counts``: shape (samples, 3)."""
    log = DataFlash()
    log.declare(129, "ISBH", "QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate")
    log.declare(130, "ISBD", "QHHaaa", "TimeUS,N,seqno,x,y,z")
    log.add("ISBH", first + 10, 4, 1, 0, multiplier, len(counts), first, rate)
    for number, start in enumerate(range(0, len(counts), 32)):
        axes = np.zeros((3, 32), "<i2")
        part = counts[start : start + 32]
        axes[:, : len(part)] = part.T
        log.add("ISBD", first + 20, 4, number, *(axis.tobytes() for axis in axes))
    return bytes(log)


def join(parts: Iterable[bytes]) -> bytes:
    return b"".join(parts)
