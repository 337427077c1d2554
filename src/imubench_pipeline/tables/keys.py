"""Key columns of a channel in tables, and grouping of rows by them."""

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from itertools import pairwise
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


def split_table(table: pa.Table, *names: str) -> dict[tuple[str, ...], pa.Table]:
    """Return parts of a table by the values of the named columns, in order of appearance."""
    if not table.num_rows:
        return {}
    labels = np.zeros(table.num_rows, dtype=np.int64)
    for name in names:
        encoded = table[name].combine_chunks().dictionary_encode()
        codes = np.asarray(encoded.indices.to_numpy(zero_copy_only=False), dtype=np.int64)
        labels = labels * len(encoded.dictionary) + codes
    order = np.argsort(labels, kind="stable")
    if np.any(order[1:] < order[:-1]):
        table, labels = table.take(pa.array(order)), labels[order]
    starts = np.concatenate(([0], np.flatnonzero(np.diff(labels)) + 1, [len(labels)]))
    parts = [table.slice(a, b - a) for a, b in pairwise(starts.tolist())]
    appearing = [parts[i] for i in np.argsort(order[starts[:-1]])]
    return {tuple(part[name][0].as_py() for name in names): part for part in appearing}
