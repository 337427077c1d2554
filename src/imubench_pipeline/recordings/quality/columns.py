"""What is wrong with each column of a recording, in findings with a severity and a time.

`repeats_beyond_chance` counts samples that repeat the one before more often than a coarse register
explains.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from imubench_pipeline.recordings.quality import copies, held, joined, levels, stationarity
from imubench_pipeline.recordings.quality.copies import shared_noise
from imubench_pipeline.recordings.quality.summary import LARGEST, ColumnSummary
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import (
    POSITION,
    QUANTITIES,
    TABLE_RATE,
    TEMPERATURE,
    quantity_of,
)
from imubench_pipeline.tables.findings import Finding, Severity
from imubench_pipeline.units import SI_UNITS, from_si

_SURE = 4.0
"""Standard errors by which counts may be off."""

_COARSEST, _FINEST = 0.6, 300.0
"""Standard deviation of the difference of neighbours, in steps of the register, that can be told
from how many of the changes are by one step: of smaller ones all are, and it matters where between
two steps the mean lies."""


_USUAL = {"gyro": ("deg/s", "°/s"), "accel": ("mg", "mg")}
"""Unit in which a reader knows the figures of each quantity, and its sign."""

_FEW_EMPTY = 0.01
"""Part of the records of a channel that may lack its number without harm."""

_ROUNDING = 1.5
"""Step over noise from which the rounding makes most of the noise."""


def repeats_beyond_chance(column: ColumnSummary) -> tuple[float, float]:
    """Return the share of samples that are repeated for another reason than rounding.

    A register that is read faster than it is written repeats samples, and changes as between
    independent samples in between. Two things repeat samples, too, and are taken off, the larger of
    them: as many samples as are equal to one `summary.FAR` before (those of coarse steps, in any
    order), and as many as rounding makes of normal noise of which as many changes are by one step
    (noise behind a low-pass, whose neighbours are alike).

    Returns
    -------
    (beyond, chance) : float
        Parts of all samples, and of those that could be equal.
    """
    pairs, far_pairs = column.pairs, column.far_pairs
    if pairs == 0 or far_pairs == 0:
        return 0.0, 0.0
    share = column.repeats / pairs
    shuffled = column.far_repeats / far_pairs
    shuffled += _SURE * math.sqrt(shuffled * (1.0 - shuffled) / far_pairs)
    chance = min(max(shuffled, _rounded(column.single_steps, column.steps)), 1.0)
    if share <= chance:
        return 0.0, chance
    beyond = (share - chance) / (1.0 - chance)
    return beyond * pairs / max(column.present - 1, 1), chance


def _rounded(single: int, steps: int) -> float:
    """Return the share of repeats in rounded normal noise with so many changes by one step."""
    if steps == 0:
        return 1.0
    part = single / steps
    part += _SURE * math.sqrt((part * (1.0 - part) + 1.0 / steps) / steps)
    low, high = _COARSEST, _FINEST
    if part >= _parts(low)[1]:
        return 1.0
    for _ in range(50):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _parts(middle)[1] > part else (low, middle)
    return _parts(low)[0]


def _parts(deviation: float) -> tuple[float, float]:
    """Return which part of neighbours is equal, and which part of the changes is by one step.

    Their difference d is normal; rounded at a random place it is k steps with a chance of
    1 - |d - k|, so that with G(x) = E[(d - x)⁺] the part is G(k - 1) - 2 G(k) + G(k + 1).

    ``deviation``: of d, in steps.
    """
    below, none, single, two = (_excess(x, deviation) for x in (-1.0, 0.0, 1.0, 2.0))
    equal = below - 2.0 * none + single
    return equal, 2.0 * (none - 2.0 * single + two) / (1.0 - equal)


def _excess(x: float, deviation: float) -> float:
    """Return E[(d - x)⁺] of a normal d."""
    z = x / deviation
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return deviation * density - 0.5 * x * math.erfc(z / math.sqrt(2.0))


def column_findings(
    columns: Mapping[str, ColumnSummary],
    rate: float,
    settings: QualitySettings,
    *,
    static: bool = True,
) -> list[Finding]:
    """Return what the columns of one file tell; a channel that cannot be used is fatal.

    Parameters
    ----------
    columns : mapping of str to ColumnSummary
        Channels, and perhaps the temperature.
    rate : float
        Hz; the times of the findings follow from it.
    static : bool
        The sensor was to be at rest; where it was turned, changes are what was meant.
    """
    findings: list[Finding] = []
    usable: dict[str, ColumnSummary] = {}
    for channel, column in columns.items():
        if channel == TEMPERATURE:
            findings += _temperature(column)
            continue
        if channel in (POSITION, TABLE_RATE):
            continue
        fatal = _unusable(channel, column, settings)
        findings += [fatal] if fatal else []
        findings += _cells(channel, column, rate)
        if fatal is None:
            usable[channel] = column
    steps = {channel: levels.quantisation(column) for channel, column in usable.items()}
    for channel, column in usable.items():
        findings += _values(channel, column, steps[channel], rate, settings)
        if static:
            findings += _changes(channel, column, steps[channel], rate, settings)
            if not _nothing_else(steps[channel], settings):
                findings += joined.joined(channel, column, rate)
                findings += joined.interleaved(channel, column)
        findings += _repeated(channel, column, steps[channel], settings)
    findings += copies.repeated_stretches(usable, steps, rate)
    if static:
        findings += shared_noise(usable)
    return findings


def _figure(channel: str, value: float) -> str:
    """Return a figure of a channel in SI, and as it is usually written."""
    quantity = quantity_of(channel)
    usual, sign = _USUAL[quantity]
    dimension = QUANTITIES[quantity]
    written = from_si(value, usual, dimension)
    return f"{value:.4g} {SI_UNITS[dimension]} ({written:.4g} {sign})"


def _unusable(channel: str, column: ColumnSummary, settings: QualitySettings) -> Finding | None:
    if column.present == 0:
        return Finding("no_samples", "fatal", f"{channel} holds no number", 0, channel)
    if column.present < settings.shortest:
        detail = (
            f"{channel} has {column.present} samples, expected at least {settings.shortest} "
            "(quality.shortest); record for longer"
        )
        return Finding("too_short", "fatal", detail, column.present, channel)
    if column.low == column.high:
        stays = "is exactly 0" if column.low == 0.0 else f"stays at {_figure(channel, column.low)}"
        detail = (
            f"{channel} never changes (it {stays} in all {column.present} samples); the axis is "
            "dead or was not read, or the column is not the one meant"
        )
        return Finding("stuck", "fatal", detail, column.low, channel)
    return None


def _cells(channel: str, column: ColumnSummary, rate: float) -> Iterator[Finding]:
    length, last = column.longest_gap
    begin, end = (last - length) / rate, last / rate
    most = f"; at most {length} records in a row ({length / rate:.3g} s), from {begin:.5g} s on"
    if column.missing:
        detail = f"{channel} has {column.missing} records without a number"
        detail += f"{most}; treated as missing samples"
        few = column.missing < _FEW_EMPTY * (column.missing + column.present)
        severity: Severity = "note" if few else "warning"
        yield Finding("empty_cells", severity, detail, column.missing, channel, begin, end)
    if column.not_finite:
        detail = (
            f"{channel} has {column.not_finite} infinities, or figures beyond {LARGEST:g}{most}; "
            "treated as missing samples"
        )
        yield Finding("not_finite", "warning", detail, column.not_finite, channel, begin, end)


def _temperature(column: ColumnSummary) -> Iterator[Finding]:
    if not (0.0 < column.step < math.inf) or column.high - column.low > 2000.0 * column.step:
        return
    detail = (
        f"the temperature has steps of {column.step:.3g} °C, from {column.low:.4g} to "
        f"{column.high:.4g} °C"
    )
    yield Finding("quantised", "note", detail, column.step, TEMPERATURE)


def _values(
    channel: str,
    column: ColumnSummary,
    steps: levels.Quantisation | None,
    rate: float,
    settings: QualitySettings,
) -> Iterator[Finding]:
    """Yield what the values tell by themselves."""
    rounded = "; the figures were rounded after it" if steps is not None and steps.hidden else ""
    if steps is not None and _few_levels(steps, settings):
        detail = (
            f"{channel} has {steps.levels:.0f} levels of {_figure(channel, steps.step)}, fewer "
            f"than {settings.fewest_levels}: its noise is that of the rounding; record "
            f"in more digits or in a finer range{rounded}"
        )
        yield Finding("coarse", "warning", detail, steps.levels, channel)
    elif steps is not None and steps.over_noise > settings.step_over_noise:
        detail = (
            f"{channel} is quantised in steps of {_figure(channel, steps.step)}, "
            f"{steps.over_noise:.2g} of its noise{rounded}"
        )
        yield Finding("quantised", "note", detail, steps.step, channel)
    length, end = column.longest_run
    stuck = length > max(3.0 * levels.longest_by_chance(column), settings.longest_stuck * rate)
    # Midway between two edges of a register, a level stays at one value for as long as it likes.
    if stuck and not _nothing_else(steps, settings):
        detail = f"{channel} stays at one value for {length / rate:.4g} s ({length} samples)"
        yield Finding(
            "stuck_for_a_while",
            "warning",
            detail,
            length / rate,
            channel,
            (end - length) / rate,
            end / rate,
        )
    at_end = levels.saturated(column, steps, settings.saturated)
    if at_end is not None:
        side, number = at_end
        value = column.low if side == "lowest" else column.high
        detail = (
            f"{channel} has {number} samples at its {side} value, {_figure(channel, value)}: it is "
            "saturated; use a wider range"
        )
        yield Finding("saturated", "warning", detail, number, channel)
    heap = None if stuck else levels.piled(column, steps)
    if heap is not None:
        value, share = heap
        detail = (
            f"{100 * share:.2g} % of the samples of {channel} are {_figure(channel, value)}, many "
            "times as many as at the values beside it: lost samples were filled in, or a dead band "
            "holds the output; leave the cells of lost samples empty"
        )
        yield Finding("piled_up", "warning", detail, share, channel)


def _changes(
    channel: str,
    column: ColumnSummary,
    steps: levels.Quantisation | None,
    rate: float,
    settings: QualitySettings,
) -> Iterator[Finding]:
    """Yield what is not the same from beginning to end."""
    blocks = column.blocks()
    moves = stationarity.steps(blocks, settings.step)
    # A level on an edge of a step of a coarse register has a spread of half of it, and its mean
    # moves by up to one.
    step_size = steps.step if steps is not None and _rounding(steps) else 0.0
    for first, last in stationarity.motions(blocks, settings.motion, 0.75 * step_size):
        if any(first - step.window <= step.sample <= last + step.window for step in moves):
            continue  # the step itself
        detail = (
            f"{channel} is shaken from {first / rate:.5g} s to {last / rate:.5g} s; use a part "
            "without it ('use:' beside the log)"
        )
        yield Finding(
            "motion", "warning", detail, (last - first) / rate, channel, first / rate, last / rate
        )
    for step in moves:
        if abs(step.size) < 1.5 * step_size:
            continue
        at = step.sample / rate
        detail = (
            f"the mean of {channel} changes by {_figure(channel, step.size)} at {at:.5g} s "
            f"({step.sigmas:.0f} times its usual changes): the sensor was moved, or its range "
            "or its temperature jumped"
        )
        yield Finding("step", "warning", detail, step.size, channel, at, at)
    warm = stationarity.warm_up(blocks, settings.warm_up)
    if warm is not None and abs(warm.drift) >= 1.5 * step_size:
        than = "a later part not at all"  # in steps so coarse
        if warm.usual > 0.0:
            than = f"{abs(warm.drift) / warm.usual:.0f} times as much as in a later part"
        detail = (
            f"{channel} drifts by {_figure(channel, warm.drift)} in its first "
            f"{warm.end / rate:.5g} s, {than}; leave it out with 'use: {{start: "
            f"{math.ceil(warm.end / rate)}"
            "}' beside the log, or quality.trim_warm_up"
        )
        yield Finding("warm_up", "warning", detail, warm.drift, channel, 0.0, warm.end / rate)
    change = stationarity.variance_change(blocks)
    if change is not None and not _rounding(steps) and change[0] > settings.variance_ratio:
        ratio, first, last = change
        detail = (
            f"the noise of {channel} is {ratio:.3g} times as large from {first / rate:.5g} s to "
            f"{last / rate:.5g} s as where it is calmest: it is not stationary"
        )
        yield Finding(
            "not_stationary", "warning", detail, ratio, channel, first / rate, last / rate
        )


def _rounding(steps: levels.Quantisation | None) -> bool:
    """Tell whether spread and repeats say where the level lies between two steps, and no more."""
    return steps is not None and steps.over_noise > _ROUNDING


def _few_levels(steps: levels.Quantisation | None, settings: QualitySettings) -> bool:
    """Tell whether a channel has so few levels that its noise is that of the rounding."""
    return steps is not None and round(steps.levels) < settings.fewest_levels


def _nothing_else(steps: levels.Quantisation | None, settings: QualitySettings) -> bool:
    """Tell whether a channel has nothing but the rounding: ``coarse`` says all there is to say."""
    return _rounding(steps) and _few_levels(steps, settings)


def _repeated(
    channel: str,
    column: ColumnSummary,
    steps: levels.Quantisation | None,
    settings: QualitySettings,
) -> Iterator[Finding]:
    """Yield whether samples are repeated regularly, or more often than rounding explains."""
    regularly = list(held.held_samples(channel, column))
    yield from regularly
    if regularly or _rounding(steps) or _few_levels(steps, settings):
        return
    beyond, chance = repeats_beyond_chance(column)
    if beyond > settings.repeated:
        share = column.repeats / max(column.present - 1, 1)
        detail = (
            f"{channel} repeats the sample before in {100 * share:.0f} % of the records, of "
            f"which rounding explains {100 * chance:.2g} %: it is read faster than it samples; "
            "state its own rate, and record each sample once"
        )
        yield Finding("repeated_samples", "warning", detail, share, channel)
