"""Pieces of a column, evenly over all of it, kept sample by sample in bounded memory.

Block statistics do not tell which samples are multiples of what, or which repeat every third one.
Some ten thousand samples do, however long the log is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from imubench_pipeline.typing import Array

PIECE = 4096
"""Records of a piece."""

MOST = 16
"""Every second piece is forgotten when there are so many; a shorter log is kept whole."""


@dataclass(frozen=True)
class Excerpt:
    """Consecutive records of a column."""

    first: int
    """Number of the first record."""
    values: Array
    """SI, shape (n,); NaN where the sample is missing."""

    @property
    def present(self) -> Array:
        """The samples that are there."""
        return self.values[np.isfinite(self.values)]


@dataclass
class Excerpts:
    """Pieces as the column streams past: every one, every second, every fourth and so on."""

    _stride: int = 1
    _taken: int = 0
    _kept: list[Array] = field(default_factory=list)
    _open: list[Array] = field(default_factory=list)

    def add(self, values: Array) -> None:
        """Take the next records of the column."""
        start = 0
        while start < len(values):
            number, inside = divmod(self._taken, PIECE)
            stop = min(len(values), start + PIECE - inside)
            if number % self._stride == 0:
                self._open.append(values[start:stop].copy())
            self._taken += stop - start
            start = stop
            if self._taken % PIECE == 0 and self._open:
                self._kept.append(np.concatenate(self._open))
                self._open = []
                if len(self._kept) == MOST:
                    self._kept = self._kept[::2]
                    self._stride *= 2

    def pieces(self) -> list[Excerpt]:
        """Return the pieces in order; the last one as far as it goes."""
        pieces = [*self._kept, np.concatenate(self._open)] if self._open else self._kept
        return [Excerpt(k * self._stride * PIECE, values) for k, values in enumerate(pieces)]


def together(first: list[Excerpt], other: list[Excerpt]) -> list[tuple[Array, Array]]:
    """Return the samples of two columns at the same records, those present in both.

    Parameters
    ----------
    first, other : list of Excerpt
        Of columns that advance together.

    Returns
    -------
    list of (ndarray, ndarray)
        A pair for each piece that both have, of equal shapes.
    """
    places = {piece.first: piece.values for piece in other}
    pairs = []
    for piece in first:
        values = places.get(piece.first)
        if values is not None and len(values) == len(piece.values):
            present = np.isfinite(piece.values) & np.isfinite(values)
            pairs.append((piece.values[present], values[present]))
    return pairs
