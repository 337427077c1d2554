from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from imubench_pipeline.allan import AllanCurve, allan_variance, cluster_sizes
from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.least_squares import Errors, add_limits, fit, fit_errors
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng, simulate
from tests.conftest import few

SENSOR = {"N": 1.0, "B": 0.3, "T_B": 50.0, "K": 3e-3}
WALK = {"N": 1.0, "K": 1e-2}
SAMPLES = 100_000
"""At 1 Hz."""

LOGS = 5
METHODS = ("weighted", "paper")


def allan(
    n: np.ndarray, N: float = 0.0, B: float = 0.0, T_B: float = 1.0, K: float = 0.0
) -> np.ndarray:
    """Allan variance at n samples of 1 Hz, from the sums of the covariances of the samples."""
    p = np.exp(-1 / T_B)
    v = B**2 * np.log(2) / (np.pi * 0.4365**2)
    process = v / n**2 * (
        n * (1 + p) / (1 - p) - p * (3 - 4 * p**n + p ** (2 * n)) / (1 - p) ** 2
    )  # fmt: skip
    return N**2 / n + process + K**2 * n / 3 * (1 + 0.5 / n**2)


def curve_of(truth: dict[str, float], samples: int, sizes: np.ndarray | None = None) -> AllanCurve:
    """Curve without noise of a log of a length at 1 Hz."""
    n = cluster_sizes(samples) if sizes is None else sizes
    edf = [equivalent_degrees(0, int(size), samples - 2 * int(size) + 1) for size in n]
    variance = allan(n.astype(float), **truth)
    return AllanCurve(n.astype(float), n, variance, np.array(edf), samples)


def everything(curve: AllanCurve, part: float = 1.0) -> np.ndarray:
    return curve.cluster_size <= part * curve.samples


def estimate_of(truth: dict[str, float], method: str = "weighted") -> Estimate:
    absent = Parameter(None, "absent")
    names = ("N", "B", "T_B", "K")
    return Estimate(
        method, {name: Parameter(truth[name]) if name in truth else absent for name in names}
    )


@cache
def fits(names: str, method: str, logs: int = LOGS) -> list[Estimate]:
    """Fits to curves of simulated logs."""
    truth = {"SENSOR": SENSOR, "WALK": WALK}[names]
    return [fit(curve, method=method) for curve in curves(names, logs, **truth)]


@cache
def curves(names: str, logs: int = LOGS, **truth: float) -> list[AllanCurve]:
    rng = channel_rng(20260107, names)
    made = (simulate(NoiseModel(**truth), 1.0, SAMPLES, rng) for _ in range(logs))
    return [allan_variance(log, 1.0, overlap="octave") for log in made]


@cache
def exact_covariance(samples: int, sizes: tuple[int, ...], **truth: float) -> np.ndarray:
    """Covariance of Allan variances by the double sum over all second differences.

    For Gaussian x and y the covariance of x^2 and y^2 is 2 E(xy)^2.
    """
    t = np.arange(samples)
    v = truth.get("B", 0.0) ** 2 * np.log(2) / (np.pi * 0.4365**2)
    log = truth["N"] ** 2 * np.eye(samples)
    log += truth.get("K", 0.0) ** 2 * np.minimum.outer(t, t)
    log += v * np.exp(-np.abs(np.subtract.outer(t, t)) / truth.get("T_B", 1.0))
    phase = np.zeros((samples + 1, samples + 1))
    phase[1:, 1:] = log.cumsum(axis=0).cumsum(axis=1)
    found = np.empty((len(sizes), len(sizes)))
    for i, n in enumerate(sizes):
        rows = phase[2 * n :] - 2 * phase[n:-n] + phase[: -2 * n]
        for j, m in enumerate(sizes):
            both = rows[:, 2 * m :] - 2 * rows[:, m:-m] + rows[:, : -2 * m]
            found[i, j] = 2 * np.mean(both**2) / (2.0 * n**2 * 2.0 * m**2)
    return found


def propagated(
    truth: dict[str, float], samples: int, sizes: np.ndarray, method: str, held: tuple = ()
) -> dict[str, float]:
    """Standard errors of the logarithms of a least squares fit, from the definitions."""
    n, step = sizes.astype(float), 1e-5
    expected = allan(n, **truth)
    free = [name for name in truth if name not in held]
    jacobian = np.column_stack(
        [
            (
                allan(n, **(truth | {name: truth[name] * np.exp(step)}))
                - allan(n, **(truth | {name: truth[name] * np.exp(-step)}))
            )
            / (2 * step)
            for name in free
        ]
    )
    power = expected if method == "weighted" else np.sqrt(expected)
    weight = 1 / (2 * np.sqrt(n / (2 * samples)) * power) ** 2
    normal = jacobian.T @ (weight[:, None] * jacobian)
    gain = np.linalg.solve(normal, jacobian.T * weight)
    covariance = gain @ exact_covariance(samples, tuple(sizes), **truth) @ gain.T
    return dict(zip(free, np.sqrt(np.diag(covariance)).tolist(), strict=True))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("samples", [50, 2000])
def test_the_error_of_n_from_one_tau_has_a_closed_form(method: str, samples: int) -> None:
    # White noise at n = 1: var / mean^2 of the Allan variance is (3 L - 4) / (L - 1)^2.
    curve = curve_of({"N": 2.0}, samples)
    used = curve.cluster_size == 1
    errors = fit_errors(curve, used, NoiseModel(N=2.0), method)
    expected = np.sqrt(3 * samples - 4) / (samples - 1) / 2
    assert errors.of("N") == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("truth", "held"),
    few(
        [
            ({"N": 3.0, "B": 1.0, "T_B": 8.0, "K": 0.05}, ()),
            ({"N": 3.0, "B": 1.0, "T_B": 8.0, "K": 0.05}, ("T_B",)),
            ({"N": 3.0, "B": 1.0, "T_B": 8.0, "K": 0.05}, ("B", "T_B")),
        ],
        [(WALK, ()), ({"N": 3.0, "B": 1.0, "T_B": 8.0}, ())],
    ),
)
def test_errors_are_those_of_the_exact_covariance(
    method: str, truth: dict[str, float], held: tuple[str, ...]
) -> None:
    samples, sizes = 900, np.array([1, 2, 3, 5, 8, 12, 20, 32, 50, 80, 100])
    expected = propagated(truth, samples, sizes, method, held)
    curve = curve_of(truth, samples, sizes)
    errors = fit_errors(curve, everything(curve), NoiseModel(**truth), method, held=held)
    assert set(errors.names) == set(expected)
    for name, error in expected.items():
        assert errors.of(name) == pytest.approx(error, rel=0.05), name


@pytest.mark.release
@pytest.mark.parametrize("method", METHODS)
def test_the_width_of_the_limits_is_the_scatter_of_fits(method: str) -> None:
    """Thirty logs know a standard deviation to 13 %."""
    for name, truth in SENSOR.items():
        found = [estimate.parameters[name] for estimate in fits("SENSOR", method, 30)]
        assert all(parameter.status == "ok" for parameter in found)
        values = np.log([parameter.value or np.nan for parameter in found])
        limits = [(p.lower or np.nan, p.upper or np.nan) for p in found]
        widths = [np.log(upper / lower) / 3.92 for lower, upper in limits]
        assert values.mean() == pytest.approx(np.log(truth), abs=0.5 * np.median(widths) + 1e-3)
        assert np.median(widths) == pytest.approx(values.std(ddof=1), rel=0.4), name


@pytest.mark.parametrize(
    ("names", "method", "logs", "least"),
    few(
        [("WALK", "paper", LOGS, 3)],
        [("SENSOR", "weighted", 15, 11), ("WALK", "paper", 15, 11)]
        + [(names, method, 30, 24) for names in ("SENSOR", "WALK") for method in METHODS],
    ),
)
def test_limits_hold_the_truth(names: str, method: str, logs: int, least: int) -> None:
    """Of 30 logs 95 % are 28.5, of 15 14.2, of 5 4.8; fewer than 24, 11 and 3 have 0.1 %."""
    for name, truth in {"SENSOR": SENSOR, "WALK": WALK}[names].items():
        found = [estimate.parameters[name] for estimate in fits(names, method, logs)]
        limits = [(p.lower, p.upper) for p in found if p.lower is not None and p.upper is not None]
        assert len(limits) >= 0.86 * logs
        assert sum(lower <= truth <= upper for lower, upper in limits) >= least, name


@pytest.mark.parametrize(("logs", "most"), few([(LOGS, 2)], [(15, 3), (30, 5)]))
@pytest.mark.parametrize("method", METHODS)
def test_a_bias_instability_that_is_not_there_may_be_zero(
    method: str, logs: int, most: int
) -> None:
    """It may seem to be there in 5 % of logs.

    More than 2 of 5, 3 of 15 or 5 of 30 have probabilities of 0.1 to 0.5 %.
    """
    phantoms = 0
    for estimate in fits("WALK", method, logs):
        bias = estimate.parameters["B"]
        phantoms += bool(bias.status == "ok" and bias.lower)
        if bias.status == "not_identified":
            assert bias.value is None and bias.lower == 0.0 and bias.reason
            assert bias.fitted is not None and (bias.upper is None or bias.upper > bias.fitted)
    assert phantoms <= most


def test_ten_times_the_log_narrows_the_limits_by_the_root_of_ten() -> None:
    # The same clusters, all far shorter than the log.
    sizes = cluster_sizes(1000)
    errors = []
    for samples in (100_000, 1_000_000):
        curve = curve_of(SENSOR, samples, sizes)
        errors.append(fit_errors(curve, everything(curve), NoiseModel(**SENSOR), "weighted"))
    for name in SENSOR:
        ratio = errors[0].of(name) / errors[1].of(name)
        assert ratio == pytest.approx(np.sqrt(10), rel=0.01), name


def test_half_the_degrees_of_freedom_widen_the_limits_by_the_root_of_two() -> None:
    curve = curve_of(SENSOR, SAMPLES)
    used, model = everything(curve, 1 / 9), NoiseModel(**SENSOR)
    whole = fit_errors(curve, used, model, "weighted")
    halved = fit_errors(replace(curve, edf=curve.edf / 2), used, model, "weighted")
    doubled = fit_errors(replace(curve, edf=curve.edf * 2), used, model, "weighted")
    for name in SENSOR:
        assert halved.of(name) / whole.of(name) == pytest.approx(np.sqrt(2), rel=1e-6)
        # No log is better than one without holes.
        assert doubled.of(name) == pytest.approx(whole.of(name), rel=1e-6)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("unit", [1e-6, 57.29577951308232])
def test_limits_have_the_unit_of_the_log(method: str, unit: float) -> None:
    (curve,) = curves("SENSOR", 1, **SENSOR)
    scaled = fit(replace(curve, variance=unit**2 * curve.variance), method=method)
    for name, parameter in fits("SENSOR", method, 1)[0].parameters.items():
        factor = 1.0 if name == "T_B" else unit
        twin = scaled.parameters[name]
        assert twin.status == parameter.status
        for part in ("value", "lower", "upper", "fitted"):
            expected = factor * getattr(parameter, part)
            assert getattr(twin, part) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("samples", "known"),
    [(1000, "N"), (2000, "N"), (3000, "N B"), (7000, "N B T_B"), (60_000, "N B T_B K")],
)
def test_longer_logs_tell_more_parameters(samples: int, known: str) -> None:
    """B needs a log of sixty correlation times, T_B of a hundred, and K of eight hundred."""
    curve = curve_of(SENSOR, samples)
    used = everything(curve, 1 / 9)
    errors = fit_errors(curve, used, NoiseModel(**SENSOR), "weighted")
    found = add_limits(estimate_of(SENSOR), curve, used).parameters
    assert [name for name in SENSOR if found[name].status == "ok"] == known.split()
    for name, truth in SENSOR.items():
        parameter, error = found[name], errors.of(name)
        assert parameter.fitted == truth
        if name in known.split():
            assert error < 0.5 and parameter.value == truth
            assert parameter.lower is not None and parameter.upper is not None
            assert parameter.lower < truth < parameter.upper
            continue
        assert (parameter.value, parameter.status) == (None, "not_identified")
        assert "standard error" in (parameter.reason or "")
        if name != "T_B":
            assert parameter.lower == 0
            # Linear in the amplitude, unless nothing is known.
            upper = truth * (1 + 1.96 * error) if error < 10 else None
            assert parameter.upper == (upper and pytest.approx(upper))


@pytest.mark.parametrize("method", METHODS)
def test_limits_of_what_is_known_lie_about_the_value_by_two_standard_errors(method: str) -> None:
    curve = curve_of(SENSOR, 1_000_000)
    used = everything(curve, 1 / 9)
    errors = fit_errors(curve, used, NoiseModel(**SENSOR), method)
    for name, parameter in add_limits(estimate_of(SENSOR, method), curve, used).parameters.items():
        assert parameter.lower is not None and parameter.upper is not None
        assert parameter.value is not None
        assert parameter.lower * parameter.upper == pytest.approx(parameter.value**2)
        half = np.log(parameter.upper / parameter.value)
        assert half == pytest.approx(1.96 * errors.of(name), rel=1e-6)


def test_what_is_not_in_the_fit_stays_absent_without_limits() -> None:
    curve = curve_of({"N": 1.0}, 10_000)
    found = add_limits(estimate_of({"N": 1.0}), curve, everything(curve, 1 / 9)).parameters
    assert found["N"].status == "ok"
    for name in ("B", "T_B", "K"):
        parameter = found[name]
        assert parameter.status == "absent"
        assert (parameter.value, parameter.lower, parameter.upper) == (None, None, None)


def test_an_estimate_without_a_term_is_returned_as_it_is() -> None:
    curve = curve_of({"N": 1.0}, 10_000)
    estimate = estimate_of({})
    found = add_limits(estimate, curve, everything(curve))
    assert found.parameters == estimate.parameters
    assert {one.value for one in found.curve.values()} == {None}


@pytest.mark.parametrize("method", METHODS)
def test_one_tau_tells_none_of_four_parameters(method: str) -> None:
    curve = curve_of(SENSOR, 10_000)
    used = curve.cluster_size == 10
    found = add_limits(estimate_of(SENSOR, method), curve, used).parameters
    for name, parameter in found.items():
        assert (parameter.value, parameter.status) == (None, "not_identified")
        assert parameter.fitted == SENSOR[name]
        assert parameter.upper is None
        assert parameter.lower == (None if name == "T_B" else 0.0)


def test_a_weak_bias_at_a_time_that_ran_into_its_bound_is_not_identified() -> None:
    # What is left of B at T_B = 10,000 s is a random walk.
    truth = {"N": 1.0, "B": 0.02, "T_B": 5000.0}
    estimate = estimate_of(truth)
    parameters = dict(estimate.parameters)
    for name in ("B", "T_B"):
        parameters[name] = Parameter(truth[name], "at_bound", "T_B runs to the end of its search")
    curve = curve_of(truth, 100_000)
    found = add_limits(Estimate("weighted", parameters), curve, everything(curve, 1 / 9))
    for name in ("B", "T_B"):
        parameter = found.parameters[name]
        assert (parameter.value, parameter.status) == (None, "not_identified")
        assert (parameter.reason or "").startswith("T_B runs to the end of its search; ")
    assert found.model == NoiseModel(**truth, further=[], sinusoids=[])


def test_without_a_doubtful_term_a_parameter_moves_by_its_correlation() -> None:
    # Standard errors 0.1 and 0.4 with a correlation of -0.5. That B^2 falls to 0 is -1/2 in
    # log B, to first order: N rises by 0.5 x 0.5 x 0.1 / 0.4, and is left with the part of its
    # error that B does not explain, 0.1 sqrt(1 - 0.25).
    errors = Errors(("N", "B"), np.array([[0.01, -0.02], [-0.02, 0.16]]))
    low, high = errors.factors("N", [])
    assert np.log([low, high]) == pytest.approx([-0.196, 0.196])
    low, high = errors.factors("N", ["B"])
    assert np.log(low) == pytest.approx(-0.196)
    assert np.log(high) == pytest.approx(0.0625 + 1.96 * 0.1 * np.sqrt(0.75))


def test_an_amplitude_whose_square_may_be_zero_has_a_lower_limit_of_zero() -> None:
    # A relative error e of an amplitude is 2 e of its square: 1.96 of those reach 0 at e = 0.255.
    for error, zero in ((0.25, False), (0.26, True)):
        errors = Errors(("K", "T_B"), np.diag([error**2, error**2]))
        assert (errors.factors("K", [])[0] == 0.0) == zero
        assert errors.factors("T_B", [])[0] == pytest.approx(np.exp(-1.96 * error))


def test_errors_that_say_nothing_do_not_overflow() -> None:
    errors = Errors(("N", "T_B"), np.diag([np.inf, 1e9]))
    for name in ("N", "T_B"):
        assert errors.of(name) == 10.0
        assert np.isfinite(errors.factors(name, [])).all()


@pytest.mark.parametrize("method", METHODS)
def test_a_process_alone_that_a_short_log_cannot_tell_has_no_value(method: str) -> None:
    # As of a gyro that is turned: neither white noise nor a walk is there to be judged beside it.
    truth = {"B": 1.0, "T_B": 10.0}
    curve = curve_of(truth, 60, cluster_sizes(60, per_decade=10, longest=1 / 9))
    found = add_limits(estimate_of(truth, method), curve, everything(curve))
    for name in ("B", "T_B"):
        assert found.parameters[name].status == "not_identified"
        assert found.parameters[name].fitted == truth[name]
    none = fit_errors(curve, everything(curve), NoiseModel(**truth), method, held=["B", "T_B"])
    assert none.names == [] and none.covariance.shape == (0, 0)


def test_what_is_doubted_itself_or_not_known_at_all_moves_nothing() -> None:
    errors = Errors(("N", "B"), np.array([[0.01, 0.3], [0.3, 200.0]]))
    assert errors.factors("N", ["B"]) == errors.factors("N", [])
    known = Errors(("N", "B"), np.array([[0.01, -0.02], [-0.02, 0.03]]))
    assert known.factors("B", ["B"]) == known.factors("B", [])


def test_the_lowest_point_is_known_as_its_derivatives_say() -> None:
    curve = curve_of(SENSOR, SAMPLES)
    used = everything(curve, 1 / 9)
    model = NoiseModel(**SENSOR)
    found = add_limits(estimate_of(SENSOR), curve, used).curve
    fine = np.geomspace(20.0, 5_000.0, 200_001)

    def lowest(**changed: float) -> np.ndarray:
        # Of the curve in continuous time.
        truth = SENSOR | changed
        variance = NoiseModel(**truth).allan_variance(fine)
        return np.log([variance.min() ** 0.5, fine[variance.argmin()]])

    errors, step = fit_errors(curve, used, model, "weighted"), 0.01
    slopes = np.array(
        [
            lowest(**{name: SENSOR[name] * np.exp(step)})
            - lowest(**{name: SENSOR[name] * np.exp(-step)})
            for name in errors.names
        ]
    ) / (2.0 * step)
    for name, slope in zip(("sigma_min", "tau_min"), slopes.T, strict=True):
        error = np.sqrt(slope @ errors.covariance @ slope)
        one = found[name]
        if error > 0.5:
            assert one.status == "not_identified"
            continue
        assert one.upper is not None and one.lower is not None
        assert np.log(one.upper / one.lower) == pytest.approx(2.0 * 1.96 * error, rel=0.1), name


def test_limits_of_what_is_not_known_are_linear_but_for_a_time() -> None:
    told = set()
    for samples in (3_000, 10_000, 30_000):
        curve = curve_of(SENSOR, samples)
        used = everything(curve, 1 / 9)
        errors = fit_errors(curve, used, NoiseModel(**SENSOR), "weighted")
        found = add_limits(estimate_of(SENSOR), curve, used).parameters
        for name, value in SENSOR.items():
            one, error = found[name], errors.of(name)
            if one.status != "not_identified" or not 0.5 < error < 10.0:
                continue
            ends = (0.0, value * (1.0 + 1.96 * error))
            if name == "T_B":
                ends = (value * np.exp(-1.96 * error), value * np.exp(1.96 * error))
            assert (one.lower, one.upper) == pytest.approx(ends)
            told.add(name)
    assert {"T_B", "K"} <= told
