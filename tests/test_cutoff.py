import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lfilter

from imubench_pipeline.cutoff import find_cutoff, folded_low_pass, low_pass
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate import simulate
from imubench_pipeline.spectrum import spectra


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
    return find_cutoff(spectra([log], len(log), rate)[0])


@pytest.mark.filterwarnings("ignore:The occurrence of roundoff")  # beyond the digits compared
@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("cutoff", [10.0, 64.0, 150.0])
def test_folds_are_those_of_the_sampled_covariance(order, cutoff):
    rate = 100.0
    f = np.array([1.0, 13.0, 49.0])
    # Poisson: the sum over folds is the Fourier series of the covariance, each by quadrature.
    covariance = [
        quad(low_pass, 0.0, np.inf, args=(cutoff, order), limit=400)[0] * 2.0
        if k == 0
        else 2.0
        * quad(
            low_pass,
            0.0,
            np.inf,
            args=(cutoff, order),
            weight="cos",
            wvar=2.0 * np.pi * k / rate,
            limit=800,
            limlst=200,
        )[0]
        for k in range(60)
    ]
    terms = [2.0 * c * np.cos(2.0 * np.pi * f * k / rate) for k, c in enumerate(covariance)]
    expected = (np.sum(terms, axis=0) - covariance[0]) / rate
    assert folded_low_pass(f, cutoff, rate, order) == pytest.approx(expected, rel=2e-3, abs=1e-6)


@pytest.mark.parametrize(
    "cutoff, rate, hours", [(10.0, 100.0, 0.5), (60.0, 500.0, 0.2), (64.0, 100.0, 2.0)]
)
def test_first_order_cutoff_is_found_also_above_nyquist(cutoff, rate, hours):
    rng = np.random.default_rng(8)
    samples = int(3600 * hours * rate)
    log = first_order(1e-4, cutoff, rate, samples, rng)
    log += simulate(NoiseModel(B=2e-5, K=1e-6), rate, samples, rng)
    found = cutoff_of(log, rate)
    assert found.order == 1
    assert found.frequency.value == pytest.approx(cutoff, rel=0.02)
    assert found.frequency.lower < cutoff < found.frequency.upper
    assert found.N.value == pytest.approx(1e-4, rel=0.02)


@pytest.mark.parametrize("cutoff, order", [(20.0, 2), (30.0, 4)])
def test_butterworth_cutoff_and_order_are_found(cutoff, order):
    rng = np.random.default_rng(2)
    found = cutoff_of(butterworth(1e-4, cutoff, order, 100.0, 120_000, rng), 100.0)
    assert found.order == order
    assert found.frequency.value == pytest.approx(cutoff, rel=0.02)


def test_no_filter_is_not_found():
    rng = np.random.default_rng(3)
    found = cutoff_of(simulate(NoiseModel(N=1e-4, K=1e-6), 100.0, 200_000, rng), 100.0)
    assert found.frequency.status == "absent"
    assert found.N.value == pytest.approx(1e-4, rel=0.02)


def test_a_short_log_with_a_high_cutoff_does_not_tell_it():
    rng = np.random.default_rng(4)
    found = cutoff_of(first_order(1e-4, 64.0, 100.0, 4_000, rng), 100.0)
    assert found.frequency.status in ("not_identified", "absent")
    assert found.frequency.value is None
