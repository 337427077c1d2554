"""What of a spectrum is fitted, and behind what: lines apart, the sensor's low-pass, the band.

Noise alone and noise behind a low-pass are decided together, by likelihood over the whole spectrum
(`imubench_pipeline.estimators.cutoff`). Frequencies are left out only where neither explains them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.band import Band, find_band
from imubench_pipeline.estimators.cutoff import Cutoff, find_cutoff
from imubench_pipeline.estimators.filter_fits import PROCESSES, UNFOLDED
from imubench_pipeline.estimators.joint_cutoff import refine_cutoff
from imubench_pipeline.estimators.lines import Line, find, without_lines
from imubench_pipeline.estimators.model_choice import Candidate, rescore
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum
from imubench_pipeline.estimators.whittle import (
    COARSE,
    SHAPES,
    Terms,
    Whittle,
    model_of,
    whittle_of,
)
from imubench_pipeline.typing import Array

Mask = NDArray[np.bool_]

_FOR_LINES = 0.05
"""Part of the rate below which a model is fitted that lines stand out of."""

_TO_NYQUIST = "found: the spectrum follows its model up to Nyquist"

_FASTEST = 3.0
"""Sampling intervals: shortest correlation of a process where longer ones explain nothing."""

_APART = 60.0
"""Correlation time of a process over that of a filter beyond which each has its own bend."""

_QUANTIZATION_BAND = 1 / 10
"""Part of the rate that the band must reach for quantization noise to show."""

FEWEST_BINS = 20
"""The papers' model can be fitted to so many, and to spare."""


@dataclass(frozen=True)
class Frame:
    """What of a spectrum is fitted."""

    lines: Sequence[Line]
    clear: Mask
    used: Mask
    """(b,): the bins clear of lines, and those of them that are fitted."""
    band: Band  # highest frequency that is fitted, and why
    low_pass: Cutoff | None = None
    """The sensor's low-pass; None where a band is asked for, which is taken as it is."""
    shortest: float | None = None
    """Shortest correlation time of a process, s; None: as `whittle_of` has it."""
    stated: float | None = None  # cut-off of the sensor's own filter, where it is stated, Hz
    cut: bool = False  # frequencies are left out that neither a process nor a filter explains

    def whittle(self, spectrum: Spectrum) -> Whittle:
        """Return the likelihood of the bins that are fitted."""
        return self._whittle(spectrum, self.used, SHAPES)

    def whole(self, spectrum: Spectrum) -> Whittle:
        """Return that of all bins, to carry a fit on to those that are not."""
        return self._whittle(spectrum, np.ones(len(self.used), dtype=np.bool_), COARSE)

    def _whittle(self, spectrum: Spectrum, bins: Mask, shapes: int) -> Whittle:
        behind = self.low_pass.behind if self.low_pass is not None else None
        return whittle_of(
            spectrum.select(bins),
            self.band.highest,
            shapes,
            shortest=self.shortest,
            behind=behind.select(bins) if behind is not None else None,
        )

    def has_a_bend_of_each_model(self, spectrum: Spectrum, times: Array) -> bool:
        """Return whether each model of the noise, of given T_B in s, has a cut-off of its own.

        So it is where the low-pass bends the spectrum well below Nyquist; higher up, what folds
        decides, unless a process is as fast as the low-pass, or nearly.
        """
        if self.low_pass is None or self.low_pass.behind is None:
            return False
        cutoffs = [allowed.filter.cutoff for allowed in self.low_pass.allowed]
        shared = len(times) > 0 and times.min() < _APART / (2.0 * np.pi * cutoffs[0])
        return bool(shared or max(cutoffs) < UNFOLDED * spectrum.rate)

    def refine(self, spectrum: Spectrum, candidates: Sequence[Candidate]) -> Frame:
        """Return the same behind a low-pass that is fitted together with the best of models."""
        if self.low_pass is None:
            return self
        low_pass = refine_cutoff(self.low_pass, spectrum, self.used, candidates)
        source = self.band.source.replace(self.low_pass.words, low_pass.words)
        return replace(self, low_pass=low_pass, band=replace(self.band, source=source))

    def rescore(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Return models by what they explain with a cut-off of their own, the best first."""
        models = self.low_pass.models if self.low_pass is not None else {}
        gained = {terms: model.gained for terms, model in models.items()}
        return rescore(candidates, gained)

    @property
    def folding(self) -> float:
        """Density of white noise that the log shows at low frequencies, over N^2."""
        if self.low_pass is None or self.low_pass.behind is None:
            return 1.0
        return float(self.low_pass.behind.white[0])

    def in_the_log(self, posterior: Posterior, terms: Terms, rng: np.random.Generator) -> Posterior:
        """Return draws of a model behind the low-pass with N as the log shows it, at its lowest.

        What is not known of the filter bends the spectrum down to there, and is in N.
        """
        factors = np.array(math.sqrt(self.folding))
        if self.low_pass is not None and self.low_pass.readings:
            number = len(posterior.parameters)
            factors = factors * self.low_pass.factors(number, rng, terms, in_the_log=True)
        return _scaled(posterior, terms, factors)

    def before_the_filter(
        self, posterior: Posterior, terms: Terms, rng: np.random.Generator
    ) -> Posterior:
        """Return draws of a model behind the low-pass with what is not known of that in N."""
        if self.low_pass is None or not self.low_pass.readings:
            return posterior
        return _scaled(
            posterior, terms, self.low_pass.factors(len(posterior.parameters), rng, terms)
        )

    def shows_quantization(self, rate: float) -> bool:
        """Return whether quantization noise would show: no filter in front, and high enough."""
        behind = self.low_pass is not None and self.low_pass.behind is not None
        return not behind and self.band.highest >= _QUANTIZATION_BAND * rate

    def with_fast_processes(self, rate: float) -> Frame:
        """Return the whole spectrum behind no filter, with processes of a few samples."""
        return replace(
            self,
            used=self.clear,
            band=Band(0.5 * rate, _TO_NYQUIST),
            low_pass=_none(self.low_pass),
            shortest=_FASTEST / rate,
        )

    def limited(self, spectrum: Spectrum) -> Frame:
        """Return the frequencies that no filter bends, behind none: where nothing explains all."""
        band = find_band(spectrum, self.clear, bandwidth=self.stated)
        used = self.clear & (spectrum.upper <= band.highest * (1.0 + 1e-9))
        cut = band.highest < 0.5 * spectrum.rate
        return Frame(self.lines, self.clear, used, band, _none(self.low_pass), cut=cut)


def _scaled(posterior: Posterior, terms: Terms, factors: Array) -> Posterior:
    if "N" not in terms.linear:
        return posterior
    parameters = posterior.parameters.copy()
    parameters[:, terms.linear.index("N")] *= factors
    return replace(posterior, parameters=parameters)


def _none(low_pass: Cutoff | None) -> Cutoff | None:
    """Return a low-pass that is told, and not fitted behind."""
    return None if low_pass is None else replace(low_pass, behind=None, readings=(), models={})


def frame_of(
    spectrum: Spectrum,
    line_spectra: Sequence[LineSpectrum],
    *,
    band: float | None = None,
    bandwidth: float | None = None,
    resolution: float = 0.0,
) -> Frame:
    """Find the lines of a spectrum and the sensor's low-pass.

    Parameters
    ----------
    line_spectra : sequence of LineSpectrum
        As `imubench_pipeline.estimators.spectrum.spectra` gives them.
    band : float, optional
        Highest frequency to use, Hz; by default all are used, behind the low-pass that shows.
    bandwidth : float, optional
        Cut-off of the sensor's own filter, where it is stated, Hz.
    resolution : float
        Step of the register, SI; 0 where none shows.
    """
    lines, clear = _lines(spectrum, line_spectra, band)
    nyquist = 0.5 * spectrum.rate
    if band is not None:
        limit = find_band(spectrum, clear, asked=band)
        used = clear & (spectrum.upper <= limit.highest * (1.0 + 1e-9))
        return Frame(lines, clear, used, limit, shortest=PROCESSES / spectrum.rate)
    low_pass = find_cutoff(spectrum, clear, resolution=resolution, stated=bandwidth)
    if low_pass.or_quantization:
        low_pass = replace(low_pass, behind=None, readings=())
    used, source = clear, _TO_NYQUIST
    if low_pass.behind is not None and low_pass.ruled is not None:
        used = clear & ~low_pass.ruled
        source = f"found: behind a {low_pass.words}, {source.removeprefix('found: ')}"
    highest = nyquist
    if used.any() and not used[clear][-1]:
        highest = float(spectrum.upper[used].max())
        source = (
            f"{source.removesuffix(' up to Nyquist')} up to {highest:.4g} Hz; beyond, the filter "
            "leaves nothing of it"
        )
    shortest = PROCESSES / spectrum.rate
    return Frame(lines, clear, used, Band(highest, source), low_pass, shortest, bandwidth)


def _lines(
    spectrum: Spectrum, line_spectra: Sequence[LineSpectrum], band: float | None
) -> tuple[list[Line], Mask]:
    """Return the lines, and the bins clear of them."""
    all_bins = np.ones(len(spectrum.frequency), dtype=np.bool_)
    start = min(band or np.inf, _FOR_LINES * spectrum.rate)
    below = spectrum.upper <= start
    if below.sum() < FEWEST_BINS:
        below = all_bins
    maximum = whittle_of(spectrum.select(below), start, COARSE).maximum(Terms("NFK", 1))
    low = spectrum.block > 1
    crossover = float(spectrum.upper[low].max()) if low.any() else 0.0
    lines = find(line_spectra, model_of(maximum), spectrum.rate, crossover)
    if not lines:
        return lines, all_bins
    density = whittle_of(spectrum, 0.5 * spectrum.rate, COARSE).density(maximum)
    return lines, without_lines(spectrum, lines, density)
