"""What channels have in common: samples that are there twice, and noise of two axes.

A channel may be in another one, a stretch of a log further on in it.

So are those of recordings of a sensor that are one log, which lies in its folder twice. Such a copy
counts as another specimen, with no spread between the two. The likelihood of a channel
and its mean are those of its samples: to nine digits they are the same of no other log.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain
from typing import Any

import numpy as np

from imubench_pipeline.model.estimates import FixedBiasRow, ModelRow
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.model.table import ChannelRow
from imubench_pipeline.recordings.quality import levels
from imubench_pipeline.recordings.quality.repeats import WINDOW, Stretch
from imubench_pipeline.recordings.quality.summary import ColumnSummary, Excerpt, together
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array

_FEWEST = 64
"""Increments of a piece that must not be 0."""

_SAME = 1.0 - 1e-6
"""Correlation of the increments of a copy; a vibration that both axes feel needs 1000 times
the noise for it."""

_ROUNDED = 0.999
"""That of a copy that was rounded, if no sample is further off than its rounding."""

_FEW_LEVELS = 64
_LOW_ENTROPY = 4 * WINDOW
"""Changes of a stretch that count where there are few levels. Of a sinusoid in steps of 20 to 100
times its noise, up to 120 changes come again by chance in 600 000 samples; of white noise, random
walks and low-passed noise in steps of 0.01 to 8 sigma not one window of 64 (24 kinds of noise)."""

_TWICE = 0.1
"""Part of the samples that occurred before from which the log is no record of a noise."""


_DIGITS = ".8e"


def copied_channels(columns: Mapping[str, ColumnSummary]) -> Iterator[Finding]:
    """Yield the channels that hold the samples of another one, perhaps in another unit.

    ``columns``: all channels of a recording; no other columns.
    """
    pieces = {
        name: column.excerpts() for name, column in columns.items() if column.low < column.high
    }
    names = list(pieces)
    named: set[str] = set()
    for place, first in enumerate(names):
        for other in names[place + 1 :]:
            factor = _factor(pieces[first], pieces[other])
            if factor is None:
                continue
            for channel, of, times in ((first, other, 1.0 / factor), (other, first, factor)):
                if channel in named:
                    continue
                named.add(channel)
                scaled = "" if abs(times - 1.0) < 1e-6 else f", times {times:.6g} in SI"
                detail = (
                    f"{channel} has the samples of {of}{scaled}: one column is used for both; "
                    "give each channel its own column in the sensor file"
                )
                yield Finding("channel_twice", "warning", detail, times, channel)


def _factor(first: list[Excerpt], other: list[Excerpt]) -> float | None:
    """Return by what the samples of one column are multiplied in the other, or None.

    The pieces vote: a knock, or a shaking that both feel, decides none but its own.
    """
    slopes, alike = [], []
    for x, y, dx, dy in _increments(first, other):
        xx, yy, xy = float(dx @ dx), float(dy @ dy), float(dx @ dy)
        correlation = abs(xy) / (np.sqrt(xx) * np.sqrt(yy))
        slopes.append(xy / xx)
        rounded = correlation > _ROUNDED and _within_rounding(x, y, xy / xx)
        alike.append(correlation > _SAME or rounded)
    if not alike or 2 * sum(alike) <= len(alike):
        return None
    return float(np.median(slopes))


def _increments(
    first: list[Excerpt], other: list[Excerpt]
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield the samples of two columns, and their increments, of pieces in which enough change."""
    for x, y in together(first, other):
        dx, dy = np.diff(x), np.diff(y)
        if min(np.count_nonzero(dx), np.count_nonzero(dy)) >= _FEWEST:
            yield x, y, dx, dy


def _within_rounding(x: Array, y: Array, slope: float) -> bool:
    """Tell whether two columns differ by no more than the steps of both."""
    left = y - slope * x
    steps = _step(y) + abs(slope) * _step(x)
    return bool(np.ptp(left) <= 1.02 * steps)


def _step(values: Array) -> float:
    """Return the least distance of values that differ by more than an error of the arithmetic."""
    gaps = np.diff(np.unique(values))
    return float(np.min(gaps[gaps > 1e-12 * np.abs(values).max()], initial=np.inf))


def repeated_stretches(
    columns: Mapping[str, ColumnSummary],
    steps: Mapping[str, levels.Quantisation | None],
    rate: float,
) -> Iterator[Finding]:
    """Yield the stretches of a log that occurred before in it, bit for bit.

    Parameters
    ----------
    columns : mapping of str to ColumnSummary
        Usable channels of one file.
    steps : mapping of str to Quantisation or None
        Of each of them.
    rate : float
        Hz.
    """
    stretches_of = {name: _significant(column, steps[name]) for name, column in columns.items()}
    lags = {name: {s.lag for s in stretches} for name, stretches in stretches_of.items()}
    channels = Counter(chain.from_iterable(lags.values()))
    # In most channels at once: the records themselves are there twice. A coarse channel may be
    # unable to tell.
    common = {lag for lag, count in channels.items() if 2 * count > len(stretches_of) > 1}
    shared = {lag: next(name for name in lags if lag in lags[name]) for lag in sorted(common)}
    if shared:
        stretches = [
            stretch
            for lag, name in shared.items()
            for stretch in stretches_of[name]
            if stretch.lag == lag
        ]
        yield _repeated(None, stretches, max(c.present for c in columns.values()), rate)
    for name, of_channel in stretches_of.items():
        alone = [stretch for stretch in of_channel if stretch.lag not in common]
        if alone:
            yield _repeated(name, alone, columns[name].present, rate)


def _significant(column: ColumnSummary, steps: levels.Quantisation | None) -> list[Stretch]:
    """Return the stretches that are no accident."""
    few = steps is not None and steps.levels < _FEW_LEVELS
    fewest = _LOW_ENTROPY if few else WINDOW
    return [stretch for stretch in column.repeated.stretches() if stretch.changes >= fewest]


def _repeated(channel: str | None, stretches: list[Stretch], present: int, rate: float) -> Finding:
    longest = max(stretches, key=lambda stretch: stretch.last - stretch.first)
    total = sum(stretch.last - stretch.first for stretch in stretches)
    often = f"{len(stretches)} times; the longest stretch, " if len(stretches) > 1 else ""
    begin, end = longest.first / rate, longest.last / rate
    detail = (
        f"{channel or 'the log'} repeats itself bit for bit: {often}{begin:.5g} s to {end:.5g} s "
        f"is what was from {begin - longest.lag / rate:.5g} s on"
    )
    share = total / present
    if share > _TWICE:
        detail += (
            f"; {100 * share:.0f} % of the log are copies, as of one that was appended to itself; "
            "use the part before them ('use:' beside the log)"
        )
        return Finding("log_twice", "warning", detail, total, channel, begin, end)
    detail += "; find what wrote them twice (a buffer, a paste), or use a part without them"
    return Finding("repeated_stretch", "warning", detail, total, channel, begin, end)


def recorded_twice(
    models: Iterable[ModelRow], biases: Iterable[FixedBiasRow]
) -> Iterator[FindingRow]:
    """Yield the rows of the table ``findings`` about recordings that another one holds, too.

    ``models`` and ``biases``: rows of the tables ``models`` and ``fixed_bias``, in the order of the
    recordings. The first of several copies is taken for the log.
    """
    means = {_place(row): row.value for row in biases}
    first: dict[tuple[Any, ...], str] = {}
    copies: dict[tuple[str, str], dict[str, list[str]]] = {}
    for row in models:
        mean = means.get(_place(row))
        if not row.chosen or mean is None:
            continue
        samples = format(row.log_likelihood, _DIGITS), format(mean, _DIGITS)
        sensor, recording, channel = _place(row)
        of = first.setdefault((sensor, channel, *samples), recording)
        if of != recording:
            copies.setdefault((sensor, recording), {}).setdefault(of, []).append(channel)
    for (sensor, recording), originals in copies.items():
        for of, channels in originals.items():
            detail = (
                f"{recording} has the samples of {of} ({', '.join(channels)}): one log lies in the "
                "folder of the sensor twice, and would count as two; remove one of them"
            )
            finding = Finding("recording_twice", "warning", detail, float(len(channels)))
            yield finding.row(sensor, recording)


def _place(row: ChannelRow) -> tuple[str, str, str]:
    return row.sensor, row.recording, row.channel


# ---------------------------------------------------------------------------------- noise in common

_SHARED = 0.45
"""Correlation from which it is told. Two axes of which each has as much noise of its own as in
common reach 0.5, an axis and the sum of three 0.58; the accelerometers of an ADIS16405 have 0.36
between y and z, other sensors at rest below 0.03."""

_SURE = 4.0
"""Standard errors by which it must be above."""


def shared_noise(columns: Mapping[str, ColumnSummary]) -> Iterator[Finding]:
    """Yield the axes of a gyro or an accelerometer whose increments follow those of another one.

    Increments leave out what is slow, such as a temperature that all axes follow.

    ``columns``: usable channels of one file.
    """
    pieces = {name: column.excerpts() for name, column in columns.items()}
    strongest: dict[str, tuple[float, str]] = {}
    for first, other in itertools.combinations(pieces, 2):
        if first.partition("_")[0] != other.partition("_")[0]:
            continue
        correlation, error = _correlation(pieces[first], pieces[other])
        if abs(correlation) < _SHARED + _SURE * error:
            continue
        for channel, beside in ((first, other), (other, first)):
            if abs(correlation) > abs(strongest.get(channel, (0.0, ""))[0]):
                strongest[channel] = (correlation, beside)
    for channel, (correlation, beside) in strongest.items():
        detail = (
            f"the noise of {channel} is correlated with that of {beside}, by {correlation:.2f}: it "
            "is of a vibration, of the supply, or of a column that was computed from several "
            "axes; axes are fused and pooled as independent"
        )
        yield Finding("shared_noise", "warning", detail, correlation, channel)


def _correlation(first: list[Excerpt], other: list[Excerpt]) -> tuple[float, float]:
    """Return the correlation of the increments, a median over pieces, and its standard error.

    Of noise whose autocorrelations are a_k and b_k it is sqrt(sum a_k b_k / n) (M. S. Bartlett,
    "Some Aspects of the Time-Correlation Problem", J. R. Stat. Soc. 98, 1935); a median of pieces
    has 1.25 times that of their mean.
    """
    correlations, variances = [], []
    for _, _, dx, dy in _increments(first, other):
        dx, dy = dx / math.sqrt(dx @ dx), dy / math.sqrt(dy @ dy)
        correlations.append(float(dx @ dy))
        variances.append(float(_autocorrelation(dx) @ _autocorrelation(dy)) / len(dx))
    if not correlations:
        return 0.0, math.inf
    error = math.sqrt(sum(variances)) / len(variances)
    return float(np.median(correlations)), 1.25 * error if len(variances) > 1 else error


def _autocorrelation(values: Array) -> Array:
    """Return that of all lags, both signs, for values of which the sum of squares is 1."""
    return np.fft.irfft(np.abs(np.fft.rfft(values, 2 * len(values))) ** 2)
