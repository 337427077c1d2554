"""The errors that a log shows beside those that its noise model predicts.

What the table ``backtest`` says of them: rows, in words, and as findings.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from imubench_pipeline.navigation.backtest.covariance import WindowCovariance
from imubench_pipeline.navigation.backtest.prediction import Predicted
from imubench_pipeline.navigation.backtest.windows import Window, errors
from imubench_pipeline.navigation.error_budget.budget import of_sensor
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array, Row

Verdict = Literal["as predicted", "more than predicted", "less than predicted"]

SHORTEST = 3
"""Windows, one after the other, that a log must hold."""


@dataclass(frozen=True)
class DeadReckoning:
    """An error of one channel.

    Attributes
    ----------
    order : int
        m: integrations but one.
    rest, time : float
        W at rest, over which the bias is the mean, and t in motion, s.
    factor : float
        By which the integral is multiplied.
    """

    order: int
    rest: float
    time: float
    factor: float = 1.0

    @property
    def duration_needed(self) -> float:
        """Length of a log that can be compared, s."""
        return SHORTEST * (self.rest + self.time)

    def sigma(self, model: NoiseModel) -> float:
        """Return the standard deviation of the error, by the error budget of a noise model."""
        start = Calibrated(self.rest)
        parts = of_sensor("", model, self.order, self.time, start, self.factor)
        return math.hypot(*(part.sigma for part in parts))


@dataclass(frozen=True)
class Comparison:
    """The rms error over the windows of a log, and what its noise model predicts.

    Attributes
    ----------
    windows : int
        Of the log; those with gaps are left out.
    predicted, lower, upper : float
        Standard deviation, with 95 % limits: rad, m/s or m.
    measured : float or None
        Rms over the windows; None where ``reason`` says why.
    independent : float or None
        Windows that would scatter as little, if independent.
    least, most : float or None
        Limits of measured in 95 % of logs, if the model is right.
    chance : float or None
        Of such an rms or a larger one, if the model is right (`Predicted.chance_above`).
    reason : str or None
    """

    windows: int
    predicted: float
    lower: float
    upper: float
    measured: float | None = None
    independent: float | None = None
    least: float | None = None
    most: float | None = None
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
    lower, upper = np.quantile([asked.sigma(one) for one in drawn], [0.025, 0.975])
    # The draws of what is absent lie above it: the value itself is inside.
    budget = (predicted, min(float(lower), predicted), max(float(upper), predicted))
    covariance = WindowCovariance(cut, asked.order, asked.factor)
    found = errors(means, covariance.weights, covariance.lags)
    if found.count <= (SHORTEST - 1) * cut.blocks:
        return Comparison(found.count, *budget, reason=_too_few(asked, cut, means, found.count))
    possible = [one for one in drawn if one.terms] or [model]
    by_draws = Predicted([covariance.spread(one, found) for one in possible], efficient)
    least, most = by_draws.limits()
    return Comparison(
        found.count,
        *budget,
        measured=math.sqrt(found.mean_square),
        independent=covariance.spread(model, found).degrees,
        least=math.sqrt(least),
        most=math.sqrt(most),
        chance=by_draws.chance_above(found.mean_square),
    )


def _too_few(asked: DeadReckoning, cut: Window, means: Sequence[Array], count: int) -> str:
    """Return why a log has too few windows."""
    span, needed = asked.rest + asked.time, asked.duration_needed
    longest = cut.block * max(len(segment) for segment in means)
    wanted = f"{SHORTEST} windows of {span:g} s, one after the other, need {needed:g} s"
    if longest < needed:
        return f"log too short: {wanted}; its longest part without a break has {longest:.3g} s"
    return f"gaps leave {count} overlapping windows: {wanted} without a gap"


def words(row: Row) -> str:
    """Return a row of the table ``backtest`` in words."""
    if row["ratio"] is None:
        return str(row["reason"])
    return (
        f"this log drifted {row['ratio']:.2f} times the prediction at {row['time']:g} s "
        f"({row['ratio_lower']:.2f} to {row['ratio_upper']:.2f} are to be expected), "
        f"{row['windows']} windows, as good as {row['independent']:.3g} independent ones"
    )


def findings(rows: Iterable[Row]) -> Iterator[Row]:
    """Yield the rows of the table ``findings`` of logs that contradict their own budgets.

    One a channel, of the error whose ratio is least likely.

    Parameters
    ----------
    rows : iterable of mapping
        Of the table ``backtest``.
    """
    worst: dict[tuple[str, str, str], Row] = {}
    for row in rows:
        place = row["sensor"], row["recording"], row["channel"]
        if row["contradicted"] and row["chance"] < worst.get(place, {"chance": 2.0})["chance"]:
            worst[place] = row
    for (sensor, recording, channel), row in worst.items():
        taken_out = row["taken_out"]
        why = (
            f"what is taken out of the noise ({taken_out.replace('_', ' ')}) is in the log"
            if taken_out
            else "its slow terms miss something, such as drift with temperature"
        )
        detail = (
            f"{channel}: {row['error']} after {row['time']:g} s with the bias from "
            f"{row['window']:g} s at rest: {words(row)}. Budgets of this channel are too small: "
            f"{why}"
        )
        finding = Finding("backtest_contradicts", "warning", detail, row["ratio"], channel)
        yield finding.row(sensor, recording)
