"""MATLAB files: version 7.3, which is HDF5, and 5 (-v6, -v7), both streamed.

A column is a number, the column of a matrix as MATLAB shows it, counted from 1; or the name of a
variable that is a vector. ``variable`` names the matrix; a field of a structure is ``imu/gyro``.
Tables, timetables and cells are not arrays: their columns have to be saved.
"""

import io
import math
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO

import h5py
import numpy as np

from imubench_pipeline.readers.arrays import hdf5, table
from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.bounds import MAX_DIMENSIONS, MAX_MATLAB_NAME, MAX_STRUCTURE_DEPTH

_MAX_CLASS_LENGTH = 64
_NUMERIC_CLASSES = frozenset(
    b"double single logical int8 uint8 int16 uint16 int32 uint32 int64 uint64".split()
)
_OBJECT_FAULT = (
    "is a table, a timetable or another object, which only MATLAB reads; expected a vector or a "
    "matrix: save its columns, as in t = seconds(x.Time); v = x.Variables; save('log.mat','t','v')"
)
_COMPLEX_FAULT = "holds complex numbers; expected real numbers: save real() of it"


class MatlabFile(ArrayFile):
    """A MATLAB file of version 7.3 or 5."""

    def tables(self, stack: ExitStack) -> Iterable[table.Table]:
        """Return a table for each variable (see `ArrayFile.tables`)."""
        if h5py.is_hdf5(self.path):
            return _list_variables_of_7(stack.enter_context(h5py.File(self.path, "r")))
        with self.path.open("rb") as file:
            begin = file.read(_HEADER_5_BYTES)
        order = _BYTE_ORDERS.get(begin[126:])
        if order is not None and struct.unpack(f"{order}H", begin[124:126])[0] >> 8 == _VERSION:
            return _list_variables_of_5(self.path)
        raise table.UnusableError(
            "not a MATLAB file of version 5 or 7.3, or its beginning is damaged; save it with -v7.3"
        )


def _list_variables_of_7(file: h5py.File) -> Iterator[table.Table]:
    """Yield the variables of version 7.3, where matrices are stored transposed."""
    # Parts of cells, objects and sparse matrices are not variables.
    for data_set in hdf5.list_data_sets(file, time_axis=1, passed_over="#"):
        attributes = data_set.data.attrs
        if "MATLAB_sparse" in data_set.data.parent.attrs:
            continue
        if data_set.fault is not None:
            pass
        elif data_set.dtype.names is not None:
            data_set.fault = _COMPLEX_FAULT
        elif "MATLAB_empty" in attributes:
            data_set.fault = "is empty; expected a vector or a matrix"
        elif "MATLAB_class" in attributes:
            # Only fixed-length texts are read: the library may crash on damaged texts of other
            # kinds.
            kind = attributes.get_id("MATLAB_class").dtype
            is_text = kind.kind == "S" and attributes.get_id("MATLAB_class").shape == ()
            if not is_text or kind.itemsize > _MAX_CLASS_LENGTH:
                data_set.fault = "has a damaged class; copy the file again"
            elif (kind := np.bytes_(attributes["MATLAB_class"])) == b"char":
                data_set.fault = "holds text; expected numbers"
            elif kind not in _NUMERIC_CLASSES:
                data_set.fault = _OBJECT_FAULT
        yield data_set


# --------------------------------------------------------------------------------- version 5
#
# The format is parsed here, since existing readers load whole variables, and read beyond their
# memory if a file is damaged. A file is a sequence of elements: type, size, and data padded to
# eight bytes. A variable is an element that contains elements: flags, dimensions, name and values.
# The values of a structure are again such elements. See "MAT-File Format" of MATLAB.

_HEADER_5_BYTES = 128
_BYTE_ORDERS = {b"IM": "<", b"MI": ">"}
_VERSION = 1
_TYPE_MATRIX, _TYPE_COMPRESSED = 14, 15
_NUMBER_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8",
            13: "u8"}  # fmt: skip
"""Types of elements with numbers. Integral values may be stored in a smaller type."""

_CLASS_STRUCTURE, _FIRST_NUMERIC_CLASS, _LAST_NUMERIC_CLASS = 2, 6, 15
_CLASS_FAULTS = {
    1: "is a cell array; expected a vector or a matrix: save cell2mat of it",
    2: "is an array of structures; expected one structure",
    3: "is an object; expected a vector or a matrix",
    4: "holds text; expected numbers",
    5: "is sparse; expected a vector or a matrix: save full() of it",
    16: "is a function; expected a vector or a matrix",
    17: _OBJECT_FAULT,
}
_FLAG_COMPLEX = 0x0800
_CLASS_TABLE = 17
_MAX_ELEMENT_HEADER = 1 << 16
_TAG_ORDER = {"<": 1, ">": -1}  # order of type and size in the tag of a small element
_READ_BLOCK = 1 << 16


def _list_variables_of_5(path: Path) -> Iterator[table.Table]:
    """Yield the variables of a file, and the fields of its structures as ``name/field``."""
    size = path.stat().st_size
    with path.open("rb") as file:
        order = _BYTE_ORDERS[file.read(_HEADER_5_BYTES)[126:]]
        start = _HEADER_5_BYTES
        while start < size:
            file.seek(start)
            kind, length = struct.unpack(f"{order}II", table.read_exactly(file, 8))
            begin, end = start + 8, start + 8 + length
            if end > size:
                raise _make_truncated_error(end, size)
            if kind == _TYPE_COMPRESSED:
                opened = partial(_Inflated.opened, path, begin, length)
                with opened() as stream:
                    most = table.MAX_DEFLATE_RATIO * (length + 8)
                    elements = _Elements(stream, order, 0, most, opened, True)
                    yield from _read_matrix(elements, elements.tag(_TYPE_MATRIX))
            elif kind == _TYPE_MATRIX:
                elements = _Elements(file, order, begin, end, lambda: path.open("rb"), False)
                yield from _read_matrix(elements, length)
            else:
                raise _make_damaged_error(f"a variable of type {kind}", start)
            start = end


@dataclass
class _Elements:
    """Reads the elements of a variable; ``checked``: the stream has a checksum at its end."""

    stream: IO[bytes]
    order: str
    at: int  # bytes from the beginning
    end: int  # end of the enclosing element
    opened: Callable[[], IO[bytes]]
    checked: bool
    kind: int = 0  # type of the last element

    def tag(self, *kinds: int) -> int:
        """Read type and size of the next element; small data follow in the same eight bytes."""
        self._check(8)
        first = self._read(4)
        self.kind, length = struct.unpack(f"{self.order}HH", first)[:: _TAG_ORDER[self.order]]
        if not length:
            self.kind, length = struct.unpack(f"{self.order}II", first + self._read(4))
            self._check(length)
        elif length > 4:
            raise _make_damaged_error(f"a small element of {length} bytes", self.at)
        if self.kind not in kinds:
            raise _make_damaged_error(f"an element of type {self.kind}", self.at)
        return length

    def data(self, *kinds: int) -> bytes:
        begin = self.at
        length = self.tag(*kinds)
        if length > _MAX_ELEMENT_HEADER:
            raise _make_damaged_error(f"{length} bytes of dimensions or names", self.at)
        read = self._read(length)
        self.skip(-(self.at - begin) % 8)  # the next element begins at a multiple of eight bytes
        return read

    def skip(self, size: int) -> None:
        table.skip(self.stream, size)
        self.at += size

    def _read(self, size: int) -> bytes:
        self.at += size
        return table.read_exactly(self.stream, size)

    def _check(self, length: int) -> None:
        if self.at + length > self.end:
            raise _make_damaged_error(
                f"an element of {length} bytes with {self.end - self.at} left", self.at
            )


def _make_truncated_error(end: int, size: int) -> table.UnusableError:
    return table.UnusableError(
        f"cut short: a variable ends at byte {end}, the file at {size}; copy it again"
    )


def _make_damaged_error(what: str, at: int) -> table.UnusableError:
    return table.UnusableError(f"corrupt data: {what} at byte {at}; copy the file again")


def _read_matrix(
    elements: _Elements, length: int, above: str | None = None, depth: int = 0
) -> Iterator[table.Table]:
    """Yield the arrays of an element that is a variable, or a field of the structure ``above``."""
    end = elements.at + length
    outer, elements.end = elements.end, end
    if length == 0 and above is not None:
        yield table.UnsupportedArray(above, "is empty; expected a vector or a matrix")
    else:
        (flags, _) = struct.unpack(f"{elements.order}II", elements.data(6)[:8].ljust(8, b"\0"))
        kind = flags & 0xFF
        sides = b"" if kind == _CLASS_TABLE else elements.data(5)
        shape = struct.unpack(f"{elements.order}{len(sides) // 4}i", sides)
        if kind != _CLASS_TABLE and (not 2 <= len(shape) <= MAX_DIMENSIONS or min(shape) < 0):
            raise _make_damaged_error(f"dimensions {shape[:MAX_DIMENSIONS]}", elements.at)
        own = elements.data(1, 16).decode("utf-8", "replace")
        if len(own) > MAX_MATLAB_NAME:
            raise _make_damaged_error(f"a name of {len(own)} letters", elements.at)
        name = own if above is None else above
        if not name:
            pass  # internal data of functions and objects
        elif kind == _CLASS_STRUCTURE and math.prod(shape) == 1:
            yield from _read_fields(elements, name, depth)
        elif not _FIRST_NUMERIC_CLASS <= kind <= _LAST_NUMERIC_CLASS:
            yield table.UnsupportedArray(
                name, _CLASS_FAULTS.get(kind, f"is of the unknown class {kind}")
            )
        elif flags & _FLAG_COMPLEX:
            yield table.UnsupportedArray(name, _COMPLEX_FAULT)
        else:
            size = elements.tag(*_NUMBER_TYPES)
            dtype = np.dtype(elements.order + _NUMBER_TYPES[elements.kind])
            if size != math.prod(shape) * dtype.itemsize:
                raise table.UnusableError(
                    f"corrupt data: {name} promises {table.describe_shape(shape)} values of "
                    f"{dtype.itemsize} bytes, but has {size} bytes; copy the file again"
                )
            opened, checked = elements.opened, elements.checked
            yield table.StreamedArray(name, shape, dtype, True, opened, elements.at, checked)
    elements.end = outer
    if above is not None:
        elements.skip(end - elements.at)


def _read_fields(elements: _Elements, name: str, depth: int) -> Iterator[table.Table]:
    if depth == MAX_STRUCTURE_DEPTH:
        yield table.UnsupportedArray(
            name, f"lies {depth} structures deep; expected a vector or a matrix"
        )
        return
    width = int.from_bytes(elements.data(5), "little" if elements.order == "<" else "big")
    names = elements.data(1)
    if not 1 <= width <= MAX_MATLAB_NAME:
        raise _make_damaged_error(f"names of fields of {width} bytes", elements.at)
    for start in range(0, len(names), width):
        field = names[start : start + width].split(b"\0")[0].decode("utf-8", "replace")
        yield from _read_matrix(elements, elements.tag(_TYPE_MATRIX), f"{name}/{field}", depth + 1)


class _Inflated(io.RawIOBase):
    def __init__(self, path: Path, start: int, length: int) -> None:
        super().__init__()
        self._file = path.open("rb")
        self._file.seek(start)
        self._left = length
        self._inflate = zlib.decompressobj()

    @classmethod
    def opened(cls, path: Path, start: int, length: int) -> IO[bytes]:
        return io.BufferedReader(cls(path, start, length), _READ_BLOCK)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: object) -> int:
        """Fill a buffer; return 0 at the end, after the checksum has been verified."""
        view = memoryview(buffer)  # type: ignore[arg-type]  # RawIOBase hands over any writable buffer
        while not self._inflate.eof:
            packed = self._inflate.unconsumed_tail
            if not packed:
                packed = self._file.read(min(_READ_BLOCK, self._left))
                self._left -= len(packed)
            read = self._inflate.decompress(packed, len(view))
            if read:
                view[: len(read)] = read
                return len(read)
            if not packed and not self._inflate.eof:
                raise table.UnusableError(
                    "compressed data end early; the file is cut short: copy it again"
                )
        return 0

    def close(self) -> None:
        self._file.close()
        super().close()
