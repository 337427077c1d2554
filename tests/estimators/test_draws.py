import math

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.posterior import Posterior, compute_draw_weight, draw_jointly
from imubench_pipeline.estimators.whittle import Maximum, Terms
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

LONGEST = 1000.0


def posterior(parameters: np.ndarray, times: np.ndarray | None = None) -> Posterior:
    drawn = len(parameters)
    return Posterior(
        parameters, np.empty((drawn, 0)) if times is None else times, np.zeros(drawn), 0.3
    )


def test_parameters_that_trade_off_stay_together(rng) -> None:
    one = rng.standard_normal(5000)
    N, K = np.exp(0.1 * one), 1e-3 * np.exp(-0.3 * one)
    drawn = draw_jointly([(Terms("NK"), posterior(np.column_stack((N, K))), 1.0)], LONGEST)
    models = draw_models(Estimate("likelihood", {}, draws=drawn), 200, rng)
    assert len(models) == 200
    for model in models:
        assert model.N**3 * model.K == pytest.approx(1e-3)
        assert model.name == "N+K"
    assert np.std(np.log([model.N for model in models])) == pytest.approx(0.1, rel=0.2)


def test_models_are_drawn_by_their_shares_with_their_own_terms() -> None:
    drawn = draw_jointly(
        [
            (Terms("NK"), posterior(np.full((400, 2), [1.0, 0.1])), 0.5),
            (Terms("NF"), posterior(np.full((100, 2), [2.0, 0.2])), 0.25),
            (
                Terms("N", 2),
                posterior(np.full((300, 3), [3.0, 0.3, 0.4]), np.full((300, 2), [5.0, 50.0])),
                0.2,
            ),
            (
                Terms("NF", 1),
                posterior(np.full((300, 3), [4.0, 0.5, 0.6]), np.full((300, 1), 70.0)),
                0.05,
            ),
        ],
        LONGEST,
        100,
    )
    found = [drawn.model(number) for number in range(len(drawn))]
    names = [model.name for model in found]
    assert {name: names.count(name) for name in names} == {
        "N+K": 50,
        "N+F": 25,
        "N+GM+GM": 20,
        "N+F+GM": 5,
    }
    two, both = found[names.index("N+GM+GM")], found[names.index("N+F+GM")]
    assert (two.B, two.T_B) == (0.3, 5.0)
    assert [(one.B, one.T_B) for one in two.further] == [(0.4, 50.0)]
    assert (both.B, both.T_B) == (0.5, None)
    assert [(one.B, one.T_B) for one in both.further] == [(0.6, 70.0)]


def test_a_process_as_slow_as_a_walk_counts_less_than_a_walk() -> None:
    slow = posterior(np.full((1000, 2), [1.0, 0.5]), np.full((1000, 1), 0.2 * LONGEST))
    walk = posterior(np.full((1000, 2), [1.0, 0.1]))
    drawn = draw_jointly([(Terms("N", 1), slow, 0.5), (Terms("NK"), walk, 0.5)], LONGEST, 1000)
    names = [drawn.model(number).name for number in range(1000)]
    # BIC asks for 4 more: odds of e^-2.
    assert names.count("N+GM") / names.count("N+K") == pytest.approx(math.exp(-2.0), abs=2e-3)


def candidate(terms: Terms, cost: float) -> Candidate:
    processes = terms.gauss_markov
    found = Maximum(
        terms, np.ones(len(terms.linear) + processes), np.full(processes, 50.0), 0.0, cost
    )
    aic = 2.0 * (cost + terms.parameters)
    fitted = Goodness(1.0, 0.5, "explained", "")
    return Candidate(found, aic, aic, 0.5, math.exp(-0.5 * aic), fitted)


def test_an_amplitude_costs_its_model_what_aic_asks_and_a_correlation_time_what_bic_asks() -> None:
    bins = 200

    def odds(terms: Terms) -> float:
        plain = candidate(Terms("N"), 0.0)
        return compute_draw_weight(candidate(terms, 0.0), bins) / compute_draw_weight(plain, bins)

    assert odds(Terms("NFK")) == pytest.approx(math.exp(-2.0))
    assert odds(Terms("N", 1)) == pytest.approx(math.exp(-1.0) / math.sqrt(bins))
    assert odds(Terms("NK", 2)) == pytest.approx(math.exp(-3.0) / bins)
    # Few sensors have quantization noise, or a ramp: 6 of BIC, as in the choice.
    assert odds(Terms("QN")) == pytest.approx(math.exp(-1.0 - 3.0))
    assert odds(Terms("NK", ramp=True)) == pytest.approx(math.exp(-2.0 - 3.0))


def test_a_weak_term_that_is_there_has_its_part_of_the_draws() -> None:
    # Better by 2 in log likelihood: the 95 % limits must hold what only that model says.
    without, having = candidate(Terms("NK"), 0.0), candidate(Terms("NFK"), -2.0)
    part = compute_draw_weight(having, 200) / (
        compute_draw_weight(without, 200) + compute_draw_weight(having, 200)
    )
    assert part == pytest.approx(1.0 / (1.0 + math.exp(-1.0)))


def test_fewer_draws_are_spread_over_all_and_more_repeat_them(rng) -> None:
    N = np.linspace(1.0, 2.0, 200)[:, None]
    drawn = draw_jointly([(Terms("N"), posterior(N), 1.0)], LONGEST)
    estimate = Estimate("likelihood", {}, draws=drawn)
    few = sorted(model.N for model in draw_models(estimate, 20, rng))
    assert np.diff(few) == pytest.approx(10.0 / 199.0)
    many = sorted(model.N for model in draw_models(estimate, 400, rng))
    assert many[::2] == many[1::2] == list(N[:, 0])


def test_lines_are_drawn_beside_the_noise(rng) -> None:
    line = {"amplitude": Parameter(1.0, lower=0.9, upper=1.1), "frequency": Parameter(2.0)}
    drawn = draw_jointly([(Terms("N"), posterior(np.ones((50, 1))), 1.0)], LONGEST, 50)
    models = draw_models(Estimate("likelihood", {}, lines=[line], draws=drawn), 50, rng)
    amplitudes = [model.sinusoids[0].amplitude for model in models]
    assert np.std(amplitudes) == pytest.approx(0.05, rel=0.4)
    assert {model.sinusoids[0].frequency for model in models} == {2.0}


@pytest.mark.release
def test_the_draws_of_a_log_know_its_error_growth_better_than_its_parameters(rng) -> None:
    # N and the GM process trade off; what they add up to after 10 s is known much better.
    truth = NoiseModel(N=1e-4, B=6e-5, T_B=60.0, K=1e-6)
    estimate = fit(simulate(truth, 5.0, 60_000, rng), 5.0, rng=rng).estimates[0]
    assert estimate.draws is not None
    assert len(estimate.draws) == 200

    def spread(models: list[NoiseModel]) -> float:
        start = Start.calibrated(60.0)
        totals = [
            budget("heading", 10.0, gyro=one, accel=NoiseModel(), start=start).total
            for one in models
        ]
        return float(np.std(np.log(totals)))

    one_by_one = Estimate(estimate.method, estimate.parameters, estimate.further)
    together = spread(draw_models(estimate, 200, rng))
    # The variance of the heading after 10 s, of a log with 5000 independent cells of 10 s or so.
    assert 0.01 < together < 0.03
    assert together < 0.7 * spread(draw_models(one_by_one, 200, rng))
