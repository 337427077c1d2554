"""Numbers of verdicts with their source, a value of the tables."""

from __future__ import annotations

import math

from markupsafe import Markup

from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.words.numbers import digits_by, number_text


class SourcedNumber(str):
    """A printed number; in HTML it names its source, a value of the tables.

    ``source`` is ``ranking/<requirement>/<sensor>/<error>/<time>/<column>``, or that of a total of
    ``error_budget``, with the recording after the sensor; two columns with a colon between them are
    a ratio. ``unit`` is the unit of the number.
    """

    __slots__ = ("source", "unit")
    source: str
    unit: str

    def __new__(cls, text: str, source: str, unit: str = "") -> SourcedNumber:
        """Return the text, with its source."""
        number = super().__new__(cls, text)
        number.source, number.unit = source, unit
        return number

    def __html__(self) -> Markup:
        """Return it as an element with its source."""
        unit = Markup(' data-in="{}"').format(self.unit) if self.unit else ""
        return Markup('<span data-from="{}"{}>{}</span>').format(self.source, unit, str(self))


class SourcedInterval(str):
    """Two printed limits; in HTML each names its source."""

    __slots__ = ("ends",)
    ends: tuple[SourcedNumber, SourcedNumber]

    def __new__(cls, lower: SourcedNumber, upper: SourcedNumber) -> SourcedInterval:
        """Return ``lower to upper``."""
        interval = super().__new__(cls, f"{lower} to {upper}")
        interval.ends = (lower, upper)
        return interval

    def __html__(self) -> Markup:
        """Return them as elements with their sources."""
        return Markup("{} to {}").format(*self.ends)


def source_number(
    row: RankingRow | ErrorBudgetRow, column: str, text: str, unit: str = ""
) -> SourcedNumber:
    """Return a number of a row of ``ranking``, or of a total of ``error_budget``."""
    names = [row.table, row.requirement or "", row.sensor]
    names += [row.recording] if isinstance(row, ErrorBudgetRow) else []
    return SourcedNumber(text, "/".join([*names, row.error, f"{row.time:g}", column]), unit)


def format_margin(row: RankingRow) -> tuple[SourcedNumber, SourcedNumber, SourcedNumber] | None:
    """Return the margin of a row of the table ``ranking`` with its 95 % limits, if there is one."""
    if row.margin is None:
        return None
    low, high = compute_margin_limits(row)
    digits = digits_by(row.margin, low, high)
    named = (("margin", row.margin), ("limit:upper", low), ("limit:lower", high))
    first, lower, upper = (source_number(row, name, number_text(x, digits)) for name, x in named)
    return first, lower, upper


def compute_margin_limits(row: RankingRow) -> tuple[float | None, float | None]:
    """Return the 95 % limits of the margin of a row of the table ``ranking`` that has one."""
    # Infinite where the error is zero, None where it is unknown.
    low, high = (
        None if row.limit is None or error is None else row.limit / error if error else math.inf
        for error in (row.upper, row.lower)
    )
    return low, high
