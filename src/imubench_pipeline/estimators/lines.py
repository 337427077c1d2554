"""Lines: sinusoids that stand out of the fitted spectrum, and those that a noise model carries on.

They are looked for in Hann-windowed Fourier spectra averaged over segments, so a line need not
keep its phase over the whole log. Under the model the density of a bin over its expectation is
chi-squared with two degrees of freedom for each segment.

Each line is two states of a Kalman filter and an integral of an error budget; some steps cost the
square or the cube of their number. So the strongest are carried on as they are. The weaker ones are
joined in a few groups of neighbours, a floor of the same power: of n sinusoids A_i at f_i,

    A^2 = sum A_i^2,   f^2 = A^2 / sum (A_i / f_i)^2,

which keeps the variance of the signal, and of its integral.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import betainc, gammainccinv

from imubench_pipeline.estimators.estimate import SI_UNITS, SIGMAS, Parameter
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum
from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array

FALSE_ALARM = 0.005
"""Chance that a channel without lines shows one."""

_LEVEL = 129
"""Bins over which the median tells how far the model is from the spectrum around a bin."""

_MEDIAN_KNOWS = 1.0 / (1.94 * 1.57)
"""Independent bins in a bin of the median: neighbours are correlated, and a median wastes some."""

_MOST_FOUND = 1000
"""Lines of a spectrum, the strongest: what compares them costs the square of their number."""

_DISTURBED = 2
_FIRST = 4
_BESIDE = 3
"""Bins on either side of a line that hold its power."""

_WIDEST = 8
_SKIRT = 0.1
"""Part of the highest excess down to which a line's width is counted."""

_NEAR, _FAR = 5, 20
"""Bins between which the neighbourhood lies that a sinusoid stands out of."""

_BY_CHANCE = 1e-4
_SHARPER = 1.1
_LEAKS = 0.3
"""Part of the standard error of a bin of the likelihood by which a line may raise it."""

# Sums over the bins of a line of the squared correlations of Hann-windowed Fourier coefficients
# (1, 2/3 and 1/6 at a distance of 0, 1 and 2 bins), without and with the distances as weights;
# what a line on a bin makes of them; and the least error.
_POWER = (12.6, 35.0 / 18.0, 4e-3)
_PLACE = (50.0, 5.0 / 18.0, 5e-3)

STRONGEST = 12
"""Lines that are carried as they are where there are too many."""

GROUPS = 4
"""Groups of the weaker ones."""

MOST = STRONGEST + GROUPS
"""So many lines are carried without being joined."""


@dataclass(frozen=True)
class Line:
    """A line that was found.

    Attributes
    ----------
    frequency, frequency_lower, frequency_upper : float
        Hz, with 95 % limits.
    amplitude, amplitude_lower, amplitude_upper : float
        Omega_0, rad/s or m/s², with 95 % limits.
    ratio : float
        Its highest density over that of the noise there.
    false_alarm : float
        Chance of such a ratio somewhere in the spectrum of a channel without lines.
    width : float
        How wide it is, Hz; a sinusoid is not wider than the resolution.
    resolution : float
        Distance of the bins, Hz.
    kind : {"sinusoid", "band", "alias"}
        A band of noise is wider, or does not stand out of its neighbourhood; an alias is what
        block means make of a faster line.
    """

    frequency: float
    frequency_lower: float
    frequency_upper: float
    amplitude: float
    amplitude_lower: float
    amplitude_upper: float
    ratio: float
    false_alarm: float
    width: float
    resolution: float
    kind: Literal["sinusoid", "band", "alias"]

    @property
    def narrow(self) -> bool:
        """Whether it is a sinusoid."""
        return self.kind == "sinusoid"

    @property
    def term(self) -> Sinusoid:
        """The noise term."""
        return Sinusoid(self.amplitude, self.frequency)


def find(
    spectra: Sequence[LineSpectrum], model: NoiseModel, rate: float, crossover: float
) -> list[Line]:
    """Find the lines of a log, by frequency.

    Parameters
    ----------
    spectra : sequence of LineSpectrum
        Of block means for frequencies up to ``crossover``, Hz, and of samples beyond; or one alone.
    model : NoiseModel
        What was fitted to the spectrum; a median over neighbouring bins mends it where it does
        not follow.
    """
    divided = crossover if len(spectra) > 1 else 0.0
    searched = [_range(spectrum, divided) for spectrum in spectra]
    total = sum(max(0, high - low) for low, high in searched)
    lines: list[Line] = []
    for spectrum, (low, high) in zip(spectra, searched, strict=True):
        if high > low:
            new = _lines(spectrum, model, rate, low, high, total)
            if len(new) > _MOST_FOUND:
                new = sorted(new, key=lambda line: -line.ratio)[:_MOST_FOUND]
            lines = _joined(lines, new)
    lines = [_without_alias(line, lines, spectra[0].block, rate) for line in lines]
    return sorted(lines, key=lambda line: line.frequency)


def _joined(lines: list[Line], new: list[Line]) -> list[Line]:
    """Join the lines of two spectra: one near the crossover shows in both, sharper in the first.

    Of a strong line beyond the crossover the first has the skirt only.
    """
    joined = list(lines)
    for line in new:
        same = [other for other in joined if _same(line, other)]
        if all(line.amplitude > _SHARPER * other.amplitude for other in same):
            joined = [other for other in joined if other not in same] + [line]
    return joined


def _without_alias(line: Line, lines: list[Line], block: int, rate: float) -> Line:
    """Return a line of block means, named an alias if a faster line explains it."""
    blocks = rate / block
    for other in lines:
        away = other.frequency - round(other.frequency / blocks) * blocks
        if block == 1 or other.frequency < 0.5 * blocks or line.frequency > 0.5 * blocks:
            continue
        # Both are seen through the mean of a block; the amplitude of a line is given without.
        seen = other.amplitude * _gain(other.frequency, block, rate)
        amplitude = line.amplitude * _gain(line.frequency, block, rate)
        close = abs(abs(away) - line.frequency) < _BESIDE * line.resolution + 0.5 * line.width
        if close and amplitude < 2.0 * seen:
            return replace(line, kind="alias")
    return line


def _gain(frequency: float, block: int, rate: float) -> float:
    """Return the amplitude that a sinusoid of 1 has in means of blocks."""
    half = math.pi * frequency / rate
    return abs(math.sin(block * half) / (block * math.sin(half))) if block > 1 else 1.0


def _range(spectrum: LineSpectrum, crossover: float) -> tuple[int, int]:
    """Return the first bin to look at, and the one past the last."""
    between = int(crossover / spectrum.frequency[1])
    if spectrum.block > 1:
        return _FIRST, between
    return max(_FIRST, between), len(spectrum.frequency) - 1


def _same(line: Line, other: Line) -> bool:
    wide = _BESIDE * line.resolution + 0.5 * other.width
    return abs(line.frequency - other.frequency) <= wide


def _lines(
    spectrum: LineSpectrum, model: NoiseModel, rate: float, low: int, high: int, total: int
) -> list[Line]:
    n = spectrum.segments
    omega = 2.0 * np.pi * spectrum.frequency / rate
    omega[0] = omega[1]
    fitted = model.sampled_spectrum(omega, rate) / rate
    # The lowest bins have lost their power with the mean of the segments.
    ratio = spectrum.density[_DISTURBED:] / fitted[_DISTURBED:]
    size = min(_LEVEL, len(ratio))
    level = median_filter(ratio, size=size, mode="reflect") / (gammainccinv(n, 0.5) / n)
    level = np.concatenate((np.ones(_DISTURBED), level))
    noise = fitted * level
    standing = spectrum.density / noise
    # The level is uncertain too, as the median of correlated bins is: Fisher's F distribution.
    m = n * size * _MEDIAN_KNOWS
    chance = total * betainc(m, n, m / (m + n * standing))
    significant = np.flatnonzero(chance[low:high] < FALSE_ALARM) + low
    if len(significant) == 0:
        return []
    groups = np.split(significant, np.flatnonzero(np.diff(significant) > _BESIDE) + 1)
    lines = [_line(spectrum, noise, standing, chance, group, rate) for group in groups]
    return _bands_merged(lines)


def _bands_merged(lines: list[Line]) -> list[Line]:
    """Merge neighbouring pieces of a band of noise."""
    merged: list[Line] = []
    for line in lines:
        last = merged[-1] if merged else None
        near = _FAR * line.resolution + 0.5 * ((last.width if last else 0.0) + line.width)
        both_wide = last and not (last.narrow or line.narrow)
        if last and both_wide and line.frequency - last.frequency < near:
            merged[-1] = _both(last, line)
        else:
            merged.append(line)
    return merged


def _both(first: Line, second: Line) -> Line:
    """Return a band of noise that holds two."""
    power = first.amplitude**2 + second.amplitude**2
    share = first.amplitude**2 / power
    grown = math.sqrt(power)
    stronger = first if first.ratio > second.ratio else second
    return replace(
        stronger,
        frequency=share * first.frequency + (1.0 - share) * second.frequency,
        frequency_lower=first.frequency_lower,
        frequency_upper=second.frequency_upper,
        amplitude=grown,
        amplitude_lower=math.hypot(first.amplitude_lower, second.amplitude_lower),
        amplitude_upper=math.hypot(first.amplitude_upper, second.amplitude_upper),
        false_alarm=min(first.false_alarm, second.false_alarm),
        width=second.frequency - first.frequency + 0.5 * (first.width + second.width),
    )


def _line(
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
    high = group[above > _SKIRT * above.max()]
    across = int(high[-1] - high[0]) + 1
    wide = across > _WIDEST or not _stands_out(spectrum, peak)
    first = max(1, (int(high[0]) if wide else peak) - _BESIDE)
    last = min(len(noise) - 1, (int(high[-1]) if wide else peak) + _BESIDE)
    bins = np.arange(first, last + 1)
    excess = spectrum.density[bins] - noise[bins]
    power = max(float(excess.sum()), float(excess.max()))
    places = spectrum.frequency[bins]
    place = float(np.clip(excess @ places / power, places[0], places[-1]))
    to_noise = power / float(noise[peak])
    power_error, place_error = (
        math.hypot(math.sqrt((noise_sum / to_noise**2 + 2.0 * cross / to_noise) / n), floor)
        for noise_sum, cross, floor in (_POWER, _PLACE)
    )
    place_error *= step
    if wide:
        place_error = math.hypot(place_error, step * across / math.sqrt(12.0 * n))
    # A line of amplitude A has the power A^2 / 4 at +f; block means see it damped.
    amplitude = 2.0 * math.sqrt(power * step) / _gain(place, spectrum.block, rate)
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


def _stands_out(spectrum: LineSpectrum, peak: int) -> bool:
    """Tell whether a bin stands out of the bins a little way off, and not only of the model."""
    beside = np.r_[peak - _FAR : peak - _NEAR + 1, peak + _NEAR : peak + _FAR + 1]
    beside = beside[(beside >= _DISTURBED) & (beside < len(spectrum.density))]
    n = spectrum.segments
    level = float(np.median(spectrum.density[beside])) / (gammainccinv(n, 0.5) / n)
    m = n * len(beside) * _MEDIAN_KNOWS
    chance = betainc(m, n, m / (m + n * float(spectrum.density[peak]) / level))
    return bool(chance < _BY_CHANCE)


def without_lines(spectrum: Spectrum, lines: Sequence[Line], density: Array) -> NDArray[np.bool_]:
    """Return the bins of a spectrum that lines leave as they are.

    ``density``, shape (b,), is the fitted one of each bin: a strong line reaches further, as 1/f²,
    than a weak one.
    """
    clear = np.ones(len(spectrum.frequency), dtype=np.bool_)
    allowed = _LEAKS * density * np.minimum(np.sqrt(2.0 / spectrum.ordinates), 1.0)
    for line in lines:
        reach = line.amplitude / (math.pi * np.sqrt(8.0 * allowed * spectrum.length))
        wide = 0.5 * line.resolution if line.narrow else 0.5 * line.width
        reach = np.maximum(reach, 1.0 / spectrum.length) + wide
        clear &= (spectrum.upper < line.frequency - reach) | (
            spectrum.lower > line.frequency + reach
        )
    return clear


def carried_sinusoids(lines: Sequence[Line]) -> list[dict[str, Parameter]]:
    """Return amplitude and frequency of the sinusoids that a model carries on, by frequency.

    Of all lines that were found, by frequency, bands of noise and aliases are left out.
    """
    narrow = [line for line in lines if line.narrow]
    if len(narrow) <= MOST:
        return [_line_parameters(line) for line in narrow]
    single = set(strongest([line.amplitude for line in narrow]))
    weaker = [line for place, line in enumerate(narrow) if place not in single]
    sinusoids = [_line_parameters(narrow[place]) for place in single]
    groups = np.array_split(np.arange(len(weaker)), GROUPS)
    sinusoids += [_as_one_line([weaker[i] for i in group]) for group in groups]
    return sorted(sinusoids, key=lambda sinusoid: sinusoid["frequency"].value or 0.0)


def strongest(amplitudes: Sequence[float]) -> list[int]:
    """Return the places of the lines that are carried as they are; all where they are few."""
    number = len(amplitudes) if len(amplitudes) <= MOST else STRONGEST
    order = sorted(range(len(amplitudes)), key=lambda place: -amplitudes[place])
    return sorted(order[:number])


def joined_finding(channel: str, quantity: str, sinusoids: Sequence[Line]) -> Finding:
    """Return the warning about a channel with more sinusoids than a model carries on.

    The quantity is gyro or accel; there are more sinusoids than `MOST`.
    """
    single = set(strongest([sinusoid.amplitude for sinusoid in sinusoids]))
    powers = [0.5 * sinusoid.amplitude**2 for sinusoid in sinusoids]
    rest = math.fsum(power for place, power in enumerate(powers) if place not in single)
    share = rest / math.fsum(powers)
    number = len(sinusoids) - len(single)
    detail = (
        f"{channel} has {len(sinusoids)} sinusoids: the {len(single)} strongest go into error "
        f"budgets, simulations and filters as they are, the other {number} as {GROUPS} of their "
        f"power, {100 * share:.3g} % of that of all lines ({math.sqrt(rest):.3g} "
        f"{SI_UNITS[quantity]['amplitude']} rms)"
    )
    return Finding("too_many_lines", "warning", detail, float(len(sinusoids)), channel)


def _line_parameters(line: Line) -> dict[str, Parameter]:
    return {
        "amplitude": Parameter(
            line.amplitude, lower=line.amplitude_lower, upper=line.amplitude_upper
        ),
        "frequency": Parameter(
            line.frequency, lower=line.frequency_lower, upper=line.frequency_upper
        ),
    }


def _as_one_line(lines: Sequence[Line]) -> dict[str, Parameter]:
    amplitude, low, high = (
        math.hypot(*values)
        for values in (
            [line.amplitude for line in lines],
            [line.amplitude_lower for line in lines],
            [line.amplitude_upper for line in lines],
        )
    )
    frequency = amplitude / math.hypot(*(line.amplitude / line.frequency for line in lines))
    first, last = lines[0].frequency, lines[-1].frequency
    reason = f"{len(lines)} weak lines from {first:.4g} to {last:.4g} Hz together"
    return {
        "amplitude": Parameter(amplitude, reason=reason, lower=low, upper=high),
        "frequency": Parameter(frequency, reason=reason, lower=first, upper=last),
    }
