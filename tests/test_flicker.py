import numpy as np
import pytest

from imubench_pipeline.flicker import bank, ripple
from imubench_pipeline.noise import FLOOR, NoiseModel


@pytest.mark.parametrize("band", [(0.01, 0.5), (0.01, 36_000.0), (1.0, 1e7)])
def test_the_bank_is_flicker_within_two_per_cent_of_the_plateau(band: tuple[float, float]) -> None:
    terms = bank(3.0, *band)
    tau = np.geomspace(*band, 500)
    variance = np.sum([term.allan_variance(tau) for term in terms], axis=0)
    np.testing.assert_allclose(variance, FLOOR**2 * 9.0, rtol=0.02)
    stated, density = ripple(*band)
    assert np.max(np.abs(variance / (FLOOR**2 * 9.0) - 1)) <= stated * 1.1 + 1e-6
    assert stated < 1e-3
    assert density < 0.02


def test_a_state_space_has_the_bank_in_it() -> None:
    space = NoiseModel(N=1.0, B=2.0, K=0.1).state_space(100.0, longest=1000.0)
    assert len(space.output) == len(bank(2.0, 0.01, 1000.0)) + 1
    assert space.transition[-1, -1] == 1.0


def test_an_empty_band_is_refused() -> None:
    with pytest.raises(ValueError, match="empty"):
        bank(1.0, 10.0, 10.0)
