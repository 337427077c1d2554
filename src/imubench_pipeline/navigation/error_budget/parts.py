"""Parts of an error budget: contributions of the sources, and missing figures.

`Largest` gives the largest value of a figure that is not known, or that a calibration can reduce.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.states import Cause, Measured, SourcePath
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget.in_use import (
    DATASHEET_KEY_OF_CAUSE,
    Figure,
    Figures,
    needed,
)
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS
from imubench_pipeline.units import SI_UNITS
from imubench_pipeline.words.reasons import budgets as texts

Quantity = Literal["attitude", "heading", "velocity", "position"]


def describe_term(measured: Measured, term: Term, through: SourcePath | None = None) -> ErrorSource:
    """Return a noise term as the source of an error."""
    values = term.values
    return ErrorSource(term.word, measured, through, values.get("T_B"), values.get("frequency"))


@dataclass(frozen=True)
class Contribution:
    """Contribution of one source to an error."""

    source: ErrorSource
    sigma: float  # 1 sigma, rad, m/s or m
    figure: Figure | None = None  # the figure that it follows from, if it is not noise


@dataclass(frozen=True)
class Missing:
    """A source whose figure is not known."""

    source: ErrorSource
    lever: float  # error from a figure of 1 SI unit
    reason: str  # why it is not known


@dataclass(frozen=True)
class Budget:
    """An error and its contributions, which are independent of each other."""

    time: float  # s
    quantity: Quantity  # attitude (a tilt) and heading in rad, velocity in m/s, position in m
    contributions: Sequence[Contribution]
    assumptions: Sequence[str] = ()  # for figures that are not known
    missing: Sequence[Missing] = ()  # sources that are left out because no figure is known

    @property
    def total(self) -> float:
        """1 sigma: the root of the sum of the squares of the contributions."""
        return math.hypot(*(contribution.sigma for contribution in self.contributions))


def compute_figure_contribution(
    measured: Measured,
    cause: Cause,
    lever: float,
    figures: Figures,
    through: SourcePath | None = None,
) -> Contribution | Missing | None:
    """Return the contribution of a figure, or that it is missing; None if it is not required.

    ``lever`` is the error from a figure of 1 SI unit.
    """
    figure = figures.get(cause, Figure(reason=texts.NOT_STATED))
    source = ErrorSource(cause, measured, through)
    if figure.sigma is not None:
        return Contribution(source, lever * figure.sigma, figure)
    if needed(measured, cause, figures):
        return Missing(source, lever, figure.reason or texts.NOT_KNOWN)
    return None


@dataclass(frozen=True)
class Largest:
    """Remaining error budget under a limit, for unknown figures and biases above the limit.

    A printed turn-on bias is used as printed, unless it exceeds the limit: a calibration may then
    reduce it to its share of the remaining budget (``room``), which all share equally.
    """

    room: float  # largest error of each of them, 1 sigma; 0 if there is none
    biases: tuple[Contribution, ...] = ()  # printed biases, if the total exceeds the limit

    @classmethod
    def of(cls, budget: Budget, limit: float | None, upper: float) -> "Largest":
        """Return the remaining budget under a limit, SI; ``upper``: upper limit of the total."""
        if limit is None:
            return cls(0.0)
        biases = tuple(
            contribution
            for contribution in budget.contributions
            if contribution.source.source == "turn_on_bias"
            and contribution.figure
            and contribution.figure.origin == "datasheet"
        )
        total = budget.total
        if total > limit:
            removed = math.fsum(bias.sigma**2 for bias in biases)
            total, upper = (math.sqrt(max(size**2 - removed, 0.0)) for size in (total, upper))
        else:
            biases = ()
        room = limit**2 - (upper if upper < limit else total) ** 2
        parts = len(biases) + len(budget.missing)
        return cls(math.sqrt(max(room, 0.0) / parts) if parts else 0.0, biases)

    def of_bias(self, of: ErrorBudgetRow, contribution: Contribution) -> ErrorBudgetRow:
        """Return the row of a source; a printed bias above the limit has its largest value."""
        figure = contribution.figure
        row = replace(
            of,
            **asdict(contribution.source),
            sigma=contribution.sigma,
            origin=figure.origin if figure else "measured",
            kind=figure.kind if figure else None,
            convention=figure.convention if figure else None,
        )
        if not self.room or contribution not in self.biases or figure is None or not figure.sigma:
            return row
        return self._add_largest(row, contribution.sigma / figure.sigma)

    def of_missing(self, of: ErrorBudgetRow, missing: Missing) -> ErrorBudgetRow:
        """Return the row of a source with a missing figure; ``of`` is the row of the error."""
        row = replace(of, **asdict(missing.source), origin="not known", reasons=(missing.reason,))
        return self._add_largest(row, missing.lever)

    def _add_largest(self, row: ErrorBudgetRow, lever: float) -> ErrorBudgetRow:
        name = DATASHEET_KEY_OF_CAUSE[row.source]  # type: ignore[index]  # a figure of a quantity
        dimension = FIGURE_DIMENSIONS[row.quantity or ""][name][0]
        return replace(
            row, largest=self.room / lever if self.room else None, largest_unit=SI_UNITS[dimension]
        )
