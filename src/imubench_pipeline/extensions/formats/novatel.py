"""Read raw IMU logs of NovAtel receivers in ASCII: RAWIMU, RAWIMUS, RAWIMUX and RAWIMUSX.

A line such as ``%RAWIMUSA,week,s;week,s,status,z,-y,x,z,-y,x*crc`` has the increments of velocity
and angle since the line before, in counts (OEM7 Commands and Logs Reference Manual, RAWIMUSX). The
columns ``gyro_x`` ... ``accel_z`` are these counts, with the sign of y restored: `scale` of a
channel is the scale factor of the IMU times the rate of the log in Hz. The time column is
``gnss_time``, in ns.
"""

import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.extensions.formats.vectornav import Counts, parse_fields
from imubench_pipeline.readers import file_format as formats
from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.readers.stamps import Clock
from imubench_pipeline.readers.text.complete_lines import CompleteLines
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.words.findings import files

TIME = "gnss_time"
_COLUMNS = {"gyro_x": 8, "gyro_y": 7, "gyro_z": 6, "accel_x": 5, "accel_y": 4, "accel_z": 3}
"""Position of each column among the last `_WIDTH` fields: week, seconds, status and counts."""

_WIDTH, _WEEK, _SECONDS, _WEEK_NS = 9, 0, 1, 604_800 * 10**9
_NEGATIVE = ("gyro_y", "accel_y")
_LOG = re.compile(rb"[%#]((RAWIMUS?X?A),[^;*\n]*;([^*\n]*))\*([0-9A-Fa-f]{8})")
_STATUS = re.compile(rb"^((?:[^,]*,){2})[^,]*")
_BLOCK_BYTES, _MAX_DESCRIBED_BYTES = 1 << 20, 1 << 21
_CRC_START = 0xFFFFFFFF  # of zlib, for a register that begins and ends without inversion

# --------------------------------------------------------------------- scale factors of IMUs

_GRAVITY_TOLERANCE = 0.05  # of the mean acceleration, for the guess of an IMU
_DEG, _ARCSEC, _FOOT, _MG = np.pi / 180, np.pi / 648_000, 0.3048, STANDARD_GRAVITY / 1000


@dataclass(frozen=True)
class Scale:
    """Scale factors of an IMU: rad and m/s per count, or rad/s and m/s² where ``is_rate``."""

    imu: str
    gyro: float
    accel: float
    types: tuple[int, ...]  # IMU types of RAWIMUX and RAWIMUSX
    is_rate: bool = False

    def per_count(self, quantity: str, rate: float) -> float:
        """Return rad/s or m/s² per count in a log with the sampling ``rate``, Hz."""
        factor = self.gyro if quantity == "gyro" else self.accel
        return factor if self.is_rate else factor * rate


SCALES = (
    Scale("HG1700 AG11/AG58, HG1900, HG1930", 2.0**-33, 2.0**-27 * _FOOT, (1, 5, 11, 20, 27, 28)),
    Scale("HG1700 AG17/AG62", 2.0**-33, 2.0**-26 * _FOOT, (4, 12)),
    Scale("HG4930", 2.0**-33, 2.0**-29, (58, 68, 69)),
    Scale("LN-200", 2.0**-19, 2.0**-14, (8,)),
    Scale("iMAR FSAS", 0.1 * 2.0**-8 * _ARCSEC, 0.05 * 2.0**-15, (13,)),
    Scale("KVH CPT, KVH 1750", 0.1 / (3600 * 256), 0.05 * 2.0**-15, (16, 33)),
    Scale("ISA-100C, Litef µIMU", 1e-9, 2e-8, (26, 52)),
    Scale("ADIS16488", 720 * 2.0**-31 * _DEG, 200 * 2.0**-31, (31,)),
    Scale("STIM300", 2.0**-21 * _DEG, 2.0**-22, (32, 56)),
    Scale("Epson G320", 0.008 * 2.0**-16 * _DEG, 0.2 * 2.0**-16 * _MG, (41, 62), True),
    Scale("Epson G370", 0.0151515 * 2.0**-16 * _DEG, 0.4 * 2.0**-16 * _MG, (61,), True),
)
"""As the manual and NovAtel's own driver for ROS (novatel_oem7_driver) state them."""


def compute_crc(text: bytes) -> int:
    """Return the CRC of a log of NovAtel: CRC-32 whose register begins with 0, not inverted."""
    return zlib.crc32(text, _CRC_START) ^ _CRC_START


class _Logs(Counts):
    """Extracts the logs of one kind, that of the first, and counts the other text."""

    def __init__(self, *, stamped: bool) -> None:
        super().__init__()
        self.kind, self._stamped = b"", stamped
        self.checked: bool | None = None  # whether a checksum in the first block is right
        self.imu = ""  # type of the IMU, if the logs state it

    def parse(
        self, text: bytes
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64], NDArray[np.bool_]]:
        """Return counts of some lines by column, their stamps, ns, and which are present."""
        found, bodies = _LOG.findall(text), []
        right = [int(crc, 16) == compute_crc(log) for log, _, _, crc in found]
        if found and self.checked is None:
            self.kind, self.checked = found[0][1], any(right)
        for is_right, (_, kind, body, _) in zip(right, found, strict=True):
            if kind != self.kind:
                self.others[kind.decode()] += 1
            elif is_right or not self.checked:
                self.right += 1
                fields = body.rsplit(b",", _WIDTH)
                if b"X" in kind and not self.imu:
                    self.imu = fields[0].rpartition(b",")[2].decode("ascii", "replace")
                # The status is hexadecimal.
                bodies.append(_STATUS.sub(rb"\1", b",".join(fields[-_WIDTH:])))
            else:
                self.wrong += 1
                bodies += [] if self._stamped else [b""]
        self.garbage += sum(bool(line.strip()) for line in _LOG.sub(b"", text).split(b"\n"))
        fields, unread = parse_fields(bodies, _WIDTH, set(range(_WIDTH)) - {2})
        self.unread += unread
        counts = {c: fields[at] * (-1 if c in _NEGATIVE else 1) for c, at in _COLUMNS.items()}
        with np.errstate(invalid="ignore"):
            present = (abs(fields[_WEEK]) < 1e4) & (abs(fields[_SECONDS]) < 1e6)
        week, seconds = (np.where(present, fields[at], 0.0) for at in (_WEEK, _SECONDS))
        stamps = week.astype(np.int64) * _WEEK_NS + np.rint(seconds * 1e9).astype(np.int64)
        return counts, stamps, present


def _make_empty_error(path: Path) -> RecordingError:
    return RecordingError(
        f"{path.name}: no log RAWIMUA, RAWIMUSA, RAWIMUXA or RAWIMUSXA; expected lines such as "
        "%RAWIMUSA,...;...*1a2b3c4d"
    )


class NovatelFile(LogFile):
    """A log of RAWIMU, RAWIMUS, RAWIMUX or RAWIMUSX."""

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        time, columns = self.log.time, {n: str(s.column) for n, s in self.sources.items()}
        of_time = TIME if time is None else str(time.column)
        if not set(columns.values()) <= _COLUMNS.keys() or of_time != TIME:
            raise RecordingError(
                f"{self.path.name}: no columns {', '.join([*columns.values(), of_time])} in a log "
                f"of RAWIMU; expected {', '.join(_COLUMNS)}, and {TIME} in ns as 'time'; correct "
                "'column' in the sensor file"
            )
        logs, clock = _Logs(stamped=time is not None), Clock(self, None, lambda _: None)
        with CompleteLines(self.path, self.findings) as lines:
            while block := lines.read(_BLOCK_BYTES):
                counts, stamps, present = logs.parse(block)
                if not len(stamps):
                    continue
                seconds = None if time is None else clock.seconds(stamps, present)
                yield Batch(seconds, {n: self.to_si(n, counts[c]) for n, c in columns.items()})
            if (zeros := lines.zeros(0, shifted=time is None)) is not None:
                self.findings.append(zeros)
        if not logs.right:
            raise _make_empty_error(self.path)
        kind = logs.kind.decode()
        logs.report(self, kind, _WIDTH)
        if not logs.checked:
            self.note(files.UncheckedLogs(self.path.name, logs.right, kind), logs.right)


def list_logs(path: Path, file_format: formats.FileFormat) -> list[formats.LogTable]:
    """Return the table of the raw IMU logs; raise `RecordingError` if there are none."""
    logs = _Logs(stamped=True)
    with CompleteLines(path, [], most=_MAX_DESCRIBED_BYTES) as lines:
        while not logs.right and (block := lines.read(_BLOCK_BYTES)):
            counts, stamps, present = logs.parse(block)
    if not logs.right:
        raise _make_empty_error(path)
    first = slice(formats.MAX_EXAMINED_RECORDS)
    steps = np.diff(stamps[present])
    rate = float(f"{1e9 / np.median(steps[steps > 0]):.4g}") if (steps > 0).any() else None
    length = float(np.linalg.norm([np.nanmean(counts[f"accel_{axis}"]) for axis in "xyz"]))
    columns = [formats.LogColumn.of_numbers(TIME, TIME, stamps[present][first], "ns")]
    for name in _COLUMNS:
        column = formats.LogColumn.of_numbers(name, name, counts[name][first])
        columns.append(_add_scale(column, logs.imu, rate, length))
    about = f"{logs.right} logs at the beginning" + f", IMU type {logs.imu}" * bool(logs.imu)
    return [formats.LogTable(file_format, logs.kind.decode(), tuple(columns), about=about)]


def _add_scale(
    column: formats.LogColumn, imu: str, rate: float | None, gravity: float
) -> formats.LogColumn:
    """Return a column with the scale of its IMU, or a hint; ``gravity``: its length in counts."""
    quantity = column.label[:-2]
    unit = {"gyro": "rad/s", "accel": "m/s^2"}[quantity]
    if rate is None:
        return replace(column, hint=f"counts: 'scale' of the IMU times the rate, 'unit: {unit}'")
    factors = {scale: float(f"{scale.per_count(quantity, rate):.10g}") for scale in SCALES}
    for scale, factor in factors.items():
        if imu in map(str, scale.types):
            hint = f"scale factor of {scale.imu} at {rate:g} Hz"
            values = column.values * factor
            return replace(column, values=values, unit=unit, scale=factor, hint=hint)
    likely = "; ".join(
        f"{scale.imu}: {factor:.6g}"
        for scale, factor in factors.items()
        if abs(gravity * scale.per_count("accel", rate) / STANDARD_GRAVITY - 1) < _GRAVITY_TOLERANCE
    )
    hint = f"counts: which IMU? 'scale' is its scale factor times {rate:g} Hz, 'unit: {unit}'"
    return replace(column, hint=hint + f"; gravity fits {likely}" * bool(likely))
