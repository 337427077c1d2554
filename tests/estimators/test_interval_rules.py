"""What an interval is made of, and from where on a value is no number to quote."""

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.intervals import (
    add_upper_limits,
    compute_mixture_limits,
    compute_mixture_quantiles,
    describe,
    is_as_good,
    make_ideal_spectrum,
)
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle, make_whittle

RATE, DURATION = 1.0, 200_000.0
N, K, B, T_B, R = 1.0, 1e-2, 1.0, 300.0, 1e-2
VALUES = {"N": N, "K": K, "F": B}
EVEN = (np.arange(4000) + 0.5) / 4000


@pytest.fixture(scope="module")
def whittle() -> Whittle:
    return make_whittle(make_ideal_spectrum(RATE, DURATION, RATE / 2.0), RATE / 2.0, 6)


def candidate(terms: Terms, bic: float = 0.0, aic: float = 0.0, **values: float) -> Candidate:
    known = VALUES | values
    powers = [known[letter] ** 2 for letter in terms.linear]
    powers += [known.get("B", B) ** 2] * terms.gauss_markov
    times = np.full(terms.gauss_markov, known.get("T_B", T_B))
    maximum = Maximum(terms, np.array(powers), times, R * terms.ramp, 0.0)
    return Candidate(maximum, bic, aic, 1.0, 1.0, Goodness(1.0, 1.0, "explained", ""))


def spread(low: float, high: float) -> np.ndarray:
    """Draws whose 2.5 and 97.5 % quantiles these are, evenly spread."""
    reach = (high - low) / 0.95
    return low + reach * (EVEN - 0.025)


def draws_of(terms: Terms, **limits: tuple[float, float]) -> Posterior:
    names = ["N" if x == "N" else "B" if x == "F" else x for x in terms.linear]
    names += ["B"] * terms.gauss_markov
    parts = {"N": (0.99, 1.01), "K": (0.8 * K, 1.3 * K), "B": (0.8, 1.25), "T_B": (250.0, 360.0)}
    parts |= limits
    parameters = np.column_stack([spread(*parts[name]) for name in names])
    times = np.tile(spread(*parts["T_B"])[:, None], terms.gauss_markov)
    ramps = spread(*limits.get("R", (0.5 * R, 1.5 * R))) * terms.ramp
    return Posterior(parameters, times, ramps, 4000.0)


def described(whittle: Whittle, terms: Terms, **limits: tuple[float, float]) -> Estimate:
    chosen = candidate(terms)
    drawn = {terms: draws_of(terms, **limits)}
    return describe("likelihood", whittle, chosen, [chosen], drawn, 0.5)


def test_limits_are_quantiles_of_the_draws(whittle: Whittle) -> None:
    found = described(whittle, Terms("NK", 1, ramp=True)).parameters
    for name, low, high in (("N", 0.99, 1.01), ("K", 0.8 * K, 1.3 * K), ("T_B", 250.0, 360.0)):
        assert (found[name].lower, found[name].upper) == pytest.approx((low, high), rel=1e-3)
    assert {found[name].status for name in ("N", "K", "B", "T_B", "R")} == {"ok"}
    assert [found[name].value for name in ("N", "K", "B", "T_B", "R")] == [N, K, B, T_B, R]
    assert found["Q"] == Parameter(None, "absent", "the data do not support it")


@pytest.mark.parametrize(
    ("name", "limits", "status"),
    [
        # Limits that are at most four times apart.
        ("B", (0.6, 2.39), "ok"),
        ("B", (0.6, 2.41), "not_identified"),
        ("T_B", (200.0, 799.0), "ok"),
        ("T_B", (200.0, 801.0), "not_identified"),
        ("N", (0.3, 1.19), "ok"),
        ("N", (0.3, 1.21), "not_identified"),
        ("K", (0.4 * K, 1.59 * K), "ok"),
        ("K", (0.4 * K, 1.61 * K), "not_identified"),
        ("R", (-1e-4, 5.0 * R), "not_identified"),
        ("R", (0.3 * R, 1.1 * R), "ok"),
    ],
)
def test_a_value_whose_limits_are_four_times_apart_is_none(
    whittle: Whittle, name: str, limits: tuple[float, float], status: str
) -> None:
    found = described(whittle, Terms("NK", 1, ramp=True), **{name: limits}).parameters[name]
    assert found.status == status
    fine = 1e-3 * (limits[1] - limits[0])
    assert (found.lower, found.upper) == pytest.approx(limits, abs=fine)
    if status == "not_identified":
        assert found.value is None
        assert found.fitted == {"N": N, "K": K, "B": B, "T_B": T_B, "R": R}[name]


@pytest.mark.parametrize(
    ("part", "at_bound"), [(0.99, True), (0.98, False), (-0.99, True), (-0.98, False)]
)
def test_a_time_at_an_end_of_the_search_is_at_bound(
    whittle: Whittle, part: float, at_bound: bool
) -> None:
    at = part * whittle.longest if part > 0.0 else whittle.shortest / -part
    chosen = candidate(Terms("N", 1), T_B=at)
    drawn = draws_of(Terms("N", 1), T_B=(0.8 * at, 1.2 * at))
    found = describe(
        "likelihood", whittle, chosen, [chosen], {Terms("N", 1): drawn}, 0.5
    ).parameters["T_B"]
    assert (found.status == "at_bound") is at_bound
    assert found.value == pytest.approx(at) or not at_bound


def test_terms_that_are_fitted_as_none_are_absent(whittle: Whittle) -> None:
    terms = Terms("NK", 1)
    chosen = candidate(terms, K=0.0, B=0.0)
    found = describe(
        "likelihood", whittle, chosen, [chosen], {terms: draws_of(terms)}, 0.5
    ).parameters
    assert (found["K"].status, found["K"].lower) == ("absent", 0.0)
    assert found["K"].upper == pytest.approx(1.3 * K, rel=1e-3)
    assert (found["B"].status, found["T_B"].status) == ("absent", "absent")
    assert found["T_B"].upper is None and found["B"].upper == pytest.approx(1.25, rel=1e-3)


def test_two_models_share_an_interval_by_their_aic(whittle: Whittle) -> None:
    walk, flicker = candidate(Terms("NK")), candidate(Terms("NFK"), 9.0, 2.0 * np.log(3.0))
    drawn = {
        Terms("NK"): draws_of(Terms("NK")),
        Terms("NFK"): draws_of(Terms("NFK"), K=(0.5 * K, 0.7 * K), N=(0.6, 0.9)),
    }
    found = describe("likelihood", whittle, walk, [walk, flicker], drawn, 0.5)
    # Three to one: what is below 2.5 % of all is below 10 % of the fourth.
    K_found, N_found = found.parameters["K"], found.parameters["N"]
    assert N_found.lower == pytest.approx(0.6 + 0.3 / 0.95 * 0.075, rel=2e-3)
    # Of the chosen one the limits lie inside.
    assert N_found.upper == pytest.approx(1.01, rel=1e-3)
    assert K_found.upper == pytest.approx(1.3 * K, rel=1e-2)
    # A quarter lies below: the median is at a third of the others.
    assert K_found.value == pytest.approx(0.8 * K + 0.5 * K / 0.95 * (1 / 3 - 0.025), rel=2e-3)
    assert K_found.fitted is None


def test_b_of_several_terms_is_another_quantity(whittle: Whittle) -> None:
    one, flicker = candidate(Terms("N", 1)), candidate(Terms("NF"))
    two = candidate(Terms("NF", 1))
    drawn = {
        one.terms: draws_of(one.terms),
        flicker.terms: draws_of(flicker.terms, B=(0.3, 0.4)),
        two.terms: draws_of(two.terms, B=(0.01, 0.02), T_B=(1.0, 2.0)),
    }
    found = describe("likelihood", whittle, one, [one, flicker, two], drawn, 0.5)
    assert found.parameters["B"].lower == pytest.approx(0.3 + 0.1 / 0.95 * 0.025, rel=2e-2)
    assert found.parameters["T_B"].lower == pytest.approx(250.0, rel=1e-3)


def test_quantiles_of_a_mixture_are_those_of_all_draws_by_weight() -> None:
    first, second = np.arange(1.0, 101.0), np.arange(201.0, 401.0)
    # Of weight 2 to 1: a half of the whole is three quarters of the first.
    found = compute_mixture_quantiles([(first, 2.0), (second, 1.0)], 0.5, 0.9)
    assert found == pytest.approx((75.0, 340.0), abs=1.0)
    assert compute_mixture_quantiles([(first, 1.0), (second, 0.0)], 0.999)[0] <= 100.0
    few = [(np.array([1.0, 2.0]), 1.0), (np.array([3.0]), 1.0)]
    assert compute_mixture_quantiles(few, 0.2, 0.4, 0.6, 1.0) == (1.0, 2.0, 3.0, 3.0)
    low, high = compute_mixture_limits([(first, 1.0), (second, 1.0)], np.arange(401.0, 500.0))
    assert (low, high) == pytest.approx((5.0, 496.5), abs=1.5)


def test_models_are_about_as_good_by_aic_or_nearly_so_by_bic() -> None:
    chosen = candidate(Terms("NK"), 10.0, 10.0)
    for bic, aic, expected in ((11.9, 99.0, True), (12.1, 99.0, False), (99.0, 9.9, True)):
        assert is_as_good(candidate(Terms("N"), bic, aic), chosen) is expected


def test_what_is_absent_has_the_limit_of_all_models_that_have_it() -> None:
    absent = Parameter(None, "absent", "none")
    estimate = Estimate("likelihood", dict.fromkeys(("N", "B", "T_B", "K"), absent))
    plain, walk = candidate(Terms("N")), candidate(Terms("NK"), 9.0, 9.0)
    slow, near = candidate(Terms("N", 1), 9.0, 9.0), candidate(Terms("N", 1), 1.0, 9.0)
    drawn = {
        Terms("N"): draws_of(Terms("N")),
        Terms("NK"): draws_of(Terms("NK")),
        Terms("NFK"): draws_of(Terms("NFK"), K=(0.5 * K, 1.7 * K)),
        Terms("N", 1): draws_of(Terms("N", 1)),
        Terms("NK", 1): draws_of(Terms("NK", 1), K=(0.1, 0.2), T_B=(10.0, 20.0)),
    }
    wider = [walk, candidate(Terms("NFK"), 12.0, 12.0)]
    found = add_upper_limits(estimate, [plain, slow], wider, drawn).parameters
    assert (found["K"].status, found["K"].lower) == ("absent", 0.0)
    assert found["K"].upper == pytest.approx(1.7 * K, rel=1e-3)
    assert (found["B"].status, found["T_B"].status) == ("absent", "absent")
    found = add_upper_limits(estimate, [plain, near], wider, drawn).parameters
    assert (found["B"].status, found["B"].lower) == ("not_identified", 0.0)
    assert "N+GM, which includes it, fits about as well as N:" in (found["B"].reason or "")
    both = candidate(Terms("NK", 1), 1.0, 9.0)
    found = add_upper_limits(estimate, [plain, near, both], wider, drawn).parameters
    assert "N+GM and N+GM+K, which include it, fit" in (found["B"].reason or "")
