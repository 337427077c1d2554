"""The back-test of a recording: rows of the table ``backtest``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.model.estimates import BacktestRow, DeterministicRow
from imubench_pipeline.navigation.backtest.comparison import DeadReckoning, compare
from imubench_pipeline.navigation.backtest.windows import average_blocks, choose_window
from imubench_pipeline.navigation.error_budget import draw_models, has_joint_draws
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.requirements import DIMENSIONS, Error, Requirement
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.units import SI_UNITS, parse_quantity
from imubench_pipeline.words.reasons import pools as texts

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
    signals, which the models do not include, since a user of the sensor gets them too. ``names``
    are ``sensor`` and ``recording``; ``estimates`` the recommended one of each channel; ``draws``
    the number of noise models drawn from each. Each channel has its own random stream of the seed.
    """
    apart: dict[str, dict[str, None]] = {}
    for component in deterministic:
        apart.setdefault(component.channel, {})[component.kind] = None
    rows = [
        replace(row, taken_out=", ".join(apart.get(channel, ())) or None)
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
    """Yield the rows of one channel."""
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
        asked: choose_window(asked.rest, asked.time, log.rate)
        for _, asked in listed
        if isinstance(asked, DeadReckoning)
    }
    lengths = {cut.block for cut in cuts.values() if cut}
    means = average_blocks(log.blocks(), log.segments, log.rate, lengths)
    drawn = draw_models(
        estimate, draws, channel_rng(seed, repr(estimate.model), channel, "backtest")
    )
    jointly = has_joint_draws(estimate)
    for about, asked in listed:
        if not isinstance(asked, DeadReckoning):
            yield replace(about, reason=asked)
        elif (cut := cuts[asked]) is None:
            yield replace(about, reason=texts.long_sampling_interval(log.rate))
        else:
            found = compare(asked, cut, means[cut.block], estimate.model, drawn, efficient=jointly)
            yield replace(
                about,
                window=asked.rest,
                windows=found.windows,
                independent=found.independent,
                measured=found.measured,
                predicted=found.predicted,
                predicted_lower=found.lower,
                predicted_upper=found.upper,
                ratio=found.ratio,
                ratio_lower=None if found.least is None else found.least / found.predicted,
                ratio_upper=None if found.most is None else found.most / found.predicted,
                chance=found.chance,
                verdict=found.verdict,
                duration_needed=asked.duration_needed,
                reason=found.reason,
            )
