"""Typed rows for tests, which say of a row only what they are about."""

from collections.abc import Iterable, Mapping
from typing import Any

import pyarrow as pa

from imubench_pipeline.model.table import R, columns_of

_PLAIN = {pa.string(): "-", pa.float64(): 1.0, pa.float32(): 1.0, pa.int64(): 1, pa.bool_(): False}


def typed(of: type[R], rows: Iterable[Mapping[str, Any]]) -> list[R]:
    """Return rows of a table; a required column that is not said has a plain value."""
    plain = {
        column.name: column.values[0]
        if column.values
        else ()
        if column.is_list
        else _PLAIN[column.type]
        for column in columns_of(of)
        if column.required
    }
    return [row if isinstance(row, of) else of(**(plain | dict(row))) for row in rows]


DATASHEET_VERDICTS = (
    "better than typ",
    "as printed",
    "worse than typ",
    "worse than max",
    "not sure",
    "not published",
    "not looked up",
    "not measured",
    "not comparable (condition)",
)
"""All verdicts on a printed figure."""
