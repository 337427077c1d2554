"""MATLAB files of version 4 (-v4): the header of each variable. See "MAT-File Format" of MATLAB.

A variable is five integers of 4 bytes (type, rows, columns, whether it is complex, bytes of the
name), the name with a terminating zero, and the numbers, column by column. The decimal digits of
the type are the byte order, 0, the type of the numbers and the kind of the variable.
"""

import re
import struct
from dataclasses import dataclass

import numpy as np

_HEADER_FORMAT = "5i"
_MACHINES = {0: "<", 1: ">", 2: "VAX D-float", 3: "VAX G-float", 4: "Cray"}
_NUMBER_TYPES = ("f8", "f4", "i4", "i2", "u2", "u1")
_KIND_FAULTS = (
    None,
    "holds text; expected numbers",
    "is sparse; expected a vector or a matrix: save full() of it",
)
_VARIABLE_NAME = re.compile(rb"[A-Za-z]\w{0,62}\0")
HEADER_BYTES = struct.calcsize(_HEADER_FORMAT) + 64  # length of the longest header with name, bytes


@dataclass(frozen=True)
class Header:
    """Header of a variable."""

    name: str
    shape: tuple[int, int]
    dtype: np.dtype[np.generic]
    begin: int  # bytes of the header and the name
    size: int  # bytes of the numbers
    fault: str | None  # reason why they cannot be read, as the end of a sentence


def parse_header(begin: bytes) -> Header | None:
    """Return the header in the first `HEADER_BYTES` bytes; None if they are no header."""
    before = struct.calcsize(_HEADER_FORMAT)
    if len(begin) < before:
        return None
    for order in "<>":
        kind, rows, columns, is_complex, length = struct.unpack(
            order + _HEADER_FORMAT, begin[:before]
        )
        machine, zero, figures, variable = (kind // place % 10 for place in (1000, 100, 10, 1))
        name = begin[before : before + max(length, 0)]
        if (
            0 <= kind < 5000
            and zero == 0
            and figures < len(_NUMBER_TYPES)
            and variable < len(_KIND_FAULTS)
            and is_complex in (0, 1)
            and min(rows, columns) >= 0
            and _VARIABLE_NAME.fullmatch(name)
            and (machine > 1 or _MACHINES[machine] == order)
        ):
            dtype = np.dtype(order + _NUMBER_TYPES[figures])
            fault = _KIND_FAULTS[variable]
            if machine > 1:
                fault = f"has figures of {_MACHINES[machine]}; expected IEEE: save it with -v7.3"
            elif fault is None and is_complex:
                fault = "holds complex numbers; expected numbers: save real() of it"
            size = rows * columns * dtype.itemsize * (1 + is_complex)
            return Header(
                name[:-1].decode("ascii"), (rows, columns), dtype, before + length, size, fault
            )
    return None
