"""Noise that two axes have in common, where all else takes axes as independent."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import numpy as np

from imubench_pipeline.recordings.quality.excerpts import Excerpt, together
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array

_SHARED = 0.45
"""Correlation from which it is told. Two axes of which each has as much noise of its own as in
common reach 0.5, an axis and the sum of three 0.58; the accelerometers of an ADIS16405 have 0.36
between y and z, other sensors at rest below 0.03."""

_SURE = 4.0
"""Standard errors by which it must be above."""

_FEWEST = 64
"""Increments of a piece that must not be 0."""


def shared_noise(columns: Mapping[str, ColumnSummary]) -> Iterator[Finding]:
    """Yield the axes of a gyro or an accelerometer whose increments follow those of another one.

    Increments leave out what is slow, such as a temperature that all axes follow.

    Parameters
    ----------
    columns : mapping of str to ColumnSummary
        Usable channels of one file.
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
    for x, y in together(first, other):
        dx, dy = np.diff(x), np.diff(y)
        if min(np.count_nonzero(dx), np.count_nonzero(dy)) < _FEWEST:
            continue
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
