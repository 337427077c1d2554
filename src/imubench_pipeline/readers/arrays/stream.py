"""Arrays that stand in a file as they do in memory, read from the beginning to the end."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.arrays.table import Array, UnusableError

LARGEST_RATIO = 1040
"""Bytes that a byte of deflate stands for, at most, with room for rounding."""

_SKIPPED = 1 << 20


class StreamedArray(Array):
    """An array whose elements follow each other in a file or in a compressed part of one.

    Where the columns of a matrix stand one after another, each is read by a stream of its own, so
    that no more than a block of each is in memory.

    Parameters
    ----------
    name, shape, dtype, time_axis
        See `Array`.
    fortran : bool
        The first index runs fastest.
    opened : callable
        Opens the bytes afresh; the caller of it closes them.
    offset : int
        Bytes before the first element.
    checked : bool
        The bytes have a checksum that is compared at their end.
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
        # Whole records follow each other, rather than whole columns.
        self._by_record = 1 in (len(shape), *shape) or (self.time_axis == 0) != fortran
        self._across = 1 if self._leaves else self.width

    def row_bytes(self, positions: Sequence[int]) -> int:
        """Return the memory that a record takes while these columns are read."""
        return self.dtype.itemsize * (self._across if self._by_record else len(positions))

    def blocks(self, positions: Sequence[int], rows: int) -> Iterator[list[NDArray[Any]]]:
        """Yield these columns, ``rows`` records at a time or fewer (see `Table.blocks`)."""
        assert self.rows is not None  # from the shape
        with ExitStack() as stack:
            if self._by_record:
                streams = [self._at(stack, 0)]
            else:
                streams = [self._at(stack, position * self.rows) for position in positions]
            for start in range(0, self.rows, rows):
                count = min(rows, self.rows - start)
                if self._by_record:
                    block = self._next(streams[0], count * self._across)
                    if not self._leaves:
                        block = block.reshape(count, self._across)
                    yield [self.taken(block, position) for position in positions]
                else:
                    yield [self._next(stream, count) for stream in streams]
            if self._checked:
                last = streams[0 if self._by_record else int(np.argmax(positions))]
                while last.read(_SKIPPED):
                    pass

    def _at(self, stack: ExitStack, element: int) -> IO[bytes]:
        stream = stack.enter_context(self._opened())
        skip(stream, self._offset + element * self.dtype.itemsize)
        return stream

    def _next(self, stream: IO[bytes], elements: int) -> NDArray[Any]:
        wanted = elements * self.dtype.itemsize
        return np.frombuffer(exactly(stream, wanted), self.dtype)


def skip(stream: IO[bytes], size: int) -> None:
    """Pass over bytes of a stream, whether it can seek or not."""
    if stream.seekable():
        stream.seek(size, io.SEEK_CUR)
        return
    while size > 0:
        size -= len(exactly(stream, min(size, _SKIPPED)))


def exactly(stream: IO[bytes], size: int) -> bytes:
    """Return the next bytes of a stream.

    Raises
    ------
    UnusableError
        If it ends before.
    """
    read = stream.read(size)
    if len(read) < size:
        raise UnusableError(f"cut short: {len(read)} of {size} bytes of an array; copy it again")
    return read
