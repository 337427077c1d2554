"""The Allan variance: grid of cluster sizes, missing samples and segments.

With theta the cumulative sum of the samples (L + 1 points, starting at 0) the fully
overlapping Allan variance at n samples a cluster is

    sigma^2(n T) = sum_{i=0}^{L-2n} (theta_{i+2n} - 2 theta_{i+n} + theta_i)^2 / (2 n^2 (L-2n+1))

(IEEE Std 952; L - 2n + 1 terms, as in allantools' ``oadev``.)
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from operator import itemgetter
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.allan import octave
from imubench_pipeline.allan.confidence import deviation_limits, equivalent_degrees, noise_exponent
from imubench_pipeline.allan.phase import (
    MIN_PRESENT_SHARE,
    NO_GAPS,
    Gaps,
    Phase,
    Span,
    count_gaps,
    integrate,
    list_spans,
    split,
    sum_all_sizes,
)
from imubench_pipeline.allan.threads import count_threads, read_ahead
from imubench_pipeline.typing import Array

_MAX_UNCERTAIN_CLUSTERS = 100
_MIN_STRIDES_IN_CLUSTER = 2  # for shorter clusters the noise type needs every sample

POWER_LAW = "power law"
FITTED = "fitted spectrum"
"""Sources of the degrees of freedom."""

Edges = Callable[[int], tuple[Array, NDArray[Any] | None, int]]
"""Returns cumulative sums and counts at the edges of adjacent clusters of approximately the given
size, and the actual size."""


@dataclass(frozen=True, repr=False)
class AllanCurve:
    """An Allan variance as a function of tau; the arrays have the shape (m,)."""

    tau: Array  # cluster length, s: ``cluster_size / rate``, with the actual cluster size
    cluster_size: NDArray[np.int64]  # n, samples in a cluster
    variance: Array  # Allan variance in the squared unit of the samples
    edf: Array  # equivalent degrees of freedom of each variance
    samples: int = 0  # L, samples in the log; by default twice the largest cluster
    exponent: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """Noise type: the power of frequency, 2 to -2, in the spectrum of fractional frequency (0:
    white noise of the samples, -1: flicker, -2: random walk). By default 0."""
    averaged: Array = field(default_factory=lambda: np.empty(0))
    """Samples in a cluster, or their harmonic mean if samples are missing. The variance of white
    noise is proportional to 1 / averaged."""
    edf_upper: Array = field(default_factory=lambda: np.empty(0))
    """Degrees of freedom of the upper limit, larger for few clusters. By default ``edf``."""
    edf_source: Sequence[str] = ()  # of the degrees of freedom: `POWER_LAW` or `FITTED`
    share: Array = field(default_factory=lambda: np.empty(0))
    """Share of the differences that are not lost to missing samples. By default 1."""

    def __post_init__(self) -> None:
        if not self.samples:
            object.__setattr__(self, "samples", 2 * int(np.max(self.cluster_size)))
        defaults = {
            "exponent": np.zeros(len(self.tau), dtype=np.int64),
            "averaged": np.asarray(self.cluster_size, dtype=np.float64),
            "edf_upper": self.edf,
            "edf_source": (POWER_LAW,) * len(self.tau),
            "share": np.ones(len(self.tau)),
        }
        for name, default in defaults.items():
            if not len(getattr(self, name)):
                object.__setattr__(self, name, default)  # the class is frozen

    def __repr__(self) -> str:
        span = f", {self.tau[0]:.4g} to {self.tau[-1]:.4g} s" if len(self.tau) else ""
        return f"<{type(self).__name__}: {len(self.tau)} tau{span}, of {self.samples} samples>"

    @property
    def deviation(self) -> Array:
        """Allan deviation in the unit of the samples, shape (m,)."""
        return np.sqrt(self.variance)

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return float(self.cluster_size[0] / self.tau[0])

    def select(self, points: NDArray[np.bool_]) -> "AllanCurve":
        """Return the curve at the points of a mask, shape (m,)."""
        arrays = {name: each for name, each in vars(self).items() if isinstance(each, np.ndarray)}
        columns: dict[str, Any] = {name: each[points] for name, each in arrays.items()}
        sources = [s for s, chosen in zip(self.edf_source, points, strict=True) if chosen]
        return replace(self, **columns, edf_source=sources)

    def limits(self, confidence: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper confidence limits of the deviation, shapes (m,)."""
        return deviation_limits(self.deviation, self.edf, confidence, self.edf_upper)


def cluster_sizes(samples: int, *, per_decade: int = 10, longest: float = 0.5) -> NDArray[np.int64]:
    """Return distinct integer cluster sizes, evenly spaced on a logarithmic scale.

    ``samples`` is the length of the log; ``per_decade`` is the number of sizes per decade (fewer
    where integers are sparse); ``longest`` is the largest size as a share of the length, at most
    1/2.
    """
    largest = int(samples * min(longest, 0.5) * (1 + 1e-12))
    if largest < 1:
        return np.empty(0, dtype=np.int64)
    exponents = np.arange(int(np.log10(largest) * per_decade + 1e-9) + 1) / per_decade
    sizes = np.rint(10.0**exponents).astype(np.int64)
    return np.unique(sizes[sizes <= largest])


def allan_variance(
    samples: ArrayLike,
    rate: float,
    *,
    cluster_sizes: ArrayLike | None = None,
    overlap: Literal["full", "octave"] = "full",
    valid: ArrayLike | None = None,
    segments: Sequence[Span] | None = None,
    threads: int | None = None,
) -> AllanCurve:
    """Return the overlapping Allan variance of a log.

    Parameters
    ----------
    samples : array_like, shape (L,)
        The log on its uniform grid, in rad/s or m/s². NaN marks a missing sample.
    rate : float
        Sampling rate, Hz.
    cluster_sizes : array_like of int, optional
        Samples per cluster, n, of each tau; by default `cluster_sizes` of the length. Sizes without
        a difference are left out.
    overlap : {"full", "octave"}
        Use every cluster; or clusters that start 1/48 of their length apart, or closer, which is as
        accurate and many times faster (sizes are then rounded by up to 1 %).
    valid : array_like of bool, shape (L,), optional
        False where the sample is missing.
    segments : sequence of (int, int), optional
        First and one-past-last sample of each segment; no difference spans two segments.
    threads : int, optional
        By default one for each core. The result has the same bits for any number.

    Raises
    ------
    ValueError
        If an argument is not as above, the segments do not follow one another in the log, or so
        many samples are missing that no size has a difference.

    References
    ----------
    IEEE Std 952-2020; limits: C. Greenhall and W. Riley, "Uncertainty of stability
    variances based on finite differences", PTTI 2003.
    """
    values = np.asarray(samples, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2:
        raise ValueError(f"samples have shape {values.shape}, expected one dimension of size >= 2")
    if overlap not in ("full", "octave"):
        raise ValueError(f"overlap {overlap!r} is not known, expected 'full' or 'octave'")
    if valid is not None:
        mask = np.asarray(valid, dtype=bool)
        if mask.shape != values.shape:
            raise ValueError(f"valid has shape {mask.shape}, expected {values.shape}, as samples")
        values = np.where(mask, values, np.nan)
    present = np.isfinite(values)
    holes, number, cores = not bool(present.all()), len(values), count_threads(threads)
    gaps = count_gaps([values]) if holes else NO_GAPS
    if overlap == "octave":
        curve = of_blocks(
            [values],
            number,
            rate,
            cluster_sizes,
            holes=holes,
            gaps=gaps,
            segments=segments,
            threads=cores,
        )
    else:
        phase = integrate([values], number, holes=holes, segments=segments)
        curve = of_phase(phase, rate, cluster_sizes, gaps=gaps, threads=cores)
    if not len(curve.tau) and holes:
        raise ValueError(
            f"{int(present.sum())} of {number} samples are finite numbers, and no two adjacent "
            f"clusters have {MIN_PRESENT_SHARE:.0%} of the usual number of samples; expected a "
            "log with fewer missing samples"
        )
    return curve


def of_blocks(
    blocks: Iterable[NDArray[np.floating[Any]]],
    samples: int,
    rate: float,
    sizes: ArrayLike | None = None,
    *,
    holes: bool,
    gaps: Gaps = NO_GAPS,
    segments: Sequence[Span] | None = None,
    threads: int = 1,
) -> AllanCurve:
    """Return the multi-octave Allan variance of a log, which is given in blocks, in order, SI.

    One pass; the memory grows with L/64 only. The result has the same bits for any number of
    threads and any blocks. ``samples`` is L, the length of all blocks, and with ``holes`` samples
    may be missing (NaN), as counted in ``gaps``. The sizes are rounded to the stride of their
    octave. The other arguments and the errors are as in `allan_variance`.
    """
    spans = list_spans(segments, samples)
    wanted = octave.round_octave_sizes(_check_arguments(rate, sizes, samples, spans))
    if samples < octave.MIN_DECIMATED_SAMPLES:
        phase = integrate(blocks, samples, holes=holes, segments=spans)
        return of_phase(phase, rate, wanted, gaps=gaps, threads=threads)
    longest: octave.OctaveSums | None = None
    sums: list[NDArray[Any]] = []
    done = 0
    if threads > 1:
        blocks = read_ahead(blocks)
    for number, group in groupby(split(blocks, spans), key=itemgetter(0)):
        start, stop = spans[number]
        part = octave.OctaveSums(wanted, stop - start, holes=holes, gaps=gaps, threads=threads)
        for _, block in group:
            part.push(block if block.dtype == np.float32 else np.asarray(block, np.float64))
        if part.received != stop - start:
            break
        part.finish()
        sums = [a + b for a, b in zip(sums, part.results, strict=True)] if sums else part.results
        if longest is None or part.received > longest.received:
            longest = part
        done += 1
    if longest is None or done < len(spans):
        raise ValueError(f"the blocks end before sample {spans[done][1]}, the end of a segment")

    def edges(n: int) -> tuple[Array, NDArray[Any] | None, int]:
        if n < _MIN_STRIDES_IN_CLUSTER * octave.DECIMATION:
            return *longest.first.every(n), n
        # The noise type is the same at the nearest multiple of the stride.
        step = round(n / octave.DECIMATION)
        return *longest.phase.every(step), step * octave.DECIMATION

    return _make_curve(rate, wanted, samples, spans, sums, edges)


def of_phase(
    phase: Phase,
    rate: float,
    sizes: ArrayLike | None = None,
    *,
    gaps: Gaps = NO_GAPS,
    threads: int = 1,
) -> AllanCurve:
    """Return the fully overlapping Allan variance of cumulative sums (see `allan_variance`)."""
    wanted = _check_arguments(rate, sizes, phase.samples, phase.segments)
    start, stop = max(phase.segments, key=lambda segment: segment[1] - segment[0])

    def edges(n: int) -> tuple[Array, NDArray[Any] | None, int]:
        return *phase.every(n, start, stop), n

    sums = sum_all_sizes(phase, wanted, threads, gaps=gaps)
    return _make_curve(rate, wanted, phase.samples, phase.segments, sums, edges)


def _check_arguments(
    rate: float, sizes: ArrayLike | None, samples: int, segments: Sequence[Span]
) -> NDArray[np.int64]:
    if not rate > 0:
        raise ValueError(f"the rate is {rate} Hz, expected a frequency above 0")
    reached = 0
    for start, stop in segments:
        if not reached <= start < stop <= samples:
            raise ValueError(
                f"segment ({start}, {stop}) is not valid: expected {reached} <= start < stop <= "
                f"{samples}, as segments follow one another in the log"
            )
        reached = stop
    wanted = cluster_sizes(samples) if sizes is None else np.asarray(sizes, dtype=np.int64)
    if wanted.ndim != 1 or (wanted < 1).any():
        raise ValueError("cluster sizes must be whole numbers of 1 or more, of shape (m,)")
    return wanted


def _make_curve(
    rate: float,
    sizes: NDArray[np.int64],
    samples: int,
    segments: Sequence[Span],
    sums: Sequence[NDArray[Any]],
    edges: Edges,
) -> AllanCurve:
    shown = sums[2] > 0
    n = sizes[shown]
    total, thinned, terms, possible = (column[shown] for column in sums)
    exponents: list[int] = []
    degrees: list[float] = []
    before = 0
    for size in n.tolist():
        # With few clusters white noise often looks blue: a bluer type than at the size before is
        # then not accepted. With too few, the type of the size before is taken.
        theta, present, actual = edges(size)
        exponent = noise_exponent(theta, present, actual)
        if exponent is None:
            exponent = before
        elif len(theta) <= _MAX_UNCERTAIN_CLUSTERS:
            exponent = min(exponent, max(before, 0))
        before = exponent
        exponents.append(exponent)
        counts = [stop - start - 2 * size + 1 for start, stop in segments]
        degrees.append(sum(equivalent_degrees(exponent, size, m) for m in counts if m > 0))
    return AllanCurve(
        tau=n / rate,
        cluster_size=n,
        variance=total / (2.0 * terms),
        edf=np.maximum(np.array(degrees) * terms / possible, 1.0),
        exponent=np.array(exponents, dtype=np.int64),
        samples=samples,
        averaged=terms / thinned,
        share=terms / possible,
    )
