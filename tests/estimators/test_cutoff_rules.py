"""When a bend is a low-pass, and when it may be a process; what a cut-off says of N."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.cutoff import (
    Cutoff,
    _describe_no_filter,
    _explain_ambiguity,
    find_cutoff,
    select_joint_models,
)
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import FilterFits
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.whittle import Behind, Maximum, Terms
from tests.conftest import few
from tests.estimators.test_filter_fits import RATE, trial, white


def test_a_long_correlation_without_white_noise_may_be_a_process_or_a_filter() -> None:
    flat = make_ideal_spectrum(RATE, 600.0, RATE / 2.0)

    def told(
        samples: float, beside: float = 0.0, gained: float = 0.0, stated: float | None = None
    ) -> tuple[str, float] | None:
        cutoff = RATE / (2.0 * np.pi * samples)
        fits = FilterFits(replace(flat, density=4.0 * white(cutoff, flat.frequency)))
        fits.slow = []
        first = trial(cutoff)
        first = replace(first, cost=fits.cost(first))
        return _explain_ambiguity(fits, [first], first.cost - beside, gained, stated)

    found = told(20.0)
    assert found is not None and found[1] == pytest.approx(2.0, rel=1e-3)
    assert "T_B = 0.2 s" in found[0] and "0.796 Hz" in found[0]
    # Ten samples and more; as likely as white noise beside a process, or the best by far.
    assert told(9.9) is None and told(10.1) is not None
    assert told(20.0, 1.9) is not None and told(20.0, 2.1) is None
    assert told(20.0, 2.1, gained=6.1) is not None
    # What its maker states tells it, to a factor of 1.6.
    for factor, known in ((1.7, False), (1.5, True), (1.0 / 1.5, True), (1.0 / 1.7, False)):
        assert (told(20.0, stated=0.796 * factor) is None) is known


def test_what_stands_beside_a_filter_is_less_what_rounding_makes() -> None:
    ones = np.ones(3)
    cutoff = Cutoff(
        Parameter(2.0), 2, Parameter(3.0), 1.5, 9.0, kind="bilinear", rounded=0.05,
        behind=Behind(ones, ones, ones),
    )  # fmt: skip
    assert cutoff.beside == pytest.approx(0.25 - 0.05)
    assert replace(cutoff, rounded=0.3).beside == 0.0
    assert replace(cutoff, behind=None).beside == 0.0
    assert cutoff.words == "bilinear low-pass of order 2 at 2 Hz"
    assert replace(cutoff, kind=None).words == ""
    assert replace(cutoff, frequency=Parameter(None, "absent")).words == ""
    assert replace(cutoff, frequency=Parameter(None, "absent", fitted=7.0)).words.endswith("7 Hz")


def test_a_doubt_leaves_n_between_both() -> None:
    plain = _describe_no_filter(2.0, 1.0, None)
    assert (plain.N, plain.frequency.status) == (Parameter(2.0), "absent")
    for before in (0.5, 3.0):
        found = _describe_no_filter(2.0, 1.0, ("alike", before))
        assert found.N == Parameter(
            None, "not_identified", "alike", min(2.0, before), max(2.0, before), fitted=2.0
        )
        assert (found.or_process, found.N_behind, found.gained) == ("alike", before, 1.0)


def test_models_that_may_be_the_best_get_a_cutoff_of_their_own() -> None:
    def of(terms: Terms, bic: float, share: float) -> Candidate:
        maximum = Maximum(terms, np.ones(len(terms.linear)), np.empty(0), 0.0, 0.0)
        return Candidate(maximum, bic, bic, share, share, Goodness(1.0, 1.0, "explained", ""))

    best, near, likely = (
        of(Terms("N"), 10.0, 0.9),
        of(Terms("NK"), 15.9, 0.02),
        of(Terms("NF"), 17.0, 0.03),
    )
    worse, asked = of(Terms("NFK"), 16.1, 0.029), of(Terms("QN"), 90.0, 0.0)
    found = select_joint_models([best, near, worse, likely, asked], Terms("QN"))
    assert found == [best, near, likely, asked]


@pytest.mark.parametrize(("duration", "told"), few([(20.0, False)], [(30.0, True)]))
def test_a_cutoff_is_told_where_its_limits_are_a_fifth_apart(duration: float, told: bool) -> None:
    flat = make_ideal_spectrum(RATE, duration, RATE / 2.0)
    scatter = np.random.default_rng(3).chisquare(flat.ordinates) / flat.ordinates
    shape = white(RATE / (2.0 * np.pi), flat.frequency)
    found = find_cutoff(replace(flat, density=shape * scatter))
    f = found.frequency
    assert f.lower is not None and f.upper is not None and f.upper < 2.0 * RATE
    assert (f.upper > 1.2 * f.lower) is not told
    assert (f.status, f.value is not None) == (("ok", True) if told else ("not_identified", False))
    assert found.N.status == f.status
    assert told or "cut-offs from" in (f.reason or "")
