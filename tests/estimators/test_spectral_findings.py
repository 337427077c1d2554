"""Slow noise that is missing, by the spectrum alone."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.estimators.cutoff import Cutoff
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.frame import Band, FitSelection
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.spectral_findings import (
    find_missing_slow_noise,
    spectral_findings,
    withhold_slow_noise,
)
from imubench_pipeline.tables.findings import Finding

FLAT = make_ideal_spectrum(10.0, 1000.0, 5.0)
BINS = len(FLAT.density)


def missing(
    bins: int, share: float, fitted: float = 1.0, white: float | None = 1.0
) -> Finding | None:
    """White noise of N = 1 with a part of its density in the lowest bins."""
    density = np.where(np.arange(BINS) < bins, share, 1.0)
    # The order of bins is that of no two spectra.
    turned = np.random.default_rng(1).permutation(BINS)
    spectrum = replace(FLAT, density=density).select(turned)
    return find_missing_slow_noise("gyro_x", spectrum, np.full(BINS, fitted)[turned], white)


def test_a_lack_has_its_part_its_end_and_is_beyond_chance() -> None:
    found = missing(40, 0.15)
    assert found is not None and found.value is not None
    assert (found.finding, found.channel) == ("slow_noise_missing", "gyro_x")
    # Sums that are looked at have 4 ordinates and more, each 1.4 times those before.
    sums = [
        n
        for n in range(4, 300)
        if np.floor(np.log(n) / np.log(1.4)) > np.floor(np.log(n - 1) / np.log(1.4))
    ]
    power = {n: 0.15 * min(n, 40) + max(n - 40, 0) for n in sums}
    chance = {n: stats.chi2(n).cdf(power[n]) for n in sums if power[n] < 0.7 * n}
    worst = min(chance, key=chance.__getitem__)
    assert found.value == pytest.approx(power[worst] / worst)
    assert f"Up to {FLAT.upper[worst - 1]:.3g} Hz" in found.detail


@pytest.mark.parametrize(
    ("bins", "share", "told"),
    [
        (4, 0.0, True),  # chance 0
        (3, 0.0, False),  # 3 of 4 and more: chance 0.09
        (12, 0.05, True),
        (12, 0.35, False),  # chance 0.01
        (200, 0.69, True),
        (200, 0.71, False),  # as sure, but no matter
    ],
)
def test_a_lack_is_told_if_it_is_sure_and_matters(bins: int, share: float, told: bool) -> None:
    assert (missing(bins, share) is not None) is told


def test_nothing_is_said_below_a_low_pass_or_without_n() -> None:
    assert missing(40, 0.15, fitted=0.96) is not None
    assert missing(40, 0.15, fitted=0.94) is None
    assert missing(40, 0.15, white=None) is None
    # Beyond a twentieth of the rate what is lacking is a filter's.
    high = np.where(FLAT.frequency > 0.5, 0.1, 1.0)
    assert (
        find_missing_slow_noise("gyro_x", replace(FLAT, density=high), np.ones(BINS), 1.0) is None
    )


def test_a_bend_like_that_of_no_known_filter_is_noted() -> None:
    def found(N: Parameter | None) -> list[Finding]:
        every = np.ones(BINS, dtype=np.bool_)
        low_pass = Cutoff(Parameter(50.0), "analogue", 4, N)
        band = Band(5.0, "attenuated")
        return spectral_findings("gyro_x", FitSelection([], every, every, band, low_pass), None)

    for known in (None, Parameter(1.0)):
        (note,) = found(known)
        assert (note.finding, note.severity, note.value) == ("filtered", "note", 50.0)
    (note,) = found(Parameter(None, "not_identified"))
    assert (note.finding, note.severity, note.value) == ("band_limit", "note", 5.0)
    assert note.detail.startswith("The spectrum of gyro x bends above 5 Hz")


def test_a_log_without_slow_noise_gives_no_k_and_lacks_no_term() -> None:
    known, absent = Parameter(1.0, lower=0.9, upper=1.1), Parameter(None, "absent", upper=0.1)
    given = Estimate("robust", {"N": known, "K": known, "B": absent, "Q": absent})
    found = withhold_slow_noise(given).parameters
    assert (found["N"], found["Q"]) == (known, absent)
    assert {found[name].status for name in ("K", "B")} == {"not_identified"}
    assert (found["K"].value, found["K"].in_model, found["B"].upper) == (None, 1.0, None)
