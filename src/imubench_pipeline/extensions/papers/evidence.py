"""Results of a run, and the counterparts that lines of the papers have in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.extensions.papers.printed import Verdict
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import R


class Log(NamedTuple):
    """A channel of a recording."""

    sensor: str
    recording: str
    channel: str


@dataclass(frozen=True, kw_only=True)
class Result:
    """Counterpart of a line: a number, a text, or numbers for the texts of the line."""

    value: float | None = None  # SI
    lower: float | None = None  # of an interval, SI
    upper: float | None = None
    printed: float | None = None  # value of the line if it has none, SI
    words: str | None = None  # replaces the words of the line
    verdict: Verdict | None = None  # None: that of the line, or it follows from the numbers
    reason: str | None = None  # replaces the reason of the line
    fields: Mapping[str, object] = field(default_factory=dict)  # for the templates of the line


class Evidence:
    """The joined tables of a run; no tables without a run.

    Parameters
    ----------
    tables : mapping of str to pyarrow.Table
        By name; a missing table counts as empty.
    """

    def __init__(self, tables: Mapping[str, pa.Table] | None = None) -> None:
        self._tables = dict(tables or {})

    def rows(self, of: type[R], **where: object) -> list[R]:
        """Return the rows of a table, by their class, where the columns have these values."""
        table = self._tables.get(of.table)
        if table is None:
            return []
        for name, value in where.items():
            column = table[name]
            table = table.filter(column.is_null() if value is None else pc.equal(column, value))
        return of.rows_of(table)

    def has(self, sensor: str, recording: str) -> bool:
        """Return whether the run has this recording, and it was usable."""
        return bool(self.rows(RecordingRow, sensor=sensor, recording=recording, status="ok"))

    def of_log(self, of: type[R], log: Log, **where: object) -> list[R]:
        """Return the rows of a table, by their class, about a channel of a recording."""
        return self.rows(of, **log._asdict(), **where)

    def parameter(self, log: Log, name: str, method: str | None = None) -> ParameterRow | None:
        """Return the estimate of the first component of a parameter.

        Without a method, the recommended one is used.
        """
        by: dict[str, object] = {"recommended": True} if method is None else {"method": method}
        rows = self.of_log(ParameterRow, log, parameter=name, component=1, **by)
        return rows[0] if rows else None
