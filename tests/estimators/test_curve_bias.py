import math

import numpy as np
import pytest

from imubench_pipeline.estimators.curve_bias import (
    Models,
    add_curve_figures,
    compute_curve_bias,
    compute_curve_figures,
    convert_noise_model,
    find_lowest_point,
    make_averaging_times,
)
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_noise_model
from imubench_pipeline.noise import FLOOR, GaussMarkov, NoiseModel

FINE = np.geomspace(0.01, 4000.0, 20_001)
TAU = make_averaging_times(100.0, 36_000.0)


def hump(model: NoiseModel, longest: float = 4000.0) -> float:
    """Of flicker noise and processes alone, over a fine grid of tau."""
    fine = np.geomspace(0.01, longest, 20_001)
    only = NoiseModel(B=model.B, T_B=model.T_B, further=model.further)
    return float(np.sqrt(only.allan_variance(fine).max())) / FLOOR


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(N=1e-4, B=3e-5),
        NoiseModel(N=1e-4, B=3e-5, T_B=200.0, K=1e-6),
        NoiseModel(N=1e-4, B=3e-5, further=[GaussMarkov(2e-5, 50.0)]),
        NoiseModel(N=1e-4, B=3e-5, T_B=5.0, further=[GaussMarkov(4e-5, 20.0)]),
        NoiseModel(N=1e-4, B=5e-5, T_B=5.0, further=[GaussMarkov(4e-5, 900.0)]),
        NoiseModel(N=1e-4, B=2e-5, further=[GaussMarkov(2e-5, 5.0), GaussMarkov(4e-5, 90.0)]),
    ],
    ids=lambda model: model.name,
)
def test_it_is_the_highest_point_of_flicker_and_processes_together(model: NoiseModel) -> None:
    bias, at = compute_curve_bias(convert_noise_model(model), 4000.0)
    assert bias[0] == pytest.approx(hump(model), rel=2e-3)
    assert 0.0 < at[0] <= 4000.0


@pytest.mark.parametrize("T_B", [None, 0.3, 100.0])
def test_of_a_single_term_it_is_b(T_B: float | None) -> None:
    bias, _ = compute_curve_bias(
        convert_noise_model(NoiseModel(N=1e-3, B=7e-5, T_B=T_B, K=1e-5)), 4000.0
    )
    assert bias[0] == pytest.approx(7e-5, rel=1e-12)


def test_a_process_that_still_rises_counts_as_far_as_the_log_shows_it() -> None:
    slow = NoiseModel(N=1e-4, B=1e-4, T_B=30_000.0)
    bias, at = compute_curve_bias(convert_noise_model(slow), 4000.0)
    assert at[0] == 4000.0
    assert bias[0] == pytest.approx(hump(slow), rel=1e-3)
    assert bias[0] < 0.5e-4


def test_the_same_curve_has_the_same_bias_whatever_its_terms() -> None:
    # Two processes of one T_B are one process: variances add.
    one = convert_noise_model(NoiseModel(N=1e-4, B=5e-5, T_B=80.0))
    two = convert_noise_model(
        NoiseModel(N=1e-4, B=3e-5, T_B=80.0, further=[GaussMarkov(4e-5, 80.0)])
    )
    assert compute_curve_bias(two, 4000.0)[0] == pytest.approx(
        compute_curve_bias(one, 4000.0)[0], rel=1e-9
    )


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(N=1e-4, K=3e-6),
        NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=3e-6),
        NoiseModel(Q=1e-5, N=1e-4, B=2e-5, K=1e-6),
        NoiseModel(N=1e-4, B=2e-5, T_B=9.0, K=1e-6, further=[GaussMarkov(2e-5, 300.0)]),
    ],
    ids=lambda model: model.name,
)
def test_the_lowest_point_is_that_of_the_curve(model: NoiseModel) -> None:
    curve = np.sqrt(model.allan_variance(FINE))
    deviation, at, inside = find_lowest_point(convert_noise_model(model), TAU)
    assert inside[0]
    assert deviation[0] == pytest.approx(float(curve.min()), rel=1e-3)
    assert at[0] == pytest.approx(float(FINE[curve.argmin()]), rel=0.02)
    for part in np.array_split(np.arange(len(FINE)), 8):
        deviation, _, _ = find_lowest_point(convert_noise_model(model), FINE[part])
        assert deviation[0] == pytest.approx(float(curve[part].min()), rel=2e-4)


def test_the_lowest_point_of_white_noise_and_a_walk_in_closed_form() -> None:
    # N^2/tau + K^2 tau/3 is least at tau = sqrt(3) N/K: 2 N K/sqrt(3)
    deviation, at, _ = find_lowest_point(convert_noise_model(NoiseModel(N=1e-4, K=2e-6)), TAU)
    assert at[0] == pytest.approx(math.sqrt(3.0) * 50.0, rel=1e-3)
    assert deviation[0] == pytest.approx(math.sqrt(2.0 * 1e-4 * 2e-6 / math.sqrt(3.0)), rel=1e-4)


def test_ramps_and_lines_are_not_in_it() -> None:
    with_ramp = NoiseModel(N=1e-4, B=2e-5, K=1e-6, R=1e-8)
    without = NoiseModel(N=1e-4, B=2e-5, K=1e-6)
    assert compute_curve_figures(with_ramp, TAU) == compute_curve_figures(without, TAU)


def test_a_curve_that_only_falls_or_rises_has_no_lowest_point() -> None:
    falls = compute_curve_figures(NoiseModel(N=1e-4), TAU)
    assert falls["B_curve"].status == "absent"
    assert falls["sigma_min"].status == "not_shown"
    assert "still falls at 4000 s" in (falls["sigma_min"].reason or "")
    rises = compute_curve_figures(NoiseModel(K=1e-4), TAU)
    assert "rises from its shortest τ" in (rises["sigma_min"].reason or "")
    assert {one.status for one in compute_curve_figures(NoiseModel(), TAU).values()} == {
        "not_shown"
    }


def candidate(letters: str, powers: list[float], times: list[float], bic: float) -> Candidate:
    """A model of weight e^(-bic/2)."""
    found = Maximum(Terms(letters, len(times)), np.array(powers) ** 2, np.array(times), 0.0, 0.0)
    weight = math.exp(-0.5 * bic)
    return Candidate(found, bic, bic, weight, weight, Goodness(1.0, 0.5, "explained", ""))


def draws_of(*candidates: Candidate, spread: float = 0.05) -> dict[Terms, Posterior]:
    """Log-normal draws about each, all parameters together up or down."""
    rng = np.random.default_rng(7)
    found = {}
    for one in candidates:
        factor = np.exp(spread * rng.standard_normal((4000, 1)))
        found[one.terms] = Posterior(
            np.sqrt(one.maximum.powers) * factor,
            np.tile(one.maximum.times, (4000, 1)),
            np.zeros(4000),
            0.3,
        )
    return found


def of(chosen: Candidate) -> Estimate:
    """An estimate with the model of a candidate."""
    model = make_noise_model(chosen.maximum)
    values = {name: getattr(model, name) for name in ("N", "B", "T_B", "K")}
    return Estimate("likelihood", {name: Parameter(value) for name, value in values.items()})


def test_limits_are_those_of_the_draws() -> None:
    chosen = candidate("NK", [1e-4, 3e-6, 7e-5], [100.0], 0.0)
    found = add_curve_figures(of(chosen), [chosen], [], draws_of(chosen), TAU).curve
    B = found["B_curve"]
    assert (B.value, B.status) == (pytest.approx(7e-5), "ok")
    assert B.lower == pytest.approx(7e-5 * math.exp(-1.96 * 0.05), rel=0.01)
    assert B.upper == pytest.approx(7e-5 * math.exp(1.96 * 0.05), rel=0.01)
    # All amplitudes 5 % larger: the curve is 5 % higher, and its lowest point where it was.
    sigma, tau = found["sigma_min"], found["tau_min"]
    assert sigma.lower is not None and sigma.upper is not None and sigma.value is not None
    assert sigma.upper / sigma.lower == pytest.approx(math.exp(2 * 1.96 * 0.05), rel=0.02)
    assert tau.value is not None
    assert (tau.lower, tau.upper) == (pytest.approx(tau.value), pytest.approx(tau.value))


def test_models_that_are_as_good_share_limits_and_the_value_is_of_the_chosen_one() -> None:
    one = candidate("NK", [1e-4, 3e-6, 6e-5], [100.0], 0.0)
    other = candidate("NFK", [1e-4, 8e-5, 3e-6], [], 0.0)
    found = add_curve_figures(of(one), [one, other], [], draws_of(one, other), TAU).curve["B_curve"]
    assert found.value == pytest.approx(6e-5)
    assert found.lower is not None and found.lower < 6e-5
    assert found.upper is not None and found.upper > 8e-5


def test_weak_bias_is_told_from_none() -> None:
    chosen = candidate("NK", [1e-4, 3e-6], [], 0.0)
    for bic, status in ((1.0, "not_identified"), (5.0, "absent")):
        having = candidate("NFK", [1e-4, 1e-5, 3e-6], [], bic)
        draws = draws_of(chosen, having)
        found = add_curve_figures(of(chosen), [chosen, having], [having], draws, TAU).curve[
            "B_curve"
        ]
        assert (found.value, found.status, found.lower) == (None, status, 0.0)
        assert found.upper == pytest.approx(1e-5 * math.exp(1.96 * 0.05), rel=0.01)


def test_flicker_that_is_fitted_at_nothing_is_absent_down_to_nothing() -> None:
    chosen = candidate("NFK", [1e-4, 0.0, 3e-6], [], 0.0)
    draws = draws_of(candidate("NFK", [1e-4, 1e-5, 3e-6], [], 0.0))
    found = add_curve_figures(of(chosen), [chosen], [], draws, TAU).curve["B_curve"]
    assert (found.value, found.status, found.lower) == (None, "absent", 0.0)
    assert found.upper is not None and 1e-5 < found.upper < 2e-5


def test_what_is_known_to_a_factor_is_an_interval() -> None:
    chosen = candidate("NK", [1e-4, 3e-6, 7e-5], [100.0], 0.0)
    found = add_curve_figures(of(chosen), [chosen], [], draws_of(chosen, spread=0.7), TAU).curve[
        "B_curve"
    ]
    assert (found.value, found.status, found.fitted) == (
        None,
        "not_identified",
        pytest.approx(7e-5),
    )
    assert found.lower is not None and found.upper is not None


def test_models_hold_the_terms_of_a_noise_model() -> None:
    models = convert_noise_model(NoiseModel(N=1.0, B=2.0, K=3.0, further=[GaussMarkov(4.0, 5.0)]))
    assert isinstance(models, Models)
    assert models.parameter("F")[0] == 2.0 and models.parameter("Q")[0] == 0.0
    assert (models.biases[0, 0], models.times[0, 0]) == (4.0, 5.0)
