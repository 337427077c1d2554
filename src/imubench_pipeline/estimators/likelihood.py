"""The DCT-Whittle likelihood of a log: estimates by the best model, and by the papers' model.

Their errors reach the Cramér-Rao bound within a few per cent, and have intervals.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.allan import of_blocks
from imubench_pipeline.allan.phase import Span, count_gaps, list_spans
from imubench_pipeline.estimators import least_squares
from imubench_pipeline.estimators.curve_bias import add_curve_figures, make_averaging_times
from imubench_pipeline.estimators.cutoff import Cutoff, select_joint_models
from imubench_pipeline.estimators.doubts import add_doubts, describe_drift_alternative
from imubench_pipeline.estimators.estimate import (
    BROADBAND_TIME,
    CURVE,
    FAMILY,
    PARAMETERS,
    SENSOR,
    Estimate,
    JointDraws,
    Parameter,
    not_shown,
)
from imubench_pipeline.estimators.frame import (
    MIN_BINS,
    Band,
    FitSelection,
    estimate_sensor_density,
    select_for_fit,
)
from imubench_pipeline.estimators.intervals import add_upper_limits, describe
from imubench_pipeline.estimators.lines import Line, select_sinusoids
from imubench_pipeline.estimators.missing import (
    average_blocks,
    draw_slow_part,
    fill_missing,
    split_at_gaps,
)
from imubench_pipeline.estimators.model_choice import (
    MIN_AKAIKE_WEIGHT,
    PAPERS_MODEL,
    Candidate,
    compare_models,
)
from imubench_pipeline.estimators.posterior import (
    Posterior,
    compute_draw_weight,
    draw_jointly,
    sample,
)
from imubench_pipeline.estimators.spectrum import Spectrum, compute_spectra
from imubench_pipeline.estimators.white_level import (
    count_fast_processes,
    describe_white_level,
    merge_fast_draws,
    merge_fast_processes,
)
from imubench_pipeline.estimators.whittle import Terms, Whittle, make_noise_model
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra as texts

_FLEXIBLE_TERMS = Terms("NFK", 1)
"""Model for the joint fit of the cut-off where no candidate explains the spectrum."""

_MAX_REMAINING_MEMORY = 1e-3
_MAX_ROUNDS = 12


@dataclass(frozen=True)
class Likelihood:
    """Result of the likelihood estimation for a channel."""

    estimates: tuple[Estimate, Estimate]
    """``likelihood``, by the model that the data favour, and ``likelihood_gm``, by the papers'."""
    candidates: Sequence[Candidate]
    """The models tried, the best first; empty for a log that is too short."""
    lines: Sequence[Line]
    band: Band | None  # the frequencies used
    spectrum: Spectrum
    clear: NDArray[np.bool_]  # (b,): the bins without lines
    used: NDArray[np.bool_]  # (b,): the subset below the end of the band, which is used
    fitted: Array
    """(b,): density of the chosen model in each bin, its ramp included; NaN without a fit."""
    frame: FitSelection

    @property
    def low_pass(self) -> Cutoff | None:
        """The sensor's own low-pass filter; None if it was not searched for."""
        return self.frame.low_pass


def fit(
    samples: ArrayLike,
    rate: float,
    *,
    segments: Sequence[Span] | None = None,
    band: float | None = None,
    bandwidth: float | None = None,
    resolution: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Likelihood:
    """Estimate the noise parameters of a log by their likelihood.

    Parameters
    ----------
    samples : array_like, shape (L,)
        The log on its uniform grid, rad/s or m/s²; NaN marks a missing sample.
    rate : float
        Hz.
    segments : sequence of (int, int), optional
        First and one-past-last sample of each part that no time relates to the others.
    band : float, optional
        Highest frequency to use, Hz; by default it is found from the spectrum.
    bandwidth : float, optional
        Stated cut-off of the sensor's own filter, Hz: it distinguishes a filter from a process.
    resolution : float
        Step of the register (LSB), SI, where the samples are rounded.
    rng : numpy.random.Generator, optional
        For the posterior draws, and for missing samples; by default always the same.

    Raises
    ------
    ValueError
        If the log has fewer than 16 samples.

    References
    ----------
    P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2,
    1953.
    """
    values = np.asarray(samples, dtype=np.float64)
    if len(values) < 16:
        raise ValueError(f"the log has {len(values)} samples, expected 16 or more")
    present = np.isfinite(values)
    if not present.any():
        raise ValueError(f"none of the {len(values)} samples is present")
    holes = not bool(present.all())
    return fit_blocks(
        lambda: [values],
        len(values),
        rate,
        segments=segments,
        holes=holes,
        band=band,
        bandwidth=bandwidth,
        resolution=resolution,
        rng=rng or np.random.default_rng(0),
    )


def fit_blocks(
    blocks: Callable[[], Iterable[Array]],
    samples: int,
    rate: float,
    *,
    holes: bool,
    segments: Sequence[Span] | None = None,
    band: float | None = None,
    bandwidth: float | None = None,
    resolution: float = 0.0,
    rng: np.random.Generator,
) -> Likelihood:
    """Estimate the noise parameters of a log that comes in blocks, in bounded memory (see `fit`).

    Missing samples are drawn from their distribution, first by the model of the Allan variance,
    then by the likelihood's own model, more often if more are missing; the bins count for the
    samples present only.

    ``blocks`` returns the log in order, in SI, at every call, NaN where a sample is missing;
    ``samples`` is L, the length of all blocks together; with ``holes``, samples may be missing.
    """
    spans = list_spans(segments, samples)
    select = partial(select_for_fit, band=band, bandwidth=bandwidth, resolution=resolution)
    if not holes:
        spectrum, lines = compute_spectra(blocks(), samples, rate, spans)
        return fit_spectrum(spectrum, select(spectrum, lines), rng=rng)
    means = average_blocks(blocks(), spans)
    parts = split_at_gaps(means, spans)
    if not parts:
        raise ValueError(f"none of the {samples} samples is present")
    present = float(means.count.sum()) / sum(stop - start for start, stop in parts)
    gaps = count_gaps(blocks())
    curve = of_blocks(blocks(), samples, rate, holes=True, gaps=gaps, segments=spans)
    try:
        model = least_squares.fit(curve).model
    except ValueError:  # too few clusters are complete
        values = np.concatenate([part[np.isfinite(part)] for part in blocks()])
        model = NoiseModel(N=float(np.std(values)) / math.sqrt(rate))
    # The rest of the first error shrinks as (missing fraction)^n.
    needed = math.log(_MAX_REMAINING_MEMORY) / math.log(min(max(1.0 - present, 1e-6), 0.9))
    rounds = min(max(2, math.ceil(needed)), _MAX_ROUNDS)
    for number in range(1, rounds + 1):
        path = draw_slow_part(means, parts, model, rate, rng)
        complete = fill_missing(blocks(), path, model, rate, rng)
        spectrum, lines = compute_spectra(complete, samples, rate, parts)
        spectrum = replace(spectrum, ordinates=spectrum.ordinates * present)
        frame = select(spectrum, lines)
        if frame.used.sum() < MIN_BINS:
            break
        if number < rounds:
            candidates = compare_models(frame.whittle(spectrum), quantization=False)
            model = make_noise_model(candidates[0].maximum)
    return fit_spectrum(spectrum, frame, rng=rng)


def fit_spectrum(
    spectrum: Spectrum,
    frame: FitSelection,
    *,
    rng: np.random.Generator,
) -> Likelihood:
    """Estimate the noise parameters from the selected bins of a spectrum (see `fit`)."""
    if frame.used.sum() < MIN_BINS:
        left, hidden = int(frame.used.sum()), int((~frame.clear).sum())
        reason = texts.few_bins_left(left, MIN_BINS, frame.band.highest, hidden)
        nothing = Parameter(None, "not_shown", reason)
        unknown = dict.fromkeys(FAMILY, nothing), (), (), dict.fromkeys(CURVE, nothing)
        both = Estimate("likelihood", *unknown), not_shown("likelihood_gm", reason)
        nan = np.full(len(frame.used), np.nan)
        return Likelihood(
            both, (), frame.lines, None, spectrum, frame.clear, frame.used, nan, frame
        )
    frame, whittle, candidates = fit_models(spectrum, frame)
    chosen = candidates[0]
    # A ramp is no noise: it is selected or not, and a possible one does not widen intervals.
    alike = [chosen] + [
        c for c in candidates[1:] if c.akaike_weight >= MIN_AKAIKE_WEIGHT and not c.terms.ramp
    ]
    number = count_fast_processes(chosen.maximum)
    wider = [c for c in candidates if c.terms in _with_one_more(chosen.terms, number)]
    papers = next(c for c in candidates if c.terms == PAPERS_MODEL)
    drawn = [c for c in candidates if c in alike or c in wider or c is papers]
    posteriors = {c.terms: sample(whittle, c.maximum, rng) for c in drawn}
    in_the_log = {
        terms: frame.in_the_log(posterior, terms, rng) for terms, posterior in posteriors.items()
    }
    of_data = _InTheLog(whittle, frame, in_the_log, alike, wider)
    estimate = of_data.estimate("likelihood")
    sensor = estimate_sensor_density(frame, chosen.maximum, posteriors[chosen.terms], spectrum, rng)
    if sensor is not None:
        estimate = replace(estimate, parameters={**estimate.parameters, SENSOR: sensor})
    of_papers = _InTheLog(whittle, frame, in_the_log, [papers], [])
    gauss_markov = of_papers.estimate("likelihood_gm")
    fitted = (
        frame.likelihood_of_all_bins(spectrum).density(chosen.maximum)
        + chosen.maximum.ramp**2 * spectrum.ramp
    )
    drift = describe_drift_alternative(whittle, chosen.maximum)
    estimate, gauss_markov = add_doubts(estimate, gauss_markov, frame, candidates, papers, drift)
    sinusoids = select_sinusoids(frame.lines)
    estimate = replace(estimate, lines=sinusoids, draws=of_data.draw_jointly())
    gauss_markov = replace(
        gauss_markov,
        parameters={name: gauss_markov.parameters[name] for name in PARAMETERS},
        lines=sinusoids,
        draws=of_papers.draw_jointly(),
    )
    lines, band, clear, used = frame.lines, frame.band, frame.clear, frame.used
    both = (estimate, gauss_markov)
    return Likelihood(both, candidates, lines, band, spectrum, clear, used, fitted, frame)


class _InTheLog:
    """Models that the log does not rule out, with the processes faster than a second in N."""

    def __init__(
        self,
        whittle: Whittle,
        frame: FitSelection,
        posteriors: Mapping[Terms, Posterior],
        alike: Sequence[Candidate],
        wider: Sequence[Candidate],
    ) -> None:
        self._whittle, self._frame = whittle, frame
        self._fastest = alike[0].maximum.times
        self._number = count_fast_processes(alike[0].maximum)
        self.draws: dict[Terms, Posterior] = {}
        self._posteriors = posteriors
        self.alike = list(self._merged(alike))
        self.wider = list(self._merged(wider))

    def _merged(self, candidates: Sequence[Candidate]) -> Iterator[Candidate]:
        """Yield each model once, without the processes that are part of N, and store its draws."""
        merged: set[Terms] = set()
        for candidate in candidates:
            terms, times = candidate.terms, candidate.maximum.times
            number = min(self._number, int(np.sum(times < BROADBAND_TIME)))
            maximum = merge_fast_processes(candidate.maximum, number, self._frame.folding)
            if maximum.terms in merged:
                continue
            merged.add(maximum.terms)
            if maximum.terms not in self.draws:
                posterior = self._posteriors[terms]
                self.draws[maximum.terms] = merge_fast_draws(posterior, terms, number)
            yield replace(candidate, maximum=maximum)

    def estimate(self, method: str) -> Estimate:
        """Return the parameters, the figures of the curve, and their intervals."""
        chosen, spectrum = self.alike[0], self._whittle.spectrum
        estimate = describe(method, self._whittle, chosen, self.alike, self.draws, self._frame)
        estimate = add_upper_limits(estimate, self.alike, self.wider, self.draws)
        tau = make_averaging_times(spectrum.rate, float(spectrum.length.max()))
        estimate = add_curve_figures(estimate, self.alike, self.wider, self.draws, tau)
        N, counted = estimate.parameters["N"], self._fastest[: self._number]
        reason = N.reason or describe_white_level(counted.tolist())
        return replace(estimate, parameters={**estimate.parameters, "N": replace(N, reason=reason)})

    def draw_jointly(self) -> JointDraws:
        """Return draws over all models that the log does not rule out."""
        bins = len(self._whittle.spectrum.density)
        # The weight of a single model, which may be nearly 0, does not matter.
        alone = len(self.alike) == 1
        parts = [
            (c.terms, self.draws[c.terms], 1.0 if alone else compute_draw_weight(c, bins))
            for c in self.alike
        ]
        return draw_jointly(parts, self._whittle.longest)


def fit_models(
    spectrum: Spectrum, frame: FitSelection
) -> tuple[FitSelection, Whittle, list[Candidate]]:
    """Fit all models to a selection of bins, and to another one where it explains more.

    If noise up to Nyquist, behind the filter found, is not explained: with processes of a few
    sampling intervals; then without the frequencies that bend. Returned are the selection, its
    likelihood and the models tried, the best first.
    """

    def fitted(tried: FitSelection) -> tuple[FitSelection, Whittle, list[Candidate]]:
        whittle = tried.whittle(spectrum)
        quantization = tried.shows_quantization(spectrum.rate)
        candidates = compare_models(whittle, quantization=quantization)
        return tried, whittle, tried.rescore(candidates)

    first = fitted(frame)
    if frame.low_pass is None:
        return first
    if not _explains(first):
        flexible = [candidate for candidate in first[2] if candidate.terms == _FLEXIBLE_TERMS]
        first = fitted(frame.refine(spectrum, flexible))
    if _explains(first) and first[0].needs_cutoff_per_model(spectrum, first[2][0].maximum.times):
        first = fitted(first[0].refine(spectrum, select_joint_models(first[2], PAPERS_MODEL)))
    if _explains(first):
        return first
    faster = fitted(frame.with_fast_processes(spectrum.rate))
    if _explains(faster):
        return faster
    limited = frame.limited(spectrum)
    if limited.band.highest >= frame.band.highest or limited.used.sum() < MIN_BINS:
        return first
    return fitted(limited)


def _explains(fitted: tuple[FitSelection, Whittle, list[Candidate]]) -> bool:
    return fitted[2][0].goodness.verdict == "explained"


def _with_one_more(terms: Terms, number: int = 0) -> list[Terms]:
    """Return the models with one more walk or bias instability; ``number`` processes are none."""
    wider: list[Terms] = []
    terms = replace(terms, ramp=False, gauss_markov=terms.gauss_markov - number)
    if "K" not in terms.linear:
        wider.append(replace(terms, linear=terms.linear + "K"))
    if "F" not in terms.linear and terms.gauss_markov == 0:
        flicker = replace(terms, linear=terms.linear.replace("N", "NF"))
        wider += [flicker, replace(terms, gauss_markov=1)]
    return [replace(each, gauss_markov=each.gauss_markov + number) for each in wider]
