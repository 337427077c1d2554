"""The errors that a log shows beside those that its noise model predicts.

What the table ``backtest`` says of them: rows, in words, and as findings.

Beside the ratio of measured to predicted error stands the range in which it lies if the noise model
is right. The errors of a log scatter about what its noise leads to, and the model is uncertain: it
was estimated, of the same log. That matters. With S the mean square that the log shows, and P that
of the model, both estimate the same number, and where the model is as sure as the log allows,

    var(S - P) = var(S) - var(P),

because no weighted mean of the two is better than P alone, so that S - P does not go with P. The
uncertainty of the model is thus a part of the scatter of S and not beside it: were it added, the
ranges would hold 98.5 % of logs in the place of 95 %.

References
----------
J. A. Hausman, "Specification tests in econometrics", Econometrica 46(6), 1978.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import gammaincc, gammaincinv

from imubench_pipeline.model.estimates import BacktestRow
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.navigation.backtest.covariance import Spread, WindowCovariance
from imubench_pipeline.navigation.backtest.windows import Window, errors
from imubench_pipeline.navigation.error_budget.budget import of_sensor
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array

_MIN_SCATTER_SHARE = 0.3
"""Part of the scatter of the log that is left at least: where a model is known hardly better than
the one error shows it, the difference is no number to rely on. On 600 logs with 7 errors each the
ranges hold 94.3 % with 0.2, 95.5 % with 0.3 and 97.1 % with 0.5."""


Verdict = Literal["as predicted", "more than predicted", "less than predicted"]

MIN_WINDOWS = 3
"""Windows, one after the other, that a log must hold."""


@dataclass(frozen=True)
class Predicted:
    """The mean square of the errors of a log, by the noise models that the log allows."""

    spreads: Sequence[Spread]  # by each model drawn, at least one
    # the models are drawn jointly from a likelihood, as sure as the log allows; else the
    # uncertainty of the model is taken to be independent of the scatter, and adds to it
    efficient: bool = True

    def limits(self, level: float = 0.95) -> tuple[float, float]:
        """Return between what limits the mean square of a part ``level`` of all logs lies.

        If the model is right; in rad^2, (m/s)^2 or m^2.
        """
        means = np.array([spread.mean for spread in self.spreads])
        logarithms = np.log(means)
        scatter = float(np.mean([spread.variance / spread.mean**2 for spread in self.spreads]))
        uncertainty = float(np.var(logarithms))
        left = scatter + uncertainty
        if self.efficient:
            left = max(scatter - uncertainty, _MIN_SCATTER_SHARE * scatter)
        centre = math.exp(float(np.mean(logarithms)))
        tail = (1.0 - level) / 2.0
        lower, upper = centre * left * gammaincinv(1.0 / left, [tail, 1.0 - tail])
        return float(lower), float(upper)

    def chance_above(self, mean_square: float) -> float:
        """Return the chance of so large a mean square, or a larger one, if the model is right.

        Here the uncertainty of the model counts in full beside the scatter: to doubt a log, more is
        asked than that a ratio is outside its range. The mean square is in rad^2, (m/s)^2 or m^2.
        """
        means = np.array([spread.mean for spread in self.spreads])
        variances = np.array([spread.variance for spread in self.spreads])
        return float(np.mean(gammaincc(means**2 / variances, mean_square * means / variances)))


@dataclass(frozen=True)
class DeadReckoning:
    """An error of one channel."""

    order: int  # m: integrations but one
    # rest, time: W at rest, over which the bias is the mean, and t in motion, s
    rest: float
    time: float
    factor: float = 1.0  # by which the integral is multiplied

    @property
    def duration_needed(self) -> float:
        """Length of a log that can be compared, s."""
        return MIN_WINDOWS * (self.rest + self.time)

    def sigma(self, model: NoiseModel) -> float:
        """Return the standard deviation of the error, by the error budget of a noise model."""
        start = Calibrated(self.rest)
        parts = of_sensor("", model, self.order, self.time, start, self.factor)
        return math.hypot(*(part.sigma for part in parts))


@dataclass(frozen=True)
class Comparison:
    """The rms error over the windows of a log, and what its noise model predicts."""

    windows: int  # of the log; those with gaps are left out
    # predicted, lower, upper: standard deviation, with 95 % limits: rad, m/s or m
    predicted: float
    lower: float
    upper: float
    measured: float | None = None  # rms over the windows; None where ``reason`` says why
    independent: float | None = None  # windows that would scatter as little, if independent
    # least, most: limits of measured in 95 % of logs, if the model is right
    least: float | None = None
    most: float | None = None
    # of such an rms or a larger one, if the model is right (`Predicted.chance_above`)
    chance: float | None = None
    reason: str | None = None

    @property
    def ratio(self) -> float | None:
        """Measured over predicted."""
        return None if self.measured is None else self.measured / self.predicted

    @property
    def verdict(self) -> Verdict | None:
        """Where measured lies."""
        if self.measured is None or self.least is None or self.most is None:
            return None
        if self.measured > self.most:
            return "more than predicted"
        return "less than predicted" if self.measured < self.least else "as predicted"


def compare(
    asked: DeadReckoning,
    cut: Window,
    means: Sequence[Array],
    model: NoiseModel,
    drawn: Sequence[NoiseModel],
    *,
    efficient: bool = True,
) -> Comparison:
    """Return how the errors of a log compare with those that its noise model predicts.

    Parameters
    ----------
    asked : DeadReckoning
    cut : Window
        That of the times at rest and in motion.
    means : sequence of ndarray
        Of the blocks of each segment of the log, NaN where samples are missing.
    model : NoiseModel
        Of the log; it has a term.
    drawn : sequence of NoiseModel
        Those that the log allows.
    efficient : bool
        They are drawn jointly from a likelihood (`Predicted`).
    """
    predicted = asked.sigma(model)
    lower, upper = np.quantile([asked.sigma(candidate) for candidate in drawn], [0.025, 0.975])
    # The draws of what is absent lie above it: the value itself is inside.
    budget = (predicted, min(float(lower), predicted), max(float(upper), predicted))
    covariance = WindowCovariance(cut, asked.order, asked.factor)
    window_errors = errors(means, covariance.weights, covariance.lags)
    if window_errors.count <= (MIN_WINDOWS - 1) * cut.blocks:
        return Comparison(
            window_errors.count,
            *budget,
            reason=_explain_too_few_windows(asked, cut, means, window_errors.count),
        )
    possible = [candidate for candidate in drawn if candidate.terms] or [model]
    by_draws = Predicted(
        [covariance.spread(candidate, window_errors) for candidate in possible], efficient
    )
    least, most = by_draws.limits()
    return Comparison(
        window_errors.count,
        *budget,
        measured=math.sqrt(window_errors.mean_square),
        independent=covariance.spread(model, window_errors).degrees,
        least=math.sqrt(least),
        most=math.sqrt(most),
        chance=by_draws.chance_above(window_errors.mean_square),
    )


def _explain_too_few_windows(
    asked: DeadReckoning, cut: Window, means: Sequence[Array], count: int
) -> str:
    """Return why a log has too few windows."""
    span, needed = asked.rest + asked.time, asked.duration_needed
    longest = cut.block * max(len(segment) for segment in means)
    wanted = f"{MIN_WINDOWS} windows of {span:g} s, one after the other, need {needed:g} s"
    if longest < needed:
        return f"log too short: {wanted}; its longest part without a break has {longest:.3g} s"
    return f"gaps leave {count} overlapping windows: {wanted} without a gap"


def words(row: BacktestRow) -> str:
    """Return a row of the table ``backtest`` in words."""
    if row.ratio is None:
        return str(row.reason)
    return (
        f"this log drifted {row.ratio:.2f} times the prediction at {row.time:g} s "
        f"({row.ratio_lower:.2f} to {row.ratio_upper:.2f} are to be expected), "
        f"{row.windows} windows, as good as {row.independent:.3g} independent ones"
    )


def findings(rows: Iterable[BacktestRow]) -> Iterator[FindingRow]:
    """Yield the rows of the table ``findings`` of logs that contradict their own budgets.

    One a channel, of the error whose ratio is least likely.
    """
    by_channel: dict[tuple[str, str, str], list[tuple[float, float, BacktestRow]]] = {}
    for row in rows:
        if row.contradicted and row.chance is not None and row.ratio is not None:
            place = row.sensor, row.recording, row.channel
            by_channel.setdefault(place, []).append((row.chance, row.ratio, row))
    for (sensor, recording, channel), contradicted in by_channel.items():
        _, ratio, row = min(contradicted, key=lambda one: one[0])
        taken_out = row.taken_out
        why = (
            f"what is taken out of the noise ({taken_out.replace('_', ' ')}) is in the log"
            if taken_out
            else "its slow terms miss something, such as drift with temperature"
        )
        detail = (
            f"{channel}: {row.error} after {row.time:g} s with the bias from "
            f"{row.window:g} s at rest: {words(row)}. Budgets of this channel are too small: "
            f"{why}"
        )
        finding = Finding("backtest_contradicts", "warning", detail, ratio, channel)
        yield finding.row(sensor, recording)
