"""Log files of every format that are broken or odd, each with what must come of it."""

from __future__ import annotations

from tests.corpus import (
    arrays,
    bags,
    exports,
    packed,
    places,
    scientific,
    stamps,
    streams,
    text,
    values,
)
from tests.corpus.cut import cut_short
from tests.corpus.entry import Cut, Entry, Kept, Rejected

__all__ = ["ENTRIES", "Cut", "Entry", "Kept", "Rejected"]

_TEXTS = [
    *text.ENTRIES,
    *stamps.ENTRIES,
    *values.ENTRIES,
    *exports.TEXTS,
    *streams.TEXTS,
]

_ALL = [
    *_TEXTS,
    *exports.FOLDERS,
    *streams.BINARY,
    *packed.ENTRIES,
    *places.ENTRIES,
    *bags.ENTRIES,
    *arrays.ENTRIES,
    *scientific.ENTRIES,
    *cut_short(_TEXTS),
]
ENTRIES: dict[str, Entry] = {entry.name: entry for entry in _ALL}
"""Every entry, by its name."""

if len(ENTRIES) < len(_ALL):
    raise ValueError("two entries have one name")
