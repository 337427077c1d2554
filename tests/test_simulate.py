from dataclasses import dataclass

import numpy as np
import pytest

from imubench_pipeline.allan import cluster_sizes
from imubench_pipeline.noise import TERMS, GaussMarkov, NoiseModel, Sinusoid, StateSpace, Term
from imubench_pipeline.noise.simulate import (
    block_sums,
    channel_rng,
    ensemble,
    reconstructed_variance,
    simulate,
    simulate_blocks,
)
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance
from tests.conftest import few
from tests.noise.examples import example, model_of

MODEL = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=20.0, K=8.2e-6)
RATE = 10.0


def gauss_markov_variance(tau: np.ndarray, B: float, T_B: float) -> np.ndarray:
    """Integral of the spectrum, written apart from the library, over a fine grid of log f."""
    f = np.geomspace(1e-9, 1e5, 400_001)
    density = 2 * B**2 * np.log(2) / (np.pi * 0.4365**2 * T_B)
    psd = density / (1 / T_B**2 + (2 * np.pi * f) ** 2)
    return np.array(
        [
            np.trapezoid(4 * psd * np.sin(np.pi * f * t) ** 4 / (np.pi * f * t) ** 2 * f, np.log(f))
            for t in tau
        ]
    )


def test_the_allan_variance_of_simulated_logs_is_the_theoretical_one(rng) -> None:
    sizes = np.array([2, 10, 50, 200, 800, 2000])
    tau = sizes / RATE
    found = np.array([reconstructed_variance(MODEL, RATE, 20_000, sizes, rng) for _ in range(200)])
    expected = (
        MODEL.N**2 / tau
        + gauss_markov_variance(tau, MODEL.B, 20.0)
        + MODEL.K**2 * tau / 3 * (1 + 0.5 / sizes**2)
    )
    error = found.std(axis=0) / np.sqrt(len(found))
    assert (np.abs(found.mean(axis=0) - expected) < 4 * error + 1e-4 * expected).all()


def test_the_spectrum_of_simulated_logs_is_the_theoretical_one(rng) -> None:
    length, members = 4096, 600
    window = np.hanning(length)
    power = np.zeros(length // 2 + 1)
    for _ in range(members):
        log = simulate(NoiseModel(N=1e-3, B=5e-3, T_B=2.0), RATE, length, rng)
        power += np.abs(np.fft.rfft(window * (log - log.mean()))) ** 2
    density = power / members / (window @ window) / RATE
    f = np.fft.rfftfreq(length, 1 / RATE)[20:200]  # far below Nyquist: no aliasing to speak of
    driving = 2 * 5e-3**2 * np.log(2) / (np.pi * 0.4365**2 * 2.0)
    expected = 1e-6 + driving / (1 / 2.0**2 + (2 * np.pi * f) ** 2)
    ratio = density[20:200] / expected
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)
    assert np.abs(ratio - 1).max() < 5 / np.sqrt(members)


@pytest.mark.parametrize(("logs", "known"), few([(1000, 0.18)], [(4000, 0.1)]))
def test_gauss_markov_starts_stationary(rng, logs: int, known: float) -> None:
    model = NoiseModel(B=1.0, T_B=1000.0)
    starts = [simulate(model, RATE, 1, rng)[0] for _ in range(logs)]
    stationary = model.state_space(RATE).initial_variance[0, 0]
    # The variance of 1000 is known to 4.5 %, of 4000 to 2.2 %.
    assert np.var(starts) == pytest.approx(stationary, rel=known)


def test_a_log_depends_on_its_seed_only() -> None:
    def log(*names: str, block: int = 1 << 20) -> np.ndarray:
        rng = channel_rng(1, *names)
        return np.concatenate(list(simulate_blocks(MODEL, RATE, 5000, rng, block)))

    np.testing.assert_array_equal(log("s", "r", "gyro_x"), log("s", "r", "gyro_x", block=77))
    assert not np.allclose(log("s", "r", "gyro_x"), log("s", "r", "gyro_y"))
    assert not np.allclose(log("s", "r", "gyro_x"), log("sr", "", "gyro_x"))


@pytest.mark.release
@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(N=0.1, B=1.0, T_B=3.0, K=0.2),
        NoiseModel(Q=0.2, B=1.0, R=0.1),
        NoiseModel(N=0.1, sinusoids=[Sinusoid(1.0, 0.07)], further=[GaussMarkov(1.0, 0.5)]),
    ],
    ids=lambda model: model.name,
)
def test_block_sums_are_distributed_as_the_sums_of_a_log(rng, model: NoiseModel) -> None:
    width, blocks, members = 25, 4, 6000
    direct = np.array(
        [
            simulate(model, RATE, width * blocks, rng).reshape(blocks, width).sum(1)
            for _ in range(members)
        ]
    )
    drawn = np.array([block_sums(model, RATE, blocks, width, rng) for _ in range(members)])
    scale = np.sqrt(np.outer(np.diag(np.cov(direct.T)), np.diag(np.cov(direct.T))))
    np.testing.assert_allclose(np.cov(drawn.T) / scale, np.cov(direct.T) / scale, atol=0.08)
    error = np.sqrt(np.diag(np.cov(direct.T)) * 2 / members)
    assert (np.abs(drawn.mean(0) - direct.mean(0)) < 4.5 * error).all()


@pytest.mark.parametrize("kind", TERMS)
def test_every_term_is_simulated_as_its_allan_variance_says(rng, kind: type[Term]) -> None:
    model = model_of(example(kind))
    sizes = np.array([1, 2, 5, 10, 50, 200, 800])
    found = np.array([reconstructed_variance(model, RATE, 8000, sizes, rng) for _ in range(80)])
    error = found.std(axis=0) / np.sqrt(len(found))
    expected = model.allan_variance(sizes / RATE, RATE)
    tolerance = 4.5 * error + 5e-3 * expected
    assert (np.abs(found.mean(axis=0) - expected) < tolerance).all()


@dataclass(frozen=True)
class Mixed(GaussMarkov):
    """A process and one ten times as slow, in states that are a mixture of the two."""

    @property
    def both(self) -> NoiseModel:
        return NoiseModel(B=self.B, T_B=self.T_B, further=[GaussMarkov(self.B, 10.0 * self.T_B)])

    def state_space(self, interval: float) -> StateSpace:
        space = self.both.state_space(1.0 / interval)
        turn = np.array([[0.8, -0.6], [0.6, 0.8]])
        return StateSpace(
            turn @ space.transition @ turn.T,
            turn @ space.process_noise @ turn.T,
            turn @ space.output,
            0.0,
            np.zeros(2),
            turn @ space.initial_variance @ turn.T,
        )


def test_states_whose_noise_goes_together_are_simulated(rng) -> None:
    mixed, sizes = Mixed(1.0, 0.7), np.array([1, 5, 50, 200])
    model = NoiseModel(further=[mixed])
    found = np.array([reconstructed_variance(model, RATE, 8000, sizes, rng) for _ in range(100)])
    error = found.std(axis=0) / np.sqrt(len(found))
    expected = mixed.both.allan_variance(sizes / RATE, RATE)
    assert (np.abs(found.mean(axis=0) - expected) < 4.5 * error).all()


@pytest.mark.release
def test_the_ensemble_is_that_of_full_length_logs(rng) -> None:
    length = 40_000
    sizes = cluster_sizes(length, per_decade=4)
    drawn = ensemble(MODEL, RATE, length, sizes, 2000, rng)
    full = np.array([reconstructed_variance(MODEL, RATE, length, sizes, rng) for _ in range(500)])
    spread = full.std(axis=0)
    for quantile, allowed in ((0.025, 0.45), (0.5, 0.2), (0.975, 0.6)):
        difference = np.quantile(drawn, quantile, axis=0) - np.quantile(full, quantile, axis=0)
        assert (np.abs(difference) < allowed * spread).all(), quantile
    np.testing.assert_allclose(drawn.std(axis=0) / spread, 1.0, atol=0.2)


def test_the_ensemble_has_the_mean_and_the_scatter_of_the_model(rng) -> None:
    length, members = 40_000, 300
    sizes = cluster_sizes(length, per_decade=4, longest=1 / 9)
    drawn = ensemble(MODEL, RATE, length, sizes, members, rng)
    expected = MODEL.allan_variance(sizes / RATE, RATE)
    scatter = np.sqrt(np.diag(compute_variance_covariance(MODEL, RATE, length, sizes)))
    error = np.abs(drawn.mean(axis=0) - expected) / scatter * np.sqrt(members)
    assert (error < 4.5).all()
    np.testing.assert_allclose(drawn.std(axis=0) / scatter, 1.0, atol=0.15)


def test_the_shortest_clusters_of_a_short_log_are_single_samples(rng) -> None:
    one, two = ensemble(NoiseModel(N=1.0), RATE, 400, np.array([1, 2]), 100, rng).T
    assert 0.2 < np.corrcoef(one, two)[0, 1] < 0.9


@pytest.mark.release
def test_neighbouring_taus_go_together_in_the_ensemble(rng) -> None:
    sizes = np.array([2, 3, 4, 8])
    full = np.array([reconstructed_variance(MODEL, RATE, 4000, sizes, rng) for _ in range(3000)])
    expected = compute_variance_covariance(MODEL, RATE, 4000, sizes)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(np.cov(full.T) / scale, expected / scale, atol=0.08)
