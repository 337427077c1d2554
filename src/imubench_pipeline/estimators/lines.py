"""Spectral lines: detection of sinusoids in the spectrum, and selection for the noise model.

They are detected in Hann-windowed Fourier spectra averaged over segments (P. D. Welch, IEEE Trans.
Audio Electroacoust. 15, 1967). Under the model the density of a bin over its expectation is
chi-squared with two degrees of freedom per segment. Of many lines, the weaker ones are merged to
one: A^2 = sum A_i^2 and f^2 = A^2 / sum (A_i / f_i)^2 preserve the variance of the signal and of
its integral.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import betainc, gammainccinv

from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings.spectrum import TooManyLines
from imubench_pipeline.words.reasons import spectra as texts

FALSE_ALARM_PROBABILITY = 0.005  # Probability that a line is detected in a channel without lines
_MEDIAN_BINS = 129  # Bins of the median filter that corrects the model around a bin
_MEDIAN_EFFICIENCY = 1.0 / (1.94 * 1.57)  # Independent bins per bin of a median of correlated ones
_MAX_FOUND = 1000  # Maximum number of lines of a spectrum; the cost of comparing them is quadratic
_SKIPPED_BINS = 2
_FIRST_BIN = 4
_LINE_HALF_WIDTH = 3  # Bins on each side of a line that contain its power
_MAX_SINUSOID_BINS = 8
_WIDTH_LEVEL = 0.1  # Fraction of the highest excess at which the width of a line is measured
_NEIGHBOUR_START, _NEIGHBOUR_END = 5, 20  # Bins from a sinusoid to its neighbourhood
_MAX_NEIGHBOUR_CHANCE = 1e-4
_MIN_AMPLITUDE_RATIO = 1.1
_MAX_LINE_LEAKAGE = 0.3  # Leakage into a bin of the likelihood, in standard errors of the bin

# Sums over the bins of a line of the squared correlations of Hann-windowed Fourier coefficients
# (1, 2/3 and 1/6 at a distance of 0, 1 and 2 bins), without and with the distances as weights;
# the cross terms of line and noise; and the minimum error.
_POWER_ERROR_TERMS = (12.6, 35.0 / 18.0, 4e-3)
_PLACE_ERROR_TERMS = (50.0, 5.0 / 18.0, 5e-3)
MAX_LINES = 16  # Lines that are used individually; the weaker ones together are one more


@dataclass(frozen=True)
class Line:
    """A spectral line with 95 % limits: a sinusoid, a band of noise, or an alias of a line."""

    frequency: float  # Hz
    frequency_lower: float
    frequency_upper: float
    amplitude: float  # Omega_0, rad/s or m/s²
    amplitude_lower: float
    amplitude_upper: float
    ratio: float  # its highest density over the noise there
    false_alarm: float
    """Probability of such a ratio anywhere in the spectrum of a channel without lines."""
    width: float  # Hz; a sinusoid is not wider than the resolution
    resolution: float  # distance of the bins, Hz
    kind: Literal["sinusoid", "band", "alias"]

    @property
    def narrow(self) -> bool:
        """Whether the line is a sinusoid."""
        return self.kind == "sinusoid"

    @property
    def term(self) -> Sinusoid:
        """The line as a term of a noise model."""
        return Sinusoid(self.amplitude, self.frequency)


def find_lines(
    spectra: Sequence[LineSpectrum], model: NoiseModel, rate: float, crossover: float
) -> list[Line]:
    """Return the spectral lines, by frequency; block means are used up to ``crossover``, Hz."""
    searched = []
    for spectrum in spectra:
        between = int(crossover / spectrum.frequency[1]) if len(spectra) > 1 else 0
        above = max(_FIRST_BIN, between), len(spectrum.frequency) - 1
        searched.append((_FIRST_BIN, between) if spectrum.block > 1 else above)
    total = sum(max(0, high - low) for low, high in searched)
    lines: list[Line] = []
    for spectrum, (low, high) in zip(spectra, searched, strict=True):
        if high > low:
            new = _find_in_spectrum(spectrum, model, rate, low, high, total)
            if len(new) > _MAX_FOUND:
                new = sorted(new, key=lambda line: -line.ratio)[:_MAX_FOUND]
            # Above its band, the first spectrum has only skirts of strong lines.
            for line in new:
                wide = _LINE_HALF_WIDTH * line.resolution
                same = [
                    other
                    for other in lines
                    if abs(line.frequency - other.frequency) <= wide + 0.5 * other.width
                ]
                if all(line.amplitude > _MIN_AMPLITUDE_RATIO * other.amplitude for other in same):
                    lines = [other for other in lines if other not in same] + [line]
    lines = [_mark_alias(line, lines, spectra[0].block, rate) for line in lines]
    return sorted(lines, key=lambda line: line.frequency)


def _mark_alias(line: Line, lines: list[Line], block: int, rate: float) -> Line:
    """Return a line of block means, with kind alias if a faster line explains it."""
    blocks = rate / block
    for other in lines:
        away = other.frequency - round(other.frequency / blocks) * blocks
        if block == 1 or other.frequency < 0.5 * blocks or line.frequency > 0.5 * blocks:
            continue
        # Block means attenuate both; the amplitude of a line is given without attenuation.
        seen = other.amplitude * _compute_block_gain(other.frequency, block, rate)
        amplitude = line.amplitude * _compute_block_gain(line.frequency, block, rate)
        reach = _LINE_HALF_WIDTH * line.resolution + 0.5 * line.width
        if abs(abs(away) - line.frequency) < reach and amplitude < 2.0 * seen:
            return replace(line, kind="alias")
    return line


def _compute_block_gain(frequency: float, block: int, rate: float) -> float:
    half = math.pi * frequency / rate
    return abs(math.sin(block * half) / (block * math.sin(half))) if block > 1 else 1.0


def _find_in_spectrum(
    spectrum: LineSpectrum, model: NoiseModel, rate: float, low: int, high: int, total: int
) -> list[Line]:
    """Return the lines between two bins; ``total`` bins are tested in all spectra."""
    n = spectrum.segments
    omega = 2.0 * np.pi * spectrum.frequency / rate
    omega[0] = omega[1]
    fitted = model.sampled_spectrum(omega, rate) / rate
    # Subtracting the mean of the segments removes power from the lowest bins.
    ratio = spectrum.density[_SKIPPED_BINS:] / fitted[_SKIPPED_BINS:]
    size = min(_MEDIAN_BINS, len(ratio))
    level = median_filter(ratio, size=size, mode="reflect") / (gammainccinv(n, 0.5) / n)
    level = np.concatenate((np.ones(_SKIPPED_BINS), level))
    noise = fitted * level
    standing = spectrum.density / noise
    # The level, a median of correlated bins, is uncertain too: Fisher's F distribution.
    m = n * size * _MEDIAN_EFFICIENCY
    chance = total * betainc(m, n, m / (m + n * standing))
    significant = np.flatnonzero(chance[low:high] < FALSE_ALARM_PROBABILITY) + low
    if len(significant) == 0:
        return []
    lines: list[Line] = []
    last = significant[:0]
    for group in np.split(significant, np.flatnonzero(np.diff(significant) > _LINE_HALF_WIDTH) + 1):
        line = _estimate_line(spectrum, noise, standing, chance, group, rate)
        if lines and lines[-1].kind == line.kind == "band" and group[0] - last[-1] < _NEIGHBOUR_END:
            # A band of noise may be above the threshold in pieces.
            group = np.concatenate((last, group))
            lines[-1] = _estimate_line(spectrum, noise, standing, chance, group, rate)
        else:
            lines.append(line)
        last = group
    return lines


def _estimate_line(
    spectrum: LineSpectrum,
    noise: Array,
    standing: Array,
    chance: Array,
    group: NDArray[np.int64],
    rate: float,
) -> Line:
    step = float(spectrum.frequency[1])
    n = spectrum.segments
    peak = int(group[np.argmax(standing[group])])
    above = spectrum.density[group] - noise[group]
    high = group[above > _WIDTH_LEVEL * above.max()]
    across = int(high[-1] - high[0]) + 1
    wide = across > _MAX_SINUSOID_BINS or not _is_above_neighbours(spectrum, peak)
    first = max(1, (int(high[0]) if wide else peak) - _LINE_HALF_WIDTH)
    last = min(len(noise) - 1, (int(high[-1]) if wide else peak) + _LINE_HALF_WIDTH)
    bins = np.arange(first, last + 1)
    excess = spectrum.density[bins] - noise[bins]
    power = max(float(excess.sum()), float(excess.max()))
    places = spectrum.frequency[bins]
    place = float(np.clip(excess @ places / power, places[0], places[-1]))
    to_noise = power / float(noise[peak])
    power_error, place_error = (
        math.hypot(math.sqrt((noise_sum / to_noise**2 + 2.0 * cross / to_noise) / n), floor)
        for noise_sum, cross, floor in (_POWER_ERROR_TERMS, _PLACE_ERROR_TERMS)
    )
    place_error *= step
    if wide:
        place_error = math.hypot(place_error, step * across / math.sqrt(12.0 * n))
    # A line of amplitude A has the power A^2 / 4 at +f; block means attenuate it.
    amplitude = 2.0 * math.sqrt(power * step) / _compute_block_gain(place, spectrum.block, rate)
    low, high = (math.sqrt(max(0.0, 1.0 + sign * SIGMAS * power_error)) for sign in (-1, 1))
    return Line(
        frequency=place,
        frequency_lower=place - SIGMAS * place_error,
        frequency_upper=place + SIGMAS * place_error,
        amplitude=amplitude,
        amplitude_lower=amplitude * low,
        amplitude_upper=amplitude * high,
        ratio=float(standing[peak]),
        false_alarm=float(min(1.0, chance[group].min())),
        width=float(across) * step,
        resolution=step,
        kind="band" if wide else "sinusoid",
    )


def _is_above_neighbours(spectrum: LineSpectrum, peak: int) -> bool:
    """Return whether a bin is significantly above its neighbourhood, not only above the model."""
    beside = np.r_[
        peak - _NEIGHBOUR_END : peak - _NEIGHBOUR_START + 1,
        peak + _NEIGHBOUR_START : peak + _NEIGHBOUR_END + 1,
    ]
    beside = beside[(beside >= _SKIPPED_BINS) & (beside < len(spectrum.density))]
    n = spectrum.segments
    level = float(np.median(spectrum.density[beside])) / (gammainccinv(n, 0.5) / n)
    m = n * len(beside) * _MEDIAN_EFFICIENCY
    chance = betainc(m, n, m / (m + n * float(spectrum.density[peak]) / level))
    return bool(chance < _MAX_NEIGHBOUR_CHANCE)


def mask_lines(spectrum: Spectrum, lines: Sequence[Line], density: Array) -> NDArray[np.bool_]:
    """Return a mask of the bins without leakage from lines, given the fitted density, (b,)."""
    clear = np.ones(len(spectrum.frequency), dtype=np.bool_)
    allowed = _MAX_LINE_LEAKAGE * density * np.minimum(np.sqrt(2.0 / spectrum.ordinates), 1.0)
    for line in lines:
        reach = line.amplitude / (math.pi * np.sqrt(8.0 * allowed * spectrum.length))
        wide = 0.5 * line.resolution if line.narrow else 0.5 * line.width
        reach = np.maximum(reach, 1.0 / spectrum.length) + wide
        first, last = line.frequency - reach, line.frequency + reach
        clear &= (spectrum.upper < first) | (spectrum.lower > last)
    return clear


def select_sinusoids(lines: Sequence[Line]) -> list[dict[str, Parameter]]:
    """Return amplitude and frequency of the sinusoids among detected lines, sorted by frequency."""
    single, weaker = _separate_weaker(lines)
    sinusoids = []
    for line in single:
        A = Parameter(line.amplitude, lower=line.amplitude_lower, upper=line.amplitude_upper)
        f = Parameter(line.frequency, lower=line.frequency_lower, upper=line.frequency_upper)
        sinusoids.append({"amplitude": A, "frequency": f})
    if weaker:
        amplitude, low, high = (
            math.hypot(*values)
            for values in zip(
                *((x.amplitude, x.amplitude_lower, x.amplitude_upper) for x in weaker), strict=True
            )
        )
        turns = math.hypot(*(line.amplitude / line.frequency for line in weaker))
        places = [line.frequency for line in weaker]
        reason = texts.grouped_lines(len(weaker), min(places), max(places))
        A = Parameter(amplitude, reason=reason, lower=low, upper=high)
        f = Parameter(amplitude / turns, reason=reason, lower=min(places), upper=max(places))
        sinusoids.append({"amplitude": A, "frequency": f})
    return sorted(sinusoids, key=lambda sinusoid: sinusoid["frequency"].value or 0.0)


def _separate_weaker(lines: Sequence[Line]) -> tuple[list[Line], list[Line]]:
    """Return the sinusoids that are used individually, and the weaker ones."""
    narrow = sorted((line for line in lines if line.narrow), key=lambda line: -line.amplitude)
    return narrow[:MAX_LINES], narrow[MAX_LINES:]


def describe_grouping(channel: str, lines: Sequence[Line]) -> Finding:
    """Return the warning for a channel with more than `MAX_LINES` sinusoids."""
    single, weaker = _separate_weaker(lines)
    rest, total = (sum(0.5 * x.amplitude**2 for x in group) for group in (weaker, lines))
    data = TooManyLines(len(lines), len(single), rest / total, math.sqrt(rest))
    return find(data, "warning", float(len(lines)), channel)
