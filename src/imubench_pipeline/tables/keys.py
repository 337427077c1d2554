"""Key columns of a channel in tables, and grouping of rows by them."""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa


@dataclass(frozen=True)
class Key:
    """Sensor, recording and channel."""

    sensor: str
    recording: str
    channel: str


def split_table(table: pa.Table, *names: str) -> dict[tuple[str, ...], pa.Table]:
    """Divide a table by the values of columns, in the order in which they appear."""
    keys = list(zip(*(table[name].to_pylist() for name in names), strict=True))
    order = dict.fromkeys(keys)
    labels = {key: i for i, key in enumerate(order)}
    which = np.array([labels[key] for key in keys], dtype=np.int64)
    return {key: table.filter(pa.array(which == label)) for key, label in labels.items()}
