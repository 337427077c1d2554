"""Conditions of a verdict other than the known errors: unknown figures and hard requirements.

Several unknown figures share the remaining error budget: with all of them at their largest, the
limit is just reached. If the printed turn-on bias alone exceeds a limit, the sensor meets it
if calibrated to within the remaining error budget.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import get_args

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.model.verdicts import Condition, Figure, Share, Shortfall
from imubench_pipeline.navigation.suitability.abilities import Abilities, judge
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.settings.requirements import Must

FIGURES: tuple[Figure, ...] = get_args(Figure)

_PASSING: tuple[Verdict, ...] = ("meets", "likely_meets")
"""Verdicts that a condition changes. A sensor that fails without a condition fails with it."""


@dataclass(frozen=True)
class Conditions:
    """Conditions of a verdict on a sensor."""

    shortfalls: tuple[Shortfall, ...]
    unknown: tuple[Condition, ...]  # demanded properties that are not known
    # figures that are not known, or too large, by quantity and figure: the largest one within
    # every limit, SI
    figures: Mapping[tuple[str, Figure], float]

    @classmethod
    def of(cls, must: Must, has: Abilities, conditions: Iterable[ErrorBudgetRow]) -> Conditions:
        """Return the conditions of the verdict on a sensor.

        ``must`` are the hard requirements, ``has`` the properties of the sensor. ``conditions`` are
        the rows of the table ``error_budget`` that the limits depend on.
        """
        lacking, unknown = judge(must, has)
        figures: dict[tuple[str, Figure], float] = {}
        for row in conditions:
            quantity = next(word for word in row.source.split() if word in SENSORS)
            key = quantity, next(figure for figure in FIGURES if figure == row.cause)
            largest = row.largest or 0.0
            figures[key] = min(figures.get(key, largest), largest)
        return cls(tuple(lacking), tuple(unknown), figures)

    def judge(self, verdict: Verdict) -> tuple[Verdict, tuple[Condition, ...]]:
        """Return the verdict, and the conditions on which it holds."""
        if self.shortfalls:
            return "excluded", ()
        return verdict, self.conditions if verdict in _PASSING else ()

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Unknown figures and properties."""
        figures = (
            Condition(figure, None, quantity, largest)
            for (quantity, figure), largest in self.figures.items()
        )
        return (*figures, *self.unknown)


def is_condition(row: ErrorBudgetRow) -> bool:
    """Return whether meeting a limit depends on the figure of a source."""
    return row.largest_unit is not None and row.cause in FIGURES


def judge_once_calibrated(
    verdict: Verdict,
    limit: float | None,
    sigma: float | None,
    upper: float | None,
    conditions: Iterable[ErrorBudgetRow],
) -> Verdict:
    """Return the verdict on an error after calibration of the biases that exceed its limit.

    The square of a bias is a term of every draw of the total. ``verdict`` is without calibration;
    limit, sigma and upper belong to the error; conditions are the sources that the verdict depends
    on.
    """
    squares = [size**2 for _, size in select_known_errors(conditions)]
    if not squares or verdict in _PASSING or limit is None:
        return verdict
    for size, better in zip((upper, sigma), _PASSING, strict=True):
        if size is not None and size**2 - math.fsum(squares) < limit**2:
            return better
    return verdict


def select_known_errors(rows: Iterable[ErrorBudgetRow]) -> list[tuple[ErrorBudgetRow, float]]:
    """Return the rows with a figure, each with its standard deviation."""
    return [(row, row.sigma) for row in rows if row.sigma is not None]


def compute_variance_shares(
    total: float, sources: Iterable[ErrorBudgetRow], least: float = 0.01
) -> tuple[Share, ...]:
    """Return the sources of an error with their shares of the variance, the largest first.

    ``total`` is 1 sigma. Shares below ``least`` are left out.
    """
    if total <= 0.0:
        return ()
    shares = (
        Share(row.source, (sigma / total) ** 2, row.kind if row.origin == "datasheet" else None)
        for row, sigma in select_known_errors(sources)
    )
    kept = (share for share in shares if share.share >= least)
    return tuple(sorted(kept, key=lambda share: -share.share))
