"""The DCT-Whittle likelihood of a log: estimates by the best model, and by the papers' model.

Their errors reach the Cramér-Rao bound within a few per cent, and have intervals.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.allan import of_blocks
from imubench_pipeline.allan.phase import Span, count_gaps, list_spans
from imubench_pipeline.estimators import least_squares, missing, white_level
from imubench_pipeline.estimators.curve_bias import add_curve_figures, make_averaging_times
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
from imubench_pipeline.estimators.frame import MIN_BINS, Band, FitSelection, select_for_fit
from imubench_pipeline.estimators.intervals import add_upper_limits, describe
from imubench_pipeline.estimators.lines import Line, select_sinusoids
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
from imubench_pipeline.estimators.whittle import Terms, Whittle, make_noise_model
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as reasons
from imubench_pipeline.words.reasons import spectra as texts

_DELTA_BIC_AGAINST_PAPERS = 6.0
"""BIC of the papers' model over the best one, above which its bias instability and random walk are
doubtful: in `silent_errors.py` without it, 3 of 203 logs have a silently wrong K."""

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
    used: NDArray[np.bool_]  # (b,): the bins without lines, below the end of the band
    fitted: Array
    """(b,): density of the chosen model in each bin, its ramp included; NaN without a fit."""
    frame: FitSelection


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
    """Estimate the noise parameters of a log by their likelihood (P. Whittle, Ark. Mat. 2, 1953).

    ``samples``, shape (L,), are the log on its uniform grid, rad/s or m/s², NaN where one is
    missing; the rate is in Hz. ``segments`` are first and one-past-last sample of each part, if the
    time between parts is unknown; ``band`` is the highest frequency to use, Hz, by default found
    from the spectrum; ``bandwidth`` is the stated cut-off of the sensor's own filter, Hz: it
    distinguishes a filter from a process; ``resolution`` is the step of the register (LSB), SI;
    ``rng`` is for posterior draws and missing samples, by default with a fixed seed. Raises
    ValueError if the log has fewer than 16 samples, or none is present.
    """
    values = np.asarray(samples, dtype=np.float64)
    if len(values) < 16:
        raise ValueError(f"the log has {len(values)} samples, expected 16 or more")
    present = np.isfinite(values)
    if not present.any():
        raise ValueError(f"none of the {len(values)} samples is finite; expected 16 or more")
    return fit_blocks(
        lambda: [values],
        len(values),
        rate,
        segments=segments,
        holes=not bool(present.all()),
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
    then by the model of the likelihood, in more rounds if more are missing; the weights of the bins
    are reduced by the fraction that is missing.

    ``blocks`` returns the log in order, in SI, at every call, NaN where a sample is missing;
    ``samples`` is L, the length of all blocks together; with ``holes``, samples may be missing.
    """
    spans = list_spans(segments, samples)
    select = partial(select_for_fit, band=band, bandwidth=bandwidth, resolution=resolution)
    if not holes:
        spectrum, lines = compute_spectra(blocks(), samples, rate, spans)
        return fit_spectrum(spectrum, select(spectrum, lines), rng=rng)
    means = missing.average_blocks(blocks(), spans)
    parts = missing.split_at_gaps(means, spans)
    if not parts:
        raise ValueError(f"none of the {samples} samples is finite; expected 16 or more")
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
        path = missing.draw_slow_part(means, parts, model, rate, rng)
        complete = missing.fill_missing(blocks(), path, model, rate, rng)
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
    spectrum: Spectrum, frame: FitSelection, *, rng: np.random.Generator
) -> Likelihood:
    """Estimate the noise parameters from the selected bins of a spectrum (see `fit`)."""
    if frame.used.sum() < MIN_BINS:
        left, hidden = int(frame.used.sum()), int((~frame.clear).sum())
        reason = texts.few_bins_left(left, MIN_BINS, frame.band.highest, hidden)
        nothing = Parameter(None, "not_shown", reason)
        unknown = dict.fromkeys(FAMILY, nothing), (), (), dict.fromkeys(CURVE, nothing)
        both = Estimate("likelihood", *unknown), not_shown("likelihood_gm", reason)
        nan = np.full(len(frame.used), np.nan)
        return Likelihood(both, (), frame.lines, None, spectrum, frame.used, nan, frame)
    whittle = frame.whittle(spectrum)
    candidates = compare_models(whittle, quantization=frame.shows_quantization(spectrum.rate))
    chosen = candidates[0]
    # A ramp is no noise: it is selected or not, and a possible one does not widen intervals.
    alike = [chosen] + [
        c for c in candidates[1:] if c.akaike_weight >= MIN_AKAIKE_WEIGHT and not c.terms.ramp
    ]
    fast = white_level.count_fast_processes(chosen.maximum, spectrum.rate)
    wider = [c for c in candidates if c.terms in _with_one_more(chosen.terms, fast)]
    papers = next(c for c in candidates if c.terms == PAPERS_MODEL)
    drawn = [c for c in candidates if c in alike or c in wider or c is papers]
    posteriors = {c.terms: sample(whittle, c.maximum, rng) for c in drawn}
    of_data = _InTheLog(whittle, frame, posteriors, alike, wider)
    estimate, low_pass = of_data.estimate("likelihood"), frame.low_pass
    if low_pass is not None and low_pass.N is not None:
        estimate = replace(estimate, parameters={**estimate.parameters, SENSOR: low_pass.N})
    of_papers = _InTheLog(whittle, frame, posteriors, [papers], [])
    gauss_markov = of_papers.estimate("likelihood_gm")
    noise = frame.whittle(spectrum, all_bins=True).density(chosen.maximum)
    gain = 1.0 if frame.gain is None else frame.gain
    fitted = noise * gain + chosen.maximum.ramp**2 * spectrum.ramp
    sinusoids = select_sinusoids(frame.lines)
    estimate = replace(estimate, lines=sinusoids, draws=of_data.draw_jointly())
    parameters = {name: gauss_markov.parameters[name] for name in PARAMETERS}
    draws = of_papers.draw_jointly()
    gauss_markov = replace(gauss_markov, parameters=parameters, lines=sinusoids, draws=draws)
    if papers.bic > chosen.bic + _DELTA_BIC_AGAINST_PAPERS:
        names = chosen.terms.name, papers.terms.name
        doubt = reasons.model_disfavoured(*names, papers.bic - chosen.bic)

        def cast_doubt(name: str, each: Parameter) -> Parameter:
            is_doubted = each.status == "ok" and name != "N"
            return replace(each, status="doubtful", reason=doubt) if is_doubted else each

        gauss_markov = gauss_markov.revised(cast_doubt)
    both, lines, used = (estimate, gauss_markov), frame.lines, frame.used
    return Likelihood(both, candidates, lines, frame.band, spectrum, used, fitted, frame)


class _InTheLog:
    """Models that the log does not rule out, with N as its Allan deviation shows it."""

    def __init__(
        self,
        whittle: Whittle,
        frame: FitSelection,
        posteriors: Mapping[Terms, Posterior],
        alike: Sequence[Candidate],
        wider: Sequence[Candidate],
    ) -> None:
        self._whittle, self._highest = whittle, frame.band.highest
        self._number = white_level.count_fast_processes(alike[0].maximum, whittle.spectrum.rate)
        self.draws: dict[Terms, Posterior] = {}
        self._posteriors = posteriors
        self.alike = list(self._merged(alike))
        self.wider = list(self._merged(wider))

    def _merged(self, candidates: Sequence[Candidate]) -> Iterator[Candidate]:
        """Yield each model once, without the processes that are part of N, and store its draws."""
        merged: set[Terms] = set()
        for candidate in candidates:
            number = min(self._number, int(np.sum(candidate.maximum.times < BROADBAND_TIME)))
            maximum = white_level.merge_fast_processes(candidate.maximum, number)
            if maximum.terms in merged:
                continue
            merged.add(maximum.terms)
            if maximum.terms not in self.draws:
                self.draws[maximum.terms] = white_level.merge_fast_draws(
                    self._posteriors[candidate.terms], candidate.terms, number
                )
            yield replace(candidate, maximum=maximum)

    def estimate(self, method: str) -> Estimate:
        chosen, spectrum = self.alike[0], self._whittle.spectrum
        estimate = describe(method, self._whittle, chosen, self.alike, self.draws, self._highest)
        estimate = add_upper_limits(estimate, self.alike, self.wider, self.draws)
        tau = make_averaging_times(spectrum.rate, float(spectrum.length.max()))
        return add_curve_figures(estimate, self.alike, self.wider, self.draws, tau)

    def draw_jointly(self) -> JointDraws:
        bins, longest = len(self._whittle.spectrum.density), self._whittle.longest
        # The weight of a single model, which may be 0, does not matter.
        parts = [
            (c.terms, self.draws[c.terms], max(compute_draw_weight(c, bins), 1e-300))
            for c in self.alike
        ]
        return draw_jointly(parts, longest)


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
