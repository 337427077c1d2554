"""What a run found, as the claims of the papers ask for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import R


class Log(NamedTuple):
    """A channel of a recording."""

    sensor: str
    recording: str
    channel: str


class Evidence:
    """The joined tables of a run; none where no run is asked.

    Parameters
    ----------
    tables : mapping of str to pyarrow.Table
        By name; a table that is not there is taken to have no rows.
    """

    def __init__(self, tables: Mapping[str, pa.Table] | None = None) -> None:
        self._tables = dict(tables or {})

    def rows(self, of: type[R], **where: object) -> list[R]:
        """Return the rows of a table, by their class, in which columns have these values."""
        table = self._tables.get(of.table)
        if table is None:
            return []
        for name, value in where.items():
            column = table[name]
            table = table.filter(column.is_null() if value is None else pc.equal(column, value))
        return of.rows_of(table)

    def has(self, sensor: str, recording: str) -> bool:
        """Tell whether the run has a recording that could be used."""
        return bool(self.rows(RecordingRow, sensor=sensor, recording=recording, status="ok"))

    def of_log(self, of: type[R], log: Log, **where: object) -> list[R]:
        """Return the rows of a table, by their class, about a channel of a recording."""
        return self.rows(of, **log._asdict(), **where)

    def parameter(self, log: Log, name: str, method: str | None = None) -> ParameterRow | None:
        """Return the estimate of one parameter's first component.

        By a method; without one, by the recommended method.
        """
        by: dict[str, object] = {"recommended": True} if method is None else {"method": method}
        rows = self.of_log(ParameterRow, log, parameter=name, component=1, **by)
        return rows[0] if rows else None
