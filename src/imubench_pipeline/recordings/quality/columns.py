"""Check each column of a recording; return findings with a severity and a time.

Tests of stationarity use block means and standard deviations. Random walk and flicker noise are no
findings: a step must be far larger than the others, and a first drift far above any later one.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.model.states import Severity
from imubench_pipeline.recordings.quality import copies, joined, levels, summary
from imubench_pipeline.recordings.quality.copies import find_shared_noise
from imubench_pipeline.recordings.quality.rest import find_motion
from imubench_pipeline.recordings.quality.summary import (
    BlockStatistics,
    compute_finite_median,
    compute_finite_medians,
)
from imubench_pipeline.recordings.recording import BESIDE
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import TEMPERATURE, quantity_of
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.words.findings import samples

_COUNT_SIGMAS = 4.0  # upper confidence bound of a count, in standard errors
_MIN_DIFFERENCE_SD, _MAX_DIFFERENCE_SD = 0.6, 300.0
"""Range of the standard deviation of the difference between neighbours, in steps of the register,
that the share of one-step changes determines. Below it all changes are by one step, and the share
depends on the position of the mean between two steps."""

_MAX_HARMLESS_EMPTY_SHARE = 0.01  # empty cells of a channel that are only noted
_MIN_STEP_WHERE_ROUNDING_DOMINATES = 1.5
"""Step over the standard deviation, with rounding, from which N is more than 10 % too large. The
number of levels, which a drift increases, does not matter."""


def estimate_excess_repeats(column: summary.ColumnSummary) -> tuple[float, float]:
    """Return the shares of samples that repeat beyond chance, and of pairs that repeat by chance.

    A register that is read faster than it is updated repeats samples. Between the repeats it
    changes like independent samples. Samples also repeat by chance; the larger of two estimates of
    this share is removed. For coarse steps, it is the share of samples that equal the sample
    `summary.FAR_LAG` before. For low-passed noise, it is the share of repeats in rounded normal
    noise whose changes are of one step equally often.
    """
    pairs, far_pairs = column.pairs, column.far_pairs
    if pairs == 0 or far_pairs == 0:
        return 0.0, 0.0
    share = column.repeats / pairs
    shuffled = column.far_repeats / far_pairs
    shuffled += _COUNT_SIGMAS * math.sqrt(shuffled * (1.0 - shuffled) / far_pairs)
    chance = min(max(shuffled, _estimate_rounded_repeats(column.single_steps, column.steps)), 1.0)
    if share <= chance:
        return 0.0, chance
    beyond = (share - chance) / (1.0 - chance)
    return beyond * pairs / max(column.present - 1, 1), chance


def _estimate_rounded_repeats(single: int, steps: int) -> float:
    """Return the share of repeats in rounded normal noise with this share of one-step changes."""
    if steps == 0:
        return 1.0
    part = single / steps
    part += _COUNT_SIGMAS * math.sqrt((part * (1.0 - part) + 1.0 / steps) / steps)
    low, high = _MIN_DIFFERENCE_SD, _MAX_DIFFERENCE_SD
    if part >= _expect_rounded_changes(low)[1]:
        return 1.0
    for _ in range(50):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _expect_rounded_changes(middle)[1] > part else (low, middle)
    return _expect_rounded_changes(low)[0]


def _expect_rounded_changes(deviation: float) -> tuple[float, float]:
    """Return the expected share of equal neighbours, and of one-step changes among the changes.

    The difference d of two neighbours is normal, with the ``deviation`` in steps. Rounded with a
    uniform phase it becomes k steps with probability 1 - |d - k|. With G(x) = E[(d - x)⁺] the
    expected share of differences of k steps is G(k - 1) - 2 G(k) + G(k + 1).
    """
    below, none, single, two = (_expect_excess(x, deviation) for x in (-1.0, 0.0, 1.0, 2.0))
    equal = below - 2.0 * none + single
    return equal, 2.0 * (none - 2.0 * single + two) / (1.0 - equal)


def _expect_excess(x: float, deviation: float) -> float:
    """Return E[(d - x)⁺] of a normal d with mean 0 and this standard deviation."""
    z = x / deviation
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return deviation * density - 0.5 * x * math.erfc(z / math.sqrt(2.0))


_MAX_PERIOD = 256  # longest period of repeats that is tested, records
_MAX_PIECES = 8  # pieces that are tested; each is tested for every period
_MIN_REPEATS_OF_PHASE = 0.98  # least share of repeats in the fullest phase of a period
_MAX_REPEATS_OF_OTHERS = 0.9  # largest share of repeats in any other phase
_MAX_LOG10_CHANCE = -12.0  # of the probability that the repeats are random


@dataclass(frozen=True)
class Held:
    """Samples that repeat periodically."""

    every: int  # period, records
    share: float  # share of repeats among the other samples


def find_regular_repeats(pieces: list[summary.Excerpt]) -> Held | None:
    """Return the period at which samples repeat their predecessor; None if there is none."""
    whole = [piece.values for piece in pieces if len(piece.values) >= summary.PIECE_SIZE // 4]
    whole = whole[:: max(1, len(whole) // _MAX_PIECES)][:_MAX_PIECES]
    periods = np.arange(3, _MAX_PERIOD + 1)
    regular: list[Held] = []
    for values in whole:
        repeats, records = np.flatnonzero(values[1:] == values[:-1]), len(values) - 1
        # The repeats in the fullest and the second fullest phase of each period
        phases = (np.bincount(repeats % every, minlength=every) for every in periods)
        second, most = np.array([np.partition(phase, -2)[-2:] for phase in phases]).T
        turns = records // periods
        share = (len(repeats) - most) / (records - turns)
        # Corrected for the number of phases and periods that are tested.
        chance = most * np.log10(share + 1.0 / records) + np.log10(periods * _MAX_PERIOD)
        is_regular = (
            (most >= _MIN_REPEATS_OF_PHASE * turns)
            & (second <= _MAX_REPEATS_OF_OTHERS * turns)
            & (chance < _MAX_LOG10_CHANCE)
        )
        if is_regular.any():
            first = int(np.argmax(is_regular))
            regular.append(Held(int(periods[first]), float(share[first])))
    if not regular or 2 * len(regular) <= len(whole):
        return None
    every = int(np.median([of_piece.every for of_piece in regular]))
    return Held(every, float(np.median([of_piece.share for of_piece in regular])))


def check_columns(
    columns: Mapping[str, summary.ColumnSummary],
    rate: float,
    settings: QualitySettings,
    *,
    static: bool = True,
) -> list[Finding]:
    """Return the findings about the columns of one file; an unusable channel is fatal.

    ``rate``: Hz. ``static``: whether the sensor was at rest; if not, changes are not reported.
    """
    findings: list[Finding] = []
    usable: dict[str, summary.ColumnSummary] = {}
    for channel, column in columns.items():
        span = column.high - column.low
        if channel == TEMPERATURE and 0.0 < column.step < math.inf and span <= 2000.0 * column.step:
            data = samples.Quantised(column.step, None, column.low, column.high)
            findings.append(find(data, "note", column.step, TEMPERATURE))
        if channel in BESIDE:
            continue
        fatal = _find_unusable(channel, column, settings)
        findings += [fatal] if fatal else []
        length, last = column.longest_gap
        begin, end = (last - length) / rate, last / rate
        if column.missing:
            few = column.missing < _MAX_HARMLESS_EMPTY_SHARE * (column.missing + column.present)
            severity: Severity = "note" if few else "warning"
            empty = samples.EmptyCells(column.missing, length, length / rate, begin)
            findings.append(find(empty, severity, column.missing, channel, begin, end))
        if column.not_finite:
            number = column.not_finite
            infinite = samples.NotFinite(
                number, summary.MAX_MEASUREMENT, length, length / rate, begin
            )
            findings.append(find(infinite, "warning", number, channel, begin, end))
        if fatal is None:
            usable[channel] = column
    steps = {channel: levels.detect_quantisation(column) for channel, column in usable.items()}
    for channel, column in usable.items():
        findings += _find_bad_values(channel, column, steps[channel], rate, settings)
        if static:
            findings += _find_changes(channel, column, steps[channel], rate, settings)
            if not _is_rounding_dominant(steps[channel]):
                findings += joined.find_joined_logs(channel, column, rate)
                findings += joined.find_interleaved_samples(channel, column)
        held = None
        if column.repeats >= column.present / (2 * _MAX_PERIOD):
            held = find_regular_repeats(column.excerpts())
        if held is not None:
            periodic = samples.HeldSamples(held.every, held.share)
            findings.append(find(periodic, "warning", held.every, channel))
        rounded = _is_rounding_dominant(steps[channel])
        beyond, chance = estimate_excess_repeats(column)
        if beyond > settings.repeated and not (held or rounded):
            share = column.repeats / max(column.present - 1, 1)
            findings.append(find(samples.RepeatedSamples(share, chance), "warning", share, channel))
    findings += copies.find_repeated_stretches(usable, steps, rate)
    if static:
        findings += find_shared_noise(usable)
    return findings


def _find_unusable(
    channel: str, column: summary.ColumnSummary, settings: QualitySettings
) -> Finding | None:
    if column.present == 0:
        return find(samples.NoSamples(), "fatal", 0, channel)
    if column.present < settings.shortest:
        data = samples.TooShort(column.present, settings.shortest)
        return find(data, "fatal", column.present, channel)
    if column.low == column.high:
        return find(samples.Stuck(column.low, column.present), "fatal", column.low, channel)
    return None


def _find_bad_values(
    channel: str,
    column: summary.ColumnSummary,
    steps: levels.Quantisation | None,
    rate: float,
    settings: QualitySettings,
) -> Iterator[Finding]:
    over_noise = steps.over_noise if steps and math.isfinite(steps.over_noise) else None
    if steps is not None and _is_rounding_dominant(steps):
        coarse = samples.Coarse(steps.levels, steps.step, over_noise, steps.hidden)
        yield find(coarse, "warning", steps.levels, channel)
    elif steps is not None and steps.over_noise > settings.step_over_noise:
        quantised = samples.Quantised(steps.step, over_noise, is_rounded=steps.hidden)
        yield find(quantised, "note", steps.step, channel)
        if levels.is_truncated(column, steps.step):
            yield find(samples.Truncated(steps.step), "warning", steps.step, channel)
    length, end = column.longest_run
    stuck = length > max(
        3.0 * levels.compute_longest_chance_run(column), settings.longest_stuck * rate
    )
    # A level midway between two edges of a register can stay at one value for any time.
    if stuck and not _is_rounding_dominant(steps):
        seconds, start = length / rate, (end - length) / rate
        constant = samples.StuckForAWhile(seconds, length)
        yield find(constant, "warning", seconds, channel, start, end / rate)
    at_end = levels.find_saturation(column, steps, settings.saturated)
    if at_end is not None:
        side, number = at_end
        value = column.low if side == "lowest" else column.high
        yield find(samples.Saturated(number, value, side), "warning", number, channel)
    heap = None if stuck else levels.find_piled_value(column, steps)
    if heap is not None:
        value, share = heap
        yield find(samples.PiledUp(share, value), "warning", share, channel)


def _find_changes(
    channel: str,
    column: summary.ColumnSummary,
    steps: levels.Quantisation | None,
    rate: float,
    settings: QualitySettings,
) -> Iterator[Finding]:
    blocks = column.blocks()
    moves = find_steps(blocks, settings.step)
    # On the edge between two values of a coarse register the spread is half a step, and the mean
    # of a block moves by up to one step.
    step_size = steps.step if steps is not None and _is_rounding_dominant(steps) else 0.0
    moved = find_motion(column, quantity_of(channel), rate, settings.motion, 0.75 * step_size)
    spans = []
    for first, last in moved:
        near = (first - step.window <= step.sample <= last + step.window for step in moves)
        if last - first <= _MAX_BLOCKS_OF_STEP * blocks.size and any(near):
            continue  # the spread is large because of the step
        begin, end, length = first / rate, last / rate, (last - first) / rate
        yield find(samples.Motion(begin, end), "warning", length, channel, begin, end)
        spans.append((first - blocks.size, last + blocks.size))
    for step in moves:
        in_motion = any(first <= step.sample <= last for first, last in spans)
        if in_motion or abs(step.size) < 1.5 * step_size:
            continue
        at = step.sample / rate
        yield find(samples.Step(step.size, at, step.sigmas), "warning", step.size, channel, at, at)
    if spans:  # which explain drifts and changes of the noise
        return
    warm = find_warm_up(blocks, settings.warm_up)
    if warm is not None and abs(warm.drift) >= 1.5 * step_size:
        # Behind a coarse register the usual drift may be 0.
        usual = abs(warm.drift) / warm.usual if warm.usual > 0.0 else None
        data = samples.WarmUp(warm.drift, warm.end / rate, usual)
        yield find(data, "warning", warm.drift, channel, 0.0, warm.end / rate)
    change = find_variance_change(blocks)
    if change is None or _is_rounding_dominant(steps):
        return
    ratio, begin, end = change[0], change[1] / rate, change[2] / rate
    if ratio > settings.variance_ratio:
        yield find(samples.NotStationary(ratio, begin, end), "warning", ratio, channel, begin, end)


def _is_rounding_dominant(steps: levels.Quantisation | None) -> bool:
    """Return whether rounding determines the noise; then the finding ``coarse`` suffices."""
    return steps is not None and steps.over_noise > _MIN_STEP_WHERE_ROUNDING_DOMINATES


_NUMBER_OF_PARTS = 20
_MIN_BLOCKS_PER_PART = 8  # least number of blocks in a part; a shorter recording is not tested
_MAX_BLOCKS_OF_STEP = 3  # in which a step makes the spread large
_SD_OVER_MAD = 1.4826  # standard deviation over the median absolute deviation, of normal noise


@dataclass(frozen=True)
class Step:
    """A sudden change of the mean."""

    sample: int  # record of the step, to half a window
    size: float  # SI
    sigmas: float  # size over the robust standard deviation of all steps
    window: int  # records of a window


@dataclass(frozen=True)
class WarmUp:
    """A drift at the beginning of a log that is larger than any later one."""

    end: int  # record from which the drift is as small as later
    drift: float  # change of the mean during the warm-up, SI
    usual: float  # median change over a later part, SI


def find_steps(blocks: BlockStatistics, sigmas: float) -> list[Step]:
    """Return the sudden changes of the mean above ``sigmas`` robust standard deviations."""
    size = max(1, len(blocks.mean) // 400)
    # Medians are robust to knocks. The means of blocks with few samples scatter too much.
    mean = np.where(2 * blocks.count >= blocks.size, blocks.mean, np.nan)
    grouped = mean[: len(mean) // size * size].reshape(-1, size)
    means = compute_finite_medians(grouped)
    if len(means) < 16:
        return []
    # Difference over two windows, so that a step inside a window counts in full.
    away = means[2:] - means[:-2]
    scale = _SD_OVER_MAD * compute_finite_median(np.abs(away - compute_finite_median(away)))
    if not scale > 0.0:
        return []
    far = np.flatnonzero(np.abs(away) > sigmas * scale)
    if len(far) == 0:
        return []
    moves = []
    for group in np.split(far, np.flatnonzero(np.diff(far) > 3) + 1):
        peak = group[np.argmax(np.abs(away[group]))]
        # A step lasts; a change that reverses at once is a knock.
        before = compute_finite_median(means[max(0, group[0] - 4) : group[0] + 1])
        after = compute_finite_median(means[group[-1] + 2 : group[-1] + 7])
        change = after - before
        if abs(change) > 0.5 * abs(float(away[peak])):
            sample = (int(peak) + 1) * size * blocks.size + size * blocks.size // 2
            moves.append(Step(sample, change, abs(float(away[peak])) / scale, size * blocks.size))
    return moves


def find_warm_up(blocks: BlockStatistics, times: float) -> WarmUp | None:
    """Return the drift at the beginning if above ``times`` the median drift of later parts."""
    size = len(blocks.mean) // _NUMBER_OF_PARTS
    if size < _MIN_BLOCKS_PER_PART:
        return None
    drifts = np.empty(_NUMBER_OF_PARTS)
    for k in range(_NUMBER_OF_PARTS):
        part = blocks.mean[k * size : (k + 1) * size]
        third = size // 3
        drifts[k] = compute_finite_median(part[-third:]) - compute_finite_median(part[:third])
    rest = np.abs(drifts[_NUMBER_OF_PARTS // 2 :])
    usual, first = compute_finite_median(rest), float(drifts[0])
    most = float(np.max(rest[np.isfinite(rest)], initial=0.0))
    # Later parts of a coarse register may not drift at all; then there is no reference.
    if not (usual > 0.0 and abs(first) > times * usual and abs(first) > 2.0 * most):
        return None
    calm = np.flatnonzero(np.abs(drifts) < 3.0 * usual)
    end = int(calm[0]) if len(calm) else _NUMBER_OF_PARTS
    drift = float(np.nansum(drifts[:end]))
    return WarmUp(end * size * blocks.size, drift, usual)


def find_variance_change(blocks: BlockStatistics) -> tuple[float, int, int] | None:
    """Return the noise ratio of the noisiest and calmest parts, and the records of the noisiest."""
    size = len(blocks.spread) // _NUMBER_OF_PARTS
    if size < _MIN_BLOCKS_PER_PART:
        return None
    parts = blocks.spread[: size * _NUMBER_OF_PARTS].reshape(_NUMBER_OF_PARTS, size)
    spreads = compute_finite_medians(parts)
    calm = float(np.min(spreads[spreads > 0.0], initial=np.inf))
    noisy = int(np.argmax(np.nan_to_num(spreads)))
    if not np.isfinite(calm):
        return None
    records = size * blocks.size
    return float(spreads[noisy]) / calm, noisy * records, (noisy + 1) * records
