import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.signal import butter, lfilter, sosfilt

from imubench_pipeline.estimators.cutoff import find_cutoff
from imubench_pipeline.estimators.low_pass import Filter
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.simulation import simulate as simulate_sensor
from tests.conftest import few


def first_order(N, cutoff, rate, samples, rng):
    """White noise behind a first-order filter, exact in continuous time: an AR(1) sequence."""
    decay = math.exp(-2.0 * math.pi * cutoff / rate)
    spread = N * math.sqrt(math.pi * cutoff)
    driven = spread * math.sqrt(1.0 - decay**2) * rng.standard_normal(samples)
    driven[0] = spread * rng.standard_normal()
    return lfilter([1.0], [1.0, -decay], driven)


def butterworth(N, cutoff, order, rate, samples, rng, over=16):
    """Noise drawn line by line from its continuous spectrum, then sampled."""
    m = samples * over
    f = np.fft.rfftfreq(m, 1.0 / (rate * over))
    power = N**2 * rate * over * m / (1.0 + (f / cutoff) ** (2 * order))
    lines = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    return np.fft.irfft(lines * np.sqrt(power / 2.0), m)[::over]


def cutoff_of(log, rate):
    return find_cutoff(compute_spectra([log], len(log), rate)[0])


@pytest.mark.filterwarnings("ignore:The occurrence of roundoff")  # beyond the digits compared
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("cutoff", [10.0, 64.0, 150.0])
def test_folds_are_those_of_the_sampled_covariance(order, cutoff):
    rate = 100.0
    f = np.array([1.0, 13.0, 49.0])

    def power(frequency):
        return 1.0 / (1.0 + (frequency / cutoff) ** (2 * order))

    # Poisson: the sum over folds is the Fourier series of the covariance, each by quadrature.
    covariance = [
        quad(power, 0.0, np.inf, limit=400)[0] * 2.0
        if k == 0
        else 2.0
        * quad(
            power,
            0.0,
            np.inf,
            weight="cos",
            wvar=2.0 * np.pi * k / rate,
            limit=800,
            limlst=200,
        )[0]
        for k in range(60)
    ]
    terms = [2.0 * c * np.cos(2.0 * np.pi * f * k / rate) for k, c in enumerate(covariance)]
    expected = (np.sum(terms, axis=0) - covariance[0]) / rate
    assert Filter("analogue", order, cutoff).white(f, rate) == pytest.approx(
        expected, rel=2e-3, abs=1e-6
    )


@pytest.mark.parametrize("order", [2, 3, 4, 7])
@pytest.mark.parametrize("cutoff", [0.2, 2.5, 40.0, 150.0])
def test_folds_that_are_not_added_one_by_one_are_not_lost(order, cutoff):
    f = np.array([0.0, 1.0, 13.0, 50.0])
    folds = f[:, None] + 100.0 * np.arange(-3000, 3001)
    every = (1.0 / (1.0 + (folds / cutoff) ** (2 * order))).sum(axis=1)
    assert Filter("analogue", order, cutoff).white(f, 100.0) == pytest.approx(
        every, rel=1e-5, abs=1e-11
    )


@pytest.mark.parametrize(
    "cutoff, rate, hours",
    few([(64.0, 100.0, 1.0)], [(10.0, 100.0, 0.5), (60.0, 500.0, 0.2), (64.0, 100.0, 2.0)]),
)
def test_first_order_cutoff_is_found_also_above_nyquist(cutoff, rate, hours):
    rng = np.random.default_rng(8)
    samples = int(3600 * hours * rate)
    log = first_order(1e-4, cutoff, rate, samples, rng)
    log += simulate(NoiseModel(B=2e-5, K=1e-6), rate, samples, rng)
    found = cutoff_of(log, rate)
    assert found.order == 1
    assert found.frequency.value == pytest.approx(cutoff, rel=0.03)
    assert found.frequency.lower < cutoff < found.frequency.upper
    assert found.N.value == pytest.approx(1e-4, rel=0.02)
    assert found.floor == 0.0


@pytest.mark.release  # the test before this has such a cut-off every day
@pytest.mark.parametrize("seed", [9, 10, 11])
def test_a_cutoff_above_nyquist_is_not_taken_for_another_of_higher_order(seed):
    # Of 64 Hz at 100 Hz; those of 120 Hz and third order fold into much the same.
    rng = np.random.default_rng(seed)
    found = cutoff_of(first_order(1e-4, 64.0, 100.0, 400_000, rng), 100.0)
    assert found.order == 1
    assert found.frequency.value == pytest.approx(64.0, rel=0.03)


@pytest.mark.release  # test_where_folds_of_other_filters_look_alike has one every day
def test_a_butterworth_filter_above_nyquist_is_not_named():
    rng = np.random.default_rng(1)
    found = cutoff_of(butterworth(1e-4, 70.0, 2, 100.0, 120_000, rng), 100.0)
    assert found.frequency.status == "not_identified"


@pytest.mark.parametrize("cutoff, order", few([(30.0, 4)], [(20.0, 2)]))
def test_butterworth_cutoff_and_order_are_found(cutoff, order):
    rng = np.random.default_rng(2)
    found = cutoff_of(butterworth(1e-4, cutoff, order, 100.0, 60_000, rng), 100.0)
    assert found.order == order
    assert found.frequency.value == pytest.approx(cutoff, rel=0.02)


def test_no_filter_is_not_found():
    rng = np.random.default_rng(3)
    found = cutoff_of(simulate(NoiseModel(N=1e-4, K=1e-6), 100.0, 200_000, rng), 100.0)
    assert found.frequency.status == "absent"
    assert found.N is None and found.gain is None


def test_a_short_log_with_a_high_cutoff_does_not_tell_it():
    rng = np.random.default_rng(4)
    found = cutoff_of(first_order(1e-4, 64.0, 100.0, 4_000, rng), 100.0)
    assert found.frequency.status in ("not_identified", "absent")
    assert found.frequency.value is None


@pytest.mark.release
@pytest.mark.parametrize("known", [True, False])
def test_the_rounding_of_a_register_does_not_move_the_cutoff(known):
    rng = np.random.default_rng(5)
    log = first_order(1e-4, 7.5, 50.0, 250_000, rng)
    step = 0.5 * float(np.std(log))
    spectrum, _ = compute_spectra([np.round(log / step) * step], len(log), 50.0)
    found = find_cutoff(spectrum, resolution=step if known else 0.0)
    if not known:
        assert found.frequency.lower > 7.5  # what the rounding adds passes for a higher cut-off
        return
    assert found.frequency.lower < 7.5 < found.frequency.upper
    assert found.N.lower < 1e-4 < found.N.upper
    assert found.floor == pytest.approx(step / math.sqrt(12.0 * 50.0), rel=1e-2)


@pytest.mark.release
def test_flicker_noise_that_folds_does_not_move_the_cutoff():
    model = SensorModel(noise=NoiseModel(N=1e-4, B=1.2e-3), low_pass=LowPass(10.0))
    found = cutoff_of(simulate_sensor(model, 25.0, 150_000, np.random.default_rng(6)), 25.0)
    assert found.order == 1
    assert found.frequency.lower < 10.0 < found.frequency.upper


@pytest.mark.release
@pytest.mark.parametrize("seed", few([1], [2, 3, 4]))
def test_cutoff_is_not_identified_if_aliases_of_filters_agree(seed):
    model = SensorModel(noise=NoiseModel(N=1e-4), low_pass=LowPass(28.4, 2))
    found = cutoff_of(simulate_sensor(model, 50.0, 300_000, np.random.default_rng(seed)), 50.0)
    # Quantization noise rises towards Nyquist like these aliases.
    assert found.frequency.value is None


@pytest.mark.release
def test_a_bend_that_is_no_filter_of_these_is_not_identified():
    # The mean of means over three samples and more, which falls with three zeros.
    white = 1e-3 * np.random.default_rng(6).standard_normal(80_000)
    for length in (3, 4, 5):
        white = np.convolve(white, np.ones(length) / length, "valid")
    found = cutoff_of(white, 100.0)
    assert found.frequency.status == found.N.status == "not_identified"
    assert found.frequency.value is None and found.N.value is None
    assert "but like none of the 9 filters" in found.frequency.reason
    assert found.frequency.fitted is not None and found.N.fitted is not None


@pytest.mark.parametrize("samples", few([3], [2, 7]))
def test_a_moving_average_is_found(samples):
    white = 1e-3 * np.random.default_rng(6).standard_normal(100_000)
    found = cutoff_of(np.convolve(white, np.ones(samples) / samples, "valid"), 100.0)
    # cos^2(pi f / rate) is also a bilinear filter with its cut-off at a half of Nyquist.
    assert found.order == 1 and (samples == 2 or found.kind == "boxcar")
    at = brentq(lambda f: response(f, samples) - 0.5, 1e-3, 99.0 / samples)
    assert found.frequency.value == pytest.approx(at, rel=0.01)
    assert found.N.lower < 1e-4 < found.N.upper


def response(f, samples):
    """Power that a moving average at 100 Hz leaves."""
    return (np.sin(samples * np.pi * f / 100) / (samples * np.sin(np.pi * f / 100))) ** 2


@pytest.mark.parametrize(
    ("order", "cutoff"),
    few([(3, 12.0)], [(order, f) for order in (1, 2, 3, 4) for f in (2.5, 12.0, 35.0)]),
)
def test_digital_butterworth_filters_are_found(order, cutoff):
    rng = np.random.default_rng(order)
    sections = butter(order, cutoff, output="sos", fs=100.0)
    found = cutoff_of(sosfilt(sections, 1e-3 * rng.standard_normal(202_000))[2_000:], 100.0)
    assert (found.kind, found.order) == ("bilinear", order)
    assert found.frequency.lower < cutoff < found.frequency.upper
    assert found.frequency.value == pytest.approx(cutoff, rel=0.03)
    assert 0.99 * found.N.lower < 1e-4 < 1.01 * found.N.upper


@pytest.mark.parametrize("T_B", few([1.7, 50.0], [1.0, 5.0]))
@pytest.mark.parametrize("B", [1e-3, 3e-2])
def test_a_strong_slow_process_is_no_low_pass(B, T_B):
    # Its density bends as behind a first-order filter, down to the white noise.
    rng = np.random.default_rng(7)
    found = cutoff_of(simulate(NoiseModel(N=1e-3, B=B, T_B=T_B), 100.0, 100_000, rng), 100.0)
    assert found.frequency.status == "absent"
    assert (found.order, found.floor) == (None, 0.0)
    assert found.frequency.reason == "the spectrum shows no low-pass"


def test_two_processes_are_no_low_pass():
    rng = np.random.default_rng(9)
    model = NoiseModel(N=1e-3, B=5e-3, T_B=50.0, further=[GaussMarkov(5e-3, 1.0)])
    found = cutoff_of(simulate(model, 100.0, 100_000, rng), 100.0)
    assert found.frequency.status == "absent"


def spectrum_with_a_line():
    rng = np.random.default_rng(11)
    samples = 50_000
    log = first_order(1e-3, 20.0, 100.0, samples, rng)
    log += 0.02 * np.sin(2.0 * np.pi * 30.0 * np.arange(samples) / 100.0)
    spectrum = compute_spectra([log], samples, 100.0)[0]
    return spectrum, (spectrum.upper < 29.0) | (spectrum.lower > 31.0)


@pytest.mark.release
def test_bins_that_a_line_touches_are_left_out():
    found = find_cutoff(*spectrum_with_a_line())
    assert found.frequency.value == pytest.approx(20.0, rel=0.02)


@pytest.mark.release  # without it the test before this would say nothing
def test_bins_that_a_line_touches_would_move_the_cutoff():
    spectrum, _ = spectrum_with_a_line()
    assert find_cutoff(spectrum).frequency.value != pytest.approx(20.0, rel=0.02)


def test_a_spectrum_of_few_bins_shows_nothing():
    found = cutoff_of(np.random.default_rng(12).standard_normal(20), 100.0)
    assert found.frequency.status == "not_shown" and found.N is None
    assert "24 are needed" in found.frequency.reason


@pytest.mark.parametrize("part", few([1.0], [0.6, 3.0]))
def test_quantization_noise_is_no_low_pass(part):
    # White noise and quantization noise rise towards Nyquist as what a steep filter lets fold.
    rate, samples, N = 50.0, 540_000, 1e-4
    rng = np.random.default_rng(1)
    log = N * math.sqrt(rate) * rng.standard_normal(samples)
    log += part * N * np.diff(rng.standard_normal(samples + 1))
    assert cutoff_of(log, rate).frequency.value is None


def with_drift(seed, rate, cutoff, samples):
    """Noise behind a filter, and a drift far below the bend."""
    rng = np.random.default_rng(seed)
    noise = first_order(5e-5, cutoff, rate, samples, rng)
    noise += simulate(NoiseModel(B=4.6e-5), rate, samples, rng)
    return noise, 2e-3 * np.sin(2.0 * np.pi * np.arange(samples) / (0.6 * samples) + 0.7)


@pytest.mark.release
def test_beside_a_drift_the_cutoff_is_within_three_standard_errors():
    noise, drift = with_drift(0, 20.0, 7.3, 1 << 17)
    found = cutoff_of(noise + drift, 20.0).frequency
    assert abs(found.value - 7.3) < 3.0 * (found.upper - found.lower) / 3.92


@pytest.mark.release  # the test before this has such a drift every day
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_drift_far_below_the_bend_does_not_pull_the_cutoff(seed):
    rate, cutoff = 20.0, 7.3
    noise, drift = with_drift(seed, rate, cutoff, 1 << 17)
    without, found = (cutoff_of(log, rate).frequency for log in (noise, noise + drift))
    spread = (without.upper - without.lower) / 3.92
    assert abs(found.value - without.value) < 1.5 * spread
    assert abs(found.value - cutoff) < 3.0 * spread
