"""What a file that is made to cost much is, and what several of them are made of."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

MIB = 1 << 20
RECORDS = b"wx,ax\n" + b"1.5,2\n" * 1000
TWO = {"gyro_x": {"column": "wx"}, "accel_x": {"column": "ax", "unit": "m/s^2"}}
FIRST = {"gyro_x": {"column": 1}}


@dataclass(frozen=True)
class Attack:
    """A file that is made to cost much.

    Attributes
    ----------
    write : callable
        Writes it into a folder, and returns its path.
    read : str
        Pattern of what comes of reading it.
    listed : str or None
        Of listing it; None: the same.
    channels : dict
        Of the sensor file.
    most_mb : float
        That it may take to read it. What a library unpacks on its own is held by the limit of the
        step alone.
    """

    write: Callable[[Path], Path]
    read: str
    listed: str | None = None
    channels: dict[str, Any] = field(default_factory=lambda: TWO)
    most_mb: float = 600.0


def file(name: str, make: Callable[[], bytes]) -> Callable[[Path], Path]:
    """Return what writes a file."""

    def write(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(make())
        return path

    return write


@cache
def _deflated_mib() -> bytes:
    """Return a MiB of zeros as blocks of deflate that stand alone."""
    compress = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return compress.compress(bytes(MIB)) + compress.flush(zlib.Z_FULL_FLUSH)


def deflated_zeros(count: int) -> bytes:
    """Return so many MiB of zeros as zlib has them, in no time."""
    check = (count * MIB % 65521) << 16 | 1  # Adler's, of zeros
    return b"\x78\x01" + _deflated_mib() * count + b"\x03\x00" + check.to_bytes(4, "big")
