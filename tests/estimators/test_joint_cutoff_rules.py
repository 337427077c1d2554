"""A cut-off fitted together with white noise alone, whose profile has a closed form."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.cutoff import Cutoff, _find_leaky_bins, find_cutoff, refine_cutoff
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import Allowed, FilterFits
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.low_pass import Filter, Frequencies
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import Behind, Maximum, Terms
from tests.estimators.test_filter_fits import RATE, trial, white

TRUE = 15.0
EVERY = np.ones(146, dtype=np.bool_)


@dataclass
class Profile:
    """-log L over the logarithm of a cut-off, N at its best for each."""

    spectrum: Spectrum

    def __post_init__(self) -> None:
        best = minimize_scalar(lambda x: self.at(x)[0], bounds=(2.0, 3.4), method="bounded")
        self.best, self.lowest = float(best.x), float(best.fun)

    def at(self, x: float) -> tuple[float, float]:
        within = (np.arange(6) + 0.5) / 6
        lower, width = self.spectrum.lower, self.spectrum.upper - self.spectrum.lower
        f = (lower[:, None] + width[:, None] * within).ravel()
        shape = white(np.exp(x), f, 300).reshape(-1, 6).mean(axis=1)
        nu = self.spectrum.ordinates
        level = float(np.average(self.spectrum.density / shape, weights=nu))
        return float(0.5 * np.sum(nu * (np.log(level * shape) + 1.0))), level**0.5

    def limits(self) -> tuple[float, float]:
        def beyond(x: float) -> float:
            return self.at(x)[0] - self.lowest - 1.9207

        return (
            float(brentq(beyond, self.best - 1.0, self.best)),
            float(brentq(beyond, self.best, self.best + 1.0)),
        )


@pytest.fixture(scope="module")
def profile() -> Profile:
    flat = make_ideal_spectrum(RATE, 30.0, RATE / 2.0)
    scatter = np.random.default_rng(3).chisquare(flat.ordinates) / flat.ordinates
    return Profile(replace(flat, density=4.0 * white(TRUE, flat.frequency) * scatter))


def candidate(terms: Terms, bic: float = 0.0, aic: float = 0.0) -> Candidate:
    maximum = Maximum(terms, np.ones(len(terms.linear)), np.empty(0), 0.0, 0.0)
    return Candidate(maximum, bic, aic, 1.0, 1.0, Goodness(1.0, 1.0, "explained", ""))


def low_pass(cutoff: float) -> Cutoff:
    ones = np.ones(len(EVERY))
    return Cutoff(
        Parameter(cutoff), 1, Parameter(2.0), 0.0, 30.0, kind="analogue",
        behind=Behind(ones, ones, ones), allowed=[Allowed(trial(cutoff), 0.05)],
    )  # fmt: skip


@pytest.mark.parametrize("start", [14.0, 17.5])
def test_a_cutoff_is_where_model_and_filter_fit_best_together(
    profile: Profile, start: float
) -> None:
    found = refine_cutoff(low_pass(start), profile.spectrum, EVERY, [candidate(Terms("N"))])
    x, (low, high) = profile.best, profile.limits()
    assert np.log(found.frequency.value or 0.0) == pytest.approx(x, abs=0.004)
    ends = np.log([found.frequency.lower or 0.0, found.frequency.upper or 0.0])
    assert ends == pytest.approx([low, high], abs=0.006)
    # What it makes of N, over N at the best; and the same filter of the samples, which folds none.
    one, other = found.readings
    middle = profile.at(x)[1]
    expected = [np.log(profile.at(end)[1] / middle) for end in (low, x, high)]
    assert [one.below, one.at, one.above] == pytest.approx(expected, abs=0.003)
    folded = 0.5 * np.log(white(np.exp(x), np.zeros(1), 20_000)[0])
    assert other.at - one.at == pytest.approx(folded, abs=2e-3)
    assert (one.weight, other.weight) == pytest.approx((1.0, 0.1))
    assert found.models[Terms("N")].gained == pytest.approx(0.0, abs=1e-9)
    assert (found.floor, found.kind, found.order) == (0.0, "analogue", 1)
    assert found.behind is not None
    assert found.behind.white == pytest.approx(
        white(np.exp(x), profile.spectrum.frequency), rel=0.02
    )


def test_the_chosen_model_is_the_best_with_a_cutoff_of_its_own(profile: Profile) -> None:
    both = [candidate(Terms("NK"), 0.0), candidate(Terms("N"), 1.0, 0.0)]
    found = refine_cutoff(low_pass(14.0), profile.spectrum, EVERY, both)
    # Both gain the same by it: a walk is not there.
    assert set(found.models) == {Terms("N"), Terms("NK")}
    gained = profile.at(np.log(14.0))[0] - profile.lowest
    assert found.models[Terms("N")].gained == pytest.approx(0.0, abs=0.01)
    assert gained > 0.1
    told = refine_cutoff(low_pass(14.0), profile.spectrum, EVERY, [candidate(Terms("N"))])
    assert found.frequency.value == pytest.approx(told.frequency.value, rel=1e-3)
    nothing = replace(low_pass(14.0), kind=None)
    assert refine_cutoff(nothing, profile.spectrum, EVERY, both) is nothing
    assert refine_cutoff(nothing, profile.spectrum, EVERY, []) is nothing


@pytest.mark.parametrize(("aic", "counts"), [(5.8, True), (6.0, False)])
def test_a_model_has_a_part_in_the_interval_from_a_share_of_a_twentieth_on(
    profile: Profile, aic: float, counts: bool
) -> None:
    alone = refine_cutoff(low_pass(14.0), profile.spectrum, EVERY, [candidate(Terms("N"))])
    # Quantization noise, which stands behind no filter, lets it bend at lower frequencies.
    both = [candidate(Terms("N")), candidate(Terms("QN"), 20.0, aic)]
    found = refine_cutoff(low_pass(14.0), profile.spectrum, EVERY, both).frequency
    assert alone.frequency.lower is not None and found.lower is not None
    gained = refine_cutoff(low_pass(14.0), profile.spectrum, EVERY, both).models[Terms("QN")]
    assert gained.gained < 0.05
    assert (found.lower < 0.99 * alone.frequency.lower) is counts


@pytest.mark.release
def test_a_filter_is_told_with_n_and_the_limits_of_both(profile: Profile) -> None:
    spectrum = profile.spectrum
    found = find_cutoff(spectrum)
    low, high = profile.limits()
    assert np.log(found.frequency.value or 0.0) == pytest.approx(profile.best, abs=0.01)
    assert (found.kind, found.order, found.floor) == ("analogue", 1, 0.0)
    first = found.readings[0]
    middle = profile.at(profile.best)[1]
    assert (first.weight, first.at) == (1.0, 0.0)
    assert first.below == pytest.approx(np.log(profile.at(low)[1] / middle), abs=0.01)
    assert first.above == pytest.approx(np.log(profile.at(high)[1] / middle), abs=0.01)
    assert found.N.value == pytest.approx(middle, rel=0.01)
    ends = [end for one in found.readings for end in (one.below, one.above)]
    error = 1.96 / np.sqrt(2.0 * spectrum.ordinates.sum())
    assert found.N.lower == pytest.approx(found.N.value * np.exp(min(ends) - error), rel=0.01)
    assert found.N.upper == pytest.approx(found.N.value * np.exp(max(ends) + error), rel=0.01)
    assert found.allowed[0].half_width == pytest.approx(0.5 * (high - low), abs=0.01)
    # Each filter by its likelihood: those three below the best are ruled out.
    weights = [one.weight for one in found.readings if one.weight != 0.1]
    assert min(weights) >= np.exp(-4.0)


def test_bins_are_ruled_by_the_ends_where_the_filter_leaves_less() -> None:
    flat = make_ideal_spectrum(RATE, 30.0, RATE / 2.0)
    steep = Filter("bilinear", 4, 5.0)
    shape = steep.white(Frequencies(flat.frequency, RATE))
    leak = steep.leakage(Frequencies(flat.frequency, RATE), flat.length)
    spectrum = replace(flat, density=4.0 * (shape + leak))
    fits = FilterFits(spectrum)
    fits.slow = []
    best = trial(5.0, "bilinear", 4)
    found = _find_leaky_bins(spectrum, fits, best, 0.0)
    rules = leak > 0.01 * shape
    # At its edge a bin may go either way, and where the filter falls by more than a half in it.
    assert (found | ~rules).all() and found[-1] and not found[flat.frequency < 5.0].any()
    # What rounding adds there is more than the ends; something ten times as strong is none of them.
    assert not _find_leaky_bins(spectrum, fits, best, 4.0 * 200.0 * leak.max())[rules].any()
    loud = replace(spectrum, density=spectrum.density * np.where(rules, 25.0, 1.0))
    assert not _find_leaky_bins(loud, fits, best, 0.0)[-1]


def test_the_rounding_of_a_register_stands_behind_the_filter() -> None:
    flat = make_ideal_spectrum(RATE, 60.0, RATE / 2.0)
    scatter = np.random.default_rng(6).chisquare(flat.ordinates) / flat.ordinates
    resolution = 20.0
    rounding = resolution**2 / 12.0 / RATE
    density = 4.0 * white(TRUE, flat.frequency) + rounding
    found = find_cutoff(replace(flat, density=density * scatter), resolution=resolution)
    assert (found.kind, found.order) == ("analogue", 1)
    assert found.frequency.in_model == pytest.approx(TRUE, rel=0.1)
    N = found.N.in_model
    assert N is not None and found.N.lower is not None and found.N.upper is not None
    assert found.N.lower < 2.0 < found.N.upper and N == pytest.approx(2.0, rel=0.1)
    assert found.floor == pytest.approx(np.sqrt(rounding))
    assert found.rounded == pytest.approx(rounding / N**2, rel=0.05)
    assert found.beside == pytest.approx(0.0, abs=1e-2)
