"""What of a spectrum is fitted, for a low-pass that is given."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.cutoff import Cutoff
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import Allowed, FilterTrial, OfModel, Reading
from imubench_pipeline.estimators.frame import Band, FitSelection, select_for_fit
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Behind, Maximum, Terms

RATE = 100.0
FLAT = make_ideal_spectrum(RATE, 100.0, RATE / 2.0)
ONES = np.ones(len(FLAT.density))
EVERY = ONES > 0.0


def allowed(*cutoffs: float) -> list[Allowed]:
    return [Allowed(FilterTrial(0.0, 0.0, "analogue", 1, f, False), 0.1) for f in cutoffs]


def behind(*cutoffs: float, white: float = 1.0, **more: object) -> Cutoff:
    return Cutoff(
        Parameter(cutoffs[0]), 1, Parameter(1.0), 0.0, 9.0, kind="analogue",
        behind=Behind(white * ONES, ONES, ONES), allowed=allowed(*cutoffs), **more,
    )  # fmt: skip


def frame(low_pass: Cutoff | None = None, highest: float = 50.0) -> FitSelection:
    return FitSelection([], EVERY, EVERY, Band(highest, "whole"), low_pass)


@pytest.mark.parametrize(
    ("cutoffs", "times", "expected"),
    [
        # Below three tenths of the rate; above, with a process up to sixty times as long.
        ((29.0,), [], True),
        ((31.0,), [], False),
        ((20.0, 31.0), [], False),
        ((31.0,), [59.0], True),
        ((31.0,), [61.0], False),
        ((31.0,), [59.0, 900.0], True),
        ((31.0, 90.0), [59.0], True),
    ],
)
def test_a_filter_well_below_nyquist_has_a_cutoff_of_each_model(
    cutoffs: tuple[float, ...], times: list[float], expected: bool
) -> None:
    T_B = np.array(times) / (2.0 * np.pi * cutoffs[0])
    assert frame(behind(*cutoffs)).needs_cutoff_per_model(FLAT, T_B) is expected
    assert not frame().needs_cutoff_per_model(FLAT, T_B)


def test_quantization_shows_in_a_wide_band_behind_no_filter() -> None:
    assert frame(highest=10.0).shows_quantization(RATE)
    assert not frame(highest=9.9).shows_quantization(RATE)
    assert not frame(behind(20.0)).shows_quantization(RATE)
    assert frame(replace(behind(20.0), behind=None)).shows_quantization(RATE)


def posterior() -> Posterior:
    return Posterior(np.array([[2.0, 3.0], [4.0, 5.0]]), np.empty((2, 0)), np.zeros(2), 2.0)


def test_draws_of_n_are_before_the_filter_or_as_the_log_shows_them(
    rng: np.random.Generator,
) -> None:
    terms = Terms("KN")
    of = frame(behind(20.0, white=9.0))
    assert (of.folding, frame().folding) == (9.0, 1.0)
    assert of.in_the_log(posterior(), terms, rng).parameters.tolist() == [[2.0, 9.0], [4.0, 15.0]]
    without = of.in_the_log(posterior(), Terms("QK"), rng)
    assert without.parameters.tolist() == [[2.0, 3.0], [4.0, 5.0]]
    same = of.before_the_filter(posterior(), terms, rng)
    assert same.parameters.tolist() == [[2.0, 3.0], [4.0, 5.0]]
    twice = Reading(1.0, np.log(2.0), np.log(2.0), np.log(2.0))
    thrice = Reading(1.0, np.log(3.0), np.log(3.0), np.log(3.0))
    read = frame(behind(20.0, readings=[twice], models={terms: OfModel([thrice], 5.0)}))
    for asked, factor in ((Terms("NK"), 2.0), (terms, 3.0), (replace(terms, ramp=True), 3.0)):
        found = read.before_the_filter(posterior(), asked, rng).parameters
        place = asked.linear.index("N")
        assert found[:, place] == pytest.approx(factor * posterior().parameters[:, place])
        assert found[:, 1 - place] == pytest.approx(posterior().parameters[:, 1 - place])
    # What a model gains with a cut-off of its own is taken from its scores.
    maximum = Maximum(terms, np.ones(2), np.empty(0), 0.0, 0.0)
    one = Candidate(maximum, 30.0, 28.0, 1.0, 1.0, Goodness(1.0, 1.0, "explained", ""))
    (scored,) = read.rescore([one])
    assert (scored.bic, scored.aic) == (20.0, 18.0)


def test_fast_processes_are_looked_for_from_three_samples_on() -> None:
    of = frame(behind(20.0), 30.0)
    fast = replace(of, used=EVERY & (FLAT.frequency < 30.0)).with_fast_processes(RATE)
    assert (fast.shortest, fast.band.highest, fast.used.all()) == (0.03, 50.0, True)
    assert fast.low_pass is not None and fast.low_pass.behind is None
    assert fast.whittle(FLAT).shortest == pytest.approx(0.03)


def test_a_band_that_is_asked_for_has_processes_of_ten_samples() -> None:
    spectrum = replace(
        FLAT, density=np.random.default_rng(1).chisquare(FLAT.ordinates) / FLAT.ordinates
    )
    found = select_for_fit(spectrum, [], band=20.0)
    assert (found.band.highest, found.shortest, found.low_pass) == (20.0, 0.1, None)
    assert (found.used == (spectrum.upper <= 20.0 * (1.0 + 1e-9))).all()
    whole = select_for_fit(spectrum, [])
    assert whole.used.all() and whole.band.highest == 50.0 and whole.shortest == 0.1
    assert whole.low_pass is not None and whole.low_pass.behind is None
    assert not whole.cut and whole.whittle(spectrum).behind is None


def test_where_nothing_explains_all_the_bend_is_left_out() -> None:
    rng = np.random.default_rng(1)
    wide = make_ideal_spectrum(RATE, 1000.0, RATE / 2.0)
    gain = 1.0 / (1.0 + (wide.frequency / 20.0) ** 8)
    spectrum = replace(wide, density=gain * rng.chisquare(wide.ordinates) / wide.ordinates)
    every = np.ones(len(gain), dtype=np.bool_)
    of = FitSelection([], every, every, Band(50.0, "whole"), None, stated=90.0).limited(spectrum)
    assert of.cut and 2.0 < of.band.highest <= 9.0
    assert (of.used == (spectrum.upper <= of.band.highest * (1.0 + 1e-9))).all()
    flat = replace(wide, density=rng.chisquare(wide.ordinates) / wide.ordinates)
    assert not FitSelection([], every, every, Band(50.0, "whole"), None).limited(flat).cut
