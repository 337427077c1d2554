"""MATLAB files of version 4 (-v4): the header of each variable.

A file is a sequence of variables: five integers of 4 bytes (type, rows, columns, whether it is
complex, bytes of the name), the name with a zero behind it, and the figures, column by column. The
decimal digits of the type are the order of the bytes, 0, the type of the figures and the kind of
the variable. See "MAT-File Format" of MATLAB.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass

import numpy as np

_FIELDS = "5i"
_ORDERS = {0: "<", 1: ">", 2: "VAX D-float", 3: "VAX G-float", 4: "Cray"}
_FIGURES = ("f8", "f4", "i4", "i2", "u2", "u1")
_KINDS = (
    None,
    "holds text; expected numbers",
    "is sparse; expected a vector or a matrix: save full() of it",
)
_NAME = re.compile(rb"[A-Za-z]\w{0,62}\0")

HEADER_BYTES = struct.calcsize(_FIELDS) + 64
"""The longest header with its name."""


@dataclass(frozen=True)
class Header:
    """Header of a variable."""

    name: str
    shape: tuple[int, int]
    dtype: np.dtype[np.generic]
    begin: int
    """Bytes of the header and the name."""
    size: int
    """Bytes of the figures."""
    fault: str | None
    """Why they cannot be read, as the end of a sentence."""


def header_of(begin: bytes) -> Header | None:
    """Return the header that bytes begin with; None: they begin with none.

    ``begin``: `HEADER_BYTES`, fewer at the end of a file. Bytes of chance are no header: 16 bytes
    of it are zero but for small numbers, and the name is one.
    """
    before = struct.calcsize(_FIELDS)
    if len(begin) < before:
        return None
    for order in "<>":
        kind, rows, columns, is_complex, length = struct.unpack(order + _FIELDS, begin[:before])
        machine, zero, figures, variable = (kind // place % 10 for place in (1000, 100, 10, 1))
        name = begin[before : before + max(length, 0)]
        if (
            0 <= kind < 5000
            and zero == 0
            and figures < len(_FIGURES)
            and variable < len(_KINDS)
            and is_complex in (0, 1)
            and min(rows, columns) >= 0
            and _NAME.fullmatch(name)
            and (machine > 1 or _ORDERS[machine] == order)
        ):
            dtype = np.dtype(order + _FIGURES[figures])
            fault = _KINDS[variable]
            if machine > 1:
                fault = f"has figures of {_ORDERS[machine]}; expected IEEE: save it with -v7.3"
            elif fault is None and is_complex:
                fault = "holds complex numbers; expected numbers: save real() of it"
            size = rows * columns * dtype.itemsize * (1 + is_complex)
            return Header(
                name[:-1].decode("ascii"), (rows, columns), dtype, before + length, size, fault
            )
    return None
