"""What errors of a temperature's path leave in the noise, and how it is told from it."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.thermal.uncertainty import subtract_path_errors
from imubench_pipeline.estimators.whittle import Terms, make_whittle

RATE, N, K = 1.0, 1e-3, 1e-5


@pytest.fixture
def whittle():
    """Of noise whose density is measured as it is expected."""
    spectrum, _ = compute_spectra([np.random.default_rng(0).standard_normal(20_000)], 20_000, RATE)
    shapes = make_whittle(spectrum, RATE / 2.0)
    density = N**2 * shapes.column("N") + K**2 * shapes.column("K")
    return shapes.of(replace(spectrum, density=density))


def errors_of(whittle):
    """Errors as strong as the noise at the lowest frequencies."""
    f = whittle.spectrum.frequency
    return whittle.spectrum.density[0] / (1.0 + (f / f[2]) ** 2) ** 2


def test_noise_is_found_beside_errors_of_the_path(whittle):
    errors, terms = errors_of(whittle), Terms("NK")
    used = np.ones(len(errors), dtype=bool)
    both = replace(whittle.spectrum, density=whittle.spectrum.density + errors)
    assert whittle.of(both).maximum(terms).parameter("K") > 1.15 * K
    left = subtract_path_errors(both, used, whittle, terms, errors)
    share = whittle.spectrum.density / both.density
    np.testing.assert_allclose(left.density, whittle.spectrum.density, rtol=0.02)
    np.testing.assert_allclose(left.ordinates, share**2 * both.ordinates, rtol=0.04)
    assert whittle.of(left).maximum(terms).parameter("K") == pytest.approx(K, rel=0.01)


def test_errors_far_below_the_noise_leave_it_as_it_is(whittle):
    used = np.ones(len(whittle.spectrum.density), dtype=bool)
    errors = 1e-6 * errors_of(whittle)
    assert (
        subtract_path_errors(whittle.spectrum, used, whittle, Terms("NK"), errors)
        is whittle.spectrum
    )


def test_bins_that_are_not_fitted_are_left_as_they_are(whittle):
    errors, used = errors_of(whittle), whittle.spectrum.frequency < 0.1
    both = replace(whittle.spectrum, density=whittle.spectrum.density + errors)
    below = whittle.select(both, used)
    left = subtract_path_errors(both, used, below, Terms("NK"), errors)
    np.testing.assert_array_equal(left.density[~used], both.density[~used])
    assert (left.density[:3] < both.density[:3]).all()
