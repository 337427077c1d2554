"""Every kind of noise term in the registry: what it says of itself is one thing, said many ways."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.linalg import expm

from imubench_pipeline.noise import Deterministic, Role, Term
from imubench_pipeline.noise.growth import Calibrated
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.typing import Array
from tests.noise.examples import EXAMPLES, NOISES, named

INTERVAL = 0.1

of_all = pytest.mark.parametrize("term", EXAMPLES, ids=named)
of_noises = pytest.mark.parametrize("term", NOISES, ids=named)


def sampled(term: Term, n: int) -> float:
    return float(term.sampled_allan_variance(np.array([float(n)]), INTERVAL)[0])


def continuous(term: Term, tau: float) -> float:
    return float(term.allan_variance(np.array([tau]))[0])


def covariance_of_samples(spaces: Sequence[StateSpace], samples: int) -> Array:
    """Return the covariance of the samples of state spaces, means included, step by step."""
    total = np.zeros((samples, samples))
    for space in spaces:
        mean, covariance = space.initial_mean, space.initial_variance
        means = np.zeros(samples)
        for i in range(samples):
            means[i] = space.output @ mean
            ahead = covariance @ space.output
            for j in range(i, samples):
                found = space.output @ ahead
                total[i, j] += found
                total[j, i] += found if j > i else 0.0
                ahead = space.transition @ ahead
            total[i, i] += space.measurement_noise
            mean = space.transition @ mean
            covariance = space.transition @ covariance @ space.transition.T + space.process_noise
        total += np.outer(means, means)
    return total


def spaces_of(term: Term, longest: float) -> list[StateSpace]:
    return [part.state_space(INTERVAL) for part in term.realised(INTERVAL, longest)]


def as_realised(term: Term) -> float:
    """Return how near a term is to what realises it: the bank of flicker noise is within 0.5 %."""
    return 1e-9 if term.realised(INTERVAL, 10.0) == [term] else 5e-3


# Density, Allan variance, spectrum and covariance


@of_noises
@pytest.mark.parametrize("tau", [0.5, 40.0])
def test_the_allan_variance_is_the_integral_of_the_density(term: Term, tau: float) -> None:
    """sigma^2 = 4 int S sin^4(pi f tau) / (pi f tau)^2 df; quantization folds at its sampling."""
    interval = 0.5 / 150.0
    try:
        density = term.psd(np.ones(1))
    except ValueError:  # it depends on the sampling: up to there, and as sampled
        density = None
    turns = 20_000 if density is not None else round(tau / interval / 2.0)
    nodes, weights = leggauss(8)
    # x = pi f tau, half a turn at a time; the lowest ones finer, where a slow process bends.
    edges = np.concatenate(([0.0], np.geomspace(1e-7, 1.0, 80), np.arange(2.0, 2.0 * turns + 1)))
    edges = edges * np.pi / 2.0
    half = np.diff(edges) / 2.0
    x = (edges[:-1] + half)[:, None] + half[:, None] * nodes
    shape = np.sin(x) ** 4 / (x**2 if density is not None else 0.0 * x + 1.0)
    if density is None:
        folded = np.sin(x * interval / tau) * tau / interval
        shape = shape / folded**2
    spectrum = term.psd(x / (np.pi * tau), interval)
    total = float(np.sum((spectrum * shape) @ weights * half))
    if density is not None:
        # Beyond, sin^4 averages to 3/8, and the density is level or falls.
        last = edges[-1]
        end = float(term.psd(np.array([last / (np.pi * tau)]))[0])
        total += 3.0 / 8.0 * end / last
    assert 4.0 / (np.pi * tau) * total == pytest.approx(continuous(term, tau), rel=1e-5)


@of_noises
@pytest.mark.parametrize("n", [1, 4, 50])
def test_the_spectrum_of_the_samples_gives_their_allan_variance(term: Term, n: int) -> None:
    points = 1 << 16
    omega = np.pi * (np.arange(points) + 0.5) / points
    transfer = 4 * np.sin(n * omega / 2) ** 4 / (n**2 * np.sin(omega / 2) ** 2)
    found = np.mean(term.sampled_spectrum(omega, INTERVAL) * transfer) / 2
    # The finest step of a walk, or of a process of 2300 samples, is 1e-5 of its variance.
    assert found == pytest.approx(sampled(term, n), rel=1e-6)


@of_all
@pytest.mark.parametrize("n", [1, 4, 50])
def test_sums_have_the_allan_variance(term: Term, n: int) -> None:
    at_zero, once, twice = term.sum_covariance(np.array([0.0, n, 2.0 * n]), n, INTERVAL)
    found = (6.0 * at_zero - 8.0 * once + 2.0 * twice) / (2.0 * n**2)
    expected = 0.0 if isinstance(term, Deterministic) else sampled(term, n)
    process = term.gauss_markov
    slow = process is not None and n * INTERVAL < 1e-3 * process.T_B
    # A process is taken for a walk in clusters of less than a thousandth of T_B: 2e-4 off here.
    assert found == pytest.approx(expected, rel=3e-4 if slow else 1e-7)


@of_all
@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_states_have_the_allan_variance_of_the_samples(term: Term, n: int) -> None:
    weights = np.concatenate([-np.ones(n), np.ones(n)]) / n
    found = weights @ covariance_of_samples(spaces_of(term, 10.0), 2 * n) @ weights / 2
    assert found == pytest.approx(sampled(term, n), rel=as_realised(term))


@of_all
def test_fine_samples_have_the_allan_variance_of_continuous_time(term: Term) -> None:
    tau, fine = 3.1, 3.1 / 4000.0
    found = float(term.sampled_allan_variance(np.array([4000.0]), fine)[0])
    assert found == pytest.approx(continuous(term, tau), rel=1e-5)


@of_all
def test_the_continuous_states_are_the_discrete_ones(term: Term) -> None:
    for part in term.realised(INTERVAL, 10.0):
        system = part.continuous_space()
        if system is None:
            assert term.role is Role.NOT_GROWING
            continue
        discrete, m = part.state_space(INTERVAL), len(system.output)
        # C. Van Loan, 1978.
        block = np.zeros((2 * m, 2 * m))
        block[:m, :m], block[m:, m:] = -system.transition, system.transition.T
        block[:m, m:] = system.density
        power = expm(block * INTERVAL)
        transition = power[m:, m:].T
        np.testing.assert_allclose(discrete.transition, transition, atol=1e-12)
        np.testing.assert_allclose(
            discrete.process_noise, transition @ power[:m, m:], rtol=1e-9, atol=1e-15
        )
        np.testing.assert_array_equal(discrete.output, system.output)


@of_noises
def test_what_drives_a_filter_has_the_density(term: Term) -> None:
    frequency = np.geomspace(1e-4, 10.0, 30)
    if term.drive is None:  # it stands behind every filter, or no sensor model can have it
        assert term.role in (Role.NOT_GROWING, Role.SLOW)
        return
    found = np.full(30, term.drive.white) + term.drive.flicker**2 / (2 * np.pi * frequency)
    if term.drive.process is not None:
        rate = 1.0 / term.drive.process.T_B
        found += term.drive.process.density / (rate**2 + (2 * np.pi * frequency) ** 2)
    np.testing.assert_allclose(found, term.psd(frequency), rtol=1e-12)


# Blocks


@of_noises
@pytest.mark.parametrize("size", [1, 2, 5])
def test_means_over_blocks_have_the_allan_variance(term: Term, size: int) -> None:
    block = 0.8
    covariance = term.block_covariance(np.arange(2.0 * size), block)
    weights = np.concatenate([-np.ones(size), np.ones(size)]) / size
    lags = np.abs(np.subtract.outer(np.arange(2 * size), np.arange(2 * size)))
    found = weights @ covariance[lags] @ weights / 2.0
    assert found == pytest.approx(continuous(term, size * block), rel=1e-9)


@pytest.mark.parametrize(
    "term", [term for term in EXAMPLES if isinstance(term, Deterministic)], ids=named
)
def test_a_course_is_seen_as_its_allan_variance(term: Deterministic) -> None:
    power, _ = term.swing(np.array([-1.0, 1.0]), 1.1)
    assert power / 2.0 == pytest.approx(continuous(term, 1.1), rel=1e-9)
    with pytest.raises(TypeError, match="deterministic"):
        term.block_covariance(np.zeros(1), 1.0)


@dataclass
class Cut:
    """Blocks of samples, one of them after a gap."""

    start: np.ndarray
    stop: np.ndarray
    rate: float = 1.0 / INTERVAL

    @property
    def count(self) -> np.ndarray:
        return self.stop - self.start

    @property
    def middle(self) -> Array:
        return (0.5 * (self.start + self.stop - 1) - self.start[0]) / self.rate


@of_all
def test_means_of_samples_have_the_covariance_of_the_states(term: Term) -> None:
    cut = Cut(np.array([0, 4, 14]), np.array([4, 11, 24]))
    averaging = np.zeros((3, 24))
    for row, start, stop in zip(averaging, cut.start, cut.stop, strict=True):
        row[start:stop] = 1.0 / (stop - start)
    for part in term.realised(INTERVAL, 10.0):
        samples = covariance_of_samples([part.state_space(INTERVAL)], 24)
        expected = averaging @ samples @ averaging.T
        np.testing.assert_allclose(part.mean_covariance(cut), expected, rtol=1e-9, atol=1e-12)


@of_all
def test_drawn_sums_have_the_allan_variance(term: Term) -> None:
    rng, width, blocks = np.random.default_rng(11), 6, 30_000
    parts = term.realised(INTERVAL, 100.0)
    sums = sum(part.block_sums(blocks, width, 1.0 / INTERVAL, rng) for part in parts)
    for size in (1, 4):
        means = sums.reshape(-1, size).mean(axis=1) / width
        found = np.mean(np.diff(means) ** 2) / 2.0
        # The standard error of 7500 differences is 2 %.
        assert found == pytest.approx(sampled(term, width * size), rel=0.07), size


# Growth


@of_all
def test_equal_window_and_motion_give_the_allan_variance(term: Term) -> None:
    for tau in (0.3, 4.0, 70.0):
        # The difference of adjacent means has twice the Allan variance.
        found = term.growth(0, tau, Calibrated(tau)) / tau**2
        assert found == pytest.approx(2.0 * continuous(term, tau), rel=1e-9)
    if term.role is not Role.WHITE:
        ((path, sigma),) = term.sources(0, 70.0, Calibrated(70.0))
    else:
        (path, sigma), (in_window, of_window) = term.sources(0, 70.0, Calibrated(70.0))
        assert in_window == "static_window"
        sigma = math.hypot(sigma, of_window)
    assert path is None
    assert sigma**2 == pytest.approx(term.growth(0, 70.0, Calibrated(70.0)))


@of_all
def test_from_a_known_state_it_grows_as_a_filter_predicts(term: Term) -> None:
    interval, steps = 0.01, 1000
    for part in term.realised(interval, 40.0):
        first, second = part.growth_from_known(np.array([interval * steps]))
        space = part.state_space(interval)
        m = len(space.output)
        if isinstance(term, Deterministic) or term.role is Role.NOT_GROWING:
            assert first == second == 0.0
            continue
        if part.gauss_markov is not None and part.gauss_markov.T_B < 20.0 * interval:
            continue  # of a bank; such steps do not follow it
        step = np.eye(2 + m)
        # Integrals of what is level between samples, and moves half a step on average.
        step[0, 1], step[0, 2:] = interval, space.output * interval**2 / 2.0
        step[1, 2:] = space.output * interval
        step[2:, 2:] = space.transition
        drive = np.zeros((2 + m, 2 + m))
        drive[1, 1] = space.measurement_noise * interval**2
        drive[2:, 2:] = space.process_noise
        covariance = np.zeros_like(step)
        for _ in range(steps):
            covariance = step @ covariance @ step.T + drive
        # A thousand steps: the last of them is a tenth of a per cent of the time.
        assert covariance[1, 1] == pytest.approx(first[0], rel=5e-3), part
        assert covariance[0, 0] == pytest.approx(second[0], rel=5e-3), part


# Parameters


@of_all
def test_it_grows_with_the_signal(term: Term) -> None:
    larger = term.scaled(3.0)
    assert type(larger) is type(term)
    assert continuous(larger, 2.0) == pytest.approx(9.0 * continuous(term, 2.0))
    power, unit = term.as_unit()
    assert power * continuous(unit, 2.0) == pytest.approx(continuous(term, 2.0))
    assert unit in (term, larger.as_unit()[1])


@of_all
def test_its_parameters_have_the_dimension_that_is_stated(term: Term) -> None:
    """In another unit of time all numbers are others, and the Allan variance is the same."""
    values = {one.symbol: term.values[one.symbol] * 60.0**-one.seconds for one in term.parameters}
    minutes = replace(term, **values)
    for tau in (0.7, 90.0):
        assert continuous(minutes, tau / 60.0) == pytest.approx(continuous(term, tau), rel=1e-9)


@of_all
def test_the_curve_shows_its_parameter_where_it_says(term: Term) -> None:
    reading = term.reading(11.0)
    if reading is None:
        assert term.role not in (Role.WHITE, Role.RANDOM_WALK, Role.GAUSS_MARKOV)
        return
    # 0.664 B is the peak of a process to 0.1 %.
    assert reading.level == pytest.approx(math.sqrt(continuous(term, reading.tau)), rel=1e-3)
    assert reading.level == pytest.approx(reading.factor * term.values[reading.symbol])
    around = [continuous(term, reading.tau * ratio) for ratio in (0.3, 3.0)]
    assert reading.peak == (max(around) < 0.99 * reading.level**2)


@of_all
def test_its_words_have_its_values(term: Term) -> None:
    written = [
        float(one) for one in re.findall(r"(?<!\w)-?\d+(?:\.\d+)?(?:e[-+]\d+)?", term.in_words)
    ]
    assert written == pytest.approx(list(term.values.values()), rel=1e-3)
