import numpy as np
import pytest

from imubench_pipeline.extensions.fusion.prediction import allan_of_spectrum, nodes
from imubench_pipeline.noise import NoiseModel

RATE = 100.0
SIZES = np.array([1, 2, 3, 7, 64, 127, 128, 129, 200, 1001, 54321, 3_000_000])


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(Q=1e-6),
        NoiseModel(N=1e-4),
        NoiseModel(B=1e-4),
        NoiseModel(B=1e-4, T_B=0.003),
        NoiseModel(B=1e-4, T_B=90.0),
        NoiseModel(B=1e-4, T_B=1e6),
        NoiseModel(K=1e-6),
        NoiseModel(Q=1e-6, N=1e-4, B=5e-5, T_B=40.0, K=1e-6),
    ],
    ids=lambda model: f"{model.name}-{model.T_B}",
)
def test_the_integral_over_the_spectrum_is_the_closed_form(model: NoiseModel) -> None:
    found = allan_of_spectrum(lambda omega: model.sampled_spectrum(omega, RATE), SIZES)
    assert found == pytest.approx(model.allan_variance(SIZES / RATE, RATE), rel=1e-7, abs=0)


def test_a_matrix_of_spectra_is_integrated_at_once() -> None:
    found = allan_of_spectrum(lambda omega: np.ones((len(omega), 2, 3)), [1, 10])
    assert found.shape == (2, 2, 3)
    assert found[:, 1, 2] == pytest.approx([1.0, 0.1])


def test_a_spectrum_that_bends_sharply_is_summed_up_in_time_as_well() -> None:
    # x_k + x_(k-1) has the spectrum 4 cos^2(w/2); its Allan variance follows from the covariances.
    covariance = np.zeros(64)
    covariance[:2] = 2.0, 1.0
    lags = np.abs(np.subtract.outer(np.arange(20), np.arange(20)))
    halves = np.repeat([-1.0, 1.0], 10) / 10
    expected = halves @ covariance[lags] @ halves / 2.0
    (found,) = allan_of_spectrum(lambda omega: 4.0 * np.cos(omega / 2.0) ** 2, [10])
    assert found == pytest.approx(expected, rel=1e-10)


def test_a_cluster_has_samples() -> None:
    with pytest.raises(ValueError, match="a cluster has 0 samples"):
        nodes(0)
