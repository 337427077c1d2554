import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
import scipy.fft
from scipy import stats

from imubench_pipeline.estimators.spectrum import (
    SINGLE,
    LineSpectrum,
    Spectrum,
    _resolution,
    compute_spectra,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE = 50.0
LONG = 1 << 19
"""Samples of a log that is too long for one transform."""


def spectrum_of(log: np.ndarray, **options) -> Spectrum:
    return compute_spectra([log], len(log), RATE, **options)[0]


def whole_transform(log: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and densities of the DCT-II of a log, without its mean."""
    c = scipy.fft.dct(log - log.mean(), type=2, norm="ortho")[1:]
    return np.arange(1, len(log)) * rate / (2 * len(log)), c**2 / rate


def test_the_power_of_a_log_is_in_its_spectrum(rng) -> None:
    log = 9.81 + rng.standard_normal(3001)
    spectrum = spectrum_of(log)
    power = np.sum(spectrum.density * spectrum.ordinates) * RATE
    assert power == pytest.approx(np.sum((log - log.mean()) ** 2), rel=1e-10)
    assert spectrum.mean == pytest.approx(log.mean(), rel=1e-12)
    assert spectrum.duration == 3001 / RATE
    assert spectrum.ordinates.sum() == 3000


def test_single_ordinates_of_white_noise_are_chi_squared_with_one_degree_of_freedom(rng) -> None:
    N = 3e-3
    ratios = np.concatenate(
        [
            spectrum_of(N * np.sqrt(RATE) * rng.standard_normal(500)).density[:SINGLE] / N**2
            for _ in range(150)
        ]
    )
    assert ratios.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(ratios)))
    assert stats.kstest(ratios, stats.chi2(1).cdf).pvalue > 0.01


def test_bins_of_white_noise_scatter_by_their_ordinates(rng) -> None:
    N = 3e-3
    values = []
    for samples in (20_000, 20_000, 300_000, LONG):
        spectrum = spectrum_of(N * np.sqrt(RATE) * rng.standard_normal(samples))
        assert (spectrum.block > 1).any() == (samples > 1 << 18)
        values.append((spectrum.density / N**2 - 1) * np.sqrt(spectrum.ordinates / 2))
        total = np.average(spectrum.density, weights=spectrum.ordinates)
        assert total == pytest.approx(N**2, rel=4 * np.sqrt(2 / spectrum.ordinates.sum()))
    together = np.concatenate(values)
    # chi-squared with one degree of freedom has an excess kurtosis of 12: twice the usual error.
    assert together.mean() == pytest.approx(0.0, abs=4 / np.sqrt(len(together)))
    assert together.std() == pytest.approx(1.0, abs=0.12)


def test_the_lowest_ordinates_stay_single_and_bins_are_five_per_cent_wide(rng) -> None:
    spectrum = spectrum_of(rng.standard_normal(20_000))
    spacing = RATE / 2 / 20_000
    assert (spectrum.ordinates[:SINGLE] == 1).all()
    np.testing.assert_allclose(spectrum.frequency[:SINGLE], spacing * np.arange(1, SINGLE + 1))
    np.testing.assert_allclose(spectrum.lower[0], spacing / 2)
    np.testing.assert_allclose(spectrum.lower[1:], spectrum.upper[:-1], rtol=1e-12)
    np.testing.assert_allclose(spectrum.upper[-1], RATE / 2 - spacing / 2)
    np.testing.assert_allclose(spectrum.upper - spectrum.lower, spacing * spectrum.ordinates)
    ratio = (spectrum.upper / spectrum.lower)[SINGLE:-1]
    assert ratio.min() > 1.05 - 1e-9
    assert (ratio < 1.05 + 1.1 * spacing / spectrum.lower[SINGLE:-1]).all()


@pytest.mark.parametrize("samples", [2000, 300_000])
def test_the_spectrum_does_not_depend_on_how_the_log_is_cut(rng, samples: int) -> None:
    log = 9.81 + np.cumsum(rng.standard_normal(samples)) * 1e-2 + rng.standard_normal(samples)
    whole, lines = compute_spectra([log], samples, RATE)
    cuts = np.sort(rng.integers(0, samples, 40))
    pieces, lines_of_pieces = compute_spectra(np.split(log, cuts), samples, RATE)
    for name in ("frequency", "lower", "upper", "ordinates", "density", "block", "cross"):
        np.testing.assert_allclose(getattr(pieces, name), getattr(whole, name), rtol=1e-6)
    assert pieces.mean == pytest.approx(whole.mean, rel=1e-12)
    assert len(lines_of_pieces) == len(lines)
    for one, other in zip(lines_of_pieces, lines, strict=True):
        np.testing.assert_allclose(one.density, other.density, rtol=1e-6)


def test_two_resolutions_agree_with_the_transform_of_the_whole_log(rng) -> None:
    model = NoiseModel(N=1e-3, B=3e-3, T_B=20.0, K=3e-4)
    log = simulate(model, RATE, LONG, rng)
    spectrum = spectrum_of(log)
    frequency, density = whole_transform(log, RATE)
    bins = np.searchsorted(spectrum.lower, frequency) - 1
    inside = frequency < spectrum.upper[bins]
    whole = np.bincount(bins[inside], weights=density[inside]) / np.bincount(bins[inside])
    ratio = spectrum.density / whole
    low = spectrum.block > 1
    # Block means keep 1 - (omega m)^2 / 12 of a line, omega m <= 1/4, and have the same ordinates.
    assert np.abs(ratio[low] - 1).max() < 0.03
    assert np.average(ratio[low], weights=spectrum.ordinates[low]) == pytest.approx(1.0, abs=0.01)
    # Segments weigh the samples otherwise, so that the two are nearly two estimates.
    scatter = (ratio[~low] - 1) * np.sqrt(spectrum.ordinates[~low] / 2)
    assert np.abs(scatter).max() < 4.0
    assert scatter.std() < 0.6
    assert abs(scatter.mean()) < 0.1


@pytest.mark.parametrize("samples", [(1 << 18) + 1, 292_144, LONG, 600_011])
def test_no_frequency_is_used_twice_or_left_out(rng, samples: int) -> None:
    spectrum = spectrum_of(rng.standard_normal(samples))
    gaps = spectrum.lower[1:] - spectrum.upper[:-1]
    change = np.flatnonzero(np.diff(spectrum.block))
    assert len(change) == 1
    spacing = 1 / (2 * spectrum.length[-1])
    assert -1e-9 * spacing < gaps[change[0]] < spacing
    np.testing.assert_allclose(np.delete(gaps, change), 0.0, atol=1e-6 * spacing)
    number = np.rint(spectrum.ordinates / ((spectrum.upper - spectrum.lower) / spacing))
    segments = samples // round(spectrum.length[-1] * RATE)
    assert (number[change[0] + 1 :] == segments).all()


@pytest.mark.parametrize("length", [5_000, 200_000])
def test_a_jump_between_segments_is_in_no_spectrum(rng, length: int) -> None:
    spans = [(100, length), (length + 300, 2 * length + 50)]
    log = rng.standard_normal(2 * length + 400)
    log[: spans[0][0]] = np.nan
    log[length : length + 300] = np.nan
    log[2 * length + 50 :] = np.nan
    log[length + 300 :] += 1e4
    spectrum, lines = compute_spectra(np.array_split(log, 7), len(log), RATE, spans)
    level = np.average(spectrum.density, weights=spectrum.ordinates)
    assert level * RATE == pytest.approx(1.0, rel=4 * np.sqrt(2 / spectrum.ordinates.sum()))
    assert spectrum.density[:SINGLE].max() * RATE < 25
    assert all(line.density.max() * RATE < 25 for line in lines)
    used = sum(stop - start for start, stop in spans)
    assert spectrum.duration == pytest.approx(used / RATE, rel=1e-3)
    middle = np.mean(np.concatenate([log[start:stop] for start, stop in spans]))
    assert spectrum.mean == pytest.approx(middle, rel=1e-3)
    # Each of the two has a lowest ordinate of its own.
    lowest = [RATE / 2 / (stop - start) for start, stop in spans]
    np.testing.assert_allclose(np.sort(spectrum.frequency[:2]), np.sort(lowest), rtol=1e-3)


def test_segments_of_different_lengths_have_all_their_ordinates(rng) -> None:
    spans = [(0, 700), (700, 1600), (1700, 3998), (3998, 4000)]
    log = rng.standard_normal(4000)
    spectrum = spectrum_of(log, segments=spans)
    power = sum(np.sum((log[a:b] - log[a:b].mean()) ** 2) for a, b in spans)
    assert np.sum(spectrum.density * spectrum.ordinates) * RATE == pytest.approx(power, rel=1e-9)
    assert spectrum.ordinates.sum() == 700 + 900 + 2298 + 2 - 4
    assert (np.diff(spectrum.frequency) > -1e-12).all()


@pytest.mark.parametrize("samples", [3000, 300_000])
@pytest.mark.parametrize("R", [2e-3, -5e-4])
def test_a_ramp_is_read_off_with_its_sign(rng, samples: int, R: float) -> None:
    time = np.arange(samples) / RATE
    spectrum = spectrum_of(9.81 + R * time)
    low = spectrum.ramp > 0
    # A noiseless ramp: every bin that has a ramp tells R.
    np.testing.assert_allclose(spectrum.cross[low][:9] / spectrum.ramp[low][:9], R, rtol=1e-6)
    assert np.sum(spectrum.cross) / np.sum(spectrum.ramp) == pytest.approx(R, rel=1e-7)
    np.testing.assert_allclose(spectrum.density[low][:9], R**2 * spectrum.ramp[low][:9], rtol=1e-6)
    # And it is taken out of a noisy log as if it had never been there.
    noise = rng.standard_normal(samples)
    clean, bent = spectrum_of(noise), spectrum_of(noise + R * time)
    mended = bent.density - 2 * R * bent.cross + R**2 * bent.ramp
    kept = bent.block == bent.block[0]
    np.testing.assert_allclose(mended[kept], clean.density[kept], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("place", [0, 777, 1999])
def test_a_missing_sample_is_refused(rng, place: int) -> None:
    log = rng.standard_normal(2000)
    log[place] = np.nan
    with pytest.raises(ValueError, match="missing"):
        spectrum_of(log)


def test_a_missing_sample_deep_in_a_long_log_is_refused(rng) -> None:
    log = rng.standard_normal(300_000)
    log[123_456] = np.nan
    with pytest.raises(ValueError, match="missing"):
        spectrum_of(log)


def test_a_log_of_a_few_samples_is_refused(rng) -> None:
    with pytest.raises(ValueError, match="15 samples"):
        spectrum_of(rng.standard_normal(15))
    assert spectrum_of(rng.standard_normal(16)).ordinates.sum() == 15


def test_chosen_bins_stay_together(rng) -> None:
    spectrum = spectrum_of(rng.standard_normal(3000))
    chosen = spectrum.frequency < 1.0
    taken = spectrum.select(chosen)
    np.testing.assert_array_equal(taken.density, spectrum.density[chosen])
    np.testing.assert_array_equal(taken.cross, spectrum.cross[chosen])
    assert (taken.rate, taken.mean) == (spectrum.rate, spectrum.mean)


def test_a_long_log_is_never_held(rng) -> None:
    samples, chunk = 1 << 22, 1 << 16

    def blocks() -> Iterator[np.ndarray]:
        for _ in range(samples // chunk):
            yield rng.standard_normal(chunk)

    tracemalloc.start()
    try:
        spectrum, lines = compute_spectra(blocks(), samples, RATE)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert spectrum.block.max() == 64
    assert peak < 0.25 * samples * 8
    assert len(spectrum.frequency) < 400
    assert sum(len(line.density) for line in lines) < 1 << 15


def power_near(lines: LineSpectrum, frequency: float) -> float:
    step = lines.frequency[1]
    near = np.abs(lines.frequency - frequency) < 2.5 * step
    return float(lines.density[near].sum() * step)


@pytest.mark.parametrize("place", [1.0, 1.01, 1.37])
def test_a_sinusoid_has_a_quarter_of_its_squared_amplitude_at_its_frequency(place: float) -> None:
    A, time = 3e-3, np.arange(1 << 19) / RATE
    fast, slow = 4.1 * place, 0.0204 * place
    both = A * np.cos(2 * np.pi * fast * time + 1) + 2 * A * np.sin(2 * np.pi * slow * time)
    spectrum, (low, high) = compute_spectra([both], len(both), RATE)
    assert low.block == spectrum.block.max()
    assert high.block == 1
    assert 2 * (len(high.frequency) - 1) * high.segments == len(both)
    # Four bins at least are in the main lobe of a Hann window: 99.9 % of the power.
    assert power_near(high, fast) == pytest.approx(A**2 / 4, rel=5e-3)
    kept = np.sinc(slow * low.block / RATE) ** 2
    assert power_near(low, slow) == pytest.approx(A**2 * kept, rel=5e-3)


def test_the_spectrum_for_lines_has_the_level_of_white_noise(rng) -> None:
    N = 3e-3
    _, lines = compute_spectra([N * np.sqrt(RATE) * rng.standard_normal(LONG)], LONG, RATE)
    for line in lines:
        inner = line.density[3:-3] / N**2
        # Neighbours under a Hann window are correlated: 1.94 times fewer are independent.
        error = np.sqrt(1.94 / len(inner) / line.segments)
        assert inner.mean() == pytest.approx(1.0, abs=4.5 * error)
        assert inner.std() == pytest.approx(1 / np.sqrt(line.segments), rel=0.15)


@pytest.mark.parametrize(
    ("lengths", "block"),
    [
        ([262_144], 1),
        ([262_145], 64),  # eight segments of 32,768, and one sample
        ([280_000], 32),  # of which a sixteenth would be left over
        ([270_500], 64),  # and here a thirty-third
        ([271_000], 16),
        ([150_000, 150_000], 64),
        ([40_000] * 8, 64),  # a quarter may be left over of many
        ([15_000] * 20, 8),
        ([1_000] * 300, 1),
    ],
)
def test_segments_are_as_long_as_they_leave_little_over(lengths: list[int], block: int) -> None:
    assert _resolution(np.array(lengths))[1] == block


def test_lines_are_looked_for_in_samples_and_in_means_of_blocks(rng) -> None:
    samples = 1 << 21
    spectrum, (of_means, of_samples) = compute_spectra(
        [rng.standard_normal(samples)], samples, 50.0
    )
    block = int(spectrum.block.max())
    assert block > 1
    assert (of_samples.block, of_means.block) == (1, block)
