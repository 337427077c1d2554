"""A line as its spectrum is expected: power, place, limits, and what is one with it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.estimators.lines import Line, find_lines, mask_lines
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum, compute_spectra
from imubench_pipeline.noise import NoiseModel

RATE, POINTS, SEGMENTS = 100.0, 1024, 20
STEP = RATE / POINTS
FREQUENCY = np.fft.rfftfreq(POINTS, 1.0 / RATE)
WHITE = NoiseModel(N=1.0)


def expected(*lines: tuple[float, float], segments: int = SEGMENTS, block: int = 1) -> LineSpectrum:
    """White noise of N = 1 and sinusoids (frequency, amplitude), Hann window, means of blocks."""
    # The level is that of a median, which is not the mean of chi-squared variates.
    density = np.full(len(FREQUENCY), stats.gamma(segments).median() / segments)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(POINTS) / POINTS)
    window /= np.linalg.norm(window)
    rate = RATE / block
    for frequency, amplitude in lines:
        half = np.pi * frequency / RATE
        damped = np.sin(block * half) / (block * np.sin(half)) if block > 1 else 1.0
        wave = amplitude * damped * np.exp(2j * np.pi * frequency / rate * np.arange(POINTS)) / 2.0
        density += np.abs(np.fft.fft(wave * window)[: len(FREQUENCY)]) ** 2 / rate
    return LineSpectrum(FREQUENCY / block, density, segments, block)


@pytest.mark.parametrize("beside", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("amplitude", [3.0, 10.0])
def test_a_sinusoid_has_its_amplitude_frequency_and_limits(beside: float, amplitude: float) -> None:
    frequency = (200 + beside) * STEP
    (line,) = find_lines([expected((frequency, amplitude))], WHITE, RATE, 0.0)
    assert line.kind == "sinusoid" and line.narrow
    assert line.amplitude == pytest.approx(amplitude, rel=0.01)
    assert line.frequency == pytest.approx(frequency, abs=0.02 * STEP)
    assert line.resolution == STEP
    # Its power over the density of the noise, in bins: the errors of power and place are those of
    # sums over the seven bins around it.
    snr = amplitude**2 / 4.0 / STEP
    power = np.hypot(np.sqrt((12.6 / snr**2 + 2.0 * 35.0 / 18.0 / snr) / SEGMENTS), 4e-3)
    place = np.hypot(np.sqrt((50.0 / snr**2 + 2.0 * 5.0 / 18.0 / snr) / SEGMENTS), 5e-3) * STEP
    assert line.frequency_upper - line.frequency == pytest.approx(1.96 * place, rel=0.03)
    assert line.frequency - line.frequency_lower == pytest.approx(1.96 * place, rel=0.03)
    assert line.amplitude_upper / line.amplitude == pytest.approx(
        np.sqrt(1.0 + 1.96 * power), rel=2e-3
    )
    assert line.amplitude_lower / line.amplitude == pytest.approx(
        np.sqrt(1.0 - 1.96 * power), rel=2e-3
    )


def test_the_chance_of_a_line_counts_bins_and_what_is_known_of_the_level() -> None:
    frequency, amplitude = 200 * STEP, 0.9
    (line,) = find_lines([expected((frequency, amplitude))], WHITE, RATE, 0.0)
    floor = stats.gamma(SEGMENTS).median() / SEGMENTS
    assert line.ratio == pytest.approx(floor + amplitude**2 / 4.0 / STEP * 2.0 / 3.0, rel=1e-6)
    known = SEGMENTS * 129 / 1.94 / 1.57
    chance = stats.f(2 * SEGMENTS, 2 * known).sf(line.ratio)
    assert line.false_alarm == pytest.approx(chance * (len(FREQUENCY) - 1 - 4), rel=1e-6)
    assert 1e-5 < line.false_alarm < 5e-3
    assert not find_lines([expected((frequency, 0.85 * amplitude))], WHITE, RATE, 0.0)


def test_the_lowest_bins_and_the_last_one_show_no_line() -> None:
    for place, number in ((3, 0), (4, 1), (510, 1)):
        spectrum = expected()
        density = spectrum.density.copy()
        density[place] = 100.0
        found = find_lines([replace(spectrum, density=density)], WHITE, RATE, 0.0)
        assert len(found) == number
    spectrum = expected()
    density = spectrum.density.copy()
    density[512] = 100.0
    assert not find_lines([replace(spectrum, density=density)], WHITE, RATE, 0.0)


def test_a_hump_is_one_band_with_the_power_of_all() -> None:
    spectrum = expected()
    hump = 20.0 * np.exp(-0.5 * ((np.arange(len(FREQUENCY)) - 250.0) / 4.0) ** 2)
    (line,) = find_lines([replace(spectrum, density=1.0 + hump)], WHITE, RATE, 0.0)
    assert line.kind == "band"
    assert line.frequency == pytest.approx(250.0 * STEP, abs=0.02 * STEP)
    # Down to a tenth of its top: 2.15 sigma on either side.
    assert line.width == pytest.approx(17.0 * STEP)
    assert line.amplitude**2 / 4.0 / STEP == pytest.approx(hump.sum(), rel=0.05)
    error = STEP * 17.0 / np.sqrt(12.0 * SEGMENTS)
    assert line.frequency_upper - line.frequency == pytest.approx(1.96 * error, rel=0.1)


def test_pieces_of_a_band_are_joined_by_their_power() -> None:
    bins = np.arange(len(FREQUENCY))
    first = 30.0 * (np.abs(bins - 250) < 6) + 90.0 * (np.abs(bins - 275) < 6)
    (band,) = find_lines([replace(expected(), density=1.0 + first)], WHITE, RATE, 0.0)
    assert band.kind == "band"
    assert band.frequency == pytest.approx((0.25 * 250 + 0.75 * 275) * STEP, abs=0.3 * STEP)
    assert band.amplitude**2 / 4.0 / STEP == pytest.approx(11 * 120.0, rel=0.05)
    # From the middle of the one to that of the other, and half of each.
    assert band.width == pytest.approx((25 + 11) * STEP, rel=0.02)
    assert band.frequency_lower < (0.25 * 250 + 0.75 * 275) * STEP < band.frequency_upper
    assert band.amplitude_lower < band.amplitude < band.amplitude_upper
    apart = 30.0 * (np.abs(bins - 250) < 6) + 90.0 * (np.abs(bins - 300) < 6)
    assert len(find_lines([replace(expected(), density=1.0 + apart)], WHITE, RATE, 0.0)) == 2


BLOCK = 8
"""Of the means for low frequencies: 12.5 Hz, bins of 0.012 Hz."""


def test_means_of_blocks_give_the_amplitude_of_the_samples() -> None:
    found = find_lines([expected((3.0, 2.0), block=BLOCK), expected()], WHITE, RATE, 4.0)
    (line,) = found
    assert (line.frequency, line.amplitude) == pytest.approx((3.0, 2.0), rel=0.01)


def test_each_spectrum_has_its_own_side_of_the_crossover() -> None:
    for frequency, number in ((3.0, 1), (5.0, 0)):
        found = find_lines([expected((frequency, 2.0), block=BLOCK), expected()], WHITE, RATE, 4.0)
        assert len(found) == number
    for frequency, number in ((3.0, 0), (5.0, 1)):
        found = find_lines([expected(block=BLOCK), expected((frequency, 2.0))], WHITE, RATE, 4.0)
        assert len(found) == number


@pytest.mark.parametrize(
    ("frequency", "seen", "kind"),
    [
        # 12.5 Hz are the rate of the means, 25 twice that: what lies 1 Hz beside shows there.
        (13.5, 1.0, "alias"),
        (24.0, 1.0, "alias"),
        (13.5, 2.3, "sinusoid"),
        (13.9, 1.0, "sinusoid"),
    ],
)
def test_what_a_fast_line_leaves_in_means_is_its_alias(
    frequency: float, seen: float, kind: str
) -> None:
    def gain(f: float) -> float:
        half = np.pi * f / RATE
        return float(abs(np.sin(BLOCK * half) / (BLOCK * np.sin(half))))

    slow = seen * 9.0 * gain(frequency) / gain(1.0)
    found = find_lines(
        [expected((1.0, slow), block=BLOCK), expected((frequency, 9.0))], WHITE, RATE, 4.0
    )
    assert [line.kind for line in found] == [kind, "sinusoid"]


def line_of(
    frequency: float, amplitude: float, kind: str = "sinusoid", width: float = 0.01
) -> Line:
    return Line(
        frequency, frequency - 1e-3, frequency + 1e-3, amplitude, 0.9 * amplitude, 1.1 * amplitude,
        99.0, 0.0, width, 0.01, kind,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("place", "amplitude", "wide"), [(20.0, 0.1, 1.2), (20.0, 2.0, 1.2), (0.07, 0.3, 0.03)]
)
def test_a_line_takes_the_bins_that_it_raises(place: float, amplitude: float, wide: float) -> None:
    spectrum: Spectrum = compute_spectra(
        [np.random.default_rng(1).standard_normal(20_000)], 20_000, RATE
    )[0]
    density = np.full(len(spectrum.frequency), 1.0 / RATE)
    for kind, half in (("sinusoid", 0.005), ("band", 0.5 * wide)):
        line = line_of(place, amplitude, kind, wide)
        clear = mask_lines(spectrum, [line], density)
        # A sinusoid falls as A^2 / (8 pi^2 D (f - f_0)^2): to a part of 0.3 of the error.
        error = 0.3 * density * np.minimum(np.sqrt(2.0 / spectrum.ordinates), 1.0)
        reach = amplitude / np.sqrt(8.0 * np.pi**2 * error * spectrum.length)
        reach = np.maximum(reach, 1.0 / spectrum.length) + half
        away = np.maximum(spectrum.lower - place, place - spectrum.upper)
        np.testing.assert_array_equal(clear, away > reach)
        assert not clear.all() and clear.any()
