"""Selection of the bins that are fitted: excluded lines, the sensor's low-pass filter, the band.

Noise without and with a low-pass filter are compared by their likelihood over the whole spectrum
(`imubench_pipeline.estimators.cutoff`). Frequencies are excluded only where neither model fits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.cutoff import Cutoff, find_cutoff, refine_cutoff
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import MAX_UNALIASED_CUTOFF, MIN_PROCESS_SAMPLES
from imubench_pipeline.estimators.lines import Line, find_lines, mask_lines
from imubench_pipeline.estimators.model_choice import Candidate, rescore
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum
from imubench_pipeline.estimators.whittle import (
    COARSE,
    SHAPES,
    Maximum,
    Terms,
    Whittle,
    make_noise_model,
    make_whittle,
)
from imubench_pipeline.model.states import BandSource
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra as texts

_DEFAULT_BAND = 1 / 20  # Frequency over sampling rate below which filters are assumed to be flat
_MIN_BAND = 1 / 1000
_MIN_BANDWIDTH_RATIO = 10.0  # There a first-order filter lowers the density by 1 %
_MIN_DEPARTURE_SIGMAS = 4.0
_GROUP_BINS = 4
_MAX_STEPS = 8
_MAX_FILTER_SAMPLES = 100  # Correlation; shorter processes need visible white noise in addition
_MAX_PROCESS_OVER_WHITE = 0.3
_MIN_BINS = 24
_CONVERGED_RATIO = 0.95
_FLEXIBLE_TERMS = Terms("NFK", 1)


@dataclass(frozen=True)
class Band:
    """The highest frequency that enters the likelihood."""

    highest: float  # Hz
    source: BandSource


def find_band(
    spectrum: Spectrum,
    clear: NDArray[np.bool_],
    *,
    asked: float | None = None,
    bandwidth: float | None = None,
) -> Band:
    """Return the highest frequency to use.

    A model fitted below a twentieth of the sampling rate is extrapolated to Nyquist. The deviation
    of a filter from it decreases as f² towards low frequencies. The band ends where this deviation
    is below half the standard error of S_N. A deviation that quantization noise explains is
    ignored. ``clear``, shape (b,), are the bins without spectral lines; ``asked``, Hz, is set by
    the user, and is used unchanged up to Nyquist; ``bandwidth`` is the configured cut-off of the
    sensor's filter, Hz: the limit is a tenth of it.
    """
    nyquist = 0.5 * spectrum.rate
    if asked is not None:
        highest = min(asked, nyquist)
        return Band(highest, "set")
    cap = nyquist
    if bandwidth is not None and bandwidth / _MIN_BANDWIDTH_RATIO < nyquist:
        cap = bandwidth / _MIN_BANDWIDTH_RATIO
    limit = _find_unbent_limit(spectrum, clear, cap)
    if limit is not None and limit < cap:
        return Band(limit, "bend")
    if cap < nyquist:
        return Band(cap, "bandwidth")
    if limit is None:
        return Band(_DEFAULT_BAND * spectrum.rate, "no_model")
    return Band(nyquist, "whole")


def _find_unbent_limit(spectrum: Spectrum, clear: NDArray[np.bool_], cap: float) -> float | None:
    """Return the frequency up to which no bend is visible; None if there is no such frequency."""
    limit = min(_DEFAULT_BAND * spectrum.rate, cap)
    for step in range(_MAX_STEPS):
        below = clear & (spectrum.upper <= limit)
        if below.sum() < _MIN_BINS or limit < _MIN_BAND * spectrum.rate:
            # The log is too short, or the deviation does not decrease.
            return cap if step == 0 else None
        whittle = _make_whittle(spectrum.select(below))
        maximum = whittle.maximum(_FLEXIBLE_TERMS)
        if _is_filter_like(whittle, maximum):
            maximum = whittle.maximum(replace(_FLEXIBLE_TERMS, gauss_markov=0))
        beyond = clear & ~below & (spectrum.upper <= cap * (1 + 1e-9))
        departure = None
        if beyond.any():
            departure = _find_first_departure(spectrum.select(beyond), whittle, maximum)
        if departure is None or (step == 0 and _is_quantized(spectrum, clear, cap)):
            return cap if step == 0 else limit
        frequency, size = departure
        # size (f / frequency)^2 / 3 = 1 / 2 sqrt(1 / (D f)), the error of S_N.
        faded = (1.5 * frequency**2 / (size * math.sqrt(spectrum.duration))) ** 0.4
        if faded > _CONVERGED_RATIO * limit:
            return min(faded, frequency) if step == 0 else limit
        limit = faded
    return limit


def _is_filter_like(whittle: Whittle, maximum: Maximum) -> bool:
    """Return whether a fast process, without visible white noise above it, may be a filter."""
    if not len(maximum.times) or maximum.times[0] > _MAX_FILTER_SAMPLES / whittle.spectrum.rate:
        return False
    process = maximum.process_powers[-1] * whittle.gauss_markov(float(maximum.times[0]))[-1]
    white = maximum.powers[maximum.terms.linear.index("N")] * whittle.column("N")[-1]
    return bool(process > _MAX_PROCESS_OVER_WHITE * white)


def _find_first_departure(
    rest: Spectrum, whittle: Whittle, maximum: Maximum
) -> tuple[float, float] | None:
    """Return frequency and relative size of the first significant deviation from a fit, or None."""
    sensitivity = whittle.sensitivity(maximum)
    _, strength, directions = np.linalg.svd(sensitivity.T, full_matrices=False)
    carried = Whittle(rest, whittle.shortest, whittle.longest, len(whittle.times))
    ratio = rest.density / carried.density(maximum) - 1.0
    slopes = carried.sensitivity(maximum) / np.sqrt(rest.ordinates / 2.0)
    determined = strength > 1e-9 * strength[0]
    errors = (directions[determined] / strength[determined, None]) @ slopes
    for i in range(0, len(ratio), _GROUP_BINS):
        nu = rest.ordinates[i : i + _GROUP_BINS]
        share = nu / nu.sum()
        mean = float(ratio[i : i + _GROUP_BINS] @ share)
        fit_variance = float(np.sum((errors[:, i : i + _GROUP_BINS] @ share) ** 2))
        if abs(mean) > _MIN_DEPARTURE_SIGMAS * math.sqrt(2.0 / nu.sum() + fit_variance):
            return float(rest.frequency[i : i + _GROUP_BINS] @ share), abs(mean)
    return None


def _is_quantized(spectrum: Spectrum, clear: NDArray[np.bool_], cap: float) -> bool:
    """Return whether quantization noise explains the spectrum up to Nyquist."""
    chosen = spectrum.select(clear & (spectrum.upper <= cap * (1 + 1e-9)))
    whittle = _make_whittle(chosen)
    maximum = whittle.maximum(Terms("QNFK"))
    if maximum.parameter("Q") == 0.0:
        return False
    high = chosen.select(chosen.frequency > _DEFAULT_BAND * spectrum.rate)
    return _find_first_departure(high, whittle, maximum) is None


def _make_whittle(spectrum: Spectrum) -> Whittle:
    return make_whittle(spectrum, float(spectrum.upper.max()), COARSE)


Mask = NDArray[np.bool_]

_LINE_MODEL_BAND = 0.05  # Fraction of the rate below which the model for line detection is fitted
_MIN_CORRELATION_SAMPLES = 3.0  # Shortest process that is tried where longer ones do not fit
_SEPARATE_BEND_RATIO = 60.0  # Correlation time of a process over the filter's with separate bends
_MIN_QUANTIZATION_BAND = 1 / 10  # Fraction of the rate at which quantization noise is visible
MIN_BINS = 20  # Bins that a fit needs; the papers' model has four parameters
_MAX_FILTER_CORRELATION = 10.0  # Correlation up to which a process may be the sensor's filter
_MIN_FLOOR_RATIO = 0.03  # Power of unfiltered over filtered white noise that matters


@dataclass(frozen=True)
class FitSelection:
    """The part of a spectrum that is fitted."""

    lines: Sequence[Line]
    clear: Mask  # (b,): the bins without lines
    used: Mask  # (b,): the subset that is fitted
    band: Band  # highest frequency that is fitted, and why
    low_pass: Cutoff | None = None
    """The sensor's low-pass filter; None where the user sets the band."""
    shortest: float | None = None
    """Shortest correlation time of a process, s; None: the default of `whittle_of`."""
    stated: float | None = None  # configured cut-off of the sensor's filter, Hz, if known
    cut: bool = False  # frequencies are excluded that neither a process nor a filter fits

    @property
    def band_words(self) -> str:
        """Reason for the highest fitted frequency."""
        low_pass = self.low_pass.words if self.low_pass is not None else ""
        return texts.band_text(self.band.source, self.band.highest, low_pass)

    def whittle(self, spectrum: Spectrum) -> Whittle:
        """Return the likelihood of the bins that are fitted."""
        return self._whittle(spectrum, self.used, SHAPES)

    def likelihood_of_all_bins(self, spectrum: Spectrum) -> Whittle:
        """Return the likelihood over all bins, including bins that are not fitted."""
        return self._whittle(spectrum, np.ones(len(self.used), dtype=np.bool_), COARSE)

    def _whittle(self, spectrum: Spectrum, bins: Mask, shapes: int) -> Whittle:
        behind = self.low_pass.behind if self.low_pass is not None else None
        behind = behind.select(bins) if behind is not None else None
        highest, shortest = self.band.highest, self.shortest
        return make_whittle(
            spectrum.select(bins), highest, shapes, shortest=shortest, behind=behind
        )

    def needs_cutoff_per_model(self, spectrum: Spectrum, times: Array) -> bool:
        """Return whether the cut-off must be fitted for each noise model separately.

        So it must if the filter bends the spectrum well below Nyquist, or if a process (``times``:
        T_B, s) is nearly as fast as the filter. Near Nyquist, aliasing determines the cut-off.
        """
        if self.low_pass is None or self.low_pass.behind is None:
            return False
        cutoffs = [allowed.filter.cutoff for allowed in self.low_pass.allowed]
        shared = len(times) > 0 and times.min() < _SEPARATE_BEND_RATIO / (2.0 * np.pi * cutoffs[0])
        return bool(shared or max(cutoffs) < MAX_UNALIASED_CUTOFF * spectrum.rate)

    def refine(self, spectrum: Spectrum, candidates: Sequence[Candidate]) -> FitSelection:
        """Return the selection with cut-off and noise model refitted jointly."""
        if self.low_pass is None:
            return self
        low_pass = refine_cutoff(self.low_pass, spectrum, self.used, candidates)
        return replace(self, low_pass=low_pass)

    def rescore(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Return the candidates, sorted by their fits with a cut-off for each model."""
        models = self.low_pass.models if self.low_pass is not None else {}
        gained = {terms: model.gained for terms, model in models.items()}
        return rescore(candidates, gained)

    @property
    def folding(self) -> float:
        """Density of the white noise in the log at low frequencies over N^2, with aliasing."""
        if self.low_pass is None or self.low_pass.behind is None:
            return 1.0
        return float(self.low_pass.behind.white[0])

    def in_the_log(self, posterior: Posterior, terms: Terms, rng: np.random.Generator) -> Posterior:
        """Return draws of a model with N as in the log, including the uncertainty of the filter."""
        factors = np.array(math.sqrt(self.folding))
        if self.low_pass is not None and self.low_pass.readings:
            number = len(posterior.parameters)
            factors = factors * self.low_pass.factors(number, rng, terms, in_the_log=True)
        return _scale_white_noise(posterior, terms, factors)

    def before_the_filter(
        self, posterior: Posterior, terms: Terms, rng: np.random.Generator
    ) -> Posterior:
        """Return draws of a model with N before the filter, including the filter's uncertainty."""
        if self.low_pass is None or not self.low_pass.readings:
            return posterior
        factors = self.low_pass.factors(len(posterior.parameters), rng, terms)
        return _scale_white_noise(posterior, terms, factors)

    def shows_quantization(self, rate: float) -> bool:
        """Return whether quantization noise is visible: no filter, and a sufficient band."""
        behind = self.low_pass is not None and self.low_pass.behind is not None
        return not behind and self.band.highest >= _MIN_QUANTIZATION_BAND * rate

    def with_fast_processes(self, rate: float) -> FitSelection:
        """Return all bins without a filter, with processes as short as a few samples."""
        return replace(
            self,
            used=self.clear,
            band=Band(0.5 * rate, "whole"),
            low_pass=_without_filter_fit(self.low_pass),
            shortest=_MIN_CORRELATION_SAMPLES / rate,
        )

    def limited(self, spectrum: Spectrum) -> FitSelection:
        """Return the frequencies that no filter bends, where no model fits all of them."""
        band = find_band(spectrum, self.clear, bandwidth=self.stated)
        used = self.clear & (spectrum.upper <= band.highest * (1.0 + 1e-9))
        cut = band.highest < 0.5 * spectrum.rate
        low_pass = _without_filter_fit(self.low_pass)
        return FitSelection(self.lines, self.clear, used, band, low_pass, cut=cut)


def _scale_white_noise(posterior: Posterior, terms: Terms, factors: Array) -> Posterior:
    if "N" not in terms.linear:
        return posterior
    parameters = posterior.parameters.copy()
    parameters[:, terms.linear.index("N")] *= factors
    return replace(posterior, parameters=parameters)


def _without_filter_fit(low_pass: Cutoff | None) -> Cutoff | None:
    """Return a low-pass that is reported, but not part of the fitted model."""
    return None if low_pass is None else replace(low_pass, behind=None, readings=(), models={})


def select_for_fit(
    spectrum: Spectrum,
    line_spectra: Sequence[LineSpectrum],
    *,
    band: float | None = None,
    bandwidth: float | None = None,
    resolution: float = 0.0,
) -> FitSelection:
    """Find the spectral lines and the low-pass filter, and select the bins to fit.

    ``line_spectra`` are as in `imubench_pipeline.estimators.spectrum.compute_spectra`; ``band``
    is the highest frequency to use, Hz, by default all, behind the low-pass filter if one is found;
    ``bandwidth`` the configured cut-off of the sensor's filter, Hz, if known; ``resolution`` the
    step of the register, SI, or 0.
    """
    all_bins = np.ones(len(spectrum.frequency), dtype=np.bool_)
    start = min(band or np.inf, _LINE_MODEL_BAND * spectrum.rate)
    below = spectrum.upper <= start
    if below.sum() < MIN_BINS:
        below = all_bins
    maximum = make_whittle(spectrum.select(below), start, COARSE).maximum(Terms("NFK", 1))
    low = spectrum.block > 1
    crossover = float(spectrum.upper[low].max()) if low.any() else 0.0
    lines = find_lines(line_spectra, make_noise_model(maximum), spectrum.rate, crossover)
    clear = all_bins
    if lines:
        density = make_whittle(spectrum, 0.5 * spectrum.rate, COARSE).density(maximum)
        clear = mask_lines(spectrum, lines, density)
    shortest = MIN_PROCESS_SAMPLES / spectrum.rate
    if band is not None:
        limit = find_band(spectrum, clear, asked=band)
        used = clear & (spectrum.upper <= limit.highest * (1.0 + 1e-9))
        return FitSelection(lines, clear, used, limit, shortest=shortest)
    low_pass = find_cutoff(spectrum, clear, resolution=resolution, stated=bandwidth)
    if low_pass.or_quantization:
        low_pass = replace(low_pass, behind=None, readings=())
    used = clear
    source: BandSource = "whole"
    if low_pass.behind is not None and low_pass.ruled is not None:
        used = clear & ~low_pass.ruled
        source = "filtered"
    highest = 0.5 * spectrum.rate
    if used.any() and not used[clear][-1]:
        highest = float(spectrum.upper[used].max())
        source = "attenuated"
    return FitSelection(lines, clear, used, Band(highest, source), low_pass, shortest, bandwidth)


def estimate_sensor_density(
    frame: FitSelection,
    maximum: Maximum,
    posterior: Posterior,
    spectrum: Spectrum,
    rng: np.random.Generator,
) -> Parameter | None:
    """Return N_sensor, the density of white noise before the filter; None where no filter shows.

    N is the density in the log, aliases included; N_sensor compares sensors at other filter
    settings, rad/s/sqrt(Hz) or m/s²/sqrt(Hz). The interval covers the filters that the log does not
    rule out. It is ``not_identified`` where the filter may be a process, and ``doubtful`` where a
    part of the noise did not pass it. ``maximum`` and ``posterior`` are the best fit with the
    filter of ``frame``, and its draws; ``spectrum`` is of the whole log.
    """
    low_pass, terms = frame.low_pass, maximum.terms
    if low_pass is None or "N" not in terms.linear:
        return None
    N, column = maximum.parameter("N"), terms.linear.index("N")
    if low_pass.or_process is not None and low_pass.N_behind is not None:
        drawn = posterior.parameters[:, column]
        return _describe_interval(low_pass.or_process, drawn, low_pass.N_behind)
    if low_pass.behind is None:
        fast = maximum.times < _MAX_FILTER_CORRELATION / spectrum.rate
        if not fast.any():
            return None
        whole = frame.likelihood_of_all_bins(spectrum)
        shapes = [whole.gauss_markov(float(time))[0] for time in maximum.times[fast]]
        before = math.sqrt(N**2 + float(maximum.process_powers[fast] @ np.array(shapes)))
        reason = texts.fast_process_or_filter(float(maximum.times[fast].max()))
        return _describe_interval(reason, posterior.parameters[:, column], before)
    draws = frame.before_the_filter(posterior, terms, rng).parameters[:, column]
    lower, upper = np.quantile(draws, (0.025, 0.975)).tolist()
    lower, upper, share = min(lower, N), max(upper, N), low_pass.beside
    if share < _MIN_FLOOR_RATIO:
        return Parameter(N, lower=lower, upper=upper)
    times = math.sqrt(1.0 + share)
    reason = texts.unfiltered_noise(share, low_pass.words, times)
    return Parameter(N, "doubtful", reason, lower, upper * times)


def _describe_interval(reason: str, drawn: Array, other: float) -> Parameter:
    """Return N_sensor between the limits of draws of N and another density, SI."""
    lower, upper = np.quantile(drawn, (0.025, 0.975)).tolist()
    return Parameter(None, "not_identified", reason, min(lower, other), max(upper, other))
