import math

import mpmath  # type: ignore[import-untyped]  # has no types
import numpy as np
import pytest

from imubench_pipeline.noise import FLOOR, Flicker, NoiseModel
from imubench_pipeline.noise.terms.flicker import fit_flicker_bank


@pytest.mark.parametrize("band", [(0.01, 36_000.0), (0.02, 20.0), (1.0, 1e7)])
def test_the_bank_is_flicker_within_two_per_cent_of_the_plateau(band: tuple[float, float]) -> None:
    n = np.unique(np.rint(np.geomspace(8, band[1] / band[0], 300)))
    terms = fit_flicker_bank(3.0, *band)
    variance = np.sum([term.sampled_allan_variance(n, band[0]) for term in terms], axis=0)
    np.testing.assert_allclose(variance, FLOOR**2 * 9.0, rtol=0.02)


@pytest.mark.parametrize("band", [(0.01, 36_000.0), (0.02, 20.0), (1.0, 1e7)])
def test_the_ripple_is_small(band: tuple[float, float]) -> None:
    terms, flicker = fit_flicker_bank(1.0, *band), Flicker(1.0)
    n = np.unique(np.rint(np.geomspace(1.0, band[1] / band[0], 400)))
    variance = np.sum([term.sampled_allan_variance(n, band[0]) for term in terms], axis=0)
    assert np.max(np.abs(variance / flicker.sampled_allan_variance(n, band[0]) - 1.0)) < 5e-3
    omega = np.geomspace(np.pi * band[0] / band[1], np.pi, 400)
    found = np.sum([term.sampled_spectrum(omega, band[0]) for term in terms], axis=0)
    assert np.max(np.abs(found / flicker.sampled_spectrum(omega, band[0]) - 1.0)) < 2.2e-2


def test_a_state_space_has_the_bank_in_it() -> None:
    space = NoiseModel(N=1.0, B=2.0, K=0.1).state_space(100.0, longest=1000.0)
    processes = [term for term in fit_flicker_bank(2.0, 0.01, 1000.0) if term.symbol == "GM"]
    assert len(space.output) == len(processes) + 1
    assert space.transition[-1, -1] == 1.0


def test_an_empty_band_is_refused() -> None:
    with pytest.raises(ValueError, match="expected 0 < interval < longest"):
        fit_flicker_bank(1.0, 10.0, 10.0)


@pytest.mark.parametrize("lag", [0, 1, 2, 99, 100, 101, 3000])
def test_blocks_far_apart_have_the_mean_logarithm_of_their_distance(lag: int) -> None:
    def weighed(u: mpmath.mpf) -> mpmath.mpf:
        return (1 - abs(u)) * mpmath.log(abs(lag + u))

    mean = mpmath.quad(weighed, [-1, 0, 1])
    found = Flicker(2.0).block_covariance(np.array([float(lag)]), 10.0)[0]
    # 1e-15, but at lag 99, where the closed form has lost digits, 2e-12
    assert found == pytest.approx(-4.0 / math.pi * float(mean), rel=1e-11)
