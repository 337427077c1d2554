"""What is doubted of a fit."""

from collections.abc import Iterable

import numpy as np
import pytest

from imubench_pipeline.estimators.doubts import cast_doubt
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE, SAMPLES = 10.0, 40_000


def k_of(model: NoiseModel, seed: int) -> Parameter:
    log = simulate(model, RATE, SAMPLES, np.random.default_rng(seed))
    return fit(log, RATE).estimates[0].parameters["K"]


@pytest.mark.parametrize("seed", few([0], [1]))
def test_a_walk_that_may_be_a_slow_process_is_doubted(seed: int) -> None:
    # A process of a twentieth of the log: BIC takes many for a walk, whose K is then no K.
    status = k_of(NoiseModel(N=1e-4, B=1e-4, T_B=170.0), seed).status
    assert status in ("doubtful", "not_identified")


@pytest.mark.release  # test_smooth_drift.py has one every day
def test_a_walk_is_hardly_ever_doubted() -> None:
    statuses = [k_of(NoiseModel(N=1e-4, K=1e-5), seed).status for seed in range(3)]
    assert statuses.count("ok") >= 2


@pytest.mark.parametrize("seed", few([0], [2, 5]))
def test_a_ramp_that_passes_for_a_walk_is_doubted(seed: int) -> None:
    # BIC asks more of a ramp than of a walk: one of four sigma of the process is hardly found.
    model = NoiseModel(N=1e-4, B=1e-4, T_B=20.0)
    log = simulate(model, RATE, SAMPLES, np.random.default_rng(seed))
    ramp = 4.3e-4 * np.arange(SAMPLES) / SAMPLES
    found = fit(log + ramp, RATE)
    assert found.candidates[0].terms.name == "N+GM+K"
    assert found.estimates[0].parameters["K"].status in ("doubtful", "not_identified")


@pytest.mark.release
@pytest.mark.parametrize("seeds", few([(0, 6)], [(range(12),)]))
def test_a_process_joined_to_a_walk_is_doubted_where_aic_has_others(seeds: Iterable[int]) -> None:
    # Process and walk pass for one slower process, and AIC sees that they are two.
    wrong = []
    for seed in seeds:
        model = NoiseModel(N=7e-4, B=7e-4, T_B=12.8, K=1.8e-4)
        log = simulate(model, 50.0, 128_000, np.random.default_rng(seed))
        found = fit(log, 50.0)
        T_B = found.estimates[0].parameters["T_B"]
        best = min(found.candidates, key=lambda one: one.aic)
        if best.aic < found.candidates[0].aic - 4.0 and best.terms.gauss_markov == 2:
            assert T_B.status != "ok"
        if T_B.status == "ok" and not 6.4 < T_B.value < 25.6:
            wrong.append(seed)
    assert wrong == []


def test_with_b_the_figures_of_the_curve_are_doubted() -> None:
    curve = {name: Parameter(1.0) for name in ("B_curve", "sigma_min")}
    estimate = Estimate("likelihood", {"B": Parameter(1.0), "K": Parameter(1.0)}, curve=curve)
    found = cast_doubt(estimate, ("B", "K"), "another model")
    assert {one.status for one in found.curve.values()} == {"doubtful"}
    found = cast_doubt(estimate, ("K",), "another model")
    assert {one.status for one in found.curve.values()} == {"ok"}


@pytest.mark.release
@pytest.mark.parametrize("seed", few([0], [1]))
def test_bias_instability_that_a_walk_hides_is_no_plain_value(seed: int) -> None:
    # The walk is the stronger below a tenth of the frequency at which the process begins.
    model = NoiseModel(N=1e-4, B=1e-4, T_B=20.0, K=6e-5)
    found = fit(simulate(model, RATE, SAMPLES, np.random.default_rng(seed)), RATE)
    B = found.estimates[0].parameters["B"]
    assert B.status != "ok" or B.value == pytest.approx(1e-4, rel=0.9)
    if B.status == "doubtful":
        assert found.estimates[0].curve["B_curve"].status == "doubtful"


@pytest.mark.release
@pytest.mark.parametrize("seed", few([1], [7, 8]))
def test_a_ramp_beside_a_walk_that_hardly_needs_it_is_doubted(seed: int) -> None:
    log = simulate(NoiseModel(N=1e-4, K=1e-5), RATE, SAMPLES, np.random.default_rng(seed))
    # Three times what the walk does over the log on average.
    ramp = 3e-5 * np.sqrt(SAMPLES / RATE) * np.arange(SAMPLES) / SAMPLES
    assert fit(log + ramp, RATE).estimates[0].parameters["R"].status == "doubtful"
