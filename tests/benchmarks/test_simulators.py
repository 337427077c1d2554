"""Simulated noise against closed forms; the Allan variance here is that of the definition."""

import math

import numpy as np
import pytest
from scipy import signal

import simulators as sim
from tests.conftest import few

pytestmark = pytest.mark.release  # as what they test is run

RATE = 10.0
LENGTH = 400_000


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260101)


def allan_deviation(log: np.ndarray, cluster: int) -> float:
    means = log[: len(log) // cluster * cluster].reshape(-1, cluster).mean(axis=1)
    return math.sqrt(0.5 * np.mean(np.diff(means) ** 2))


def density(log: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two-sided, by Welch."""
    frequency, one_sided = signal.welch(log, RATE, nperseg=4096)
    return frequency[1:-1], 0.5 * one_sided[1:-1]


def test_white_noise_and_walk_have_their_allan_deviation(rng):
    white = sim.white(LENGTH, RATE, 2e-3, rng)
    assert allan_deviation(white, 10) == pytest.approx(2e-3, rel=0.02)
    walk = sim.random_walk(LENGTH, RATE, 3e-4, rng)
    assert allan_deviation(walk, 300) == pytest.approx(3e-4 * math.sqrt(30.0 / 3.0), rel=0.1)


def test_gauss_markov_process_is_stationary_and_peaks_at_its_bias_instability(rng):
    B, T_B = 5e-3, 4.0
    log = sim.gauss_markov(LENGTH, RATE, B, T_B, rng)
    assert log.var() == pytest.approx(B**2 * math.log(2) / (math.pi * 0.4365**2), rel=0.05)
    lagged = np.mean(log[40:] * log[:-40]) / log.var()
    assert lagged == pytest.approx(math.exp(-1.0), rel=0.08)
    assert allan_deviation(log, round(1.89 * T_B * RATE)) == pytest.approx(0.664 * B, rel=0.03)
    starts = [sim.gauss_markov(1, RATE, B, T_B, rng)[0] for _ in range(4000)]
    assert np.var(starts) == pytest.approx(B**2 * sim.VARIANCE, rel=0.1)


@pytest.mark.release
def test_flicker_noise_of_both_kinds_has_the_plateau_and_its_own_density_at_nyquist(rng):
    B = 1e-3
    plain = sim.flicker(LENGTH, RATE, B, rng)
    fractional = sim.fractional_flicker(LENGTH, B, rng)
    for log in (plain, fractional):
        assert allan_deviation(log, 500) == pytest.approx(0.664 * B, rel=0.1)
    frequency, measured = density(plain)
    assert np.mean(measured * 2.0 * np.pi * frequency)[()] == pytest.approx(B**2, rel=0.03)
    frequency, measured = density(fractional)
    sampled = B**2 / (RATE * 2.0 * np.sin(np.pi * frequency / RATE))
    assert np.mean(measured / sampled) == pytest.approx(1.0, rel=0.03)


def test_telegraph_noise_is_correlated_as_a_gauss_markov_process(rng):
    log = sim.telegraph(LENGTH, RATE, 1.0, 8.0, rng)
    assert set(np.unique(log)) == {-1.0, 1.0}
    assert np.mean(log[40:] * log[:-40]) == pytest.approx(math.exp(-1.0), abs=0.04)  # T_B = 4 s


def test_second_order_process_has_its_covariance_and_instability(rng):
    log = sim.second_order(2 * LENGTH, RATE, 1.0, 3.0, rng)
    assert log.std() == pytest.approx(1.0, rel=0.03)
    assert np.mean(log[30:] * log[:-30]) == pytest.approx(2.0 / math.e, rel=0.05)
    clusters = np.unique(np.geomspace(20, 200, 30).astype(int))
    highest = max(allan_deviation(log, int(cluster)) for cluster in clusters)
    assert sim.second_order_instability() * sim.FLOOR == pytest.approx(highest, rel=0.03)


def nothing(samples, rate):
    return np.zeros(samples)


# Every day an analogue one has the variance of the sampled process, below.
@pytest.mark.parametrize(
    ("kind", "order"),
    few([("digital", 2)], [("digital", 1), ("digital", 4), *(("analogue", n) for n in (1, 2, 4))]),
)
def test_low_pass_has_lost_half_of_the_power_at_its_cutoff(rng, kind, order):
    if kind == "analogue":
        log = sim.analogue(nothing, 1.0, 200_000, RATE, 0.5, order, rng)
    else:
        log = sim.digital(lambda n, rate: sim.white(n, rate, 1.0, rng), 200_000, RATE, 0.5, order)
    assert len(log) == 200_000
    frequency, measured = density(log)
    assert np.mean(measured[frequency < 0.05]) == pytest.approx(1.0, rel=0.1)
    at = np.abs(frequency - 0.5) < 0.02
    assert np.mean(measured[at]) == pytest.approx(0.5, rel=0.1)
    assert np.mean(measured[np.abs(frequency - 1.0) < 0.05]) == pytest.approx(
        1.0 / (1.0 + 2.0 ** (2 * order)), rel=0.15
    )


@pytest.mark.release
@pytest.mark.parametrize("cutoff", few([0.3], [2.0, 4.0]))
def test_folds_of_first_order_are_those_of_the_sampled_process(rng, cutoff):
    # White noise behind it is a Gauss-Markov process, sampled an AR(1) sequence.
    frequency = np.linspace(0.0, 0.5, 11) * RATE
    decay = math.exp(-2.0 * math.pi * cutoff / RATE)
    variance = math.pi * cutoff
    gap = 1.0 - 2.0 * decay * np.cos(2.0 * np.pi * frequency / RATE) + decay**2
    exact = variance / RATE * (1.0 - decay**2) / gap
    assert sim.folded(frequency, RATE, cutoff, 1) == pytest.approx(exact, rel=1e-5)
    log = sim.analogue(nothing, 1.0, LENGTH, RATE, cutoff, 1, rng)
    assert log.var() == pytest.approx(variance, rel=0.02)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_folds_add_up_to_the_variance_before_the_sampling(order):
    cutoff = 3.0
    frequency = (np.arange(2000) + 0.5) / 2000 * 0.5 * RATE
    whole = math.pi * cutoff / order / math.sin(math.pi / (2 * order))
    sampled = RATE * np.mean(sim.folded(frequency, RATE, cutoff, order))
    assert sampled == pytest.approx(whole, rel=1e-5)


@pytest.mark.release
def test_slow_noise_passes_an_analogue_low_pass(rng):
    walk = sim.analogue(
        lambda n, rate: 7.0 + sim.random_walk(n, rate, 1e-2, rng), 0.0, 100_000, RATE, 1.0, 2, rng
    )
    assert walk[0] == pytest.approx(7.0, abs=0.4)
    assert allan_deviation(walk, 100) == pytest.approx(1e-2 * math.sqrt(10.0 / 3.0), rel=0.1)


def test_moving_mean_has_its_cutoff():
    gain = abs(signal.freqz(np.ones(7) / 7, worN=[sim.moving_mean_cutoff(50.0, 7)], fs=50.0)[1])
    assert gain[0] == pytest.approx(math.sqrt(0.5), rel=1e-3)


def test_decimated_noise_keeps_its_density(rng):
    log = sim.decimated(lambda n, rate: sim.white(n, rate, 1.0, rng) + 5.0, 100_000, RATE, 8)
    frequency, measured = density(log)
    assert len(log) == 100_000
    assert log.mean() == pytest.approx(5.0, abs=0.05)
    assert np.mean(measured[frequency < 3.0]) == pytest.approx(1.0, rel=0.06)


def test_bias_instability_of_a_curve_is_b_of_one_process_and_the_root_of_the_sum_of_two_alike():
    sigma = math.sqrt(sim.VARIANCE) * 3e-4
    assert sim.instability_of_curve([(sigma, 5.0)], 100.0) == pytest.approx(3e-4, rel=1e-3)
    two = sim.instability_of_curve([(sigma, 5.0), (sigma, 5.0)], 100.0)
    assert two == pytest.approx(math.sqrt(2.0) * 3e-4, rel=1e-3)
    assert sim.instability_of_curve([(sigma, 5.0)], 2.0) < 2.5e-4


@pytest.mark.parametrize("cutoff", few([4.0], [1.0]))
def test_resonant_low_pass_keeps_what_folds(rng, cutoff):
    quality = 1.6
    log = sim.resonant(lambda n, r: sim.white(n, r, 1.0, rng), LENGTH, RATE, cutoff, quality)
    # Both sides of |H|^2: pi f_c Q, by residues.
    assert log.var() == pytest.approx(math.pi * cutoff * quality, rel=0.02)


def test_resonant_low_pass_has_its_quality_at_the_cutoff(rng):
    log = sim.resonant(lambda n, rate: sim.white(n, rate, 1.0, rng), 200_000, RATE, 1.0, 1.6)
    frequency, measured = density(log)
    assert np.mean(measured[frequency < 0.1]) == pytest.approx(1.0, rel=0.1)
    assert np.mean(measured[np.abs(frequency - 1.0) < 0.02]) == pytest.approx(1.6**2, rel=0.1)


def test_bounds_are_those_of_the_whole_covariance():
    # White noise and a process of a few samples: the information from the dense covariance.
    samples, truth = 600, {"N": 1.0, "B": 2.0, "T_B": 0.8}

    def covariance(N: float, B: float, T_B: float) -> np.ndarray:
        lag = np.abs(np.subtract.outer(np.arange(samples), np.arange(samples))) / RATE
        return N**2 * RATE * np.eye(samples) + sim.VARIANCE * B**2 * np.exp(-lag / T_B)

    inverse = np.linalg.inv(covariance(**truth))
    slopes = []
    for name, value in truth.items():
        low, high = (covariance(**truth | {name: value * (1.0 + step)}) for step in (-1e-4, 1e-4))
        slopes.append(inverse @ (high - low) / 2e-4)
    information = np.array([[0.5 * np.trace(a @ b) for a in slopes] for b in slopes])
    exact = np.sqrt(np.diag(np.linalg.inv(information)))

    def density(frequency, of):
        process = sim.gauss_markov_density(frequency, RATE, of["B"], of["T_B"])
        return sim.white_density(frequency, RATE, of["N"]) + process

    found = sim.bounds(samples, RATE, density, truth)
    np.testing.assert_allclose([found[name] for name in truth], exact, rtol=0.05)


def test_bound_of_one_density_alone_is_that_of_so_many_degrees_of_freedom():
    def walk(frequency, of):
        return sim.random_walk_density(frequency, RATE, of["K"])

    assert sim.bounds(20_000, RATE, walk, {"K": 3.0})["K"] == pytest.approx(
        1.0 / np.sqrt(2 * 20_000), rel=1e-3
    )
