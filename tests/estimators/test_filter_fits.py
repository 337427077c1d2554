"""Slow noise is told apart behind a filter before its cut-off is fitted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from imubench_pipeline.estimators.filter_fits import (
    FAMILY,
    FilterFits,
    FilterTrial,
    Reading,
    compute_density_in_log,
    draw_factors,
    get_highest_cutoff,
    read_as_digital,
)
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.low_pass import Filter, Frequencies, Kind
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import Shapes, Terms
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE, CUTOFF, OVER = 100.0, 10.0, 8


def slow_terms(model: NoiseModel, seed: int) -> list[float]:
    """The correlation times that are kept behind a first-order filter, s; inf: flicker or a walk.

    The filter works on eight times as many samples as are kept.
    """
    fine = simulate(model, OVER * RATE, OVER * 60_000, np.random.default_rng(seed))
    filtered = sosfilt(butter(1, CUTOFF, fs=OVER * RATE, output="sos"), fine)[::OVER][1000:]
    fits = FilterFits(compute_spectra([filtered], len(filtered), RATE)[0])
    fits.choose_slow(FilterTrial(0.0, 0.0, "analogue", 1, CUTOFF, False))
    return [float(fits.times[place]) for place in fits.slow]


@pytest.mark.parametrize("seed", range(3))
def test_white_noise_alone_asks_for_no_other(seed: int) -> None:
    assert slow_terms(NoiseModel(N=1e-3), seed) == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("slow", [{"K": 1e-3}, {"B": 5e-3}], ids=["walk", "flicker"])
def test_a_term_of_one_parameter_is_taken_and_none_of_two(
    slow: dict[str, float], seed: int
) -> None:
    assert set(slow_terms(NoiseModel(N=1e-3, **slow), seed)) == {np.inf}


def test_a_process_is_taken_first_near_its_correlation_time() -> None:
    first, *_ = slow_terms(NoiseModel(N=1e-3, B=1e-2, T_B=3.0), 1)
    assert 2.0 < first < 4.5


def white(cutoff: float, frequency: np.ndarray, folds: int = 2000) -> np.ndarray:
    """White noise behind an analogue filter of first order, folded by the sampling."""
    k = np.arange(-folds, folds + 1)
    return np.asarray((1.0 / (1.0 + ((frequency[:, None] + k * RATE) / cutoff) ** 2)).sum(axis=1))


@pytest.fixture(scope="module")
def expected() -> FilterFits:
    """Of a spectrum as it is expected behind a filter of first order."""
    flat = make_ideal_spectrum(RATE, 600.0, RATE / 2.0)
    return FilterFits(replace(flat, density=white(CUTOFF, flat.frequency)))


def trial(
    cutoff: float, kind: Kind = "analogue", order: int = 1, floor: bool = False
) -> FilterTrial:
    return FilterTrial(0.0, 0.0, kind, order, cutoff, floor)


def test_n_before_a_filter_and_the_floor_behind_it_are_read_off(expected: FilterFits) -> None:
    expected.slow = []
    assert expected.density(trial(CUTOFF)) == (pytest.approx(1.0, rel=1e-3), 0.0)
    N, floor = expected.density(trial(CUTOFF, floor=True))
    assert N == pytest.approx(1.0, rel=2e-3) and floor < 0.05
    spectrum = expected.whittle.spectrum
    raised = FilterFits(replace(spectrum, density=4.0 * spectrum.density + 0.25))
    raised.slow = []
    N, floor = raised.density(trial(CUTOFF, floor=True))
    assert (N, floor) == pytest.approx((2.0, 0.5), rel=0.01)
    # What a register adds is told apart beforehand: parts of N^2.
    raised.rounded = 1.0 / 16.0
    assert raised.density(trial(CUTOFF))[0] == pytest.approx(2.0, rel=2e-3)


def test_the_limits_are_where_the_profile_has_lost_half_of_chi_squared(
    expected: FilterFits,
) -> None:
    expected.slow = []
    spectrum, best = expected.whittle.spectrum, trial(CUTOFF)

    def profile(cutoff: float) -> float:
        # N^2 is a mean of ratios; -log L is then up to a constant n / 2 times its logarithm.
        shape, nu = white(cutoff, spectrum.frequency), spectrum.ordinates
        level = np.average(spectrum.density / shape, weights=nu)
        return float(0.5 * np.sum(nu * (np.log(level * shape) + 1.0)))

    lower, upper = expected.limits(best)
    for end in (lower, upper):
        assert profile(end) - profile(CUTOFF) == pytest.approx(1.92, rel=0.04)
    assert lower < CUTOFF < upper


def test_the_limits_end_with_the_search() -> None:
    flat = make_ideal_spectrum(RATE, 20.0, RATE / 2.0)
    fits = FilterFits(flat)
    fits.slow = []
    lower, upper = fits.limits(trial(3.9 * RATE))
    assert upper == pytest.approx(4.0 * RATE)
    assert lower < 3.9 * RATE


def test_a_filter_is_found_among_the_family(expected: FilterFits) -> None:
    expected.slow = []
    best = expected.try_filters()[0]
    assert (best.kind, best.order, best.floor) == ("analogue", 1, False)
    assert best.cutoff == pytest.approx(CUTOFF, rel=2e-3)
    nu = expected.whittle.spectrum.ordinates
    assert best.score - best.cost == pytest.approx(0.5 * np.log(len(nu)))
    assert expected.may_bend()
    spectrum = expected.whittle.spectrum
    scatter = np.random.default_rng(1).chisquare(nu) / nu
    noisy = FilterFits(replace(spectrum, density=spectrum.density * scatter))
    noisy.slow = []
    assert noisy.explains(trial(CUTOFF)) and not noisy.explains(trial(1.3 * CUTOFF))
    assert best.correlation(RATE) == pytest.approx(RATE / (2.0 * np.pi * best.cutoff))
    # Half the BIC behind it: the model of white noise alone, with N and the cut-off.
    alone = expected.cost(best) + 2.0 * 0.5 * np.log(len(nu))
    assert expected.behind(best) == pytest.approx(alone, abs=0.02)


def test_white_noise_beside_a_process_is_no_floor_behind_a_filter(expected: FilterFits) -> None:
    spectrum = expected.whittle.spectrum
    # A correlation of 5 samples, and a floor of a hundredth.
    slow = white(RATE / (2.0 * np.pi * 5.0), spectrum.frequency) + 0.01
    fits = FilterFits(replace(spectrum, density=slow))
    fits.slow = []
    kinds: tuple[Kind, Kind] = ("analogue", "bilinear")
    of_first = [x for kind in kinds for x in fits._find_maxima(kind, 1, 1e-3)]
    assert not [x for x in of_first if x.floor and x.correlation(RATE) > 2.0]
    fast = white(RATE / (2.0 * np.pi * 1.5), spectrum.frequency) + 0.01
    fits = FilterFits(replace(spectrum, density=fast))
    fits.slow = []
    assert [x for x in fits._find_maxima("analogue", 1, 1e-3) if x.floor]


def test_no_filter_bends_white_noise() -> None:
    flat = make_ideal_spectrum(RATE, 600.0, RATE / 2.0)
    fits = FilterFits(flat)
    assert not fits.may_bend()
    N, half_bic, cost, rising = fits.unfiltered()
    nu = flat.ordinates
    assert N == pytest.approx(1.0, rel=1e-3)
    assert cost == pytest.approx(0.5 * nu.sum(), rel=1e-6)
    assert half_bic - cost == pytest.approx(0.5 * np.log(len(nu)), abs=1e-3)
    assert rising - half_bic == pytest.approx(0.5 * np.log(len(nu)), abs=1e-2)


def test_the_lengths_of_means_that_are_tried_are_whole() -> None:
    fits = FilterFits(make_ideal_spectrum(RATE, 60.0, RATE / 2.0))
    tried = fits._make_scan("boxcar", 1, RATE / 500.0, 24)
    lengths = 0.442946 * RATE / tried
    for whole in range(3, 21):
        assert np.abs(lengths - whole).min() < 1e-9
    assert (tried.min(), tried.max()) == pytest.approx((RATE / 500.0, 0.222 * RATE))
    assert len(tried) == 24 + 18
    np.testing.assert_allclose(
        fits._make_scan("analogue", 1, 0.2, 5), 0.2 * 2000.0 ** (np.arange(5) / 4.0)
    )


def test_draws_of_n_lie_about_each_filter_by_its_weight(rng: np.random.Generator) -> None:
    readings = [Reading(3.0, -0.2, 0.0, 0.1), Reading(1.0, 2.0, 2.5, 3.5)]
    logarithm = np.log(draw_factors(readings, 40_000, rng))
    first = logarithm[logarithm < 1.2]
    assert len(first) / 40_000 == pytest.approx(0.75, abs=0.01)
    # 95 % of each side lie within its limit.
    for part, at, below, above in (
        (first, 0.0, -0.2, 0.1),
        (logarithm[logarithm > 1.2], 2.5, 2.0, 3.5),
    ):
        low, middle, high = np.quantile(part, [0.025, 0.5, 0.975])
        assert middle == pytest.approx(at, abs=0.02)
        assert (low, high) == pytest.approx((below, above), abs=0.06)


def test_draws_of_the_density_in_the_log_have_their_own_limits(rng: np.random.Generator) -> None:
    readings = [Reading(3.0, -0.2, 0.0, 0.1, (-0.02, 0.0, 0.04))]
    drawn = np.log(draw_factors(readings, 40_000, rng, in_the_log=True))
    assert np.quantile(drawn, [0.025, 0.5, 0.975]) == pytest.approx([-0.02, 0.0, 0.04], abs=2e-3)


@pytest.mark.parametrize("cutoff", [1.0, 20.0, 40.0, 300.0])
def test_the_density_in_the_log_has_the_folds_and_what_passes_no_filter(cutoff: float) -> None:
    # Of first order the folds add up to x coth x.
    x = np.pi * cutoff / RATE
    found = compute_density_in_log(Filter("analogue", 1, cutoff), 2.0, 3.0, RATE)
    assert found == pytest.approx(np.sqrt(4.0 * x / np.tanh(x) + 3.0), rel=1e-6)
    # What is done to the samples folds nothing.
    digital = compute_density_in_log(Filter("bilinear", 1, min(cutoff, 40.0)), 2.0, 0.0, RATE)
    assert digital == pytest.approx(2.0, rel=1e-9)


def test_a_filter_applied_to_the_samples_folds_nothing_into_n() -> None:
    shown = (-0.01, 0.0, 0.02)
    found = read_as_digital(Reading(0.5, -0.1, 0.0, 0.2, shown), trial(CUTOFF), RATE)
    assert found.in_the_log == shown
    folded = 0.5 * np.log(white(CUTOFF, np.zeros(1), 200_000)[0])
    assert found.weight == pytest.approx(0.05)
    assert (found.below, found.at, found.above) == pytest.approx(
        (folded - 0.1, folded, folded + 0.2), rel=1e-4
    )


@pytest.mark.parametrize(("order", "cutoff", "duration"), [(3, 55.0, 60.0), (4, 55.0, 20.0)])
def test_the_limits_are_the_outermost_of_several_hollows(
    order: int, cutoff: float, duration: float
) -> None:
    flat = make_ideal_spectrum(RATE, duration, RATE / 2.0)
    density = Filter("analogue", order, cutoff).white(Frequencies(flat.frequency, RATE))
    fits = FilterFits(replace(flat, density=density))
    fits.slow = []
    best = trial(cutoff, "analogue", order)
    grid = np.geomspace(45.0, 100.0, 120)
    costs = np.array([fits.cost(replace(best, cutoff=float(one))) for one in grid])
    inside = costs < fits.cost(best) + 1.92
    assert np.sum(np.diff(inside.astype(int)) == 1) == 2
    lower, upper = fits.limits(best)
    assert lower == pytest.approx(grid[inside].min(), rel=0.007)
    assert upper == pytest.approx(grid[inside].max(), rel=0.007)


def test_a_process_that_explains_all_is_the_only_slow_term(expected: FilterFits) -> None:
    spectrum, best = expected.whittle.spectrum, trial(CUTOFF)
    # Of half a second, between those of flicker noise and a walk.
    place = int(np.argmin(np.abs(np.log(expected.times[2:] / 0.5)))) + 2
    slow = expected.everything_slow[:, place] / (1.0 + (spectrum.frequency / CUTOFF) ** 2)
    density = spectrum.density + 3.0 * slow / slow[:8].mean()
    scatter = np.random.default_rng(7).chisquare(spectrum.ordinates) / spectrum.ordinates
    for each in (density, density * scatter):
        fits = FilterFits(replace(spectrum, density=each))
        fits.choose_slow(best)
        assert len(fits.slow) == 1 and abs(fits.slow[0] - place) <= 1


def test_rounding_is_tried_beside_a_process_and_a_walk() -> None:
    terms = Terms("QNK", 1)
    exact = make_ideal_spectrum(RATE, 2000.0, 0.5 * RATE)
    shapes = Shapes(exact)
    density = 1e-6 * shapes.white() + 4e-9 * shapes.quantization() + 1e-7 * shapes.random_walk()
    density += 4e-5 * shapes.gauss_markov(2.0)
    fits = FilterFits(replace(exact, density=density))
    *_, rising = fits.unfiltered()
    best = fits.whittle.maximum(terms)
    assert rising == pytest.approx(best.cost + fits.penalty * terms.parameters, abs=1e-6)


def test_no_filter_of_the_samples_is_looked_for_beyond_nyquist() -> None:
    bilinear = [(kind, order) for kind, order in FAMILY if kind == "bilinear"]
    assert len(bilinear) == 4
    assert all(0.4 * RATE < get_highest_cutoff(*each, RATE) < 0.5 * RATE for each in bilinear)
