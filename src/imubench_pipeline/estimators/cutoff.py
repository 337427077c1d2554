"""Estimation of the low-pass filter of a sensor from the spectrum of its noise at rest.

White noise, flicker noise, a random walk and processes behind each filter of a family are fitted to
the whole spectrum, and compared with the same noise without a filter by BIC. White noise behind an
analogue filter of first order is a Gauss-Markov process: one of a few samples is attributed to the
filter, a longer one is a process. An analogue cut-off may exceed Nyquist: aliasing then hides most
of the bend, but a long log can determine it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.low_pass import BOXCAR_CUTOFF_LENGTH, Filter, Kind
from imubench_pipeline.estimators.model_choice import assess_goodness_of_fit
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import COARSE, Terms, make_whittle
from imubench_pipeline.estimators.whittle_kernels import TOLERANCE, fit_powers
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra as texts

_MAX_CUTOFFS: Mapping[tuple[Kind, int], float] = {
    ("analogue", 1): 4.0,
    **{("analogue", order): 1.0 for order in (2, 3, 4)},
    **{("bilinear", order): 0.42 for order in (1, 2, 3, 4)},
    ("boxcar", 1): BOXCAR_CUTOFF_LENGTH / 2.0,
}
"""Filters that are tried, and their highest cut-off over the sampling rate.

An analogue filter of higher order is an anti-aliasing filter; above the sampling rate its aliases
equal the values of a first-order filter with a lower cut-off. The shortest boxcar has two samples.
"""

MIN_PROCESS_SAMPLES = 10.0
"""Correlation in sampling intervals: a shorter process without white noise is a filter."""

MIN_BINS = 24  # Fewest bins of a spectrum in which a filter is searched
_MIN_CUTOFF = 1 / 500  # Over the rate; for first order 1 / (2 pi MIN_PROCESS_SAMPLES)
_STATED_RATIO = 1.6  # Lowest cut-off tried over the configured one
_SCAN_CUTOFFS = 20  # Cut-offs tried for each filter; the best are refined
_MAX_BOXCAR_SAMPLES = 20  # Maximum whole number of samples whose mean is tried
_POINTS_PER_BIN = 6  # Frequencies at which the gain in a bin is evaluated
_TIMES_PER_DECADE = 3  # Correlation times of the processes in addition to flicker noise and a walk
_MIN_GAIN = 3.0  # Decrease of half the BIC by a filter: "strong" evidence (Kass and Raftery, 1995)
_MAX_LEAKAGE_FRACTION = 0.01  # Maximum spectral leakage over density in a fitted bin
_MAX_DELTA = 3.0  # Log likelihood below the best, up to which another filter is possible
_HALF_CHI_SQUARED = 1.9207  # Decrease of the log likelihood at the ends of a 95 % interval
_MAX_LIMIT_RATIO = 1.2  # Ratio of the limits of a cut-off above which it is not identified
_MIN_FLOOR_RATIO = 0.03  # Power of unfiltered over filtered white noise that matters

_UNFILTERED_MODELS = (Terms("NFK", 1), Terms("NK", 2))
_QUANTIZATION_MODELS = (Terms("QN"), Terms("QNFK", 1))


@dataclass(frozen=True)
class Cutoff:
    """The low-pass filter that a spectrum shows, if any."""

    frequency: Parameter  # f_c (-3 dB), Hz
    kind: Kind | None = None  # None without a filter
    order: int | None = None  # n; None without a filter
    N: Parameter | None = None  # density of white noise before the filter, SI; None without one
    floor: float = 0.0  # density of white noise added after the filter, with rounding, SI
    gain: Array | None = None
    """(b,): density of the white noise in the bins of the spectrum over its density at 0 Hz."""

    @property
    def words(self) -> str:
        """Description of the filter; empty without one."""
        cutoff = self.frequency.in_model
        if self.kind is None or self.order is None or cutoff is None:
            return ""
        return texts.filter_text(self.kind, self.order, cutoff)


def find_cutoff(
    spectrum: Spectrum,
    clear: NDArray[np.bool_] | None = None,
    *,
    resolution: float = 0.0,
    stated: float | None = None,
) -> Cutoff:
    """Estimate the low-pass filter of a sensor from a spectrum, or find that there is none.

    BIC selects kind and order, and a floor of white noise after the filter in addition to rounding.
    The intervals cover all filters that the log does not exclude: above Nyquist the aliases of two
    filters may look alike. The cut-off is ``not_identified`` if its limits differ by more than a
    fifth, or if no such filter fits the bend; ``absent`` without a filter.

    ``spectrum`` reaches Nyquist; ``clear``, shape (b,), are the bins without spectral lines;
    ``resolution`` is the step of the register (LSB), SI: rounding adds white noise of variance
    LSB^2 / 12; ``stated`` is the configured cut-off, Hz, if known: filters of first order are
    searched down to it.
    """
    usable = np.ones(len(spectrum.frequency), dtype=np.bool_) if clear is None else clear
    if usable.sum() < MIN_BINS:
        return Cutoff(Parameter(None, "not_shown", texts.few_bins(int(usable.sum()), MIN_BINS)))
    rounding = resolution**2 / (12.0 * spectrum.rate)
    lowest = spectrum.rate / (2.0 * math.pi * MIN_PROCESS_SAMPLES)
    lowest = min(lowest, (stated or math.inf) / _STATED_RATIO)
    absent = Cutoff(Parameter(None, "absent", texts.NO_FILTER))
    fits = _Fits(spectrum.select(usable), 0.0, lowest)
    if not fits.may_bend():
        return absent
    tried = fits.try_filters()
    if not tried:
        return absent
    allowed = _MAX_LEAKAGE_FRACTION * _compute_gain(spectrum, tried[0].low_pass)
    leaky = _compute_leakage(spectrum, tried[0].low_pass) > allowed
    rounded = rounding / tried[0].N ** 2
    if (usable & ~leaky).sum() < MIN_BINS:
        return absent
    if (usable & leaky).any() or rounded > 0.0:
        fits = _Fits(spectrum.select(usable & ~leaky), rounded, lowest)
        tried = fits.try_filters()
    if not tried or fits.find_gain(tried[0], _UNFILTERED_MODELS) < _MIN_GAIN:
        return absent
    found = _describe_filter(spectrum, fits, tried)
    beside_rounding = fits.find_gain(tried[0], _QUANTIZATION_MODELS)
    if beside_rounding >= _MIN_GAIN:
        return found
    if beside_rounding < -_MIN_GAIN:
        return absent
    lower, upper = found.frequency.lower or 0.0, found.frequency.upper or math.inf
    return Cutoff(found.frequency.withheld(texts.filter_or_quantization(lower, upper)))


def _describe_filter(spectrum: Spectrum, fits: "_Fits", tried: "Sequence[_Trial]") -> Cutoff:
    """Return the best filter, with limits over all filters that the log does not exclude."""
    best, rate = tried[0], spectrum.rate
    # Trials with a floor count only if the best has one: with a floor no high cut-off is known.
    comparable = [trial for trial in tried if trial.with_floor <= best.with_floor]
    alike = [trial for trial in comparable if trial.cost < best.cost + _MAX_DELTA]
    ends = [end for trial in alike for end in (trial, *fits.find_limits(trial))]
    shown, cutoffs = best.low_pass.half_power(rate), [end.low_pass.half_power(rate) for end in ends]
    error = SIGMAS / math.sqrt(2.0 * float(fits.spectrum.ordinates.sum()))
    N = Parameter(
        best.N,
        lower=min(end.N for end in ends) * math.exp(-error),
        upper=max(end.N for end in ends) * math.exp(error),
    )
    frequency = Parameter(shown, lower=min(cutoffs), upper=max(cutoffs))
    share = (best.floor / best.N) ** 2
    if not fits.explains(best):
        reason = texts.unknown_filter(len(_MAX_CUTOFFS))
        frequency, N = frequency.withheld(reason), N.withheld(reason)
    elif max(cutoffs) > _MAX_LIMIT_RATIO * min(cutoffs):
        frequency = frequency.withheld(texts.cutoff_range(min(cutoffs), max(cutoffs)))
    found = Cutoff(frequency, best.low_pass.kind, best.low_pass.order, N)
    if share > _MIN_FLOOR_RATIO and N.status == "ok" and N.upper is not None:
        times = math.sqrt(1.0 + share)
        reason = texts.unfiltered_noise(share, found.words, times)
        N = replace(N, status="doubtful", reason=reason, upper=N.upper * times)
    beside = fits.rounded + share
    gain = _compute_gain(spectrum, best.low_pass) + beside
    return replace(
        found,
        N=N,
        floor=best.N * math.sqrt(beside),
        gain=gain / (float(best.low_pass.white(0.0, rate)) + beside),
    )


@dataclass(frozen=True)
class _Trial:
    """A filter at a maximum of the likelihood."""

    low_pass: Filter
    with_floor: bool = False  # white noise is added after the filter, in addition to rounding
    cost: float = 0.0  # -log L
    N: float = 0.0  # density of white noise before the filter, SI
    floor: float = 0.0  # density of the white noise after it, SI


def _compute_gain(spectrum: Spectrum, low_pass: Filter) -> Array:
    """Return the power gain of a filter for white noise in the bins, without leakage."""
    points = (np.arange(_POINTS_PER_BIN)[:, None] + 0.5) / _POINTS_PER_BIN
    within = spectrum.lower + (spectrum.upper - spectrum.lower) * points
    return np.asarray(low_pass.white(within, spectrum.rate).mean(axis=0))


def _compute_leakage(spectrum: Spectrum, low_pass: Filter) -> Array:
    """Return the spectral leakage in bins of single samples, 0 in others."""
    leak = low_pass.leakage(spectrum.frequency, spectrum.rate, spectrum.length)
    return np.where(spectrum.block == 1, leak, 0.0)


class _Fits:
    """Whittle fits of a spectrum for given filters, with slow noise in the model."""

    def __init__(self, spectrum: Spectrum, rounded: float, lowest: float) -> None:
        self.rate, self.spectrum = spectrum.rate, spectrum
        self._whittle = make_whittle(
            spectrum, 0.5 * spectrum.rate, COARSE, shortest=MIN_PROCESS_SAMPLES / spectrum.rate
        )
        first, last = self._whittle.shortest, self._whittle.longest
        number = 1 + max(1, round(_TIMES_PER_DECADE * math.log10(last / first)))
        times = np.geomspace(first, last, number).tolist()
        slow = [self._whittle.column("F"), self._whittle.column("K")]
        self._slow = np.column_stack(slow + [self._whittle.gauss_markov(time) for time in times])
        self.rounded, self._lowest = rounded, lowest  # density of rounding over N^2
        self._bins = self._whittle.bins()
        self._penalty = 0.5 * math.log(len(spectrum.frequency))
        flat = np.column_stack([np.ones(len(self._slow)), self._slow])
        self._unfiltered = self._fit_powers(flat)[1]

    def may_bend(self) -> bool:
        """Return whether a filter at one of a few cut-offs has a better likelihood than none."""
        return any(
            self._fit(Filter(*each, cutoff)).cost < self._unfiltered - 1.0
            for each in _MAX_CUTOFFS
            for cutoff in self._list_cutoffs(*each)[::3].tolist()
        )

    def try_filters(self) -> list[_Trial]:
        """Return the maxima over all filters by BIC, best first; with a floor if none explains."""
        maxima: list[_Trial] = []
        for with_floor in (False, True):
            for each in _MAX_CUTOFFS:
                maxima += self._find_maxima(*each, with_floor)
            maxima.sort(key=lambda trial: trial.cost + self._penalty * trial.with_floor)
            if maxima and self.explains(maxima[0]):
                break
        return maxima

    def find_gain(self, trial: _Trial, models: Sequence[Terms]) -> float:
        """Return half the BIC of models without a filter, less the one with it."""
        costs = [
            self._whittle.maximum(terms).cost + self._penalty * ("Q" in terms.linear)
            for terms in models
        ]
        gain = min(self._unfiltered, *costs) - trial.cost - self._penalty * (1 + trial.with_floor)
        fast = make_whittle(self.spectrum, 0.5 * self.rate, COARSE, shortest=3.0 / self.rate)
        process = min(fast.maximum(terms).cost for terms in _UNFILTERED_MODELS)
        # A process of a few samples is a filter of first order, if no white noise is visible.
        is_process_like = trial.low_pass.kind != "boxcar" and trial.low_pass.order == 1
        return min(gain, process - trial.cost + 2.0 * _MIN_GAIN * is_process_like)

    def explains(self, trial: _Trial) -> bool:
        """Return whether the filter explains the spectrum where it bends it."""
        spectrum, columns = self.spectrum, self._make_columns(trial.low_pass, trial.with_floor)
        fitted = columns @ self._fit_powers(columns)[0]
        lowest = min(0.1 * trial.low_pass.cutoff, spectrum.frequency[-MIN_BINS])
        bent = spectrum.frequency > lowest
        shown = spectrum.select(bent)
        judged = assess_goodness_of_fit(
            shown.ordinates, shown.density, fitted[bent], shown.frequency, 2 + trial.with_floor
        )
        return judged.verdict == "explained"

    def find_limits(self, trial: _Trial) -> tuple[_Trial, _Trial]:
        """Return the filters at the ends of the 95 % interval of the cut-off."""
        low_pass = trial.low_pass
        most = trial.cost + _HALF_CHI_SQUARED
        cutoffs = self._list_cutoffs(low_pass.kind, low_pass.order)

        def at(x: float) -> _Trial:
            return self._fit(replace(low_pass, cutoff=math.exp(x)), trial.with_floor)

        def find_end(sign: float, end: float) -> _Trial:
            inside, step = math.log(low_pass.cutoff), 1e-3
            while sign * (inside - end) < 0.0:
                outside = sign * min(sign * (inside + sign * step), sign * end)
                if at(outside).cost > most:
                    edge = brentq(lambda x: at(x).cost - most, inside, outside, rtol=1e-5)
                    return at(float(edge))
                inside, step = outside, 2.0 * step
            return at(end)

        return find_end(-1.0, math.log(cutoffs[0])), find_end(1.0, math.log(cutoffs[-1]))

    def _find_maxima(self, kind: Kind, order: int, with_floor: bool) -> Iterator[_Trial]:
        if with_floor and kind != "boxcar" and order == 1:
            return  # white noise plus a process

        def cost(x: float) -> float:
            return self._fit(Filter(kind, order, math.exp(x)), with_floor).cost

        scan = np.log(self._list_cutoffs(kind, order))
        costs = np.array([cost(x) for x in scan.tolist()])
        beside = np.pad(costs, 1, constant_values=np.inf)
        for place in np.flatnonzero((costs <= beside[:-2]) & (costs < beside[2:])).tolist():
            ends = scan[[max(place - 1, 0), min(place + 1, len(scan) - 1)]].tolist()
            best = minimize_scalar(cost, bounds=ends, method="bounded", options={"xatol": 1e-5})
            trial = self._fit(Filter(kind, order, math.exp(best.x)), with_floor)
            # If the floor exceeds the filtered noise, the latter is a slow process.
            if trial.N > trial.floor and best.x > scan[0] + 0.01:
                yield trial

    def _list_cutoffs(self, kind: Kind, order: int) -> Array:
        if kind == "boxcar":
            return BOXCAR_CUTOFF_LENGTH * self.rate / np.arange(_MAX_BOXCAR_SAMPLES, 1.9, -1)
        lowest = self._lowest if order == 1 else _MIN_CUTOFF * self.rate
        return np.geomspace(lowest, _MAX_CUTOFFS[kind, order] * self.rate, _SCAN_CUTOFFS)

    def _make_columns(self, low_pass: Filter, with_floor: bool) -> Array:
        """Return the densities of the terms behind a filter as columns, white noise first."""
        white = _compute_gain(self.spectrum, low_pass) + _compute_leakage(self.spectrum, low_pass)
        white += self.rounded
        at = self.spectrum.frequency, self.rate
        slow = self._slow * low_pass.slow(*at)[:, None]
        slow[:, 0] = self._slow[:, 0] * low_pass.flicker(*at)
        return np.hstack([white[:, None], slow] + [np.ones((len(white), 1))] * with_floor)

    def _fit(self, low_pass: Filter, with_floor: bool = False) -> _Trial:
        powers, cost = self._fit_powers(self._make_columns(low_pass, with_floor))
        floor = math.sqrt(powers[-1]) if with_floor else 0.0
        return _Trial(low_pass, with_floor, cost, math.sqrt(powers[0]), floor)

    def _fit_powers(self, columns: Array) -> tuple[Array, float]:
        """Return the squared parameter of each column, and -log L."""
        norm = columns.mean(axis=0)
        powers, _, cost = fit_powers(
            np.ascontiguousarray(columns / norm), self._bins, False, TOLERANCE
        )
        return powers / norm * self._whittle.scale, cost
