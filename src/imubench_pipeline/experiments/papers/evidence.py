"""What a run found, as the claims of the papers ask for it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import pyarrow as pa

from imubench_pipeline.typing import Row


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
        self._rows: dict[str, list[Row]] = {}

    def rows(self, table: str, **where: object) -> list[Row]:
        """Return the rows of a table in which columns have these values."""
        if table not in self._rows:
            self._rows[table] = self._tables[table].to_pylist() if table in self._tables else []
        return [
            row
            for row in self._rows[table]
            if all(row[name] == value for name, value in where.items())
        ]

    def has(self, sensor: str, recording: str) -> bool:
        """Tell whether the run has a recording that could be used."""
        return bool(self.rows("recordings", sensor=sensor, recording=recording, status="ok"))

    def of_log(self, table: str, log: Log, **where: object) -> list[Row]:
        """Return the rows of a table about a channel of a recording."""
        return self.rows(table, **log._asdict(), **where)

    def parameter(self, log: Log, name: str, method: str | None = None) -> Row | None:
        """Return the row of ``parameters`` of one parameter's first component.

        By a method; without one, by the recommended method.
        """
        by: dict[str, object] = {"recommended": True} if method is None else {"method": method}
        rows = self.of_log("parameters", log, parameter=name, component=1, **by)
        return rows[0] if rows else None
