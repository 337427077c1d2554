"""Tables of columns in the array formats, read in blocks of records."""

import io
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import islice
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.bounds import MAX_FIELDS

NUMBER_KINDS = "fiu"  # kinds of NumPy types that are numbers: float, signed and unsigned integer
DATE_KIND = "M"  # kind of the NumPy type of dates (datetime64)

_KIND_NAMES = {
    **dict.fromkeys(NUMBER_KINDS, "numbers"),
    **dict.fromkeys("SUT", "text"),
    **{"M": "dates", "m": "durations", "c": "complex numbers", "b": "truth values"},
    **{"O": "objects", "V": "raw bytes or arrays"},
}
_MAX_FIELD_ELEMENTS = 1024  # largest number of elements of a field that become columns of their own


class UnusableError(Exception):
    """Requested data are missing or unreadable; the message does not name the file."""


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    label: str  # name of the column; empty for the columns of a matrix
    kind: str  # kind of the NumPy type
    holds: str  # kind of the data in words


class Table:
    """An array or table in a file: columns of equal length under one name."""

    name: str = ""  # name of the table; empty if the file has one table without a name
    rows: int | None = None  # number of records; None if it is known only after reading
    width: int = 0  # number of columns
    labels: Sequence[str] = ()  # names of the columns; empty if they have none
    fault: str | None = None  # reason why the table cannot be used, as the end of a sentence
    simulated: bool = False  # the table has the mark of a simulated log

    @property
    def shown(self) -> str:
        """Name of the table in messages."""
        return self.name or "the table"

    def column(self, position: int) -> Column:
        """Return a column by its position, counted from 0."""
        raise UnusableError(f"{self.shown} {self.fault}")

    def unit(self, position: int) -> str | None:
        """Return the unit of a column, if the file states it."""
        return None

    def row_bytes(self, positions: Sequence[int]) -> int:
        """Return the memory per record for reading these columns, bytes."""
        return 0

    def held_bytes(self, positions: Sequence[int]) -> int:
        """Return the memory, bytes, that reading these columns takes in addition to the blocks."""
        return 0

    def blocks(self, positions: Sequence[int], rows: int) -> Iterator[list[NDArray[Any]]]:
        """Yield these columns, ``rows`` records at a time or fewer.

        A column with missing values is a masked array, or has NaN or NaT there.
        """
        return iter(())


class UnsupportedArray(Table):
    """An unsupported array in a file; ``fault``: the reason, as in `Table`."""

    def __init__(self, name: str, fault: str) -> None:
        self.name = name
        self.fault = fault


@dataclass(frozen=True)
class _Leaf:
    """A column of an array of records: a field, or one element of a vector field."""

    label: str
    path: tuple[str | int, ...]
    dtype: np.dtype[Any]


class Array(Table):
    """A vector, a matrix with time along its longer side, or a vector of records with fields.

    A field that is a vector of three is the columns ``gyro[1]``, ``gyro[2]`` and ``gyro[3]``; a
    field of a field is ``imu.gyro``. ``time_axis``: axis of time of a square matrix.
    """

    def __init__(
        self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], time_axis: int = 0
    ) -> None:
        self.name = name
        self.dtype = dtype
        self.shape = shape
        self.time_axis = time_axis
        self._leaves: list[_Leaf] = []
        if len(shape) not in (1, 2):
            self.fault = "is a single value; expected a vector or a matrix"
            if shape:
                self.fault = (
                    f"has {len(shape)} dimensions ({describe_shape(shape)}); expected a vector, or "
                    "a matrix with one column per channel: reshape it"
                )
            return
        if 0 in shape:
            self.fault = f"is empty ({describe_shape(shape)}); expected at least one record"
            return
        if len(shape) == 1 or shape[0] != shape[1]:
            self.time_axis = 0 if len(shape) == 1 or shape[0] > shape[1] else 1
        sides = (*shape, 1)[:2]
        self.rows, self.width = sides[self.time_axis], sides[1 - self.time_axis]
        if dtype.names:
            self._leaves = list(islice(_list_leaves(dtype), MAX_FIELDS + 1))
            if len(self._leaves) > MAX_FIELDS:
                self.fault = f"has more than {MAX_FIELDS} columns; expected a log of one sensor"
            if self.width != 1:
                self.fault = "is a matrix of records; expected a vector of records"
            self.width = len(self._leaves)
            self.labels = [leaf.label for leaf in self._leaves]
        elif dtype.kind not in NUMBER_KINDS + DATE_KIND:
            holds = _KIND_NAMES.get(dtype.kind, str(dtype))
            self.fault = f"holds {holds}; expected numbers: convert it"

    def column(self, position: int) -> Column:
        """Return a column by its position, counted from 0."""
        if not self._leaves:
            return Column("", self.dtype.kind, _KIND_NAMES[self.dtype.kind])
        label, dtype = self._leaves[position].label, self._leaves[position].dtype
        return Column(label, dtype.kind, _KIND_NAMES.get(dtype.kind, str(dtype)))

    def fields(self, positions: Sequence[int]) -> list[str]:
        """Return the names of the fields that contain these columns; empty without fields."""
        if not self._leaves:
            return []
        return list(dict.fromkeys(str(self._leaves[position].path[0]) for position in positions))

    def column_in(self, block: NDArray[Any], position: int) -> NDArray[Any]:
        """Return one column of a block of records, or of a matrix with time along axis 0."""
        if not self._leaves:
            return block[:, position]
        values = block
        for step in self._leaves[position].path:
            values = values[step] if isinstance(step, str) else values[..., step]
        return values


def describe_shape(shape: tuple[int, ...]) -> str:
    """Return a shape as text, such as 1000 x 3."""
    return " x ".join(str(side) for side in shape) or "1"


def _list_leaves(
    dtype: np.dtype[Any], label: str = "", path: tuple[str | int, ...] = ()
) -> Iterator[_Leaf]:
    if dtype.names is not None:
        for name in dtype.names:
            below = f"{label}.{name}" if label else name
            yield from _list_leaves(dtype[name], below, (*path, name))
    elif (
        dtype.subdtype is not None
        and len(dtype.shape) == 1
        and math.prod(dtype.shape) <= _MAX_FIELD_ELEMENTS
        and dtype.base.names is None
    ):
        for element in range(dtype.shape[0]):
            yield _Leaf(f"{label}[{element + 1}]", (*path, element), dtype.base)
    else:
        yield _Leaf(label, path, dtype)


MAX_DEFLATE_RATIO = 1040  # largest expansion ratio of deflate, with a margin for rounding
_SKIP_BLOCK = 1 << 20


class StreamedArray(Array):
    """An array (see `Array`) with consecutive elements in a file or in a compressed part of it.

    ``fortran``: the first index varies fastest. ``opened``: function that opens a stream, to be
    closed by the caller. ``offset``: bytes before the first element. ``checked``: whether reading a
    stream to its end verifies a checksum.
    """

    def __init__(
        self,
        name: str,
        shape: tuple[int, ...],
        dtype: np.dtype[Any],
        fortran: bool,
        opened: Callable[[], IO[bytes]],
        offset: int,
        checked: bool,
    ) -> None:
        super().__init__(name, shape, dtype)
        self._opened = opened
        self._offset = offset
        self._checked = checked
        # The array is stored record by record, not column by column.
        self._by_record = 1 in (len(shape), *shape) or (self.time_axis == 0) != fortran
        self._across = 1 if self._leaves else self.width

    def row_bytes(self, positions: Sequence[int]) -> int:
        """Return the memory per record for reading these columns, bytes."""
        return self.dtype.itemsize * (self._across if self._by_record else len(positions))

    def blocks(self, positions: Sequence[int], rows: int) -> Iterator[list[NDArray[Any]]]:
        """Yield these columns, ``rows`` records at a time or fewer (see `Table.blocks`)."""
        assert self.rows is not None  # from the shape
        with ExitStack() as stack:
            starts = [0] if self._by_record else [place * self.rows for place in positions]
            streams = [self._at(stack, start) for start in starts]
            for start in range(0, self.rows, rows):
                count = min(rows, self.rows - start)
                if self._by_record:
                    size = count * self._across * self.dtype.itemsize
                    block = np.frombuffer(read_exactly(streams[0], size), self.dtype)
                    if not self._leaves:
                        block = block.reshape(count, self._across)
                    yield [self.column_in(block, position) for position in positions]
                else:
                    parts = [
                        read_exactly(stream, count * self.dtype.itemsize) for stream in streams
                    ]
                    yield [np.frombuffer(part, self.dtype) for part in parts]
            if self._checked:
                last = streams[0 if self._by_record else int(np.argmax(positions))]
                while last.read(_SKIP_BLOCK):
                    pass

    def _at(self, stack: ExitStack, element: int) -> IO[bytes]:
        stream = stack.enter_context(self._opened())
        # The checksum of a member of an archive requires reading from its beginning.
        skip(stream, self._offset + element * self.dtype.itemsize, seek=not self._checked)
        return stream


def skip(stream: IO[bytes], size: int, *, seek: bool = True) -> None:
    """Skip ``size`` bytes of a stream; read them if it cannot seek or ``seek`` is false."""
    if seek and stream.seekable():
        stream.seek(size, io.SEEK_CUR)
        return
    while size > 0:
        size -= len(read_exactly(stream, min(size, _SKIP_BLOCK)))


def read_exactly(stream: IO[bytes], size: int) -> bytes:
    """Return the next bytes of a stream; raise `UnusableError` if it ends early."""
    read = stream.read(size)
    if len(read) < size:
        raise UnusableError(f"cut short: {len(read)} of {size} bytes of an array; copy it again")
    return read
