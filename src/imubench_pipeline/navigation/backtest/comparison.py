"""Compare the errors over windows of a log with the prediction of its noise model.

The results are rows of the table ``backtest``, and findings.

The ratio of measured to predicted error comes with its 95 % range if the noise model is right. The
errors of a log have a random scatter, and the model is uncertain, since it was estimated from the
same log. Let S be the mean square of the errors of the log, and P that of the model: both estimate
the same number. If P is an efficient estimate,

    var(S - P) = var(S) - var(P),

because no weighted mean of the two has less variance than P, so S - P and P are uncorrelated
(Hausman 1978). The uncertainty of the model is thus a part of the scatter of S. If it were added,
the ranges would cover 98.5 % of logs instead of 95 %.

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
from imubench_pipeline.navigation.backtest.windows import Window, compute_window_errors
from imubench_pipeline.navigation.error_budget.budget import of_sensor
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated
from imubench_pipeline.tables.findings import find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings.backtest import BacktestContradicts
from imubench_pipeline.words.reasons import pools as texts

_MIN_SCATTER_SHARE = 0.3
"""Minimum remaining variance, as a fraction of the scatter of the log. If the model is hardly
better known than the error itself, the difference is unreliable. On 600 logs with 7 errors each,
the ranges cover 94.3 % with 0.2, 95.5 % with 0.3 and 97.1 % with 0.5."""


Verdict = Literal["as predicted", "more than predicted", "less than predicted"]

MIN_WINDOWS = 3
"""Minimum number of consecutive windows in a log."""


@dataclass(frozen=True)
class Predicted:
    """Predicted mean square of the errors of a log, from drawn noise models."""

    spreads: Sequence[Spread]  # one for each drawn model, at least one
    # whether the models are drawn jointly from a likelihood (an efficient estimate); else the
    # uncertainty of the model is assumed to be independent of the scatter, and adds to it
    efficient: bool = True

    def limits(self, level: float = 0.95) -> tuple[float, float]:
        """Return the limits that contain the mean square of a fraction ``level`` of all logs.

        They assume that the model is right, and are in rad^2, (m/s)^2 or m^2.
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
        """Return the p-value of a mean square: the probability of this or a larger one.

        The uncertainty of the model is added in full to the scatter: a ratio outside its range is
        not enough to contradict a budget. The mean square is in rad^2, (m/s)^2 or m^2.
        """
        means = np.array([spread.mean for spread in self.spreads])
        variances = np.array([spread.variance for spread in self.spreads])
        return float(np.mean(gammaincc(means**2 / variances, mean_square * means / variances)))


@dataclass(frozen=True)
class DeadReckoning:
    """One dead-reckoning error of one channel."""

    order: int  # m: number of integrations minus one
    # rest, time: W at rest, whose mean is the bias, and t in motion, s
    rest: float
    time: float
    factor: float = 1.0  # multiplier of the integral

    @property
    def duration_needed(self) -> float:
        """Minimum length of a log for the comparison, s."""
        return MIN_WINDOWS * (self.rest + self.time)

    def sigma(self, model: NoiseModel) -> float:
        """Return the standard deviation of the error, from the error budget of a noise model."""
        start = Calibrated(self.rest)
        parts = of_sensor("", model, self.order, self.time, start, self.factor)
        return math.hypot(*(part.sigma for part in parts))


@dataclass(frozen=True)
class Comparison:
    """Measured rms error over the windows of a log, and its prediction."""

    windows: int  # number in the log; windows with gaps are left out
    # predicted, lower, upper: standard deviation, with 95 % limits: rad, m/s or m
    predicted: float
    lower: float
    upper: float
    measured: float | None = None  # rms over the windows; None if ``reason`` is set
    independent: float | None = None  # equivalent number of independent windows
    # least, most: limits of measured in 95 % of logs, if the model is right
    least: float | None = None
    most: float | None = None
    # p-value of the rms (`Predicted.chance_above`)
    chance: float | None = None
    reason: str | None = None

    @property
    def ratio(self) -> float | None:
        """Measured over predicted."""
        return None if self.measured is None else self.measured / self.predicted

    @property
    def verdict(self) -> Verdict | None:
        """Position of the measured rms relative to the predicted range."""
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
    """Return the comparison of the errors of a log with those that its noise model predicts.

    Parameters
    ----------
    asked : DeadReckoning
    cut : Window
        Window for the times at rest and in motion.
    means : sequence of ndarray
        Block means of each segment of the log, NaN where samples are missing.
    model : NoiseModel
        Model of the log, with at least one term.
    drawn : sequence of NoiseModel
        Models drawn from the estimate of the log.
    efficient : bool
        Whether they are drawn jointly from a likelihood (`Predicted`).
    """
    predicted = asked.sigma(model)
    lower, upper = np.quantile([asked.sigma(candidate) for candidate in drawn], [0.025, 0.975])
    # Draws of an absent term are above 0: extend the limits to the value.
    budget = (predicted, min(float(lower), predicted), max(float(upper), predicted))
    covariance = WindowCovariance(cut, asked.order, asked.factor)
    window_errors = compute_window_errors(means, covariance.weights, covariance.lags)
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
    if longest < needed:
        return texts.short_for_windows(MIN_WINDOWS, span, needed, longest)
    return texts.gaps_between_windows(count, MIN_WINDOWS, span, needed)


def findings(rows: Iterable[BacktestRow]) -> Iterator[FindingRow]:
    """Yield the rows of the table ``findings`` for logs that contradict their own budgets.

    There is one for each channel, about the error with the smallest p-value.
    """
    by_channel: dict[tuple[str, str, str], list[tuple[float, float, BacktestRow]]] = {}
    for row in rows:
        if row.contradicted and row.chance is not None and row.ratio is not None:
            place = row.sensor, row.recording, row.channel
            by_channel.setdefault(place, []).append((row.chance, row.ratio, row))
    for (sensor, recording, channel), contradicted in by_channel.items():
        _, ratio, row = min(contradicted, key=lambda one: one[0])
        data = BacktestContradicts(
            row.error,
            row.time,
            row.window,
            ratio,
            row.ratio_lower,
            row.ratio_upper,
            row.windows,
            row.independent,
            tuple(row.taken_out.split(", ")) if row.taken_out else (),
        )
        yield find(data, "warning", ratio, channel).row(sensor, recording)
