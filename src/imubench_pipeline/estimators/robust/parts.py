"""The Allan variance of equal parts of a log, and how much more they differ than they should.

A real sensor is not quite stationary: its noise changes with temperature, supply and time. The
parts of a log then differ by more than the sampling errors of a stationary log. The excess is a
property of the sensor, which a longer log does not remove; it belongs into an interval that is to
hold for the next log.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.allan.octave import OctaveSums
from imubench_pipeline.allan.phase import NO_GAPS, Gaps, Span, list_spans, split
from imubench_pipeline.typing import Array

PARTS = 6
"""Parts whose sums are kept; 2 and 3 of them are joined."""

LONGEST_OF_PARTS = 1 / 15
"""Longest tau at which parts are compared, as a part of the log: 2.5 clusters in a part."""

_DIVISIONS = (2, 3, 6)
_SIGNIFICANCE = 0.95  # Quantile of chi-squared above which an excess counts


@dataclass(frozen=True)
class PartVariances:
    """Allan variances of equal parts of a log at the cluster sizes of its curve."""

    squares: Array  # (PARTS, m): sums of squared differences of cluster means
    terms: Array  # (PARTS, m): number of these differences; 0 where a part is too short

    def select(self, points: NDArray[np.bool_]) -> "PartVariances":
        """Return the variances at the points that a mask, shape (m,), selects."""
        return PartVariances(self.squares[:, points], self.terms[:, points])

    def divide(self, number: int) -> Array:
        """Return the variances of 1, 2, 3 or 6 equal parts, shape (number, m); NaN if unknown."""
        squares, terms = (
            sums.reshape(number, PARTS // number, -1).sum(axis=1)
            for sums in (self.squares, self.terms)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(terms > 0, squares / (2.0 * terms), np.nan)


def compute_part_variances(
    blocks: Iterable[Array],
    curve: AllanCurve,
    *,
    holes: bool,
    gaps: Gaps = NO_GAPS,
    segments: Sequence[Span] | None = None,
) -> PartVariances:
    """Return the Allan variances of equal parts of a log in blocks (see `allan.of_blocks`)."""
    edges = np.linspace(0, curve.samples, PARTS + 1).astype(np.int64)
    spans: list[Span] = []
    owner: list[int] = []
    for part, (begin, end) in enumerate(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)):
        for start, stop in list_spans(segments, curve.samples):
            low, high = max(start, begin), min(stop, end)
            if high - low >= 2:
                spans.append((low, high))
                owner.append(part)
    squares, terms = np.zeros((2, PARTS, len(curve.tau)))
    for number, group in groupby(split(blocks, spans), key=itemgetter(0)):
        low, high = spans[number]
        sums = OctaveSums(curve.cluster_size, high - low, holes=holes, gaps=gaps)
        for _, block in group:
            sums.push(np.asarray(block, np.float64))
        sums.finish()
        total, _, counted, _ = sums.results
        squares[owner[number]] += total
        terms[owner[number]] += counted
    return PartVariances(squares, terms)


def estimate_excess(
    parts: PartVariances, curve: AllanCurve, influence: Array, covariance: Callable[[int], Array]
) -> float:
    """Return the variance of ln(parameter) between parts of a log, without sampling errors.

    ``influence``, shape (m,), are the derivatives of the logarithm of the parameter by the
    logarithms of the variances; ``covariance`` returns, for a number of samples, the covariance of
    the relative variances of a log of this length.
    """
    excesses = []
    for number in _DIVISIONS:
        variances = parts.divide(number)
        there = (variances > 0.0).all(axis=0) & (influence != 0.0)
        there &= curve.cluster_size <= LONGEST_OF_PARTS * curve.samples
        if there.sum() < 2:
            continue
        values = np.log(variances[:, there] / curve.variance[there]) @ influence[there]
        sampling = covariance(curve.samples // number)[np.ix_(there, there)]
        expected = influence[there] @ sampling @ influence[there]
        spread = float(np.var(values, ddof=1))
        least = chi2.ppf(_SIGNIFICANCE, number - 1) / (number - 1)
        excesses.append(spread - expected if spread > least * expected else 0.0)
    return float(np.mean(excesses)) if excesses else 0.0
