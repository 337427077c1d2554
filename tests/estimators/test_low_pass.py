import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import butter, freqz, sosfreqz

from imubench_pipeline.estimators.low_pass import Filter, Kind
from imubench_pipeline.estimators.spectrum import compute_spectra

RATE = 50.0
FREQUENCY = np.array([0.01, 0.7, 3.0, 11.0, 19.0, 24.0])


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("cutoff", [1.0, 8.0, 20.0])
def test_a_bilinear_filter_is_the_digital_butterworth(order: int, cutoff: float) -> None:
    _, gain = sosfreqz(butter(order, cutoff, output="sos", fs=RATE), FREQUENCY, fs=RATE)
    one = Filter("bilinear", order, cutoff)
    assert one.white(FREQUENCY, RATE) == pytest.approx(np.abs(gain) ** 2, rel=1e-9, abs=1e-14)
    assert one.slow(FREQUENCY, RATE) == pytest.approx(np.abs(gain) ** 2, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("samples", [2, 3, 8])
def test_a_boxcar_of_whole_samples_is_the_moving_average(samples: int) -> None:
    one = Filter("boxcar", 1, 0.442946 * RATE / samples)
    _, gain = freqz(np.ones(samples) / samples, 1.0, FREQUENCY, fs=RATE)
    assert one.white(FREQUENCY, RATE) == pytest.approx(np.abs(gain) ** 2, rel=1e-6, abs=1e-12)


def test_a_boxcar_leaves_half_the_power_of_slow_noise_at_its_cutoff() -> None:
    assert Filter("boxcar", 1, 3.0).slow(3.0, RATE) == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("length", [1.4, 2.5])
def test_a_boxcar_of_a_part_of_a_sample_folds(length: float) -> None:
    # Averaged in continuous time over `length` samples, then sampled: sinc^2 folded.
    one = Filter("boxcar", 1, 0.442946 * RATE / length)
    k = np.arange(-4000, 4001)[:, None]
    folded = (np.sinc((FREQUENCY + k * RATE) * length / RATE) ** 2).sum(axis=0)
    assert one.white(FREQUENCY, RATE) == pytest.approx(folded, rel=2e-3)


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("cutoff", [4.0, 30.0])
def test_an_analogue_filter_keeps_its_variance_when_sampled(order: int, cutoff: float) -> None:
    one = Filter("analogue", order, cutoff)
    grid = (np.arange(4000) + 0.5) / 4000 * 0.5 * RATE
    sampled = 2.0 * np.mean(one.white(grid, RATE)) * 0.5 * RATE
    whole = 2.0 * quad(lambda f: 1.0 / (1.0 + (f / cutoff) ** (2 * order)), 0.0, np.inf)[0]
    assert sampled == pytest.approx(whole, rel=2e-4)


def test_the_ends_of_the_transform_are_what_is_left_in_a_deep_stopband() -> None:
    rng = np.random.default_rng(2)
    grid = np.fft.rfftfreq(1 << 21, 1.0 / RATE)
    one = Filter("bilinear", 4, 1.5)
    lines = rng.standard_normal((2, len(grid))) * np.sqrt(one.white(grid, RATE) * RATE / 2)
    log = np.fft.irfft((lines[0] + 1j * lines[1]) * np.sqrt(1 << 21), 1 << 21)
    spectrum, _ = compute_spectra([log], len(log), RATE)
    deep = (spectrum.frequency > 17.0) & (spectrum.frequency < 21.0)
    part = spectrum.select(deep)
    leak = one.leakage(part.frequency, RATE, part.length)
    assert (one.white(part.frequency, RATE) < 0.2 * leak).all()
    assert np.average(part.density / leak) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("kind", ["analogue", "bilinear"])
def test_the_ends_are_those_of_the_variance_of_differences(kind: Kind) -> None:
    one = Filter(kind, 2, 4.0)
    length = np.full(len(FREQUENCY), 30.0)
    variance = (
        2.0
        * quad(
            lambda f: float(one.white(f, RATE)) * (2.0 - 2.0 * np.cos(2.0 * np.pi * f / RATE)),
            0.0,
            0.5 * RATE,
            epsabs=1e-10,
            limit=200,
        )[0]
    )
    omega = 2.0 * np.pi * FREQUENCY / RATE
    ends = 4.0 * variance / (30.0 * RATE**2) * np.cos(0.5 * omega) ** 2
    ends *= (1.0 - one.slow(FREQUENCY, RATE)) ** 2 / (2.0 - 2.0 * np.cos(omega)) ** 2
    assert one.leakage(FREQUENCY, RATE, length) == pytest.approx(ends, rel=1e-4)


@pytest.mark.parametrize("samples", [2, 3, 7.5])
def test_half_the_power_of_a_mean_is_lost_where_it_says(samples: float) -> None:
    one = Filter("boxcar", 1, 0.442946 * RATE / samples)
    at = one.half_power(RATE)
    assert one.white(at, RATE) == pytest.approx(0.5 * one.white(0.0, RATE), rel=1e-6)
    assert one.white(0.9 * at, RATE) > one.white(at, RATE) > one.white(1.1 * at, RATE)
    assert Filter("analogue", 1, 3.0).half_power(RATE) == 3.0
