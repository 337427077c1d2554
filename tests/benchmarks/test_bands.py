"""The bounds over the bands that logs were estimated in."""

import numpy as np
import pytest

import bands
from imubench_pipeline.estimators.intervals import compute_cramer_rao_bounds
from imubench_pipeline.noise import NoiseModel

pytestmark = pytest.mark.release  # as what they test is run

MODEL = NoiseModel(N=1e-4, B=1e-4, T_B=60.0, K=1e-6)


def test_bounds_are_those_over_the_band_of_each_log():
    found = bands.bounds_over(MODEL, 20.0, 36_000.0, [10.0, 0.73, 10.0])
    for i, band in enumerate((10.0, 0.73, 10.0)):
        known = compute_cramer_rao_bounds(MODEL, 20.0, 36_000.0, band)
        assert {name: bound[i] for name, bound in found.items()} == pytest.approx(known, rel=0.01)
    # White noise is known by the number of ordinates, but for those below the process.
    assert found["N"][1] == pytest.approx(found["N"][0] * np.sqrt(10.0 / 0.73), rel=0.1)


def test_what_is_cut_is_said():
    assert bands.what_is_cut([10.0, 10.0], 20.0) == (
        "default band: up to Nyquist, 10 Hz, in 2 of 2 logs"
    )
    assert bands.what_is_cut([10.0, 1.0, 3.0], 20.0).endswith(
        "in 1 of 3 logs; cut in 2, at 1 to 3 Hz (median 2)"
    )
