"""Find copied samples, copied recordings, and noise that two axes share.

A copy of a recording would count as another unit, with no spread between the two. It is found by
the log-likelihood and the mean of each channel: no two logs agree in nine digits of both.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, combinations
from typing import Any

import numpy as np

from imubench_pipeline.model.estimates import FixedBiasRow, ModelRow
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.recordings.quality import levels
from imubench_pipeline.recordings.quality.repeats import WINDOW, Stretch
from imubench_pipeline.recordings.quality.summary import ColumnSummary, Excerpt, pair_common_samples
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings import samples as words
from imubench_pipeline.words.findings.base import FindingData

_MIN_NONZERO_INCREMENTS = 64  # least number of increments of a piece that are not 0
_MIN_COPY_CORRELATION = 1.0 - 1e-6
"""Least correlation of the increments of a copy. A vibration that both axes measure reaches it only
if it is 1000 times the noise."""

_MIN_ROUNDED_COPY_CORRELATION = 0.999  # if no sample differs by more than rounding
_MAX_LEVELS_LOW_ENTROPY = 64
_MIN_CHANGES_LOW_ENTROPY = 4 * WINDOW
"""Least changes of value in a repeated stretch of a column with few levels. A sinusoid in steps of
20 to 100 times its noise repeats up to 120 changes by chance in 600 000 samples. White noise,
random walks and low-passed noise in steps of 0.01 to 8 sigma repeat no window of 64 (24 kinds of
noise)."""

_MIN_SHARE_LOG_TWICE = 0.1  # repeated samples for which the whole log is copied

_FINGERPRINT_FORMAT = ".8e"  # nine digits, to find copies of a log


def find_copied_channels(columns: Mapping[str, ColumnSummary]) -> Iterator[Finding]:
    """Yield a finding for each channel with the samples of another one, in any unit."""
    pieces = {
        name: column.excerpts() for name, column in columns.items() if column.low < column.high
    }
    named: set[str] = set()
    for first, other in combinations(pieces, 2):
        slopes, alike = [], []
        for x, y, dx, dy in _pair_increments(pieces[first], pieces[other]):
            xx, yy, xy = float(dx @ dx), float(dy @ dy), float(dx @ dy)
            correlation = abs(xy) / (np.sqrt(xx) * np.sqrt(yy))
            slopes.append(xy / xx)
            copied = correlation > _MIN_COPY_CORRELATION
            if not copied and correlation > _MIN_ROUNDED_COPY_CORRELATION:
                # The columns differ by no more than the steps of both.
                steps = _find_step(y) + abs(slopes[-1]) * _find_step(x)
                copied = np.ptp(y - slopes[-1] * x) <= 1.02 * steps
            alike.append(bool(copied))
        if 2 * sum(alike) <= len(alike):
            continue
        factor = float(np.median(slopes))
        for channel, of, times in ((first, other, 1.0 / factor), (other, first, factor)):
            if channel not in named:
                named.add(channel)
                yield find(words.ChannelTwice(of, times), "warning", times, channel)


def _pair_increments(
    first: list[Excerpt], other: list[Excerpt]
) -> Iterator[tuple[Array, Array, Array, Array]]:
    """Yield samples and increments of two columns, for pieces with enough nonzero increments."""
    for x, y in pair_common_samples(first, other):
        dx, dy = np.diff(x), np.diff(y)
        if min(np.count_nonzero(dx), np.count_nonzero(dy)) >= _MIN_NONZERO_INCREMENTS:
            yield x, y, dx, dy


def _find_step(values: Array) -> float:
    """Return the least difference between values, beyond rounding errors of the arithmetic."""
    gaps = np.diff(np.unique(values))
    return float(np.min(gaps[gaps > 1e-12 * np.abs(values).max()], initial=np.inf))


def find_repeated_stretches(
    columns: Mapping[str, ColumnSummary],
    steps: Mapping[str, levels.Quantisation | None],
    rate: float,
) -> Iterator[Finding]:
    """Yield findings about stretches of usable channels that repeat an earlier one bit for bit."""
    stretches_of = {}
    for name, column in columns.items():
        quantisation = steps[name]
        few = quantisation is not None and quantisation.levels < _MAX_LEVELS_LOW_ENTROPY
        fewest = _MIN_CHANGES_LOW_ENTROPY if few else WINDOW  # fewer may repeat by chance
        stretches_of[name] = [s for s in column.repeated.stretches() if s.changes >= fewest]
    lags = {name: {s.lag for s in stretches} for name, stretches in stretches_of.items()}
    channels = Counter(chain.from_iterable(lags.values()))
    # A lag that most channels have: whole records are copied. Not all channels need to show it,
    # since a coarse one may have too few changes.
    common = {lag for lag, count in channels.items() if 2 * count > len(stretches_of) > 1}
    shared = {lag: next(name for name in lags if lag in lags[name]) for lag in sorted(common)}
    if shared:
        stretches = [s for lag, name in shared.items() for s in stretches_of[name] if s.lag == lag]
        yield _describe_repeats(None, stretches, max(c.present for c in columns.values()), rate)
    for name, of_channel in stretches_of.items():
        alone = [stretch for stretch in of_channel if stretch.lag not in common]
        if alone:
            yield _describe_repeats(name, alone, columns[name].present, rate)


def _describe_repeats(
    channel: str | None, stretches: list[Stretch], present: int, rate: float
) -> Finding:
    longest = max(stretches, key=lambda stretch: stretch.last - stretch.first)
    total = sum(stretch.last - stretch.first for stretch in stretches)
    begin, end = longest.first / rate, longest.last / rate
    original = begin - longest.lag / rate
    share = total / present
    data: FindingData = words.RepeatedStretch(begin, end, original, len(stretches))
    if share > _MIN_SHARE_LOG_TWICE:
        data = words.LogTwice(begin, end, original, len(stretches), share)
    return find(data, "warning", total, channel, begin, end)


def find_copied_recordings(
    models: Iterable[ModelRow], biases: Iterable[FixedBiasRow]
) -> Iterator[FindingRow]:
    """Yield findings about recordings that are copies of an earlier one of their sensor."""
    means = {(row.sensor, row.recording, row.channel): row.value for row in biases}
    first: dict[tuple[Any, ...], str] = {}
    copies: dict[tuple[str, str], dict[str, list[str]]] = {}
    for row in models:
        mean = means.get((row.sensor, row.recording, row.channel))
        if not row.chosen or mean is None:
            continue
        samples = tuple(
            format(figure, _FINGERPRINT_FORMAT) for figure in (row.log_likelihood, mean)
        )
        sensor, recording, channel = row.sensor, row.recording, row.channel
        of = first.setdefault((sensor, channel, *samples), recording)
        if of != recording:
            copies.setdefault((sensor, recording), {}).setdefault(of, []).append(channel)
    for (sensor, recording), originals in copies.items():
        for of, channels in originals.items():
            data = words.RecordingTwice(recording, of, tuple(channels))
            yield find(data, "warning", float(len(channels))).row(sensor, recording)


_MIN_SHARED_CORRELATION = 0.45
"""Least correlation that is reported. Two axes with as much noise of their own as in common reach
0.5, an axis and the sum of three 0.58. The accelerometers of an ADIS16405 have 0.36 between y and
z, other sensors at rest below 0.03."""

_CORRELATION_SIGMAS = 4.0  # standard errors above `_MIN_SHARED_CORRELATION`


def find_shared_noise(columns: Mapping[str, ColumnSummary]) -> Iterator[Finding]:
    """Yield findings about usable axes of one sensor with correlated increments.

    Increments suppress slow signals, such as a temperature effect on all axes. For n samples of
    noise with the autocorrelations a_k and b_k, the standard error of the correlation is
    sqrt(sum a_k b_k / n) (M. S. Bartlett, "Some Aspects of the Time-Correlation Problem", J. R.
    Stat. Soc. 98, 1935).
    """
    pieces = {name: column.excerpts() for name, column in columns.items()}
    strongest: dict[str, tuple[float, str]] = {}
    for first, other in combinations(pieces, 2):
        if first.partition("_")[0] != other.partition("_")[0]:
            continue
        correlations, variances = [], []
        for _, _, dx, dy in _pair_increments(pieces[first], pieces[other]):
            dx, dy = dx / math.sqrt(dx @ dx), dy / math.sqrt(dy @ dy)
            correlations.append(float(dx @ dy))
            variances.append(float(_autocorrelate(dx) @ _autocorrelate(dy)) / len(dx))
        if not correlations:
            continue
        correlation = float(np.median(correlations))
        error = math.sqrt(sum(variances)) / len(variances)
        if len(variances) > 1:  # the standard error of a median is 1.25 times that of a mean
            error *= 1.25
        if abs(correlation) < _MIN_SHARED_CORRELATION + _CORRELATION_SIGMAS * error:
            continue
        for channel, beside in ((first, other), (other, first)):
            if abs(correlation) > abs(strongest.get(channel, (0.0, ""))[0]):
                strongest[channel] = (correlation, beside)
    for channel, (correlation, beside) in strongest.items():
        yield find(words.SharedNoise(beside, correlation), "warning", correlation, channel)


def _autocorrelate(values: Array) -> Array:
    """Return the autocorrelation at all lags of both signs; the squares of the values sum to 1."""
    return np.fft.irfft(np.abs(np.fft.rfft(values, 2 * len(values))) ** 2)
