"""The DCT-Whittle likelihood of a log: the model that the data favour, and the papers' model.

It is as sure as the Cramér-Rao bound allows, to a few per cent, and says how sure it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.allan import of_blocks
from imubench_pipeline.estimators import least_squares
from imubench_pipeline.estimators.band import Band, find_band
from imubench_pipeline.estimators.curve_bias import averaging_times, with_curve
from imubench_pipeline.estimators.draws import drawn_share, joint_draws
from imubench_pipeline.estimators.estimate import CURVE, FAMILY, Estimate, Parameter
from imubench_pipeline.estimators.intervals import describe, papers_only, with_upper_limits
from imubench_pipeline.estimators.lines import Line, find, without_lines
from imubench_pipeline.estimators.model_choice import PAPERS, Candidate, compare
from imubench_pipeline.estimators.posterior import DRAWS, Posterior, sample
from imubench_pipeline.estimators.whittle import COARSE, Maximum, Terms, whittle_of
from imubench_pipeline.missing import block_means, divided, filled, slow_part
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.spectrum import LineSpectrum, Spectrum, spectra

Array = NDArray[np.float64]
Span = tuple[int, int]

_FEWEST_BINS = 4 * (PAPERS.parameters + 1)
"""The papers' model can be fitted to so many, and to spare."""

_LEAST_SHARE = 0.05
"""Candidates of a smaller share do not enter the intervals."""

_FEWEST_DRAWS = 4_000
_FORGOTTEN = 1e-3
_MOST_ROUNDS = 12
_QUANTIZATION_BAND = 1 / 10
"""Part of the rate that the band must reach for quantization noise to show."""


@dataclass(frozen=True)
class Likelihood:
    """What the likelihood says of a channel.

    Attributes
    ----------
    estimates : tuple of Estimate
        ``likelihood``, the model that the data favour, and ``likelihood_gm``, the papers' N, B,
        T_B and K.
    candidates : sequence of Candidate
        The models tried, the best first; empty for a log that is too short.
    lines : sequence of Line
    band : Band or None
        The frequencies used.
    spectrum : Spectrum
    clear, used : ndarray of bool, shape (b,)
        The bins clear of lines, and those of them that are used: below the end of the band.
    fitted : ndarray, shape (b,)
        Density of the chosen model in each bin, its ramp included; NaN where there is none.
    """

    estimates: tuple[Estimate, Estimate]
    candidates: Sequence[Candidate]
    lines: Sequence[Line]
    band: Band | None
    spectrum: Spectrum
    clear: NDArray[np.bool_]
    used: NDArray[np.bool_]
    fitted: Array


def fit(
    samples: ArrayLike,
    rate: float,
    *,
    segments: Sequence[tuple[int, int]] | None = None,
    band: float | None = None,
    bandwidth: float | None = None,
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
        Cut-off of the sensor's own filter, where it is known, Hz.
    rng : numpy.random.Generator, optional
        For the posterior draws, and for missing samples; by default always the same.

    Returns
    -------
    Likelihood

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
    return fit_blocks(
        lambda: [values],
        len(values),
        rate,
        segments=segments,
        holes=not bool(np.isfinite(values).all()),
        band=band,
        bandwidth=bandwidth,
        rng=rng or np.random.default_rng(0),
    )


def fit_blocks(
    blocks: Callable[[], Iterable[Array]],
    samples: int,
    rate: float,
    *,
    holes: bool,
    segments: Sequence[tuple[int, int]] | None = None,
    band: float | None = None,
    bandwidth: float | None = None,
    rng: np.random.Generator,
) -> Likelihood:
    """Estimate the noise parameters of a log that comes in blocks, in bounded memory (see `fit`).

    Missing samples are drawn from their distribution, first by the model of the Allan variance,
    then by that of the likelihood itself, the more often the more are missing; the bins count
    for the samples present only.

    Parameters
    ----------
    blocks : callable
        Gives the log in order, in SI, as often as it is called; NaN where a sample is missing.
    samples : int
        L, the length of all blocks together.
    rate, segments, band, bandwidth, rng
        As in `fit`.
    holes : bool
        Samples may be missing.
    """
    spans = tuple(segments) if segments else ((0, samples),)
    if not holes:
        spectrum, lines = spectra(blocks(), samples, rate, spans)
        return fit_spectrum(spectrum, lines, band=band, bandwidth=bandwidth, rng=rng)
    means = block_means(blocks(), spans)
    parts = divided(means, spans)
    if not parts:
        raise ValueError(f"none of the {samples} samples is present")
    present = float(means.count.sum()) / sum(stop - start for start, stop in parts)
    model = _first_model(blocks, samples, rate, spans)
    rounds = _rounds(1.0 - present)
    for number in range(1, rounds + 1):
        path = slow_part(means, parts, model, rate, rng)
        complete = filled(blocks(), path, model, rate, rng)
        spectrum, lines = spectra(complete, samples, rate, parts)
        spectrum = replace(spectrum, ordinates=spectrum.ordinates * present)
        if number < rounds:
            _, _, used, limit = lines_and_band(spectrum, lines, band, bandwidth)
            if used.sum() < _FEWEST_BINS:
                break
            whittle = whittle_of(spectrum.taken(used), limit.highest)
            model = model_of(compare(whittle, quantization=False)[0].found)
    return fit_spectrum(spectrum, lines, band=band, bandwidth=bandwidth, rng=rng)


def _rounds(missing: float) -> int:
    """Return how often to fill and fit: what is left of the first error shrinks as missing^n."""
    needed = math.log(_FORGOTTEN) / math.log(min(max(missing, 1e-6), 0.9))
    return min(max(2, math.ceil(needed)), _MOST_ROUNDS)


def _first_model(
    blocks: Callable[[], Iterable[Array]], samples: int, rate: float, spans: Sequence[Span]
) -> NoiseModel:
    """Return what the Allan variance says, or white noise where too few clusters are complete."""
    curve = of_blocks(blocks(), samples, rate, holes=True, segments=spans)
    try:
        return least_squares.fit(curve).model
    except ValueError:
        there = np.concatenate([part[np.isfinite(part)] for part in blocks()])
        return NoiseModel(N=float(np.std(there)) / math.sqrt(rate))


def fit_spectrum(
    spectrum: Spectrum,
    line_spectra: Sequence[LineSpectrum],
    *,
    band: float | None = None,
    bandwidth: float | None = None,
    rng: np.random.Generator,
) -> Likelihood:
    """Estimate the noise parameters from a spectrum (see `fit`)."""
    lines, clear, used, limit = lines_and_band(spectrum, line_spectra, band, bandwidth)
    if used.sum() < _FEWEST_BINS:
        reason = (
            f"{used.sum()} bins of the spectrum are left up to {limit.highest:.4g} Hz, "
            f"{_FEWEST_BINS} are needed: too short a log"
        )
        if not clear.all():
            reason += f", or lines that hide too much of it ({(~clear).sum()} bins)"
        nothing = {name: Parameter(None, "not_shown", reason) for name in FAMILY}
        of_curve = {name: nothing["B"] for name in CURVE}
        return Likelihood(
            (
                Estimate("likelihood", nothing, curve=of_curve),
                Estimate("likelihood_gm", papers_only(nothing), curve=of_curve),
            ),
            (),
            lines,
            None,
            spectrum,
            clear,
            used,
            np.full(len(used), np.nan),
        )
    whittle = whittle_of(spectrum.taken(used), limit.highest)
    quantization = limit.highest >= _QUANTIZATION_BAND * spectrum.rate
    candidates = compare(whittle, quantization=quantization)
    sinusoids = [_line_parameters(line) for line in lines if line.narrow]
    chosen = candidates[0]
    draws: dict[Terms, Posterior] = {}
    # A ramp is no noise: it is believed or not, and does not widen intervals as a possibility.
    alike = [chosen] + [
        c for c in candidates[1:] if c.share >= _LEAST_SHARE and not c.found.terms.ramp
    ]
    wider = [c for c in candidates if c.found.terms in _with_one_more(chosen.found.terms)]
    for candidate in candidates:
        terms = candidate.found.terms
        if candidate in alike or candidate in wider or terms == PAPERS:
            part = 1.0 if terms == PAPERS or candidate is chosen else candidate.share
            number = max(_FEWEST_DRAWS, round(part * DRAWS))
            draws[terms] = sample(whittle, candidate.found, rng, number)
    estimate = describe("likelihood", whittle, chosen, alike, draws, limit)
    estimate = with_upper_limits(estimate, alike, wider, draws)
    tau = averaging_times(spectrum.rate, float(spectrum.length.max()))
    estimate = with_curve(estimate, alike, wider, draws, tau)
    papers = next(c for c in candidates if c.found.terms == PAPERS)
    gauss_markov = describe("likelihood_gm", whittle, papers, [papers], draws, limit)
    gauss_markov = with_curve(gauss_markov, [papers], (), draws, tau)
    return Likelihood(
        (
            replace(
                estimate,
                lines=sinusoids,
                draws=joint_draws(
                    [(c.found.terms, draws[c.found.terms], drawn_share(c)) for c in alike],
                    whittle.longest,
                ),
            ),
            replace(
                gauss_markov,
                parameters=papers_only(gauss_markov.parameters),
                lines=sinusoids,
                draws=joint_draws([(PAPERS, draws[PAPERS], 1.0)], whittle.longest),
            ),
        ),
        candidates,
        lines,
        limit,
        spectrum,
        clear,
        used,
        whittle_of(spectrum, limit.highest, COARSE).density(chosen.found)
        + chosen.found.ramp**2 * spectrum.ramp,
    )


def _with_one_more(terms: Terms) -> list[Terms]:
    """Return the models that have a random walk, or a bias instability, that a model has not."""
    wider = []
    terms = replace(terms, ramp=False)
    if "K" not in terms.linear:
        wider.append(replace(terms, linear=terms.linear + "K"))
    if "F" not in terms.linear and terms.gauss_markov == 0:
        wider.append(replace(terms, linear=terms.linear.replace("N", "NF")))
        wider.append(replace(terms, gauss_markov=1))
    return wider


def lines_and_band(
    spectrum: Spectrum,
    line_spectra: Sequence[LineSpectrum],
    asked: float | None = None,
    bandwidth: float | None = None,
) -> tuple[list[Line], NDArray[np.bool_], NDArray[np.bool_], Band]:
    """Find the lines of a spectrum, and the bins that show noise and nothing else.

    Parameters
    ----------
    spectrum : Spectrum
    line_spectra : sequence of LineSpectrum
        As `imubench_pipeline.spectrum.spectra` gives them.
    asked, bandwidth : float, optional
        ``band`` and ``bandwidth`` of `fit`.

    Returns
    -------
    lines : list of Line
    clear, used : ndarray of bool, shape (b,)
        The bins clear of lines, and those of them below the end of the band.
    band : Band
    """
    everything = np.ones(len(spectrum.frequency), dtype=np.bool_)
    start = min(asked or np.inf, 0.05 * spectrum.rate)
    below = spectrum.upper <= start
    if below.sum() < _FEWEST_BINS:
        below = everything
    found = whittle_of(spectrum.taken(below), start, COARSE).maximum(Terms("NFK", 1))
    low = spectrum.block > 1
    crossover = float(spectrum.upper[low].max()) if low.any() else 0.0
    lines = find(line_spectra, model_of(found), spectrum.rate, crossover)
    clear = everything
    if lines:
        density = whittle_of(spectrum, 0.5 * spectrum.rate, COARSE).density(found)
        clear = without_lines(spectrum, lines, density)
    band = find_band(spectrum, clear, asked=asked, bandwidth=bandwidth)
    return lines, clear, clear & (spectrum.upper <= band.highest * (1.0 + 1e-9)), band


def model_of(found: Maximum) -> NoiseModel:
    """Return the noise model of a fit; flicker noise comes first, then processes by T_B."""
    terms = found.terms
    values = {letter: found.parameter(letter) for letter in terms.linear}
    processes = [
        GaussMarkov(float(B), float(time))
        for B, time in zip(found.biases, found.times, strict=True)
    ]
    first = None if "F" in values or not processes else processes.pop(0)
    return NoiseModel(
        Q=values.get("Q", 0.0),
        N=values.get("N", 0.0),
        B=values.get("F", first.B if first else 0.0),
        T_B=first.T_B if first else None,
        K=values.get("K", 0.0),
        R=found.ramp,
        further=[process for process in processes if process.B > 0],
    )


def _line_parameters(line: Line) -> dict[str, Parameter]:
    return {
        "amplitude": Parameter(
            line.amplitude, lower=line.amplitude_lower, upper=line.amplitude_upper
        ),
        "frequency": Parameter(
            line.frequency, lower=line.frequency_lower, upper=line.frequency_upper
        ),
    }
