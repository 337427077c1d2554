import contextlib
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.allan import AllanCurve, allan_variance, cluster_sizes
from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.estimators.curve import read
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.least_squares import UnfitCurveError, fit
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, ensemble, simulate
from tests.conftest import few

MTI_7 = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
C102 = NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5)
WHITE = NoiseModel(N=8.4e-5)
HOURS_10 = 3_600_000


def curve_of(variance: np.ndarray, sizes: np.ndarray, rate: float, samples: int) -> AllanCurve:
    edf = [equivalent_degrees(0, int(n), samples - 2 * int(n) + 1) for n in sizes]
    return AllanCurve(sizes / rate, sizes, variance, np.array(edf), samples)


def noiseless(model: NoiseModel, rate: float = 100.0, samples: int = HOURS_10) -> AllanCurve:
    sizes = cluster_sizes(samples)
    return curve_of(model.allan_variance(sizes / rate), sizes, rate, samples)


def value(estimate: Estimate, name: str) -> float:
    found = estimate.parameters[name].value
    assert found is not None, estimate.parameters[name]
    return found


def fitted(estimate: Estimate, name: str) -> float:
    """What the fitted model has, identified or not."""
    found = estimate.parameters[name].in_model
    assert found is not None, estimate.parameters[name]
    return found


@pytest.mark.parametrize("method", ["weighted", "paper"])
def test_a_noiseless_curve_gives_its_parameters_back(method) -> None:
    estimate = fit(noiseless(MTI_7), method=method)
    for name in ("N", "B", "T_B", "K"):
        assert fitted(estimate, name) == pytest.approx(getattr(MTI_7, name), rel=1e-6)
        # The limits of K, known to 38 %, are more than four times apart.
        assert estimate.parameters[name].status == ("not_identified" if name == "K" else "ok")
    assert estimate.model.name == "N+GM+K"


@settings(max_examples=8)
@given(st.floats(0.5, 3), st.floats(0.5, 1.4), st.floats(20, 500), st.floats(0.3, 3))
def test_noiseless_curves_of_many_sensors(N: float, B: float, T_B: float, K: float) -> None:
    model = NoiseModel(N=N * 1e-4, B=B * 7e-5, T_B=T_B, K=K * 1e-6)
    estimate = fit(noiseless(model))
    for name in ("N", "B", "T_B", "K"):
        assert fitted(estimate, name) == pytest.approx(getattr(model, name), rel=1e-6)


def test_the_tau_of_a_curve_is_that_of_its_clusters() -> None:
    # sizes far from a log-spaced grid: a fit at nominal taus would be badly off
    sizes = np.unique(np.rint(np.geomspace(1, HOURS_10 / 9, 23) * 1.04).astype(int))
    curve = curve_of(MTI_7.allan_variance(sizes / 100.0), sizes, 100.0, HOURS_10)
    assert fitted(fit(curve), "T_B") == pytest.approx(89.5, rel=1e-6)


@pytest.mark.parametrize(
    ("model", "absent"),
    [
        (NoiseModel(N=1e-3), ("B", "T_B", "K")),
        (NoiseModel(N=1e-3, K=1e-5), ("B", "T_B")),
        (NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5), ("K",)),
    ],
)
def test_terms_that_are_not_there_are_absent(model: NoiseModel, absent: tuple) -> None:
    estimate = fit(noiseless(model))
    for name in absent:
        assert estimate.parameters[name].status == "absent"
        assert estimate.parameters[name].value is None
    assert value(estimate, "N") == pytest.approx(model.N, rel=1e-6)


def test_a_peak_just_beyond_the_curve_is_at_its_bound() -> None:
    estimate = fit(noiseless(NoiseModel(N=1e-4, B=1e-3, T_B=2300.0)))
    for name in ("B", "T_B"):
        assert estimate.parameters[name].status == "at_bound"
        assert estimate.parameters[name].lower is None
    assert "longest time of its search" in (estimate.parameters["T_B"].reason or "")


def test_a_peak_far_beyond_the_curve_is_a_random_walk() -> None:
    model = NoiseModel(N=1e-4, B=1e-3, T_B=20_000.0)
    estimate = fit(noiseless(model))
    for name in ("B", "T_B"):
        assert estimate.parameters[name].status == "not_identified"
    assert "longest time of its search" in (estimate.parameters["T_B"].reason or "")
    # far below T_B the process is the random walk of its driving noise
    driving = 2 * 1e-6 * np.log(2) / (np.pi * 0.4365**2 * 20_000.0)
    assert value(estimate, "K") == pytest.approx(np.sqrt(driving), rel=0.1)


def test_sampling_counts_where_the_log_can_tell(rng) -> None:
    # a random walk sampled at 1 Hz with little white noise: 3/2 of the continuous form at n = 1
    model = NoiseModel(N=1e-3, K=2e-3)
    log = simulate(model, 1.0, 200_000, rng)
    estimate = fit(allan_variance(log, 1.0))
    assert value(estimate, "K") == pytest.approx(2e-3, rel=0.02)
    assert value(estimate, "N") == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize(
    ("loss", "samples"),
    few([(0.1, HOURS_10 // 10)], [(loss, HOURS_10) for loss in (0.01, 0.05, 0.1)]),
)
def test_holes_do_not_bias_n(rng, loss: float, samples: int) -> None:
    log = simulate(MTI_7, 100.0, samples, rng)
    log[rng.random(samples) < loss] = np.nan
    curve = allan_variance(log, 100.0)
    estimate = fit(curve)
    assert value(estimate, "N") == pytest.approx(8.4e-5, rel=0.005)
    assert estimate.parameters["N"].reason is None
    assert value(read(curve), "N") == pytest.approx(8.4e-5, rel=0.01)


def test_noiseless_curves_of_sampled_logs() -> None:
    sizes = cluster_sizes(HOURS_10)
    for T_B, B in ((2.0, 6.7e-4), (20.0, 6.7e-4), (89.5, 6.7e-3)):
        model = NoiseModel(N=8.4e-5, B=B, T_B=T_B, K=8.2e-5)
        curve = curve_of(model.allan_variance(sizes / 100.0, 100.0), sizes, 100.0, HOURS_10)
        estimate = fit(curve)
        for name in ("N", "B", "T_B", "K"):
            assert fitted(estimate, name) == pytest.approx(getattr(model, name), rel=1e-6)


def test_a_low_pass_in_the_sensor_harms_neither_n_nor_b(rng) -> None:
    log = simulate(MTI_7, 100.0, HOURS_10, rng)
    filtered = (log[1:] + log[:-1]) / 2
    plain, bent = (fit(allan_variance(samples, 100.0)) for samples in (log, filtered))
    assert value(bent, "N") == pytest.approx(8.4e-5, rel=0.01)
    assert value(bent, "B") == pytest.approx(value(plain, "B"), rel=0.03)
    assert value(bent, "T_B") == pytest.approx(value(plain, "T_B"), rel=0.06)
    assert "the curve bends" in (bent.parameters["N"].reason or "")
    assert plain.parameters["N"].reason is None


@pytest.mark.parametrize(("logs", "most"), few([(6, 1)], [(60, 2)]))
def test_clean_curves_keep_their_short_taus(rng, logs: int, most: int) -> None:
    sizes = cluster_sizes(HOURS_10)
    curves = ensemble(MTI_7, 100.0, HOURS_10, sizes, logs, rng)
    shortened = sum(
        fit(curve_of(variance, sizes, 100.0, HOURS_10)).parameters["N"].reason is not None
        for variance in curves
    )
    assert shortened <= most


@pytest.mark.release
def test_ten_hour_logs_of_an_mti_7(rng) -> None:
    """RMSE near the Cramér-Rao bound of 0.037, 4.2 and 9.8 %."""
    errors = {name: [] for name in ("N", "B", "T_B")}
    for _ in range(30):
        log = simulate(MTI_7, 100.0, HOURS_10, rng)
        estimate = fit(allan_variance(log, 100.0, overlap="octave"))
        for name, found in errors.items():
            found.append(value(estimate, name) / getattr(MTI_7, name) - 1)
    rmse = {name: np.sqrt(np.mean(np.square(found))) for name, found in errors.items()}
    assert rmse["N"] <= 0.0015
    assert rmse["B"] <= 0.06
    assert rmse["T_B"] <= 0.13


@cache
def simulated_curves(model: NoiseModel, members: int, hours: float = 10.0) -> list[AllanCurve]:
    """Curves of full logs at 10 Hz."""
    samples = int(36_000 * hours)
    rng = channel_rng(20260103, model.name, str(hours))
    logs = (simulate(model, 10.0, samples, rng) for _ in range(members))
    return [allan_variance(log, 10.0, overlap="octave") for log in logs]


@pytest.mark.release
@pytest.mark.parametrize("model", [MTI_7, C102])
def test_limits_hold_the_truth_as_often_as_they_say(model: NoiseModel) -> None:
    """Of 60 logs 95 % are 57; fewer than 51 has a probability of 0.2 %."""
    held = dict.fromkeys(("N", "B", "T_B", "K"), 0)
    for curve in simulated_curves(model, 60):
        for name, found in fit(curve).parameters.items():
            assert name == "K" or found.status == "ok"
            if found.lower is not None and found.upper is not None:
                held[name] += found.lower <= getattr(model, name) <= found.upper
    assert min(held.values()) >= 51, held


@pytest.mark.release  # test_limits.py has the coverage of the same limits
def test_standard_errors_are_the_scatter_of_fits() -> None:
    """Thirty logs know a standard deviation to 13 %."""
    values: dict[str, list[float]] = {"N": [], "B": [], "T_B": []}
    errors: dict[str, list[float]] = {name: [] for name in values}
    for curve in simulated_curves(MTI_7, 30):
        parameters = fit(curve).parameters
        for name in values:
            found = parameters[name]
            assert found.value is not None and found.lower is not None and found.upper is not None
            values[name].append(np.log(found.value))
            errors[name].append(np.log(found.upper / found.lower) / (2 * 1.96))
    for name, logarithms in values.items():
        assert np.median(errors[name]) == pytest.approx(np.std(logarithms), rel=0.3), name


@pytest.mark.parametrize(
    ("method", "logs", "most"),
    few([("weighted", 2, 1)], [("weighted", 30, 5), ("paper", 30, 5)]),
)
def test_white_logs_have_neither_b_nor_k(method: str, logs: int, most: int) -> None:
    """At most 5 % may have; more than 2 of 5, or 5 of 30, then has 0.1 or 0.3 %."""
    phantoms = 0
    for curve in simulated_curves(WHITE, logs):
        parameters = fit(curve, method=method).parameters
        assert parameters["N"].status == "ok"
        phantoms += any(parameters[name].value is not None for name in ("B", "K"))
        for found in (parameters["B"], parameters["K"]):
            assert found.value is not None or found.status in ("absent", "not_identified")
            if found.status == "not_identified":
                assert found.lower == 0.0
                assert found.fitted is not None
                assert found.upper is None or found.upper > found.fitted
                assert "standard error" in (found.reason or "")
    assert phantoms <= most


@pytest.mark.parametrize(("logs", "told", "held"), few([(4, 3, 2)], [(20, 17, 16)]))
def test_a_random_walk_is_told_although_no_bias_instability_is(
    logs: int, told: int, held: int
) -> None:
    """Of 20 limits 19 hold K, of 4 3.8: fewer than 16, and than 2, have 0.3 and 0.1 %."""
    model = NoiseModel(N=8.4e-5, K=2e-6)
    found = [fit(curve).parameters["K"] for curve in simulated_curves(model, logs)]
    limits = [(k.lower, k.upper) for k in found if k.lower is not None and k.upper is not None]
    assert sum(k.value is not None for k in found) >= told
    assert sum(lower <= 2e-6 <= upper for lower, upper in limits) >= held


def test_a_short_log_does_not_tell_the_correlation_time() -> None:
    model = NoiseModel(N=8.4e-5, B=1e-5, T_B=200.0)
    for curve in simulated_curves(model, 5, hours=1.0):
        found = fit(curve)
        assert value(found, "N") == pytest.approx(8.4e-5, rel=0.02)
        assert found.parameters["T_B"].status in ("absent", "not_identified", "at_bound")


def test_holes_widen_the_limits(rng) -> None:
    log = simulate(WHITE, 10.0, 360_000, rng)
    widths = []
    for loss in (0.0, 0.5):
        holed = log.copy()
        holed[90_000 : 90_000 + int(loss * 360_000)] = np.nan
        found = fit(allan_variance(holed, 10.0)).parameters["N"]
        assert found.lower is not None and found.upper is not None
        widths.append(np.log(found.upper / found.lower))
    # half of the log gone: the standard error of N grows by the root of two
    assert widths[1] / widths[0] == pytest.approx(np.sqrt(2), rel=0.1)


def test_a_curve_without_its_log() -> None:
    sizes = cluster_sizes(HOURS_10)
    edf = np.full(len(sizes), 100.0)
    curve = AllanCurve(sizes / 100.0, sizes, MTI_7.allan_variance(sizes / 100.0), edf)
    assert fitted(fit(curve), "T_B") == pytest.approx(89.5, rel=1e-6)


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="of the 4 points that are needed"):
        fit(noiseless(MTI_7, samples=20))
    with pytest.raises(ValueError, match="'weighted' or 'paper'"):
        fit(noiseless(MTI_7), method="best")  # wrong on purpose


@pytest.mark.parametrize("values", [np.zeros(2000), np.tile([0.0, 1.0], 1000)])
def test_samples_that_repeat_exactly_are_refused_with_the_reason(values: np.ndarray) -> None:
    curve = allan_variance(values, 100.0)
    for method in ("weighted", "paper"):
        with pytest.raises(UnfitCurveError, match="samples repeat exactly"):
            fit(curve, method=method)
    shown = read(curve)
    assert {one.status for one in shown.parameters.values()} == {"not_shown"}
    assert "repeat exactly" in shown.parameters["N"].reason


@given(
    form=st.sampled_from(["turns", "sine", "ramp", "jump", "walk", "impulse", "relaxation"]),
    period=st.floats(2.0, 2000.0),
    size=st.sampled_from([1e-200, 1e-6, 1.0, 1e6, 1e70]),
    noise=st.sampled_from([0.0, 1e-6, 1.0]),
    lost=st.sampled_from([0.0, 0.5, 0.95]),
    samples=st.integers(16, 3000),
    seed=st.integers(0, 1000),
)
@settings(max_examples=10, deadline=None)
def test_a_log_of_any_form_is_fitted_or_refused(
    form: str, period: float, size: float, noise: float, lost: float, samples: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(samples)
    shape = {
        "turns": np.sign(np.sin(2 * np.pi * t / period)),
        "sine": np.sin(2 * np.pi * t / period),
        "ramp": t / samples,
        "jump": (t > samples / 2) * 1.0,
        "walk": np.cumsum(rng.normal(size=samples)),
        "impulse": (t == samples // 3) * 1.0,
        "relaxation": np.exp(-t / period),
    }[form]
    values = size * (shape + noise * rng.normal(size=samples))
    values[rng.random(samples) < lost] = np.nan
    try:
        curve = allan_variance(values, 100.0)
    except ValueError as refused:
        assert lost and "expected a log with fewer missing" in str(refused)
        return
    for method in ("weighted", "paper"):
        with contextlib.suppress(UnfitCurveError):
            found = fit(curve, method=method)
            for name, parameter in found.parameters.items():
                assert (parameter.value is not None) == (parameter.status in ("ok", "at_bound")), (
                    name
                )
