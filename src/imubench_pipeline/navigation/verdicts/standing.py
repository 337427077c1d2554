"""Compare the error of a sensor with each limit of a requirement, and find the deciding limit."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from imubench_pipeline.model import table
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.states import SURE_PROBABILITY, Verdict
from imubench_pipeline.model.verdicts import Share
from imubench_pipeline.navigation import suitability
from imubench_pipeline.navigation.verdicts.specimens import Expected, Spread, predict_error
from imubench_pipeline.words.reasons import budgets as texts

MAX_LIMIT_RATIO = 4.0
"""Maximum ratio of upper to lower limit of an error; beyond it, the log is not conclusive."""


@table.row
class OutageErrorRow(ErrorBudgetRow):
    """An error at the end of outages on a trajectory."""

    trajectory: Annotated[str | None, "of the outages"]


def get_trajectory(total: ErrorBudgetRow) -> str | None:
    """Return the trajectory of an error in outages; None for an error of dead reckoning."""
    return total.trajectory if isinstance(total, OutageErrorRow) else None


@dataclass(frozen=True)
class Standing:
    """The error of a sensor compared with one limit of a requirement."""

    # row ``total`` of the representative recording: the one whose error is nearest to the expected
    # error
    total: ErrorBudgetRow
    totals: Sequence[ErrorBudgetRow]  # one for each recording with a figure
    expected: Expected  # the error, of the next specimen where there are several
    source: ErrorBudgetRow | None = None  # the largest contribution
    share: float | None = None  # its part of the variance
    parts: tuple[Share, ...] = ()  # all relevant sources
    # rows of sources whose class limit is too large for the limit
    conditions: tuple[ErrorBudgetRow, ...] = ()

    @property
    def known(self) -> bool:
        """Whether the error is known."""
        return self.expected.sigma is not None

    @property
    def margin(self) -> float:
        """The limit divided by the expected error."""
        return _divide(self.total.limit, self.expected.sigma)

    @property
    def margins(self) -> tuple[float, float]:
        """95 % limits of the margin."""
        limit = self.total.limit
        return _divide(limit, self.expected.upper), _divide(limit, self.expected.lower)

    def scale_margin(self, sigma: float | None) -> float | None:
        """Return the margin if the total of the representative recording were ``sigma``."""
        if not self.known or sigma is None or not self.total.sigma:
            return None
        return self.margin * self.total.sigma / sigma if sigma > 0.0 else math.inf

    @property
    def chance(self) -> float:
        """Probability that the error is within its limit, given the logs and specimens."""
        assert self.expected.within is not None  # of a known error with a limit
        return self.expected.within

    @property
    def wide(self) -> bool:
        """Whether the 95 % limits of the error have a ratio above `MAX_LIMIT_RATIO`."""
        low, high = self.margins
        return low <= 0.0 or high / low > MAX_LIMIT_RATIO

    @property
    def verdict(self) -> Verdict:
        """Verdict on this limit, by the probability that the error is within it."""
        if not self.known:
            return "not_enough_data"
        if self.chance >= SURE_PROBABILITY:
            return "meets"
        best = self.scale_margin(self.total.best)
        if self.conditions and self.chance < 0.5 and best is not None and best >= 1.0:
            return "meets_if"
        if self.chance <= 1.0 - SURE_PROBABILITY:
            return "fails"
        # The interval of the representative log may be too wide for a verdict.
        lower, upper = self.total.lower, self.total.upper
        if lower is None or upper is None or lower <= 0.0 or upper / lower > MAX_LIMIT_RATIO:
            return "not_enough_data"
        return "likely_meets" if self.chance >= 0.5 else "likely_fails"


def list_standings(
    rows: Iterable[ErrorBudgetRow],
    devices: Mapping[str, str],
    usual: Mapping[tuple[Any, ...], Spread] | None = None,
) -> list[Standing]:
    """Return the standing of one sensor for each limit; ``usual``: other sensors' spreads."""
    by_limit: dict[tuple[Any, ...], list[ErrorBudgetRow]] = {}
    for row in rows:
        if row.source == "total":
            # A total without the numbers for its verdict has no figure.
            needed = ("sigma", "lower", "upper", "within", "limit")
            missing = [name for name in needed if getattr(row, name) is None]
            if missing:
                reasons = row.reasons or (texts.missing_numbers(missing),)
                row = replace(row, sigma=None, reasons=reasons)
        by_limit.setdefault(make_limit_key(row), []).append(row)
    listed = []
    for key, parts in by_limit.items():
        totals = [row for row in parts if row.source == "total"]
        if not totals:
            continue
        figures = suitability.select_known_errors(totals)
        with_figure = [row for row, _ in figures]
        prediction = predict_error(with_figure, devices, (usual or {}).get(key))
        if prediction.sigma is None:
            listed.append(Standing(totals[0], with_figure, prediction))
            continue
        # Logarithmic distances from the prediction; plain ones where an error is 0.
        distances = [
            (
                abs(math.log(sigma / prediction.sigma))
                if prediction.sigma and sigma
                else abs(sigma - prediction.sigma)
            )
            for _, sigma in figures
        ]
        answer, sigma = figures[distances.index(min(distances))]
        own = [row for row in parts if row.source != "total" and row.recording == answer.recording]
        conditions = tuple(row for row in own if row.largest)
        standing = Standing(answer, with_figure, prediction, conditions=conditions)
        sources = suitability.select_known_errors(own)
        if sources and sigma > 0.0:
            largest, size = max(sources, key=lambda source: source[1])
            share, shares = (size / sigma) ** 2, suitability.compute_variance_shares(sigma, own)
            standing = replace(standing, source=largest, share=share, parts=shares)
        listed.append(standing)
    return listed


def make_limit_key(row: ErrorBudgetRow) -> tuple[Any, ...]:
    """Return the error, time, size and trajectory that identify the limit of a row."""
    return row.error, row.time, row.limit, get_trajectory(row)


def find_deciding_limit(by_limit: Sequence[Standing]) -> Standing:
    """Return the deciding limit: the worst known one, or if it does not fail, any unknown one."""
    known = [standing for standing in by_limit if standing.known]
    worst = min(known, key=lambda standing: standing.margin, default=by_limit[0])
    unknown = [standing for standing in by_limit if not standing.known]
    return worst if not unknown or worst.verdict == "fails" else unknown[0]


def _divide(limit: float | None, error: float | None) -> float:
    return limit / error if limit is not None and error else math.inf
