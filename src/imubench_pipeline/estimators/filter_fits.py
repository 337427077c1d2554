"""Whittle fits of a spectrum behind low-pass filters: cut-off, likelihood and N before it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import SIGMAS
from imubench_pipeline.estimators.low_pass import BOXCAR_CUTOFF_LENGTH, Filter, Frequencies, Kind
from imubench_pipeline.estimators.model_choice import assess_goodness_of_fit
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import COARSE, Behind, Terms, Whittle, make_whittle
from imubench_pipeline.estimators.whittle_kernels import TOLERANCE, fit_powers
from imubench_pipeline.typing import Array

_POINTS_PER_BIN = 6
_SCAN_CUTOFFS, _COARSE_SCAN_CUTOFFS = 24, 8  # For the optimisation, and for the test of any filter
_MAX_BOXCAR_SAMPLES = 20  # Maximum whole number of samples whose mean is tried
_MIN_CUTOFF = 1 / 500

_MAX_CUTOFFS: Mapping[tuple[Kind, int], float] = {
    ("analogue", 1): 4.0,
    **{("analogue", order): 1.0 for order in (2, 3, 4)},
    **{("bilinear", order): 0.42 for order in (1, 2, 3, 4)},
    ("boxcar", 1): 0.222,
}
"""Filters that are tried, and their highest cut-off over the sampling rate; the lowest is 1/500.

An analogue filter of higher order is an anti-aliasing filter; above the sampling rate its aliases
equal those of a first-order filter with a lower cut-off. The shortest boxcar has two samples.
"""

FAMILY: Sequence[tuple[Kind, int]] = tuple(_MAX_CUTOFFS)
"""Kind and order of the filters that are tried."""

_CORRELATION_RANGE = (1e2, 1e5)  # Correlation times of slow noise, sampling intervals
_MIN_CORRELATION_RATIO = 4.0  # Correlation time of slow noise over the filter's, 1 / (2 pi f_c)

_MAX_FILTER_SAMPLES, MIN_PROCESS_SAMPLES = 2.0, 10.0
"""Limits of the correlation in sampling intervals: below the first, additional white noise is
attributed to a filter of first order; processes are at least as long as the second."""

_TIMES_PER_DECADE = 6
_ANALOGUE_PREFERENCE = 0.01
_MIN_SCAN_GAIN = 1.0  # Minimum gain of log likelihood in the coarse scan for a full search
_MAX_SLOW_TERMS = 4
MAX_UNALIASED_CUTOFF = 0.3  # Over the rate; below it the likelihood has one maximum
_LIMIT_SCAN_CUTOFFS = 24  # Scanned on each side for further maxima within the interval
HALF_CHI_SQUARED = 1.9207  # Decrease of the log likelihood at the ends of a 95 % interval

_UNFILTERED_MODELS = (("N", 0), ("NK", 0), ("NFK", 0), ("NK", 1), ("NFK", 1), ("NK", 2))
"""Linear terms and number of processes of the unfiltered noise models."""

_QUANTIZATION_MODELS = (Terms("N"), Terms("NK"), Terms("NF"), Terms("NFK"), Terms("NK", 1))
_MIN_CUTOFF_RATIO = 1.01
MIN_BINS = 24
_DIGITAL_TWIN_WEIGHT = 0.1  # Weight of a filter of the same shape after sampling


class BinGains:
    """Power gains of filters in the bins of a spectrum."""

    def __init__(self, spectrum: Spectrum) -> None:
        points = (np.arange(_POINTS_PER_BIN)[:, None] + 0.5) / _POINTS_PER_BIN
        width = spectrum.upper - spectrum.lower
        self._within = Frequencies(spectrum.lower + width * points, spectrum.rate)
        self._mean = Frequencies(spectrum.frequency, spectrum.rate)
        self._length, self._single = spectrum.length, spectrum.block == 1

    def __call__(self, trial: FilterTrial) -> tuple[Array, Array, Array]:
        """Return the gains for white noise, with leakage, for flicker noise and for slow noise."""
        low_pass = trial.low_pass
        white, flicker, slow = (gain.mean(axis=0) for gain in low_pass.gains(self._within))
        return white + self.leakage(low_pass), flicker, slow

    def white(self, low_pass: Filter) -> Array:
        """Return the gain for white noise at points within each bin, shape (6, b)."""
        return low_pass.white(self._within)

    def leakage(self, low_pass: Filter) -> Array:
        """Return the spectral leakage in bins of single samples, 0 in others."""
        return np.where(self._single, low_pass.leakage(self._mean, self._length), 0.0)


def get_highest_cutoff(kind: Kind, order: int, rate: float) -> float:
    """Return the highest cut-off of a filter that is tried at a sampling rate, Hz."""
    return _MAX_CUTOFFS[kind, order] * rate


@dataclass(frozen=True)
class FilterTrial:
    """A filter at a maximum of the likelihood."""

    score: float  # half its BIC
    cost: float  # -log L
    kind: Kind
    order: int
    cutoff: float  # Hz
    floor: bool  # white noise is added after the filter, in addition to rounding

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
    """Return whether a fit, its density of shape (b,), explains the bend of a filter."""
    bent = spectrum.frequency > min(0.1 * trial.cutoff, spectrum.frequency[-MIN_BINS])
    shown = spectrum.select(bent)
    judged = assess_goodness_of_fit(
        shown.ordinates, shown.density, fitted[bent], shown.frequency, 2 + trial.floor
    )
    return judged.verdict == "explained"


class FilterFits:
    """Whittle fits of a spectrum for given filters."""

    def __init__(self, spectrum: Spectrum) -> None:
        self.rate = spectrum.rate
        self.lowest = _MIN_CUTOFF * spectrum.rate
        self.whittle: Whittle = make_whittle(
            spectrum, 0.5 * spectrum.rate, COARSE, shortest=MIN_PROCESS_SAMPLES / spectrum.rate
        )
        whittle = self.whittle
        shortest, longest = (end / spectrum.rate for end in _CORRELATION_RANGE)
        count = 1 + round(_TIMES_PER_DECADE * math.log10(longest / shortest))
        times = np.geomspace(shortest, longest, count)
        times = times[(times >= whittle.shortest) & (times < whittle.longest)]
        columns = [whittle.column("F"), whittle.column("K")]
        columns += [whittle.gauss_markov(float(time)) for time in times]
        self.everything_slow = np.column_stack(columns)
        self.times = np.concatenate([[np.inf, np.inf], times])
        self.slow = [0, 1, *range(2, len(columns), _TIMES_PER_DECADE)]  # columns that are fitted
        self.penalty = 0.5 * math.log(len(spectrum.frequency))
        self.rounded = 0.0  # density of rounding over N^2
        self._left = BinGains(spectrum)
        self._bins = self.whittle.bins()

    def choose_slow(self, trial: FilterTrial) -> None:
        """Select slow terms by BIC, forward: each unnecessary one would bias the cut-off."""
        slow: list[int] = []
        self.slow = slow
        left = self.gains(trial)
        best = self.cost(trial)
        while len(slow) < _MAX_SLOW_TERMS:
            wider = [
                (self._fit_powers(self._make_columns(trial, left, [*slow, k]))[1], k)
                for k in range(self.everything_slow.shape[1])
                if k not in slow
            ]
            cost, place = min((c + self.penalty * (1 + (k > 1)), k) for c, k in wider)
            if cost >= best:
                break
            best = cost - self.penalty * (1 + (place > 1))
            slow.append(place)

    def unfiltered(self) -> tuple[float, float, float, float]:
        """Return N, half the BIC and -log L without a filter, and half the BIC with Q."""

        def score(terms: Terms) -> tuple[float, float, float]:
            fit = self.whittle.maximum(terms)
            return fit.cost + self.penalty * terms.parameters, fit.cost, fit.parameter("N")

        plain = min(score(Terms(*model)) for model in _UNFILTERED_MODELS)
        rounded = min(
            score(Terms("Q" + terms.linear, terms.gauss_markov)) for terms in _QUANTIZATION_MODELS
        )
        return (plain if plain[0] < rounded[0] else rounded)[2], plain[0], plain[1], rounded[0]

    def behind(self, trial: FilterTrial) -> float:
        """Return half the BIC of the best model with a filter."""
        white, *slow = self.gains(trial)
        N, after = self.density(trial)
        behind = Behind(white + (after / N) ** 2, *slow)
        shortest = max(
            MIN_PROCESS_SAMPLES / self.rate, _MIN_CORRELATION_RATIO / (2.0 * math.pi * trial.cutoff)
        )
        spectrum = self.whittle.spectrum
        whittle = make_whittle(spectrum, 0.5 * self.rate, COARSE, shortest=shortest, behind=behind)
        own = 1 + trial.floor
        terms = [Terms(*alone) for alone in _UNFILTERED_MODELS]
        return min(
            whittle.maximum(each).cost + self.penalty * (each.parameters + own) for each in terms
        )

    def cost(self, trial: FilterTrial) -> float:
        """Return -log L at a cut-off."""
        return self._fit_powers(self._columns_of(trial))[1]

    def density(self, trial: FilterTrial) -> tuple[float, float]:
        """Return N before the filter, and the density of the floor after it."""
        powers = self._fit_powers(self._columns_of(trial))[0]
        return math.sqrt(powers[0]), math.sqrt(powers[-1]) if trial.floor else 0.0

    def may_bend(self) -> bool:
        """Return whether a filter at one of a few cut-offs has a better likelihood than none."""
        _, _, alone, _ = self.unfiltered()
        flat = np.column_stack(
            [np.ones(len(self.whittle.spectrum.frequency)), self.everything_slow[:, self.slow]]
        )
        alone = min(alone, self._fit_powers(flat)[1])
        least = min(
            self.cost(FilterTrial(0.0, 0.0, kind, order, float(cutoff), False))
            for kind, order in FAMILY
            for cutoff in self._make_scan(kind, order, 2.0 * self.lowest, _COARSE_SCAN_CUTOFFS)
        )
        return least < alone - _MIN_SCAN_GAIN

    def try_filters(self, within: float = 1e-5) -> list[FilterTrial]:
        """Return the maxima of the likelihood over all filters, sorted by BIC, best first.

        ``within`` is the relative tolerance of the cut-off. Trials without a floor are preferred,
        and analogue filters of first order to digital ones, which differ only in N.
        """

        def score(trial: FilterTrial) -> float:
            return trial.score + trial.floor + _ANALOGUE_PREFERENCE * (trial.kind != "analogue")

        maxima = [trial for filters in FAMILY for trial in self._find_maxima(*filters, within)]
        return sorted(maxima, key=score)

    def _find_maxima(self, kind: Kind, order: int, within: float) -> Iterator[FilterTrial]:
        """Yield the maxima of the likelihood over the cut-off, without and with a floor."""
        scan = np.log(self._make_scan(kind, order, self.lowest, _SCAN_CUTOFFS))
        start = FilterTrial(0.0, 0.0, kind, order, 1.0, True)

        def at(x: float, floor: bool) -> FilterTrial:
            return replace(start, cutoff=math.exp(x), floor=floor)

        columns = [self._columns_of(at(float(x), True)) for x in scan]
        for floor in (False, True):
            costs = np.array([self._fit_powers(c if floor else c[:, :-1])[1] for c in columns])
            beside = np.pad(costs, 1, constant_values=np.inf)
            for place in np.flatnonzero((costs <= beside[:-2]) & (costs < beside[2:])).tolist():
                best = minimize_scalar(
                    lambda x, floor=floor: self.cost(at(x, floor)),
                    bounds=scan[[max(place - 1, 0), min(place + 1, len(scan) - 1)]].tolist(),
                    method="bounded",
                    options={"xatol": within},
                )
                trial = replace(at(best.x, floor), cost=float(best.fun))
                slow = order == 1 and trial.correlation(self.rate) > _MAX_FILTER_SAMPLES
                if floor and slow and kind != "boxcar":
                    continue  # white noise plus a process
                before, after = self.density(trial)
                # If the floor exceeds the filtered noise, the latter is a slow process.
                if before > after and trial.cutoff > _MIN_CUTOFF_RATIO * self.lowest:
                    yield replace(trial, score=trial.cost + self.penalty * (1 + floor))

    def _make_scan(self, kind: Kind, order: int, lowest: float, number: int) -> Array:
        """Return the cut-offs from which a search starts, ascending, Hz."""
        scan = np.geomspace(lowest, get_highest_cutoff(kind, order, self.rate), number)
        if kind != "boxcar":
            return scan
        lengths = np.arange(_MAX_BOXCAR_SAMPLES, 2, -1)
        return np.unique(np.concatenate([scan, BOXCAR_CUTOFF_LENGTH * self.rate / lengths]))

    def explains(self, trial: FilterTrial) -> bool:
        """Return whether the filter explains the spectrum where it bends it."""
        columns = self._columns_of(trial)
        fitted = columns @ self._fit_powers(columns)[0]
        return explains_bend(self.whittle.spectrum, fitted, trial)

    def limits(self, trial: FilterTrial) -> tuple[float, float]:
        """Return the outermost ends of the 95 % interval from the profile likelihood."""
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
            (1.0, get_highest_cutoff(trial.kind, trial.order, self.rate)),
        ):
            edge = end_of(sign, math.log(end))
            first = max(math.log(end), min(edge, math.log(MAX_UNALIASED_CUTOFF * self.rate)))
            number = _LIMIT_SCAN_CUTOFFS if first != edge else 0
            further = np.linspace(first, edge, number, endpoint=False)
            allowed = next((k for k, x in enumerate(further) if beyond(float(x)) < 0.0), None)
            if allowed is not None:
                inside = float(further[allowed])
                outside = float(further[allowed - 1]) if allowed else inside
                edge = brentq(beyond, inside, outside, xtol=1e-6) if allowed else inside
            ends.append(math.exp(edge))
        return ends[0], ends[1]

    def gains(self, trial: FilterTrial) -> tuple[Array, Array, Array]:
        """Return the gains for white noise, with rounding, for flicker and for slow noise."""
        white, flicker, slow = self._left(trial)
        return white + self.rounded, flicker, slow

    def _columns_of(self, trial: FilterTrial) -> Array:
        return self._make_columns(trial, self.gains(trial), self.slow)

    def _make_columns(
        self, trial: FilterTrial, left: tuple[Array, Array, Array], slow: Sequence[int]
    ) -> Array:
        """Return the densities of the filtered terms as columns."""
        white, flicker, gain = left
        indices = np.array(slow, dtype=np.int64)
        # A process as fast as the filter is indistinguishable from it.
        indices = indices[
            self.times[indices] >= _MIN_CORRELATION_RATIO / (2.0 * math.pi * trial.cutoff)
        ]
        gains = np.where(indices == 0, flicker[:, None], gain[:, None])
        columns = np.column_stack([white, self.everything_slow[:, indices] * gains])
        return np.column_stack([columns, np.ones(len(white))]) if trial.floor else columns

    def _fit_powers(self, columns: Array) -> tuple[Array, float]:
        norm = columns.mean(axis=0)
        powers, _, cost = fit_powers(
            np.ascontiguousarray(columns / norm), self._bins, False, TOLERANCE
        )
        return powers / norm * self.whittle.scale, cost


@dataclass(frozen=True)
class Reading:
    """N under a filter that the log allows."""

    weight: float  # relative likelihood of the filter
    below: float
    at: float
    above: float
    """Logarithm of N at the lower limit of the cut-off, at its best value and at its upper limit,
    relative to N with the selected filter."""
    in_the_log: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The same for the density in the log, far below the cut-off."""


@dataclass(frozen=True)
class Allowed:
    """A filter that the log does not exclude."""

    filter: FilterTrial  # at its best cut-off
    half_width: float  # half of the 95 % interval of the logarithm of its cut-off

    def at(self, x: float) -> FilterTrial:
        """Return the filter at a logarithm of the cut-off, Hz."""
        return replace(self.filter, cutoff=math.exp(x))


@dataclass(frozen=True)
class OfModel:
    """N under the allowed filters, each fitted jointly with a noise model."""

    readings: Sequence[Reading]  # relative to N at the selected cut-off in the same model
    gained: float  # gain of log likelihood by fitting the cut-off to this model


def read_as_digital(reading: Reading, trial: FilterTrial, rate: float) -> Reading:
    """Return the reading of a first-order filter applied after sampling: N has no aliases."""
    gain = 0.5 * math.log(float(trial.low_pass.white(Frequencies(0.0, rate))))
    before = (reading.below + gain, reading.at + gain, reading.above + gain)
    return Reading(_DIGITAL_TWIN_WEIGHT * reading.weight, *before, reading.in_the_log)


def compute_density_in_log(low_pass: Filter, N: float, beside: float, rate: float) -> float:
    """Return the density of white noise in a log far below the cut-off of a filter.

    ``N`` is the density before the filter, SI, ``beside`` the squared density of the white noise
    added after it, SI, and ``rate`` in Hz.
    """
    return math.sqrt(N**2 * float(low_pass.white(Frequencies(0.0, rate))) + beside)


def draw_factors(
    readings: Sequence[Reading], number: int, rng: np.random.Generator, *, in_the_log: bool = False
) -> Array:
    """Return draws of N over its value, before the filter or in the log, shape (number,)."""
    weight = np.array([reading.weight for reading in readings])
    which = rng.choice(len(weight), number, p=weight / weight.sum())
    ends = [r.in_the_log if in_the_log else (r.below, r.at, r.above) for r in readings]
    below, at, above = np.array(ends)[which].T
    normal = rng.standard_normal(number)
    side = np.where(normal < 0.0, at - below, above - at)
    return np.asarray(np.exp(at + normal / SIGMAS * side))
