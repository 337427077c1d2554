"""Selection of the bins that are fitted: excluded lines, the sensor's low-pass filter, the band.

Where the sensor has a low-pass filter (`imubench_pipeline.estimators.cutoff`), the noise is fitted
only up to the frequency at which the filter changes the estimate of S_N by half its standard error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.cutoff import MIN_PROCESS_SAMPLES, Cutoff, find_cutoff
from imubench_pipeline.estimators.lines import Line, find_lines, mask_lines
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum
from imubench_pipeline.estimators.whittle import (
    COARSE,
    SHAPES,
    Terms,
    Whittle,
    make_noise_model,
    make_whittle,
)
from imubench_pipeline.model.states import BandSource
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra as texts

Mask = NDArray[np.bool_]

MIN_BINS = 20  # Bins that a fit needs; the papers' model has four parameters
_LINE_MODEL_BAND = 0.05  # Fraction of the rate below which the model for line detection is fitted
_MIN_CORRELATION_SAMPLES = 3.0  # T_B of the shortest process that is tried without a filter
_MAX_FILTER_BIAS = 0.5  # Bias of S_N within the band, in standard errors
_UNKNOWN_FILTER_BAND = 1 / 10  # Band over the cut-off, if no filter of the family fits the bend
_MIN_QUANTIZATION_BAND = 1 / 10  # Fraction of the rate at which quantization noise is visible


@dataclass(frozen=True)
class Band:
    """The highest frequency that enters the likelihood."""

    highest: float  # Hz
    source: BandSource


@dataclass(frozen=True)
class FitSelection:
    """The part of a spectrum that is fitted."""

    lines: Sequence[Line]
    clear: Mask  # (b,): the bins without lines
    used: Mask  # (b,): the subset that is fitted
    band: Band  # highest frequency that is fitted, and why
    low_pass: Cutoff | None = None
    """The sensor's low-pass filter; None where the user sets the band."""

    @property
    def band_words(self) -> str:
        """Reason for the highest fitted frequency."""
        low_pass = self.low_pass.words if self.low_pass is not None else ""
        return texts.band_text(self.band.source, self.band.highest, low_pass)

    @property
    def gain(self) -> Array | None:
        """Density of white noise over its density at 0 Hz, shape (b,); None without a filter."""
        return self.low_pass.gain if self.low_pass is not None else None

    def whittle(self, spectrum: Spectrum, *, all_bins: bool = False) -> Whittle:
        """Return the likelihood of the fitted bins, or an approximate one of all bins."""
        if not all_bins:
            spectrum = spectrum.select(self.used)
        samples = _MIN_CORRELATION_SAMPLES if self.gain is None else MIN_PROCESS_SAMPLES
        shapes, shortest = COARSE if all_bins else SHAPES, samples / spectrum.rate
        return make_whittle(spectrum, self.band.highest, shapes, shortest=shortest)

    def shows_quantization(self, rate: float) -> bool:
        """Return whether quantization noise is visible: no filter, and a sufficient band."""
        return self.gain is None and self.band.highest >= _MIN_QUANTIZATION_BAND * rate

    def _limit(self, spectrum: Spectrum, highest: float, source: BandSource) -> "FitSelection":
        used = self.used & (spectrum.upper <= highest * (1.0 + 1e-9))
        return replace(self, used=used, band=Band(highest, source))


def select_for_fit(
    spectrum: Spectrum,
    line_spectra: Sequence[LineSpectrum],
    *,
    band: float | None = None,
    bandwidth: float | None = None,
    resolution: float = 0.0,
) -> FitSelection:
    """Find the spectral lines and the low-pass filter, and select the bins to fit.

    ``line_spectra`` are as in `imubench_pipeline.estimators.spectrum.compute_spectra`. ``band`` is
    the highest frequency to use, Hz; by default, as far as the low-pass filter does not matter.
    ``bandwidth`` is the configured cut-off of the sensor's filter, Hz, if known. ``resolution`` is
    the step of the register, SI; 0 if not known.
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
    selection = FitSelection(lines, clear, clear, Band(0.5 * spectrum.rate, "whole"))
    if band is not None:
        return selection._limit(spectrum, min(band, 0.5 * spectrum.rate), "set")
    low_pass = find_cutoff(spectrum, clear, resolution=resolution, stated=bandwidth)
    selection = replace(selection, low_pass=low_pass)
    if low_pass.gain is None:
        return selection
    selection = replace(selection, band=Band(0.5 * spectrum.rate, "filtered"))
    ordinates = np.where(clear, spectrum.ordinates, 0.0)
    # The relative bias of S_N is the mean of G - 1, and its standard error sqrt(2 / nu).
    bias = np.abs(np.cumsum(ordinates * (low_pass.gain - 1.0)))
    bent = bias > _MAX_FILTER_BIAS * np.sqrt(2.0 * np.cumsum(ordinates))
    limit = float(spectrum.lower[bent].min()) if bent.any() else 0.5 * spectrum.rate
    if low_pass.N is not None and low_pass.N.value is None:
        limit = min(limit, _UNKNOWN_FILTER_BAND * (low_pass.frequency.in_model or limit))
    elif not bent.any():
        return selection
    return selection._limit(spectrum, limit, "attenuated")
