"""Findings on the spectrum of a channel: lines, a low-pass filter, missing slow noise."""

import math
from collections.abc import Iterable

import numpy as np
from scipy.special import chdtr

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.frame import FitSelection
from imubench_pipeline.estimators.lines import MAX_LINES, Line, describe_grouping
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings import spectrum as words
from imubench_pipeline.words.reasons import estimates as texts

_MIN_SINUSOID_RATIO = 0.5  # Integral of a sinusoid over the integral of white noise after 1 s
_MAX_SLOW_FREQUENCY = 0.05  # Highest frequency over the rate in the test for missing slow noise
_MIN_FLAT_RATIO = 0.95  # Minimum fitted density over N^2, below the effect of a low-pass filter
_MIN_ORDINATES = 4.0
_MAX_DENSITY_RATIO = 0.7  # Density over N^2 below which slow noise is missing
_MAX_CHANCE = 1e-4  # Maximum false-alarm probability over all sums of a channel
_SPACING_RATIO = 1.4  # Ratio of the numbers of ordinates in successive sums


def spectral_findings(channel: str, frame: FitSelection, white: float | None) -> list[Finding]:
    """Return the findings on the lines and the band of a channel; ``white`` is N, SI, if known."""
    highest, low_pass = frame.band.highest, frame.low_pass
    findings = describe_lines(channel, frame.lines, white)
    if low_pass is not None and low_pass.N is not None and low_pass.N.value is None:
        findings.append(find(words.BandLimit(highest), "note", highest, channel))
    elif low_pass is not None and low_pass.kind is not None and low_pass.frequency.in_model:
        cutoff = low_pass.frequency.in_model
        findings.append(find(words.Filtered(cutoff), "note", cutoff, channel))
    return findings


def describe_lines(channel: str, lines: Iterable[Line], white: float | None) -> list[Finding]:
    """Return a note on lines, and warnings if they are too many, or strong relative to N."""
    group = [line for line in lines if line.kind != "alias"]
    if not group:
        return []
    strongest = max(group, key=lambda line: line.ratio)
    sinusoids = [line for line in group if line.kind == "sinusoid"]
    data = words.Lines(
        len(sinusoids), len(group) - len(sinusoids), strongest.frequency, strongest.ratio
    )
    findings = [find(data, "note", strongest.frequency, channel)]
    if white:
        # After t the integral A / (2 pi f) of a sinusoid differs by A sin(pi f t) / (pi f sqrt(2))
        # rms; the sine is at most 1, or its argument. White noise: N sqrt(t), here t = 1 s.
        integrals = {
            line.amplitude / (math.sqrt(2.0) * max(1.0, math.pi * line.frequency)) / white: line
            for line in sinusoids
        }
        most = max(integrals, default=0.0)
        if most >= _MIN_SINUSOID_RATIO:
            strong = words.StrongLine(integrals[most].frequency, most)
            findings.append(find(strong, "warning", most, channel))
    if len(sinusoids) > MAX_LINES:
        findings.append(describe_grouping(channel, sinusoids))
    return findings


def find_missing_slow_noise(
    channel: str, spectrum: Spectrum, fitted: Array, white: float | None
) -> Finding | None:
    """Return a finding if the lowest frequencies have less power than white noise.

    Slow noise only adds to the density of white noise, N^2, below a sensor's low-pass. If a log has
    a lower density, its bias was zeroed at rest, it passed a high-pass, or a curve or means of its
    parts were subtracted: K, B, and the dead reckoning errors computed from them are too small.
    Ordinates of white noise, divided by N^2, sum to chi-squared with nu degrees of freedom: a sum
    far below is not chance. ``spectrum`` is of the log without corrections. ``fitted``, shape (b,),
    is the density of the chosen model in each bin, or NaN; ``white`` the lower limit of N, SI.
    """
    if not white or not np.isfinite(white):
        return None
    order = np.argsort(spectrum.frequency)
    level = white**2
    low = spectrum.frequency[order] <= _MAX_SLOW_FREQUENCY * spectrum.rate
    order = order[low & ~np.logical_or.accumulate(fitted[order] < _MIN_FLAT_RATIO * level)]
    degrees = np.cumsum(spectrum.ordinates[order])
    power = np.cumsum(spectrum.ordinates[order] * spectrum.density[order]) / level
    sums = np.floor(np.log(np.maximum(degrees, 1.0)) / np.log(_SPACING_RATIO))
    looked = (degrees >= _MIN_ORDINATES) & (np.diff(sums, prepend=-1.0) > 0.0)
    lacking = looked & (power < _MAX_DENSITY_RATIO * degrees)
    if not lacking.any():
        return None
    chance = np.where(lacking, chdtr(degrees, power), 1.0) * looked.sum()
    worst = int(np.argmin(chance))
    if chance[worst] > _MAX_CHANCE:
        return None
    ratio = float(power[worst] / degrees[worst])
    highest = float(spectrum.upper[order[worst]])
    return find(words.SlowNoiseMissing(highest, ratio), "warning", ratio, channel)


def withhold_slow_noise(estimate: Estimate) -> Estimate:
    """Return an estimate of a log that lacks slow noise: K is unknown, and nothing is absent."""

    def withhold(name: str, one: Parameter) -> Parameter:
        if name == "K" or (one.status == "absent" and name != "Q"):
            return Parameter(None, "not_identified", texts.SLOW_NOISE_MISSING, fitted=one.value)
        return one

    return estimate.revised(withhold)
