"""Statistics of consecutive blocks of a column, gathered in bounded memory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from imubench_pipeline.typing import Array

FIRST_SIZE = 256
"""Records of a block, until there are many blocks."""

_MANY = 1 << 15
"""Two blocks are made one where there are twice as many as this."""


@dataclass(frozen=True)
class BlockStatistics:
    """Statistics of consecutive blocks of records."""

    size: int
    """Records of a block; the last one may have fewer."""
    count: Array
    """Samples present, shape (b,)."""
    mean: Array
    spread: Array
    low: Array
    high: Array
    """Mean, standard deviation and extremes of the samples present, SI, shape (b,); NaN where there
    are none."""


def _no_rows() -> Array:
    return np.empty((0, 5))


@dataclass
class Gathering:
    """Blocks as they come; each a row of count, mean, spread, lowest and highest sample."""

    _size: int = FIRST_SIZE
    _rows: list[Array] = field(default_factory=list)
    _number: int = 0
    _waiting: Array = field(default_factory=_no_rows)

    def add(self, rows: Array) -> None:
        """Take consecutive blocks of `FIRST_SIZE` records, shape (n, 5)."""
        fresh = np.concatenate([self._waiting, rows])
        while True:
            together = self._size // FIRST_SIZE
            whole = min(len(fresh) // together, 2 * _MANY - self._number)
            self._rows.append(_united(fresh[: whole * together], together))
            self._number += whole
            fresh = fresh[whole * together :]
            if self._number < 2 * _MANY:
                break
            self._rows = [_united(np.concatenate(self._rows), 2)]
            self._number, self._size = _MANY, 2 * self._size
        self._waiting = fresh.copy()

    def blocks(self, last: Array) -> BlockStatistics:
        """Return all blocks; ``last``, shape (n, 5), are those that were not added yet."""
        fresh = np.concatenate([self._waiting, last])
        rows = np.concatenate([*self._rows, _united(fresh, self._size // FIRST_SIZE)])
        return BlockStatistics(self._size, *(np.ascontiguousarray(column) for column in rows.T))


def _united(rows: Array, together: int) -> Array:
    """Make one block of so many; the last one may be of fewer."""
    if together == 1 or len(rows) == 0:
        return rows.copy()
    begins = np.arange(0, len(rows), together)
    count, mean, spread, low, high = rows.T
    present = count > 0
    total = np.add.reduceat(count, begins)
    weight = np.maximum(total, 1.0)
    united = np.add.reduceat(np.where(present, count * mean, 0.0), begins) / weight
    # About the mean of the new block: no digit is lost to a large bias.
    away = mean - np.repeat(united, together)[: len(rows)]
    squares = np.add.reduceat(np.where(present, count * (spread**2 + away**2), 0.0), begins)
    empty = total == 0
    return np.column_stack(
        [
            total,
            np.where(empty, np.nan, united),
            np.where(empty, np.nan, np.sqrt(squares / weight)),
            np.fmin.reduceat(low, begins),
            np.fmax.reduceat(high, begins),
        ]
    )


def present_median(values: Array) -> float:
    """Return the median of the values that are there, shape (n,); NaN where none is."""
    present = values[np.isfinite(values)]
    return float(np.median(present)) if len(present) else float("nan")
