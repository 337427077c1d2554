"""The closed forms of error growth against spectra, covariances, fifty digits and each other."""

import math
from collections.abc import Callable, Sequence

import mpmath  # type: ignore[import-untyped]  # has no types
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray
from scipy.integrate import dblquad

from imubench_pipeline.noise import (
    Flicker,
    GaussMarkov,
    Quantization,
    Ramp,
    RandomWalk,
    Role,
    Sinusoid,
    Term,
    WhiteNoise,
)
from imubench_pipeline.noise.growth import Calibrated, SensorStart, Uncalibrated
from tests.noise.examples import NOISES, named

Array = NDArray[np.float64]

log_times = st.floats(-2.5, 3.5).map(lambda x: 10.0**x)
orders = st.integers(0, 2)


def at_rest_then_moving(order: int, time: float, window: float) -> Callable[[Array], Array]:
    """Return the kernel h(s) of an error of a calibrated sensor."""

    def h(s: Array) -> Array:
        constant = time ** (order + 1) / math.factorial(order + 1)
        moving = np.clip(time - s, 0.0, None) ** order / math.factorial(order)
        return np.where(s < 0, -constant / window, moving)

    return h


# Closed forms against the integral of the spectrum


def squared_gain(omega: Array, order: int, time: float, window: float) -> Array:
    """Return |H|^2, by quadrature at low and by integration by parts at high frequency."""
    h = at_rest_then_moving(order, time, window)
    gain = np.empty(len(omega), dtype=np.complex128)
    low = omega * (time + window) < 60.0
    nodes, weights = leggauss(64)
    gain[low] = 0.0
    for first, last in ((-window, 0.0), (0.0, time)):
        s = (first + last) / 2.0 + (last - first) / 2.0 * nodes
        part = np.exp(-1j * np.outer(omega[low], s)) @ (weights * h(s))
        gain[low] += (last - first) / 2.0 * part
    w = omega[~low]
    mean = time ** (order + 1) / math.factorial(order + 1) / window
    turned = np.exp(-1j * w * time)
    moving = sum(
        time ** (order - j) / math.factorial(order - j) * (-1.0) ** j / (1j * w) ** (j + 1)
        for j in range(order + 1)
    ) - (-1.0) ** order * turned / (1j * w) ** (order + 1)
    gain[~low] = moving - mean * (np.exp(1j * w * window) - 1.0) / (1j * w)
    return np.abs(gain) ** 2


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize(("time", "window"), [(3.0, 10.0), (40.0, 10.0), (10.0, 10.0)])
@pytest.mark.parametrize(
    "term", [term for term in NOISES if term.role is not Role.NOT_GROWING], ids=named
)
def test_variance_is_the_integral_of_the_spectrum(
    term: Term, order: int, time: float, window: float
) -> None:
    last = 2000.0 / min(time, window)
    inside = np.arange(0.0, last, 0.4 / (time + window))
    edges = np.concatenate(([0.0], inside[1] * np.geomspace(1e-8, 1.0, 60)[:-1], inside[1:]))
    nodes, weights = leggauss(10)
    half = np.diff(edges) / 2.0
    frequency = (edges[:-1] + half)[:, None] + half[:, None] * nodes
    gain = squared_gain(2.0 * np.pi * frequency.ravel(), order, time, window)
    density = term.psd(frequency.ravel())
    total = 2.0 * float(np.sum((density * gain).reshape(frequency.shape) @ weights * half))
    # Beyond, |H|^2 is the mean over the jumps of the kernel; S falls like f^-p there.
    constant = time ** (order + 1) / math.factorial(order + 1)
    first = time**order / math.factorial(order)
    jumps = (constant / window) ** 2 + (first + constant / window) ** 2 + (order == 0)
    end = edges[-1]
    near = term.psd(np.array([end, end * 1.01]))
    slope = -math.log(near[1] / near[0]) / math.log(1.01)
    total += 2.0 * float(near[0]) * jumps / (4.0 * np.pi**2 * end) / (1.0 + slope)
    found = term.growth(order, time, Calibrated(window))
    assert found == pytest.approx(total, rel=1e-5)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("start", [Calibrated(8.0), Uncalibrated(bias=0.0, on_time=0.0)])
def test_quantization_by_parseval(order: int, start: SensorStart) -> None:
    # (4 Q^2/T) sin^2(pi f T) is the density of (r(s) - r(s - T)) / T, r white of density Q^2 T.
    time, interval = 5.0, 1e-3
    window = start.window if isinstance(start, Calibrated) else 8.0
    s = np.arange(-window - 1.0, time + 1.0, interval / 20.0) + interval / 40.0
    if isinstance(start, Calibrated):
        kernel = at_rest_then_moving(order, time, window)
    else:

        def kernel(s: Array) -> Array:
            return np.where(s < 0, 0.0, np.clip(time - s, 0.0, None) ** order) / (
                math.factorial(order)
            )

    h = np.where((s > -window) & (s < time), kernel(s), 0.0)
    total = float(np.sum((h[20:] - h[:-20]) ** 2)) / 20.0
    found = Quantization(1.0).growth(order, time, start)
    assert found == pytest.approx(total, rel=3e-3)


@pytest.mark.release
@given(orders, st.floats(0.01, 100.0), st.floats(0.0, 300.0))
@settings(max_examples=8)
def test_flicker_since_switch_on_by_its_covariance(order: int, time: float, on_time: float) -> None:
    a = on_time / time

    def integrand(u: float, s: float) -> float:
        if u >= s:
            return 0.0
        covariance = math.log((math.sqrt(a + s) + math.sqrt(a + u)) ** 2 / (s - u)) / math.pi
        return 2.0 * covariance * ((1 - s) * (1 - u)) ** order / math.factorial(order) ** 2

    expected = dblquad(integrand, 0.0, 1.0, 0.0, lambda s: s, epsabs=1e-8)[0]
    found = Flicker(1.0).growth(order, time, Uncalibrated(bias=0.0, on_time=on_time))
    assert found == pytest.approx(expected * time ** (2 * order + 2), rel=1e-6)


# Closed forms against fifty digits, at all ratios of the times


def folded(integral: Callable[[int, mpmath.mpf], mpmath.mpf], m: int, t: float, W: float) -> float:
    """Return the double integral of h(s) h(s') R(|s - s'|), from the n-fold integrals of R."""
    time, window = mpmath.mpf(t), mpmath.mpf(W)
    c = time ** (m + 1) / mpmath.factorial(m + 1)
    total = _double(integral, m, time)
    total += 2 * (c / window) ** 2 * integral(2, window)
    # Cross: mean over w of the integral of k(s) R(s + w), twice.
    n = m + 2
    cross = integral(n, time + window) - integral(n, time)
    cross -= sum(integral(n - i, window) * time**i / mpmath.factorial(i) for i in range(m + 1))
    return float(total - 2 * c / window * cross)


def _double(
    integral: Callable[[int, mpmath.mpf], mpmath.mpf], m: int, time: mpmath.mpf
) -> mpmath.mpf:
    # 2 int_0^t A(x) R(x) dx with A(x) = int_0^{t-x} y^m (y+x)^m dy / m!^2, in powers of t - x;
    # int_0^t (t-x)^p R(x) dx is p! times the (p+1)-fold integral.
    total = mpmath.mpf(0)
    for i in range(m + 1):
        for k in range(i + 1):
            power = 2 * m - i + 1 + k
            factor = mpmath.binomial(m, i) * mpmath.binomial(i, k) * (-1) ** k * time ** (i - k)
            factor /= (2 * m - i + 1) * mpmath.factorial(m) ** 2
            total += factor * mpmath.factorial(power) * integral(power + 1, time)
    return 2 * total


def of_exponential(T_B: float) -> Callable[[int, mpmath.mpf], mpmath.mpf]:
    def integral(n: int, x: mpmath.mpf) -> mpmath.mpf:
        T = mpmath.mpf(T_B)
        z = -x / T
        rest = mpmath.exp(z) - sum(z**k / mpmath.factorial(k) for k in range(n))
        return T / 2 * (-T) ** n * rest

    return integral


def of_logarithm(n: int, x: mpmath.mpf) -> mpmath.mpf:
    return -(x**n) / mpmath.factorial(n) * (mpmath.log(x) - mpmath.harmonic(n)) / mpmath.pi


def of_distance(n: int, x: mpmath.mpf) -> mpmath.mpf:
    return -(x ** (n + 1)) / mpmath.factorial(n + 1) / 2


@given(orders, log_times, log_times)
def test_calibrated_flicker_and_walk_to_nine_digits(order: int, time: float, window: float) -> None:
    with mpmath.workdps(60):
        flicker = folded(of_logarithm, order, time, window)
        walk = folded(of_distance, order, time, window)
    start = Calibrated(window)
    assert Flicker(1.0).growth(order, time, start) == pytest.approx(flicker, rel=1e-9)
    assert RandomWalk(1.0).growth(order, time, start) == pytest.approx(walk, rel=1e-12)


@given(orders, log_times, log_times, st.floats(-4.0, 7.0))
def test_gauss_markov_to_ten_digits(
    order: int, time: float, window: float, log_time: float
) -> None:
    term = GaussMarkov(1.0, 10.0**log_time)
    with mpmath.workdps(80):
        integral = of_exponential(term.T_B)
        calibrated = folded(integral, order, time, window)
        stationary = float(_double(integral, order, mpmath.mpf(time)))
    found = term.growth(order, time, Calibrated(window)) / term.density
    assert found == pytest.approx(calibrated, rel=1e-10)
    found = term.growth(order, time, Uncalibrated(bias=0.0, on_time=3.0)) / term.density
    assert found == pytest.approx(stationary, rel=1e-10)


@given(orders, log_times, log_times, st.floats(-6.0, 2.0))
def test_lines_to_nine_digits(order: int, time: float, window: float, log_rate: float) -> None:
    frequency = 10.0**log_rate
    with mpmath.workdps(60):
        t, W, w = mpmath.mpf(time), mpmath.mpf(window), 2 * mpmath.pi * mpmath.mpf(frequency)
        z = 1j * w * t
        rest = mpmath.exp(z) - sum(z**k / mpmath.factorial(k) for k in range(order + 1))
        moving = rest / (1j * w) ** (order + 1)
        c = t ** (order + 1) / mpmath.factorial(order + 1)
        gain = abs(moving - c * (1 - mpmath.exp(-1j * w * W)) / (1j * w * W))
    # The phase itself is known to so many digits only.
    digits = 1e-9 + 1e-14 * frequency * (time + window)
    found = math.sqrt(2.0 * Sinusoid(1.0, frequency).growth(order, time, Calibrated(window)))
    size = float(c)
    assert found == pytest.approx(float(gain), rel=1e-9, abs=digits * min(size, float(gain) + size))


# Relations between the closed forms


@given(orders, log_times, log_times, st.floats(0.01, 100.0))
def test_scaling_laws(order: int, time: float, window: float, factor: float) -> None:
    # Of a density f^-p: sigma^2 grows as time^(2m+1+p) if window and on-time grow with it.
    later = factor * time
    pairs: Sequence[tuple[SensorStart, SensorStart]] = (
        (Calibrated(window), Calibrated(factor * window)),
        (Uncalibrated(bias=0, on_time=window), Uncalibrated(bias=0, on_time=factor * window)),
    )
    for slope, term in enumerate((WhiteNoise(0.3), Flicker(0.3), RandomWalk(0.3), Ramp(0.3))):
        for before, after in pairs:
            ratio = term.growth(order, later, after) / term.growth(order, time, before)
            assert ratio == pytest.approx(factor ** (2 * order + 1 + slope), rel=1e-8)


@given(orders, log_times, log_times)
def test_a_gauss_markov_process_lies_between_white_noise_and_a_walk(
    order: int, time: float, window: float
) -> None:
    start = Calibrated(window)
    # S(f) = S_B T_B^2 / (1 + (2 pi f T_B)^2)
    short = GaussMarkov(1.0, 1e-6 * min(time, window))
    white = WhiteNoise(math.sqrt(short.density) * short.T_B)
    assert short.growth(order, time, start) == pytest.approx(
        white.growth(order, time, start), rel=1e-4
    )
    long = GaussMarkov(1.0, 1e7 * max(time, window))
    walk = RandomWalk(math.sqrt(long.density))
    assert long.growth(order, time, start) == pytest.approx(
        walk.growth(order, time, start), rel=1e-4
    )


def test_the_mean_of_flicker_since_switch_on() -> None:
    # Right after switch-on 2/pi B^2; long after (B^2/pi) (ln(4 A / t) + 3/2).
    assert Flicker(2.0).mean_variance(5.0, 0.0) == pytest.approx(8.0 / math.pi)
    late = (math.log(4e6) + 1.5) * 4.0 / math.pi
    assert Flicker(2.0).mean_variance(5.0, 5e6) == pytest.approx(late, rel=1e-6)
