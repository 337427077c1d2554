"""Closed forms of the spectrum against integrals that know nothing of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf, workdps

from imubench_pipeline.noise import (
    Flicker,
    NoiseModel,
    RandomWalk,
    Sinusoid,
    WhiteNoise,
)
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.noise.terms.base import drives_of
from imubench_pipeline.simulate.discretisation import (
    compute_white_factor,
    discretise_slow_sources,
)
from imubench_pipeline.simulate.model import (
    MAX_FREQUENCY_RATIO,
    SensorModel,
    compute_sampled_spectrum,
    fit_density_bank,
)
from tests.sensor_model import theory

RATE = 100.0
DENSITIES = {
    "white": (NoiseModel(N=0.3), lambda f: np.full_like(f, 0.09)),
    "slow": (NoiseModel(B=2.0, T_B=40.0), lambda f: theory.gauss_markov(f, 2.0, 40.0)),
    "fast": (NoiseModel(B=2.0, T_B=0.004), lambda f: theory.gauss_markov(f, 2.0, 0.004)),
    "walk": (NoiseModel(K=0.1), lambda f: 0.01 / (2 * np.pi * f) ** 2),
    "flicker": (NoiseModel(B=2.0), lambda f: 4.0 / (2 * np.pi * f)),
}


@pytest.mark.parametrize("order", range(1, 7))
def test_the_states_of_a_filter_have_its_poles(order: int) -> None:
    low_pass = LowPass(64.0, order)
    f = np.array([1.0, 20.0, 64.0, 300.0])
    F, b, c = low_pass.transition, low_pass.input, low_pass.output
    response = [c @ np.linalg.solve(2j * np.pi * x * np.eye(order) - F, b) for x in f]
    np.testing.assert_allclose(np.abs(response) ** 2, theory.butterworth(f, 64.0, order), 1e-12)
    np.testing.assert_allclose(low_pass.power(f), theory.butterworth(f, 64.0, order), 1e-12)
    np.testing.assert_allclose(response, [low_pass.response(x) for x in f], 1e-12)
    np.testing.assert_allclose(F @ low_pass.steady_state, -b, atol=1e-12 * low_pass.angular_cutoff)


@pytest.mark.parametrize(("cutoff", "order"), [(64.0, 1), (64.0, 4), (3.0, 2), (20.0, 3)])
@pytest.mark.parametrize("noise", DENSITIES)
def test_the_spectrum_of_the_samples_is_the_folded_density(
    noise: str, cutoff: float, order: int
) -> None:
    model = SensorModel(noise=DENSITIES[noise][0], low_pass=LowPass(cutoff, order))
    f = np.geomspace(1e-4, 49.9, 60)

    def density(g: np.ndarray) -> np.ndarray:
        return DENSITIES[noise][1](g) * theory.butterworth(g, cutoff, order)

    found = model.sampled_spectrum(2 * np.pi * f / RATE, RATE) / RATE
    np.testing.assert_allclose(found, theory.folded(density, f, RATE), rtol=2e-5)


def test_white_noise_behind_a_filter_above_nyquist_is_folded_as_a_closed_form_says() -> None:
    # Samples of first-order filtered white noise: variance N^2 w/2, correlation e^(-w T |k|).
    N, w = 0.3, 2 * np.pi * 64.0
    model = SensorModel(noise=NoiseModel(N=N), low_pass=LowPass(64.0, 1))
    v, p = N**2 * w / 2, np.exp(-w / RATE)
    omega = np.array([1e-3, 0.1, 1.0, np.pi])
    wanted = v * (1 - p**2) / (1 - 2 * p * np.cos(omega) + p**2)
    np.testing.assert_allclose(model.sampled_spectrum(omega, RATE), wanted, rtol=1e-12)


@pytest.mark.parametrize(("rate", "T_B"), [(1000.0, 1e5), (100.0, 1e5), (1.0, 1e5), (100.0, 3e-3)])
@workdps(50)
def test_a_correlation_time_of_a_day_beside_a_filter_of_a_millisecond(
    rate: float, T_B: float
) -> None:
    """The discretisation against its integrals with fifty digits."""
    low_pass = LowPass(1000 / (2 * np.pi), 1)
    w, T, a = mpf(low_pass.angular_cutoff), 1 / mpf(rate), 1 / mpf(T_B)
    found = discretise_slow_sources(np.array([T_B]), 1 / rate, low_pass)

    def integral(p, q):  # of e^-(p t) e^-(q t)
        return (1 - mp.exp(-(p + q) * T)) / (p + q)

    # What e has of an impulse of x at the time t before: k e^(-a t) - h e^(-w t).
    k = a / (w - a)
    h = 1 + k
    xx = integral(a, a)
    xe = k * integral(a, a) - h * integral(a, w)
    ee = k**2 * integral(a, a) - 2 * k * h * integral(a, w) + h**2 * integral(w, w)
    coupling = a / (w - a) * (mp.exp(-a * T) - mp.exp(-w * T))
    assert found.lost[0] == pytest.approx(float(-mp.expm1(-a * T)), rel=1e-14)
    assert found.own[0] == pytest.approx(float(mp.sqrt(xx)), rel=1e-14)
    assert found.coupling[0, 0] == pytest.approx(float(coupling), rel=1e-10)
    assert found.shared[0, 0] == pytest.approx(float(xe / mp.sqrt(xx)), rel=1e-10)
    assert found.residual[0, 0, 0] ** 2 == pytest.approx(float(ee - xe**2 / xx), rel=1e-8)
    white = w**2 * integral(w, w)
    assert compute_white_factor(low_pass, 1 / rate)[0, 0] ** 2 == pytest.approx(
        float(white), rel=1e-12
    )


@pytest.mark.parametrize("order", [2, 4])
def test_the_noise_of_a_butterworth_filter_is_the_integral_of_its_response(order: int) -> None:
    from scipy.linalg import expm

    low_pass, interval = LowPass(200.0, order), 0.01
    t, weight = np.polynomial.legendre.leggauss(400)
    t, weight = interval * (t + 1) / 2, weight * interval / 2
    g = np.array([expm(low_pass.transition * x) @ low_pass.input for x in t])
    wanted = (g * weight[:, None]).T @ g
    factor = compute_white_factor(low_pass, interval)
    np.testing.assert_allclose(factor.T @ factor, wanted, rtol=1e-10, atol=1e-12 * wanted.max())


def test_a_bank_has_the_density_of_flicker_noise() -> None:
    f = np.geomspace(1e-5, 3e3, 777)
    total = sum(
        theory.gauss_markov(f, term.B, term.T_B) for term in fit_density_bank(0.7, 1e-5, 3e3)
    )
    np.testing.assert_allclose(total, 0.49 / (2 * np.pi * f), rtol=1e-3)


@pytest.mark.parametrize("order", [1, 3])
def test_flicker_bank_has_the_sampled_spectrum_of_flicker_noise(order: int) -> None:
    model = SensorModel(noise=NoiseModel(B=0.7), low_pass=LowPass(64.0, order))
    bank = fit_density_bank(0.7, 0.5 / 3600.0, MAX_FREQUENCY_RATIO * 64.0)
    omega = np.geomspace(2 * np.pi / 3600.0, np.pi * RATE, 50) / RATE
    found = compute_sampled_spectrum(drives_of(bank), model.low_pass, omega, RATE)
    np.testing.assert_allclose(found, model.sampled_spectrum(omega, RATE), rtol=2e-3)


def test_without_a_filter_the_model_is_that_of_the_noise() -> None:
    noise = NoiseModel(Q=1e-3, N=0.3, B=0.2, K=0.01)
    model = SensorModel(noise=noise, resolution=0.1)
    omega = np.array([1e-3, 0.1, 3.0])
    added = 0.01 / 12
    spectrum = model.sampled_spectrum(omega, RATE)
    np.testing.assert_allclose(spectrum, noise.sampled_spectrum(omega, RATE) + added)


def test_ramps_and_lines_have_no_density() -> None:
    noise = NoiseModel(N=0.3)
    more = NoiseModel(N=0.3, R=1e-3, sinusoids=[Sinusoid(1.0, 6.0)])
    omega = np.array([1e-5, 1.0])
    for low_pass in (None, LowPass(3.0, 2)):
        found, wanted = (
            SensorModel(noise=each, low_pass=low_pass).sampled_spectrum(omega, RATE)
            for each in (more, noise)
        )
        np.testing.assert_array_equal(found, wanted)


def test_quantization_is_behind_the_filter() -> None:
    noise, omega = NoiseModel(Q=1e-3), np.array([0.1, 3.0])
    found = SensorModel(noise=noise, low_pass=LowPass(3.0, 2)).sampled_spectrum(omega, RATE)
    np.testing.assert_allclose(found, noise.sampled_spectrum(omega, RATE))


def test_sources_are_what_has_a_density() -> None:
    terms = [WhiteNoise(2.0), WhiteNoise(1.0), RandomWalk(3.0), Flicker(2.0)]
    found = drives_of(terms)
    assert (found.white, found.flicker) == (5.0, 4.0)
    assert found.times.tolist() == [np.inf] and found.densities.tolist() == [9.0]


positive = st.floats(-3.0, 1.0).map(lambda power: 10.0**power)


@settings(max_examples=10)
@given(
    N=positive,
    B=positive,
    T_B=st.floats(-3.0, 5.0).map(lambda power: 10.0**power),
    K=positive,
    flicker=st.booleans(),
    cutoff=st.floats(-1.0, 3.0).map(lambda power: 10.0**power),
    order=st.integers(1, 8),
)
def test_any_model_has_the_folded_spectrum(
    N: float, B: float, T_B: float, K: float, flicker: bool, cutoff: float, order: int
) -> None:
    noise = NoiseModel(N=N, B=B, T_B=None if flicker else T_B, K=K)
    model = SensorModel(noise=noise, low_pass=LowPass(cutoff, order))

    def density(f: np.ndarray) -> np.ndarray:
        slow = B**2 / (2 * np.pi * f) if flicker else theory.gauss_markov(f, B, T_B)
        before = N**2 + slow + K**2 / (2 * np.pi * f) ** 2
        return before * theory.butterworth(f, cutoff, order)

    f = np.geomspace(1e-3, 49.9, 12)
    found = model.sampled_spectrum(2 * np.pi * f / RATE, RATE) / RATE
    wanted = theory.folded(density, f, RATE)
    # What a filter of high order leaves far beyond its cut-off is lost beside what it lets pass.
    np.testing.assert_allclose(found, wanted, rtol=1e-4, atol=1e-12 * wanted.max())
