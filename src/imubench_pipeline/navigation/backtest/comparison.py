"""Compare the errors over windows of a log with the prediction of its noise model.

The results are rows of the table ``backtest``, and findings.

The ratio of measured to predicted error comes with its 95 % range if the noise model is right. The
errors of a log have a random scatter, and the model is uncertain, since it was estimated from the
same log. Let S be the mean square of the errors of the log, and P the mean square by the model:
both estimate the same number. If P is an efficient estimate,

    var(S - P) = var(S) - var(P),

because no weighted mean of the two has less variance than P, so S - P and P are uncorrelated
(Hausman 1978). The uncertainty of the model is thus a part of the scatter of S. If it were added,
the ranges would cover 98.5 % of logs instead of 95 %.

References
----------
J. A. Hausman, "Specification tests in econometrics", Econometrica 46(6), 1978.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincc, gammaincinv

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.model.estimates import BacktestRow, DeterministicRow
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.model.states import BacktestVerdict
from imubench_pipeline.navigation.backtest import windows
from imubench_pipeline.navigation.error_budget.budget import of_sensor
from imubench_pipeline.navigation.error_budget.uncertainty import compute_limits, draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.requirements import DIMENSIONS, Error, Requirement
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.findings import find
from imubench_pipeline.typing import Array
from imubench_pipeline.units import SI_UNITS, parse_quantity
from imubench_pipeline.words.findings.spectrum import BacktestContradicts
from imubench_pipeline.words.reasons import pools as texts

_MIN_SCATTER_SHARE = 0.3
"""Minimum remaining variance, as a fraction of the scatter of the log. If the model is hardly
better known than the error itself, the difference is unreliable. On 600 logs with 7 errors each,
the ranges cover 94.3 % with 0.2, 95.5 % with 0.3 and 97.1 % with 0.5."""

MIN_WINDOWS = 3  # minimum number of consecutive windows in a log
CONTRADICTION_LEVEL = 0.01
"""Significance level of a contradiction, for all rows of a recording together (Bonferroni)."""

MIN_CONTRADICTING_RATIO = 1.1
"""Minimum ratio of a contradiction. A day at 1 Hz has 30,000 windows of 10 s, so that a ratio of
1.01 is significant, but it does not matter for a requirement."""

_INTEGRATIONS: Mapping[tuple[str, Error], tuple[int, float]] = {
    ("gyro", "attitude"): (0, 1.0),
    ("gyro", "heading"): (0, 1.0),
    ("gyro", "velocity"): (1, STANDARD_GRAVITY),
    ("gyro", "position"): (2, STANDARD_GRAVITY),
    ("accel", "velocity"): (0, 1.0),
    ("accel", "position"): (1, 1.0),
}
"""Number of integrations minus one, and multiplier of the integral, by quantity and error. The
attitude error of a gyro projects gravity into velocity and position."""


@dataclass(frozen=True)
class DeadReckoning:
    """A dead-reckoning error from one channel: its bias is measured at rest, before the motion."""

    order: int  # m: number of integrations minus one
    # rest, time: the time W at rest, whose mean is the bias, and the time t in motion, s
    rest: float
    time: float
    factor: float = 1.0  # multiplier of the integral

    @property
    def duration_needed(self) -> float:
        """Minimum length of a log for the comparison, s."""
        return MIN_WINDOWS * (self.rest + self.time)

    def sigma(self, model: NoiseModel) -> float:
        """Return the standard deviation of the error that a noise model predicts, rad, m/s or m."""
        parts = of_sensor("gyro", model, self.order, self.time, Calibrated(self.rest), self.factor)
        return math.hypot(*(part.sigma for part in parts))


def _limit_mean_square(
    spreads: Sequence[windows.Spread], found: float, *, efficient: bool
) -> tuple[float, float, float]:
    """Return the limits of the mean square of 95 % of all logs, and the p-value of the found one.

    They assume that the model is right; there is one spread for each drawn model, at least one.
    ``efficient``: the models are drawn jointly from a likelihood (an efficient estimate); else the
    uncertainty of the model is assumed to be independent of the scatter, and adds to it. The
    p-value is the probability of the found mean square or a larger one. It has the uncertainty in
    full: a ratio outside its range is not enough to contradict a budget.
    """
    means = np.array([spread.mean for spread in spreads])
    variances = np.array([spread.variance for spread in spreads])
    logarithms = np.log(means)
    scatter = float(np.mean([spread.variance / spread.mean**2 for spread in spreads]))
    uncertainty = float(np.var(logarithms))
    left = scatter + uncertainty
    if efficient:
        left = max(scatter - uncertainty, _MIN_SCATTER_SHARE * scatter)
    centre = math.exp(float(np.mean(logarithms)))
    tail = (1.0 - 0.95) / 2.0
    lower, upper = centre * left * gammaincinv(1.0 / left, [tail, 1.0 - tail])
    p_value = np.mean(gammaincc(means**2 / variances, found * means / variances))
    return float(lower), float(upper), float(p_value)


def _compare(
    about: BacktestRow,
    asked: DeadReckoning,
    cut: windows.Window,
    means: Sequence[Array],
    model: NoiseModel,
    drawn: Sequence[NoiseModel],
    *,
    efficient: bool,
) -> BacktestRow:
    """Return a row with the errors of a log, compared with the prediction of its noise model.

    ``cut``: window at rest and in motion; ``means``: block means of each segment, NaN where samples
    are missing; ``drawn``: models from the estimate; ``efficient``: see `_limit_mean_square`.
    """
    predicted = asked.sigma(model)
    lower, upper = compute_limits([asked.sigma(candidate) for candidate in drawn], predicted)
    covariance = windows.WindowCovariance(cut, asked.order, asked.factor)
    errors = windows.compute_window_errors(means, covariance.weights, covariance.lags)
    span, needed = asked.rest + asked.time, asked.duration_needed
    about = replace(
        about,
        window=asked.rest,
        windows=errors.count,
        predicted=predicted,
        predicted_lower=lower,
        predicted_upper=upper,
        duration_needed=needed,
    )
    if errors.count <= (MIN_WINDOWS - 1) * cut.blocks:
        longest = cut.block * max(len(segment) for segment in means)
        reason = texts.gaps_between_windows(errors.count, MIN_WINDOWS, span, needed)
        if longest < needed:
            reason = texts.short_for_windows(MIN_WINDOWS, span, needed, longest)
        return replace(about, reason=reason)
    possible = [candidate for candidate in drawn if candidate.terms] or [model]
    spreads = [covariance.spread(candidate, errors) for candidate in possible]
    low, high, chance = _limit_mean_square(spreads, errors.mean_square, efficient=efficient)
    measured, least, most = (math.sqrt(square) for square in (errors.mean_square, low, high))
    verdict: BacktestVerdict = "less than predicted" if measured < least else "as predicted"
    return replace(
        about,
        independent=covariance.spread(model, errors).degrees,
        measured=measured,
        ratio=measured / predicted,
        ratio_lower=least / predicted,
        ratio_upper=most / predicted,
        chance=chance,
        verdict="more than predicted" if measured > most else verdict,
    )


def findings(rows: Iterable[BacktestRow]) -> Iterator[FindingRow]:
    """Yield a finding for each channel that contradicts its budget: the row of least p-value."""
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
            row.taken_out,
        )
        yield find(data, "warning", ratio, channel).row(sensor, recording)


def list_backtest_rows(
    names: Mapping[str, str],
    logs: Mapping[str, ChannelLog],
    estimates: Mapping[str, Estimate],
    requirements: Mapping[str, Requirement],
    deterministic: Iterable[DeterministicRow],
    *,
    draws: int,
    seed: int,
) -> Iterator[BacktestRow]:
    """Yield the rows of the table ``backtest`` of a recording.

    The logs are used as recorded, with lines, temperature drift and other ``deterministic``
    signals. The models do not include these, but a user of the sensor gets them. ``names`` has
    ``sensor`` and ``recording``. ``estimates`` has the recommended estimate of each channel, from
    which ``draws`` noise models are drawn. Each channel has its own random stream of the seed.
    """
    apart: dict[str, dict[str, None]] = {}
    for component in deterministic:
        apart.setdefault(component.channel, {})[component.kind] = None
    rows = [
        replace(row, taken_out=tuple(apart.get(channel, ())))
        for channel, log in logs.items()
        if channel in estimates
        for row in _test_channel(names, channel, log, estimates[channel], requirements, draws, seed)
    ]
    compared = sum(row.chance is not None for row in rows)
    for row in rows:
        if row.chance is None or row.ratio is None:
            yield row
        else:
            contradicted = (
                row.chance * compared < CONTRADICTION_LEVEL and row.ratio >= MIN_CONTRADICTING_RATIO
            )
            yield replace(row, contradicted=contradicted)


def _test_channel(
    names: Mapping[str, str],
    channel: str,
    log: ChannelLog,
    estimate: Estimate,
    requirements: Mapping[str, Requirement],
    draws: int,
    seed: int,
) -> Iterator[BacktestRow]:
    listed: list[tuple[BacktestRow, DeadReckoning | str]] = []
    for name, requirement in requirements.items():
        for limit in requirement.by_dead_reckoning:
            key = quantity_of(channel), limit.error
            # The error that the limit needs, or why the log cannot show it.
            asked: DeadReckoning | str
            if key == ("gyro", "north"):
                asked = texts.NORTH_NOT_TESTED
            elif key not in _INTEGRATIONS:
                continue
            elif requirement.static_window is None:
                asked = texts.TURN_ON_NOT_TESTED
            elif not estimate.model.terms:
                asked = texts.NOISE_NOT_KNOWN
            else:
                order, factor = _INTEGRATIONS[key]
                rest = parse_quantity(requirement.static_window, "time")
                asked = DeadReckoning(order, rest, limit.seconds, factor)
            about = BacktestRow(
                sensor=names["sensor"],
                recording=names["recording"],
                channel=channel,
                requirement=name,
                error=limit.error,
                time=limit.seconds,
                unit=SI_UNITS[DIMENSIONS[limit.error]],
            )
            listed.append((about, asked))
    cuts = {
        asked: windows.choose_window(asked.rest, asked.time, log.rate)
        for _, asked in listed
        if isinstance(asked, DeadReckoning)
    }
    lengths = {cut.block for cut in cuts.values() if cut}
    means = windows.average_blocks(log.blocks(), log.segments, log.rate, lengths)
    drawn = draw_models(
        estimate, draws, channel_rng(seed, repr(estimate.model), channel, "backtest")
    )
    jointly = estimate.draws is not None
    for about, asked in listed:
        if not isinstance(asked, DeadReckoning):
            yield replace(about, reason=asked)
        elif (cut := cuts[asked]) is None:
            yield replace(about, reason=texts.long_sampling_interval(log.rate))
        else:
            yield _compare(
                about, asked, cut, means[cut.block], estimate.model, drawn, efficient=jointly
            )
