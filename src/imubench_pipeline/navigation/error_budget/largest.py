"""How large a figure may be that is not known, or that a calibration can take down."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from imubench_pipeline.navigation.error_budget.parts import Budget, Contribution, Missing
from imubench_pipeline.navigation.error_budget.printed_errors import PRINTED
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS
from imubench_pipeline.units import SI_UNITS


def source_row(contribution: Contribution) -> dict[str, Any]:
    """Return what the table ``error_budget`` says of a source."""
    figure = contribution.figure
    return {
        "source": contribution.source,
        "sigma": contribution.sigma,
        "cause": contribution.cause,
        "origin": figure.origin if figure else "measured",
        "kind": figure.kind if figure else None,
        "convention": figure.convention if figure else None,
    }


@dataclass(frozen=True)
class Largest:
    """What room a limit leaves to figures that are not known, and to biases that it cannot bear.

    A printed turn-on bias counts as delivered; where it alone breaks the limit, a calibration may
    take it down to what there is room for. All these figures share the room.

    Attributes
    ----------
    room : float
        Of each of them: the error that it may add, 1 sigma; 0 where there is none.
    biases : tuple of Contribution
        The printed biases that break the limit.
    """

    room: float
    biases: tuple[Contribution, ...] = ()

    @classmethod
    def of(cls, found: Budget, limit: float | None, upper: float) -> Largest:
        """Return the room in a budget.

        Parameters
        ----------
        found : Budget
        limit : float or None
            Largest standard deviation that is allowed, SI; None: there is none to keep.
        upper : float
            Upper limit of the total. A sensor that surely passes still does with these figures.
        """
        if limit is None:
            return cls(0.0)
        biases = tuple(
            one
            for one in found.contributions
            if one.cause == "turn_on_bias" and one.figure and one.figure.origin == "datasheet"
        )
        total = found.total
        if total > limit:
            taken = math.fsum(one.sigma**2 for one in biases)
            total, upper = (math.sqrt(max(size**2 - taken, 0.0)) for size in (total, upper))
        else:
            biases = ()
        room = limit**2 - (upper if upper < limit else total) ** 2
        parts = len(biases) + len(found.missing)
        return cls(math.sqrt(max(room, 0.0) / parts) if parts else 0.0, biases)

    def of_bias(self, one: Contribution) -> dict[str, Any]:
        """Return the largest figure of a printed bias; nothing of what the limit can bear.

        Parameters
        ----------
        one : Contribution
            A source of the budget.
        """
        if not self.room or one not in self.biases or one.figure is None or not one.figure.sigma:
            return {}
        quantity = "accel" if "accel" in one.source.split() else "gyro"
        return self._figure(quantity, one.cause, one.sigma / one.figure.sigma)

    def of_missing(self, one: Missing) -> dict[str, Any]:
        """Return the row of a source whose figure is not known."""
        return {
            "source": one.source,
            "cause": one.cause,
            "origin": "not known",
            "reason": one.reason,
        } | self._figure(one.quantity, one.cause, one.lever)

    def _figure(self, quantity: str, cause: str, lever: float) -> dict[str, Any]:
        dimension = FIGURE_DIMENSIONS[quantity][PRINTED[cause]][0]  # type: ignore[index]  # a cause
        return {
            "largest": self.room / lever if self.room else None,
            "largest_unit": SI_UNITS[dimension],
        }
