"""Each doubt by itself: at the gain from which it is said, and not below."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.doubts import add_doubts, describe_drift_alternative
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.frame import Band, FitSelection
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_whittle

RATE, DURATION, N = 10.0, 4000.0, 1e-2
FLAT = make_ideal_spectrum(RATE, DURATION, RATE / 2.0)
SPECTRUM = replace(FLAT, density=np.full(len(FLAT.density), N**2))
EVERY = np.ones(len(FLAT.density), dtype=np.bool_)
NAMES = ("Q", "N", "B", "T_B", "K", "R")


def candidate(terms: Terms, bic: float, aic: float, K: float = 1.0, N: float = N) -> Candidate:
    values = {"Q": 1.0, "N": N, "F": 1.0, "K": K}
    powers = [values[letter] ** 2 for letter in terms.linear] + [1.0] * terms.gauss_markov
    times = 100.0 * np.arange(1.0, 1.0 + terms.gauss_markov)
    maximum = Maximum(terms, np.array(powers), times, 1.0, 0.0)
    return Candidate(maximum, bic, aic, 1.0, 1.0, Goodness(1.0, 1.0, "explained", ""))


def estimate() -> Estimate:
    parameters = {name: Parameter(N, lower=0.9 * N, upper=1.1 * N) for name in NAMES}
    return Estimate("likelihood", parameters, curve={"B_curve": Parameter(1.0)})


def frame(highest: float = RATE / 2.0, *, cut: bool = False) -> FitSelection:
    return FitSelection([], EVERY, EVERY, Band(highest, "whole"), cut=cut)


def doubted(
    chosen: Candidate,
    *others: Candidate,
    papers: Candidate | None = None,
) -> tuple[Estimate, Estimate]:
    candidates = [chosen, *others]
    return add_doubts(estimate(), estimate(), frame(), candidates, papers or chosen)


def statuses(found: Estimate) -> set[str]:
    return {name for name, one in found.parameters.items() if one.status == "doubtful"}


def at(linear: str, processes: int, bic: float, aic: float, **more: float) -> Candidate:
    ramp = bool(more.pop("ramp", False))
    return candidate(Terms(linear, processes, ramp), bic, aic, **more)


@pytest.mark.parametrize(
    ("chosen", "other", "expected"),
    [
        # AIC that prefers a model without the walk; one with a ramp is another matter.
        (at("NK", 0, 0.0, 0.0), at("N", 1, 20.0, -2.6), {"K"}),
        (at("NK", 0, 0.0, 0.0), at("N", 1, 20.0, -2.4), set()),
        (at("NK", 0, 0.0, 0.0), at("N", 1, 20.0, -2.6, ramp=True), set()),
        (at("NF", 0, 0.0, 0.0), at("N", 1, 20.0, -3.0), set()),
        # A ramp that leaves little of it.
        (at("NK", 0, 0.0, 0.0, K=2.0), at("NK", 0, 20.0, -2.6, K=0.49, ramp=True), {"K"}),
        (at("NK", 0, 0.0, 0.0, K=2.0), at("NK", 0, 20.0, -2.6, K=0.51, ramp=True), set()),
        (at("NK", 0, 0.0, 0.0, K=2.0), at("NK", 0, 20.0, -2.4, K=0.49, ramp=True), set()),
        # One term of bias instability instead of two, and none instead of one.
        (at("NF", 1, 0.0, 0.0), at("N", 1, 8.8, 20.0), {"B", "T_B"}),
        (at("NF", 1, 0.0, 0.0), at("N", 1, 9.2, 20.0), set()),
        (at("NF", 0, 0.0, 0.0), at("NK", 0, 3.8, 20.0), {"B", "T_B"}),
        (at("NF", 0, 0.0, 0.0), at("NK", 0, 4.2, 20.0), set()),
        (at("NF", 0, 0.0, 0.0), at("N", 1, 0.5, 20.0), set()),
        (at("NK", 0, 0.0, 0.0), at("N", 0, 0.5, 20.0), set()),
        # Other terms of it by AIC, where there is a process and no walk.
        (at("N", 1, 0.0, 0.0), at("N", 2, 20.0, -4.2), {"B", "T_B"}),
        (at("N", 1, 0.0, 0.0), at("N", 2, 20.0, -3.8), set()),
        (at("NK", 1, 0.0, 0.0), at("NK", 2, 20.0, -5.0), set()),
        (at("NF", 0, 0.0, 0.0), at("NF", 1, 20.0, -5.0), set()),
        (at("N", 1, 0.0, 0.0), at("NK", 1, 20.0, -5.0), set()),
        # Quantization noise and a ramp that are hardly needed.
        (at("QN", 0, 0.0, 0.0), at("N", 0, 7.8, 20.0), {"Q"}),
        (at("QN", 0, 0.0, 0.0), at("N", 0, 8.2, 20.0), set()),
        (at("NK", 0, 0.0, 0.0, ramp=True), at("NK", 0, 7.8, 20.0), {"R"}),
        (at("NK", 0, 0.0, 0.0, ramp=True), at("NK", 0, 8.2, 20.0), set()),
        (at("QN", 0, 0.0, 0.0), at("NF", 0, 6.0, 20.0), set()),
    ],
)
def test_a_rival_is_named_from_its_gain_on(
    chosen: Candidate, other: Candidate, expected: set[str]
) -> None:
    assert statuses(doubted(chosen, other)[0]) == expected


def test_the_papers_model_is_doubted_where_the_data_are_against_it() -> None:
    chosen = at("NF", 0, 10.0, 0.0)
    for bic, expected in ((16.2, {"B", "T_B", "K"}), (15.8, set())):
        papers = at("NK", 1, bic, 20.0)
        found, of_papers = doubted(chosen, papers, papers=papers)
        assert statuses(of_papers) == expected
        assert statuses(found) == set()


@pytest.mark.parametrize("status", ["not_identified", "doubtful"])
def test_the_only_bias_and_that_of_the_curve_are_as_sure(status: str) -> None:
    known = estimate()
    unsure = Parameter(1.0, status, "why", 0.5, 2.0)
    given = replace(known, parameters={**known.parameters, "B": unsure})
    found, _ = add_doubts(given, known, frame(), [at("N", 1, 0.0, 0.0)], at("N", 1, 0, 0))
    of_curve = found.curve["B_curve"]
    assert (of_curve.status, of_curve.reason, of_curve.fitted) == (status, "why", 1.0)
    assert of_curve.value == (1.0 if status == "doubtful" else None)
    given = replace(given, further=[{"B": Parameter(1.0), "T_B": Parameter(1.0)}])
    found, _ = add_doubts(given, known, frame(), [at("N", 2, 0.0, 0.0)], at("N", 1, 0, 0))
    assert found.curve["B_curve"].status == "ok"


def test_beyond_a_cut_a_process_would_not_be_seen() -> None:
    known = estimate()
    absent = Parameter(None, "absent", "none", 0.0, 1.0)
    given = replace(known, parameters={**known.parameters, "B": absent})
    of = frame(1.0, cut=True)
    found, _ = add_doubts(given, known, of, [at("N", 0, 0, 0)], at("N", 0, 0, 0))
    B = found.parameters["B"]
    assert (B.status, B.lower, B.upper) == ("not_identified", None, None)


def of_slope(power: float, bins: float = 8.0) -> tuple[str | None, float]:
    """What is said of a walk that is a drift of this spectrum, as it is expected."""
    f = SPECTRUM.frequency
    density = N**2 * (1.0 + (bins / (2.0 * DURATION) / f) ** power)
    whittle = make_whittle(replace(SPECTRUM, density=density), RATE / 2.0)
    maximum = whittle.maximum(Terms("NK"))
    return describe_drift_alternative(whittle, maximum), maximum.parameter("K")


def test_a_walk_is_one_by_its_slope_and_by_what_it_adds_beyond_the_lowest_cosines() -> None:
    reason, K = of_slope(2.0, 12.0)
    assert reason is None
    assert pytest.approx(2.0 * np.pi * 12.0 / (2.0 * DURATION) * N, rel=0.01) == K
    assert "smooth drift" in (of_slope(4.0, 12.0)[0] or "")
    assert "without the 5 lowest" in (of_slope(2.0, 1.5)[0] or "")
