from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from imubench_pipeline.estimators.frame import Band, find_band
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.lines import find_lines, mask_lines
from imubench_pipeline.estimators.spectrum import Spectrum, compute_spectra
from imubench_pipeline.estimators.whittle import Shapes, Terms, make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 100.0
NYQUIST = 50.0
N = 1e-3
WHITE = NoiseModel(N=N)
SLOW = NoiseModel(N=N, B=1e-3, T_B=20.0, K=1e-4)
FLICKER = NoiseModel(N=N, B=1e-3)

Coefficients = tuple[list[float], list[float]]
TWO_TAPS: Coefficients = ([0.5, 0.5], [1.0])


def low_pass(cut_off: float) -> Coefficients:
    """A first-order low-pass."""
    decay = float(np.exp(-2 * np.pi * cut_off / RATE))
    return [1 - decay], [1.0, -decay]


def filtered(log: np.ndarray, coefficients: Coefficients, settling: int = 1000) -> np.ndarray:
    return np.asarray(signal.lfilter(*coefficients, log))[settling:]


def spectrum_of(log: np.ndarray) -> Spectrum:
    return compute_spectra([log], len(log), RATE)[0]


def band_of(spectrum: Spectrum, **options: float) -> Band:
    return find_band(spectrum, np.ones(len(spectrum.frequency), dtype=np.bool_), **options)


def lost_power(coefficients: Coefficients, highest: float) -> float:
    """Mean part of the density that a filter takes up to a frequency."""
    frequency = np.linspace(0, highest, 2001)[1:]
    _, gain = signal.freqz(*coefficients, worN=frequency, fs=RATE)
    return float(1 - np.mean(np.abs(gain) ** 2))


def fitted_n(spectrum: Spectrum, highest: float, terms: Terms) -> float:
    used = spectrum.select(spectrum.upper <= highest * (1 + 1e-9))
    return make_whittle(used, highest).maximum(terms).parameter("N")


@pytest.mark.parametrize(
    "model",
    [WHITE, SLOW, FLICKER, NoiseModel(N=N, K=5e-3), NoiseModel(Q=1e-4, N=N)],
    ids=lambda model: model.name,
)
@pytest.mark.parametrize("samples", few([30_000], [400_000]))
def test_a_log_that_no_filter_bends_keeps_the_full_band(
    rng, model: NoiseModel, samples: int
) -> None:
    # Quantization noise rises towards Nyquist, as no low-pass makes it do.
    for _ in range(2):
        band = band_of(spectrum_of(simulate(model, RATE, samples, rng)))
        assert band == Band(NYQUIST, "whole")


@pytest.mark.release
@pytest.mark.parametrize(
    ("model", "logs", "most"),
    few(
        [(NoiseModel(N=N, B=6e-3), 10, 1)],
        [
            (model, 20, 2)
            for model in (NoiseModel(N=N, B=6e-3), NoiseModel(K=1e-2), NoiseModel(N=N, K=0.1))
        ],
    ),
)
def test_slow_noise_that_hides_the_white_noise_is_no_bend(
    rng, model: NoiseModel, logs: int, most: int
) -> None:
    # It passes the white noise above a twentieth of the rate, from where the model is carried on.
    bent = sum(
        band_of(spectrum_of(simulate(model, RATE, 100_000, rng))).highest < NYQUIST
        for _ in range(logs)
    )
    assert bent <= most


@pytest.mark.parametrize(
    "coefficients",
    few(
        [TWO_TAPS, low_pass(1.0), signal.butter(2, 10.0, fs=RATE)],
        [(low_pass(20.0),), (low_pass(3.0),)],
    ),
    ids=[
        "two taps",
        "first order, 1 Hz",
        "second order",
        "first order, 20 Hz",
        "first order, 3 Hz",
    ],
)
@pytest.mark.parametrize("samples", few([50_000], [400_000]))
def test_a_band_ends_where_what_a_filter_takes_is_less_than_what_is_known(
    rng, coefficients: Coefficients, samples: int
) -> None:
    parts = []
    for _ in range(5):
        log = filtered(simulate(WHITE, RATE, samples + 1000, rng), coefficients)
        band = band_of(spectrum_of(log))
        assert band.source == "bend"
        # A band of f Hz and a log of D s have 2 D f ordinates: S_N is known to 1 / sqrt(D f).
        known = 1 / np.sqrt(samples / RATE * band.highest)
        parts.append(lost_power(coefficients, band.highest) / known)
    # A filter that bends what is used from the beginning is taken for slow noise in part.
    slow = lost_power(coefficients, RATE / 20) > 0.3
    most, mean = (1.5, 1.1) if not slow else (2.2, 1.5) if samples > 100_000 else (4.5, 3.5)
    assert np.max(parts) < most
    assert np.mean(parts) < mean
    # A bend of second order is not a first-order one further up; the band ends early, not late.
    assert np.mean(parts) > 0.01


@pytest.mark.release
@pytest.mark.parametrize(
    "coefficients", few([TWO_TAPS], [(low_pass(20.0),)]), ids=["two taps", "20 Hz"]
)
def test_a_gentle_filter_costs_little_of_the_band(rng, coefficients: Coefficients) -> None:
    for _ in range(2):
        log = filtered(simulate(WHITE, RATE, 201_000, rng), coefficients)
        highest = band_of(spectrum_of(log)).highest
        # Half a standard error of S_N may be lost; the band is not much shorter than for a fifth.
        frequency = np.linspace(0.2, NYQUIST, 500)
        known = 1 / np.sqrt(2000 * frequency)
        lost = np.array([lost_power(coefficients, f) for f in frequency])
        assert highest > 0.8 * frequency[np.argmax(lost > 0.2 * known)]


def test_n_is_known_to_one_per_cent_through_two_taps(rng) -> None:
    for _ in range(2):
        spectrum = spectrum_of(filtered(simulate(WHITE, RATE, 1_000_000, rng), TWO_TAPS))
        band = band_of(spectrum)
        assert fitted_n(spectrum, band.highest, Terms("N")) == pytest.approx(N, rel=0.01)
        # Without a limit half the power is lost: cos^2 has the mean 1/2.
        assert fitted_n(spectrum, NYQUIST, Terms("N")) == pytest.approx(N / np.sqrt(2), rel=0.01)


def test_slow_noise_is_the_same_through_two_taps(rng) -> None:
    model, terms = NoiseModel(N=N, K=3e-4), Terms("NK")
    for _ in range(3):
        log = simulate(model, RATE, 400_000, rng)
        straight, bent = spectrum_of(log[1000:]), spectrum_of(filtered(log, TWO_TAPS))
        band = band_of(bent).highest
        used = [s.select(s.upper <= band) for s in (straight, bent)]
        first, second = (make_whittle(s, band).maximum(terms) for s in used)
        assert second.parameter("K") == pytest.approx(first.parameter("K"), rel=0.02)
        assert second.parameter("N") == pytest.approx(first.parameter("N"), rel=0.01)
        assert second.parameter("N") == pytest.approx(N, rel=0.02)


def test_a_resonance_ends_the_band_below_it(rng) -> None:
    radius, angle = np.exp(-2 * np.pi * 0.5 / RATE), 2 * np.pi * 20.0 / RATE
    resonance: Coefficients = ([1.0], [1.0, -2 * radius * np.cos(angle), radius**2])
    for _ in range(4):
        noise = filtered(rng.standard_normal(101_000), resonance)
        log = rng.standard_normal(100_000) + 0.5 * noise / noise.std()
        spectrum = spectrum_of(log)
        band = band_of(spectrum)
        assert 0.5 < band.highest < 19.0
        level = 1 / np.sqrt(RATE)
        # What the resonance adds below it is small: its density at 0 Hz is known.
        found = fitted_n(spectrum, band.highest, Terms("N"))
        assert found == pytest.approx(level, rel=4 / np.sqrt(4 * 1000 * band.highest) + 0.002)


def test_a_stated_bandwidth_limits_the_band_to_a_tenth_of_it(rng) -> None:
    spectrum = spectrum_of(simulate(SLOW, RATE, 100_000, rng))
    assert band_of(spectrum, bandwidth=40.0) == Band(4.0, "bandwidth")
    assert band_of(spectrum, bandwidth=200.0).highest == 20.0
    assert band_of(spectrum, bandwidth=200.0).source == "bandwidth"


@pytest.mark.parametrize("bandwidth", [500.0, 1e4])
def test_a_bandwidth_far_beyond_nyquist_says_nothing(rng, bandwidth: float) -> None:
    spectrum = spectrum_of(simulate(SLOW, RATE, 100_000, rng))
    assert band_of(spectrum, bandwidth=bandwidth) == band_of(spectrum)


def test_a_bend_below_a_tenth_of_the_stated_bandwidth_is_found(rng) -> None:
    # The sensor is not as fast as is said.
    log = filtered(simulate(WHITE, RATE, 201_000, rng), low_pass(3.0))
    band = band_of(spectrum_of(log), bandwidth=100.0)
    assert band.source == "bend"
    assert band.highest < 1.5


def test_a_bend_above_a_tenth_of_the_stated_bandwidth_is_not_looked_at(rng) -> None:
    log = filtered(simulate(WHITE, RATE, 201_000, rng), low_pass(20.0))
    band = band_of(spectrum_of(log), bandwidth=20.0)
    assert band == Band(2.0, "bandwidth")


@pytest.mark.parametrize(("asked", "highest"), [(7.0, 7.0), (0.123456, 0.123456), (80.0, 50.0)])
def test_a_band_that_is_asked_for_is_taken_as_it_is(rng, asked: float, highest: float) -> None:
    # Not even a filter that bends the spectrum below it, or another bandwidth, moves it.
    spectrum = spectrum_of(filtered(simulate(WHITE, RATE, 50_000, rng), low_pass(3.0)))
    assert band_of(spectrum, asked=asked) == Band(highest, "set")
    assert band_of(spectrum, asked=asked, bandwidth=10.0) == Band(highest, "set")


def test_a_line_is_no_bend(rng) -> None:
    log = simulate(WHITE, RATE, 300_000, rng)
    log += 1e-2 * np.cos(2 * np.pi * 20.0 * np.arange(300_000) / RATE)
    spectrum, line_spectra = compute_spectra([log], len(log), RATE)
    low = spectrum.block > 1
    lines = find_lines(line_spectra, WHITE, RATE, float(spectrum.upper[low].max()))
    clear = mask_lines(spectrum, lines, np.full(len(low), N**2))
    assert find_band(spectrum, clear).highest == NYQUIST
    # The bins that it touches would be one.
    assert band_of(spectrum).highest < 20.0


def test_a_spectrum_that_follows_no_model_is_taken_to_a_twentieth_of_the_rate(rng) -> None:
    spectrum = spectrum_of(simulate(WHITE, RATE, 400_000, rng))
    spectrum.density[:] *= 1 + 0.8 * np.sin(4 * np.log(spectrum.frequency))
    band = band_of(spectrum)
    assert band.highest == RATE / 20
    assert band.source == "no_model"


def test_a_log_too_short_to_tell_keeps_the_full_band(rng) -> None:
    # 180 samples have 18 ordinates below a twentieth of the rate.
    log = filtered(simulate(WHITE, RATE, 1180, rng), TWO_TAPS)
    assert band_of(spectrum_of(log)).highest == NYQUIST
    assert band_of(spectrum_of(log), bandwidth=100.0).highest == 10.0


@pytest.mark.parametrize("T_B", [0.2, 0.5])
def test_a_process_beside_which_white_noise_shows_is_no_filter(T_B: float) -> None:
    # As dense as the white noise at low frequencies, and far less where the fit ends.
    exact = make_ideal_spectrum(RATE, 20_000.0, NYQUIST)
    shapes = Shapes(exact)
    process = shapes.gauss_markov(T_B)
    density = N**2 * (shapes.white() + process / process[0])
    assert band_of(replace(exact, density=density)).highest == NYQUIST
