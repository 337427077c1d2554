"""Many models at once: as each of them alone."""

import math
from operator import methodcaller

import numpy as np

from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.exponentials import (
    evaluate_decay,
    evaluate_phi,
    integrate_squared_response,
)
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated
from imubench_pipeline.noise.model import stack_models, sum_over_stacked_terms

MODELS = [
    NoiseModel(Q=1e-6, N=1e-4, B=2e-5, T_B=90.0, K=1e-7, R=-1e-9),
    NoiseModel(N=2e-4, B=1e-5),
    NoiseModel(N=3e-4, B=3e-5, T_B=0.3, further=[GaussMarkov(1e-5, 4000.0)]),
    NoiseModel(N=1e-4, sinusoids=[Sinusoid(1e-4, 2.0), Sinusoid(2e-4, 1e-3)]),
    NoiseModel(K=2e-7),
    NoiseModel(),
]


def over_models(figure, places: int | None = None) -> np.ndarray:
    return sum_over_stacked_terms(len(MODELS), stack_models(MODELS), figure, places)


def test_a_figure_of_many_models_is_that_of_each() -> None:
    for start in (Calibrated(60.0), Uncalibrated(bias=0.0, on_time=5.0)):
        for order in (0, 1, 2):
            for time in (1.0, 600.0):
                alone = [math.fsum(t.growth(order, time, start) for t in m.terms) for m in MODELS]
                growth = methodcaller("growth", order, time, start)
                at_once = over_models(growth)
                np.testing.assert_allclose(at_once, alone, rtol=1e-12)
    taus = np.array([0.1, 3.0, 700.0])
    at_once = over_models(lambda term: term.allan_variance(taus[:, None]), len(taus))
    np.testing.assert_allclose(at_once.T, [m.allan_variance(taus) for m in MODELS], rtol=1e-12)


def test_each_term_of_each_model_is_there_once() -> None:
    there = [number for numbers, _ in stack_models(MODELS) for number in numbers.tolist()]
    assert [there.count(number) for number in range(len(MODELS))] == [
        len(model.terms) for model in MODELS
    ]


def test_functions_of_exponentials_are_the_same_of_arrays() -> None:
    x = np.concatenate([[0.0], np.geomspace(1e-8, 1e5, 200), [2.0]])
    for order in range(5):
        np.testing.assert_allclose(
            evaluate_decay(order, x), [evaluate_decay(order, e) for e in x.tolist()], 1e-13
        )
        z = 1j * x
        np.testing.assert_allclose(
            evaluate_phi(order, z), [evaluate_phi(order, e) for e in z.tolist()], 1e-12
        )
    for order in range(3):
        alone = [integrate_squared_response(order, each) for each in x.tolist()]
        np.testing.assert_allclose(integrate_squared_response(order, x), alone, 1e-13)
