"""Key columns of a channel in tables, and grouping of rows by them."""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pyarrow as pa

_Key = TypeVar("_Key", bound=Hashable)
_Row = TypeVar("_Row")


@dataclass(frozen=True)
class Key:
    """Key of a channel in tables."""

    sensor: str
    recording: str
    channel: str


def group_rows(rows: Iterable[_Row], key: Callable[[_Row], _Key]) -> dict[_Key, list[_Row]]:
    """Return lists of rows by key, in the order in which the keys first appear."""
    groups: dict[_Key, list[_Row]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


@dataclass(frozen=True)
class TableParts(Mapping[tuple[str, ...], pa.Table]):
    """Parts of a table by the values of its key columns; thousands of them need little memory."""

    table: pa.Table  # sorted by part
    rows: Mapping[tuple[str, ...], tuple[int, int]]  # first row and number of rows of each part

    def __getitem__(self, key: tuple[str, ...]) -> pa.Table:
        return self.table.slice(*self.rows[key])

    def get_or_empty(self, key: tuple[str, ...]) -> pa.Table:
        """Return a part; an empty table if there is none."""
        return self.table.slice(*self.rows.get(key, (0, 0)))

    def __iter__(self) -> Iterator[tuple[str, ...]]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)


def split_table(table: pa.Table, *names: str) -> TableParts:
    """Return parts of a table by the values of the named columns, in order of appearance."""
    if not table.num_rows:
        return TableParts(table, {})
    labels = np.zeros(table.num_rows, dtype=np.int64)
    for name in names:
        encoded = table[name].combine_chunks().dictionary_encode()
        codes = np.asarray(encoded.indices.to_numpy(zero_copy_only=False), dtype=np.int64)
        labels = labels * len(encoded.dictionary) + codes
    order = np.argsort(labels, kind="stable")
    if np.any(order[1:] < order[:-1]):
        table, labels = table.take(pa.array(order)), labels[order]
    starts = np.concatenate(([0], np.flatnonzero(np.diff(labels)) + 1, [len(labels)]))
    firsts, sizes = starts[:-1], np.diff(starts)
    keys = zip(*(table[name].take(pa.array(firsts)).to_pylist() for name in names), strict=True)
    parts = list(zip(keys, zip(firsts.tolist(), sizes.tolist(), strict=True), strict=True))
    return TableParts(table, dict(parts[i] for i in np.argsort(order[firsts])))
