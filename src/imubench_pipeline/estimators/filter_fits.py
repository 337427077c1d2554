"""Whittle fits of a spectrum behind filters: which cut-off, how good, and what N before it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import SIGMAS
from imubench_pipeline.estimators.goodness import goodness
from imubench_pipeline.estimators.low_pass import BOXCAR_CUTOFF_LENGTH, Filter, Frequencies, Kind
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import COARSE, Behind, Terms, Whittle, whittle_of
from imubench_pipeline.estimators.whittle_kernels import TOLERANCE, best_powers
from imubench_pipeline.typing import Array

_POINTS = 6
"""Frequencies of a bin over which a density is averaged."""

_SCAN, _COARSE_SCAN = 24, 8
"""Cut-offs tried before the best is polished, and to see whether a filter may be there."""

_WHOLE = 20
"""Samples up to which each mean of a whole number of them is tried: near its nulls another length
is far off."""

_LOWEST = 1 / 500

_HIGHEST: Mapping[tuple[Kind, int], float] = {
    ("analogue", 1): 4.0,
    ("analogue", 2): 1.0,
    ("analogue", 3): 1.0,
    ("analogue", 4): 1.0,
    ("bilinear", 1): 0.42,
    ("bilinear", 2): 0.42,
    ("bilinear", 3): 0.42,
    ("bilinear", 4): 0.42,
    ("boxcar", 1): 0.222,
}
"""Filters that are looked for, and their highest cut-off, parts of the rate; the lowest is 1/500.
An analogue filter of higher order is there to keep noise from folding, and beyond the rate its
folds are those of a lower one of first order; the shortest mean is one of two samples."""

FAMILY: Sequence[tuple[Kind, int]] = tuple(_HIGHEST)
"""Kind and order of the filters that are tried."""

_CORRELATIONS = (1e2, 1e5)
"""Shortest and longest correlation time of slow noise, sampling intervals."""

_SLOWER = 4.0
"""Least correlation time of slow noise over that of the filter, 1 / (2 pi f_c)."""

_FILTERS, PROCESSES = 2.0, 10.0
"""Correlation in sampling intervals, 1 / (2 pi f_c T), below which white noise beside it is taken
for that behind a filter of first order, and above which it is beside a process."""

_A_DECADE = 6
"""Correlation times that are tried."""

_SAME = 0.01

_WORTH_TRYING = 1.0
"""Log likelihood that a filter of the coarse scan must gain for more to be tried."""

_MOST_SLOW = 4
"""Terms of slow noise."""

UNFOLDED = 0.3
"""Part of the rate up to which there is one such cut-off only: little is folded."""

_BETWEEN = 24
"""Cut-offs tried on each side, beyond that, for others that the log allows as well."""

HALF_CHI_SQUARED = 1.9207
"""Log likelihood below its maximum at the ends of a 95 % interval."""

_ALONE = (("N", 0), ("NK", 0), ("NFK", 0), ("NK", 1), ("NFK", 1), ("NK", 2))
"""Letters and processes of the models of noise that are tried."""

_WITH_Q = (Terms("N"), Terms("NK"), Terms("NF"), Terms("NFK"), Terms("NK", 1))

_ABOVE_ENDS = 1.01

FEWEST_BINS = 24

_TWIN = 0.1
"""Weight of the same first-order filter applied to the samples: it looks like that before the
sampling, whose folds are in N."""


class BinGains:
    """What filters leave of noise in the bins of a spectrum."""

    def __init__(self, spectrum: Spectrum) -> None:
        points = (np.arange(_POINTS)[:, None] + 0.5) / _POINTS
        width = spectrum.upper - spectrum.lower
        self._within = Frequencies(spectrum.lower + width * points, spectrum.rate)
        self._mean = Frequencies(spectrum.frequency, spectrum.rate)
        self._length, self._single = spectrum.length, spectrum.block == 1

    def __call__(self, trial: FilterTrial) -> tuple[Array, Array, Array]:
        """Return what is left of white noise, of flicker noise and of slow noise."""
        low_pass = trial.low_pass
        white, flicker, slow = (gain.mean(axis=0) for gain in low_pass.gains(self._within))
        return white + self.leakage(low_pass), flicker, slow

    def white(self, low_pass: Filter) -> Array:
        """Return what is left of white noise at points within each bin, shape (6, b)."""
        return low_pass.white(self._within)

    def leakage(self, low_pass: Filter) -> Array:
        """Return what the ends of the transform add, of single samples."""
        return np.where(self._single, low_pass.leakage(self._mean, self._length), 0.0)


def highest_cutoff(kind: Kind, order: int, rate: float) -> float:
    """Return the highest cut-off of a filter that is looked for at a rate, Hz."""
    return _HIGHEST[kind, order] * rate


@dataclass(frozen=True)
class FilterTrial:
    """A filter, where its likelihood has a maximum."""

    score: float  # half its BIC
    cost: float  # -log L
    kind: Kind
    order: int
    cutoff: float  # Hz
    floor: bool  # white noise stands behind it beside that of rounding

    @property
    def low_pass(self) -> Filter:
        """The filter."""
        return Filter(self.kind, self.order, self.cutoff)

    @property
    def is_first_order_analogue(self) -> bool:
        """Whether white noise behind it is a Gauss-Markov process."""
        return self.kind == "analogue" and self.order == 1

    def correlation(self, rate: float) -> float:
        """Return the correlation time of a filter of first order, sampling intervals."""
        return rate / (2.0 * math.pi * self.cutoff)


def explains_bend(spectrum: Spectrum, fitted: Array, trial: FilterTrial) -> bool:
    """Return whether a fit behind a filter gives the spectrum where that bends it.

    ``fitted``, shape (b,), is the density of the fit in each bin.
    """
    bent = spectrum.frequency > min(0.1 * trial.cutoff, spectrum.frequency[-FEWEST_BINS])
    shown = spectrum.select(bent)
    judged = goodness(
        shown.ordinates, shown.density, fitted[bent], shown.frequency, 2 + trial.floor
    )
    return judged.verdict == "explained"


class FilterFits:
    """Whittle fits of a spectrum for given filters."""

    def __init__(self, spectrum: Spectrum) -> None:
        self.rate = spectrum.rate
        self.lowest = _LOWEST * spectrum.rate
        self.whittle: Whittle = whittle_of(
            spectrum, 0.5 * spectrum.rate, COARSE, shortest=PROCESSES / spectrum.rate
        )
        whittle = self.whittle
        shortest, longest = (end / spectrum.rate for end in _CORRELATIONS)
        count = 1 + round(_A_DECADE * math.log10(longest / shortest))
        times = np.geomspace(shortest, longest, count)
        times = times[(times >= whittle.shortest) & (times < whittle.longest)]
        columns = [whittle.column("F"), whittle.column("K")]
        columns += [whittle.gauss_markov(float(time)) for time in times]
        self.everything_slow = np.column_stack(columns)
        self.times = np.concatenate([[np.inf, np.inf], times])
        self.slow = [0, 1, *range(2, len(columns), _A_DECADE)]  # those that are in the fits
        self.penalty = 0.5 * math.log(len(spectrum.frequency))
        self.rounded = 0.0  # density of rounding, parts of N^2
        self._left = BinGains(spectrum)
        self._bins = self.whittle.bins()

    def choose_slow(self, trial: FilterTrial) -> None:
        """Keep the terms of slow noise that the spectrum asks for behind a filter, by BIC.

        A term that is not there can only add to a fit: together they would pull the cut-off.
        """
        slow: list[int] = []
        self.slow = slow
        left = self.gains(trial)
        best = self.cost(trial)
        while len(slow) < _MOST_SLOW:
            wider = [
                (self._powers(self._behind(trial, left, [*slow, k]))[1], k)
                for k in range(self.everything_slow.shape[1])
                if k not in slow
            ]
            cost, place = min((c + self.penalty * (1 + (k > 1)), k) for c, k in wider)
            if cost >= best:
                break
            best = cost - self.penalty * (1 + (place > 1))
            slow.append(place)

    def unfiltered(self) -> tuple[float, float, float, float]:
        """Return of noise without a filter N, half its BIC, -log L, and half the BIC with Q.

        The density of quantization noise rises towards Nyquist as that of what a steep filter
        lets fold.
        """

        def score(terms: Terms) -> tuple[float, float, float]:
            fit = self.whittle.maximum(terms)
            return fit.cost + self.penalty * terms.parameters, fit.cost, fit.parameter("N")

        plain = min(score(Terms(*model)) for model in _ALONE)
        rounded = min(score(Terms("Q" + terms.linear, terms.gauss_markov)) for terms in _WITH_Q)
        return (plain if plain[0] < rounded[0] else rounded)[2], plain[0], plain[1], rounded[0]

    def behind(self, trial: FilterTrial) -> float:
        """Return half the BIC of the best model behind a filter."""
        white, *slow = self.gains(trial)
        N, after = self.density(trial)
        behind = Behind(white + (after / N) ** 2, *slow)
        shortest = max(PROCESSES / self.rate, _SLOWER / (2.0 * math.pi * trial.cutoff))
        spectrum = self.whittle.spectrum
        whittle = whittle_of(spectrum, 0.5 * self.rate, COARSE, shortest=shortest, behind=behind)
        own = 1 + trial.floor
        terms = [Terms(*alone) for alone in _ALONE]
        return min(
            whittle.maximum(each).cost + self.penalty * (each.parameters + own) for each in terms
        )

    def cost(self, trial: FilterTrial) -> float:
        """Return -log L at a cut-off."""
        return self._powers(self._columns(trial))[1]

    def density(self, trial: FilterTrial) -> tuple[float, float]:
        """Return N before the filter, and the density after it."""
        powers = self._powers(self._columns(trial))[0]
        return math.sqrt(powers[0]), math.sqrt(powers[-1]) if trial.floor else 0.0

    def may_bend(self) -> bool:
        """Return whether a filter at any of a few cut-offs is nearly as good as none."""
        _, _, alone, _ = self.unfiltered()
        flat = np.column_stack(
            [np.ones(len(self.whittle.spectrum.frequency)), self.everything_slow[:, self.slow]]
        )
        alone = min(alone, self._powers(flat)[1])
        least = min(
            self.cost(FilterTrial(0.0, 0.0, kind, order, float(cutoff), False))
            for kind, order in FAMILY
            for cutoff in self._cutoffs(kind, order, 2.0 * self.lowest, _COARSE_SCAN)
        )
        return least < alone - _WORTH_TRYING

    def try_filters(self, within: float = 1e-5) -> list[FilterTrial]:
        """Return the maxima of the likelihood over all filters, the best by BIC first.

        ``within``: error up to which a cut-off is found, parts of it.
        """
        maxima = [trial for kind, order in FAMILY for trial in self._of(kind, order, within)]
        # A floor that gains next to nothing is none. Of first order, with a floor, digital and
        # analogue filters are the same but for N.
        return sorted(
            maxima, key=lambda trial: trial.score + trial.floor + _SAME * (trial.kind != "analogue")
        )

    def _of(self, kind: Kind, order: int, within: float) -> Iterator[FilterTrial]:
        """Yield the maxima of the likelihood over the cut-off, without and with a floor."""
        scan = np.log(self._cutoffs(kind, order, self.lowest, _SCAN))
        start = FilterTrial(0.0, 0.0, kind, order, 1.0, True)

        def at(x: float, floor: bool) -> FilterTrial:
            return replace(start, cutoff=math.exp(x), floor=floor)

        columns = [self._columns(at(float(x), True)) for x in scan]
        for floor in (False, True):
            costs = np.array([self._powers(c if floor else c[:, :-1])[1] for c in columns])
            beside = np.pad(costs, 1, constant_values=np.inf)
            for place in np.flatnonzero((costs <= beside[:-2]) & (costs < beside[2:])).tolist():
                best = minimize_scalar(
                    lambda x, floor=floor: self.cost(at(x, floor)),
                    bounds=(
                        float(scan[max(place - 1, 0)]),
                        float(scan[min(place + 1, len(scan) - 1)]),
                    ),
                    method="bounded",
                    options={"xatol": within},
                )
                trial = replace(at(best.x, floor), cost=float(best.fun))
                if (
                    floor
                    and order == 1
                    and kind != "boxcar"
                    and trial.correlation(self.rate) > _FILTERS
                ):
                    continue  # white noise beside a process
                before, after = self.density(trial)
                # Where what is behind the filter is the greater, it is a process of slow noise.
                if before > after and trial.cutoff > _ABOVE_ENDS * self.lowest:
                    yield replace(trial, score=trial.cost + self.penalty * (1 + floor))

    def _cutoffs(self, kind: Kind, order: int, lowest: float, number: int) -> Array:
        """Return the cut-offs from which a search starts, rising, Hz."""
        scan = np.geomspace(lowest, highest_cutoff(kind, order, self.rate), number)
        if kind != "boxcar":
            return scan
        lengths = np.arange(_WHOLE, 2, -1)
        return np.unique(np.concatenate([scan, BOXCAR_CUTOFF_LENGTH * self.rate / lengths]))

    def explains(self, trial: FilterTrial) -> bool:
        """Return whether the filter gives the spectrum where it bends."""
        columns = self._columns(trial)
        fitted = columns @ self._powers(columns)[0]
        return explains_bend(self.whittle.spectrum, fitted, trial)

    def limits(self, trial: FilterTrial) -> tuple[float, float]:
        """Return the ends of the 95 % interval, by the profile of the likelihood.

        Above Nyquist the profile may have several hollows: the ends are the outermost.
        """
        most = self.cost(trial) + HALF_CHI_SQUARED

        def beyond(x: float) -> float:
            return self.cost(replace(trial, cutoff=math.exp(x))) - most

        def end_of(sign: float, end: float) -> float:
            inside = math.log(trial.cutoff)
            step, outside = 1e-3, inside
            while sign * ((outside := inside + sign * step) - end) < 0.0:
                if beyond(outside) > 0.0:
                    return float(brentq(beyond, inside, outside, xtol=1e-6))
                inside, step = outside, 2.0 * step
            return end

        ends = []
        for sign, end in (
            (-1.0, self.lowest),
            (1.0, highest_cutoff(trial.kind, trial.order, self.rate)),
        ):
            edge = end_of(sign, math.log(end))
            first = max(math.log(end), min(edge, math.log(UNFOLDED * self.rate)))
            number = _BETWEEN if first != edge else 0
            further = np.linspace(first, edge, number, endpoint=False)
            allowed = next((k for k, x in enumerate(further) if beyond(float(x)) < 0.0), None)
            if allowed is not None:
                inside = float(further[allowed])
                outside = float(further[allowed - 1]) if allowed else inside
                edge = brentq(beyond, inside, outside, xtol=1e-6) if allowed else inside
            ends.append(math.exp(edge))
        return ends[0], ends[1]

    def gains(self, trial: FilterTrial) -> tuple[Array, Array, Array]:
        """Return what a filter leaves of white noise, with rounding, of flicker and slow noise."""
        white, flicker, slow = self._left(trial)
        return white + self.rounded, flicker, slow

    def _columns(self, trial: FilterTrial) -> Array:
        return self._behind(trial, self.gains(trial), self.slow)

    def _behind(
        self, trial: FilterTrial, left: tuple[Array, Array, Array], slow: Sequence[int]
    ) -> Array:
        """Return the terms behind a filter, as columns."""
        white, flicker, gain = left
        indices = np.array(slow, dtype=np.int64)
        # A process as fast as the filter is the filter.
        indices = indices[self.times[indices] >= _SLOWER / (2.0 * math.pi * trial.cutoff)]
        gains = np.where(indices == 0, flicker[:, None], gain[:, None])
        columns = np.column_stack([white, self.everything_slow[:, indices] * gains])
        return np.column_stack([columns, np.ones(len(white))]) if trial.floor else columns

    def _powers(self, columns: Array) -> tuple[Array, float]:
        norm = columns.mean(axis=0)
        powers, _, cost = best_powers(
            np.ascontiguousarray(columns / norm), self._bins, False, TOLERANCE
        )
        return powers / norm * self.whittle.scale, cost


@dataclass(frozen=True)
class Reading:
    """What a filter that the log allows makes of N."""

    weight: float  # of the filter, by its likelihood
    below: float
    at: float
    above: float
    """Logarithm of N at the lower limit of the cut-off, at its best and at its upper limit, less
    that of the filter that was chosen."""
    in_the_log: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The same three of the density in the log, far below the cut-off."""


@dataclass(frozen=True)
class Allowed:
    """A filter that the log does not rule out."""

    filter: FilterTrial  # at its best cut-off
    half_width: float  # half of the 95 % interval of the logarithm of its cut-off

    def at(self, x: float) -> FilterTrial:
        """Return it at a logarithm of the cut-off, Hz."""
        return replace(self.filter, cutoff=math.exp(x))


@dataclass(frozen=True)
class OfModel:
    """What the filters make of N in a model of the noise, each fitted together with it."""

    readings: Sequence[Reading]  # over N at the cut-off that was chosen, in the same model
    gained: float
    """Log likelihood of the model with a cut-off of its own, less that with the chosen one."""


def also_after_sampling(reading: Reading, trial: FilterTrial, rate: float) -> Reading:
    """Return the reading of the same filter, analogue of first order, applied to the samples.

    Its shape is the same, and it folds nothing into N.
    """
    gain = 0.5 * math.log(float(trial.low_pass.white(Frequencies(0.0, rate))))
    before = (reading.below + gain, reading.at + gain, reading.above + gain)
    return Reading(_TWIN * reading.weight, *before, reading.in_the_log)


def density_in_the_log(low_pass: Filter, N: float, beside: float, rate: float) -> float:
    """Return the density of white noise in a log far below the cut-off of a filter.

    Parameters
    ----------
    low_pass : Filter
    N : float
        Density before the filter, SI.
    beside : float
        Squared density of the white noise that does not pass it, SI.
    rate : float
        Hz.
    """
    return math.sqrt(N**2 * float(low_pass.white(Frequencies(0.0, rate))) + beside)


def draw_factors(
    readings: Sequence[Reading], number: int, rng: np.random.Generator, *, in_the_log: bool = False
) -> Array:
    """Return draws of N over its value for the filter that was chosen, shape (number,).

    Of N before the filter, or of the density in the log.
    """
    weight = np.array([reading.weight for reading in readings])
    which = rng.choice(len(weight), number, p=weight / weight.sum())
    ends = [r.in_the_log if in_the_log else (r.below, r.at, r.above) for r in readings]
    below, at, above = np.array(ends)[which].T
    normal = rng.standard_normal(number)
    side = np.where(normal < 0.0, at - below, above - at)
    return np.asarray(np.exp(at + normal / SIGMAS * side))
