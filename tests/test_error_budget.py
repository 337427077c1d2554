import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import quad, simpson, solve_ivp
from scipy.special import ndtri

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget.budget import Start, budget, time_until
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.navigation.error_budget.in_use import Figure, Figures
from imubench_pipeline.navigation.error_budget.parts import Budget, Contribution, Quantity
from imubench_pipeline.navigation.error_budget.uncertainty import compute_limits, draw_models
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.words.verdicts import source_text
from tests.starts import uncalibrated

Array = NDArray[np.float64]

G = 9.80665
QUANTITIES: tuple[Quantity, ...] = ("attitude", "heading", "velocity", "position")
NOTHING = NoiseModel()
MTI_7_GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
MTI_7_ACCEL = NoiseModel(N=98e-6 * G, B=2.4e-4, T_B=60.0, K=3e-6)
EVERYTHING = NoiseModel(
    Q=2e-6,
    N=8.4e-5,
    B=6e-5,
    K=8e-7,
    R=1e-8,
    further=(GaussMarkov(4e-5, 20.0),),
    sinusoids=(Sinusoid(2e-5, 0.7),),
)
log_times = st.floats(-2.5, 3.5).map(lambda x: 10.0**x)


def test_reference_figures_of_a_mems_sensor() -> None:
    start = Start.calibrated(60.0)
    gyro, accel = NoiseModel(N=8.4e-5), NoiseModel(N=98e-6 * G)
    found = budget("position", 60.0, gyro=gyro, accel=accel, start=start)
    sigma = {source_text(one.source): one.sigma for one in found.contributions}
    assert sigma["gyro N"] == pytest.approx(G * 8.4e-5 * math.sqrt(60.0**5 / 20.0))
    assert sigma["gyro N"] == pytest.approx(5.1, abs=0.05)
    assert sigma["accel N"] == pytest.approx(98e-6 * G * math.sqrt(60.0**3 / 3.0))
    assert sigma["accel N"] == pytest.approx(0.26, abs=0.005)
    mean = 8.4e-5 / math.sqrt(60.0)
    assert sigma["gyro N in the static window"] == pytest.approx(G * mean * 60.0**3 / 6.0)


@given(
    st.sampled_from(QUANTITIES),
    log_times,
    log_times,
    st.booleans(),
)
def test_the_total_is_the_root_of_the_squares(
    quantity: Quantity, time: float, window: float, calibrated: bool
) -> None:
    start = (
        replace(Start.calibrated(window), heading=0.01)
        if calibrated
        else uncalibrated(gyro_bias=1e-3, accel_bias=0.02, on_time=window, tilt=1e-3)
    )
    found = budget(quantity, time, gyro=EVERYTHING, accel=EVERYTHING, start=start)
    squares = math.fsum(one.sigma**2 for one in found.contributions)
    assert found.total**2 == pytest.approx(squares)
    names = [one.source for one in found.contributions]
    assert len(set(names)) == len(names)


@given(
    st.sampled_from(QUANTITIES),
    log_times,
    st.sampled_from(["Q", "N", "B", "K", "R"]),
    st.sampled_from(["gyro", "accel"]),
    st.floats(1.01, 100.0),
    st.booleans(),
)
def test_more_noise_is_never_better(
    quantity: Quantity, time: float, name: str, sensor: str, factor: float, calibrated: bool
) -> None:
    values: dict[str, Any] = {"Q": 2e-6, "N": 8e-5, "B": 6e-5, "K": 8e-7, "R": 1e-8}
    start = (
        Start.calibrated(30.0)
        if calibrated
        else uncalibrated(gyro_bias=1e-3, accel_bias=0.02, on_time=30.0)
    )
    models = {"gyro": NoiseModel(**values), "accel": NoiseModel(**values)}
    both = [budget(quantity, time, **models, start=start).contributions]
    models[sensor] = NoiseModel(**(values | {name: factor * values[name]}))
    both.append(budget(quantity, time, **models, start=start).contributions)
    unseen = sensor == "accel" and (
        quantity == "heading" or (quantity == "attitude" and not calibrated)
    )
    # By source: the total may round to what it was, where another is ten million times as much.
    sigmas = [(one.sigma, other.sigma) for one, other in zip(*both, strict=True)]
    assert all(before <= after for before, after in sigmas)
    assert any(before < after for before, after in sigmas) != unseen


def test_a_levelled_tilt_is_the_mean_error_of_the_accelerometer_over_g() -> None:
    start = Start.calibrated(25.0)
    accel = NoiseModel(N=1e-3)
    biased: Figures = {"turn_on_bias": Figure(sigma=0.03)}
    found = budget("attitude", 10.0, gyro=NOTHING, accel=accel, start=start, accel_figures=biased)
    sigma = {source_text(one.source): one.sigma for one in found.contributions}
    assert sigma == {
        "initial tilt from accel N": pytest.approx(1e-3 / 5.0 / G),
        "initial tilt from accel turn-on bias": pytest.approx(0.03 / G),
    }
    # It cancels the error that made it: velocity sees the noise in the window, and no bias.
    found = budget("velocity", 10.0, gyro=NOTHING, accel=accel, start=start)
    assert found.total == pytest.approx(math.hypot(1e-3 * math.sqrt(10.0), 1e-3 / 5.0 * 10.0))


def test_a_stated_tilt_and_biases_grow_with_gravity() -> None:
    start = uncalibrated(gyro_bias=2e-3, accel_bias=0.1, on_time=0.0, tilt=0.01, heading=0.2)
    expected: dict[Quantity, tuple[float, float, float]] = {
        "attitude": (2e-3 * 6.0, 0.0, 0.01),
        "velocity": (G * 2e-3 * 18.0, 0.1 * 6.0, G * 0.01 * 6.0),
        "position": (G * 2e-3 * 36.0, 0.1 * 18.0, G * 0.01 * 18.0),
    }
    for quantity, parts in expected.items():
        found = budget(quantity, 6.0, gyro=NOTHING, accel=NOTHING, start=start)
        assert found.total == pytest.approx(math.hypot(*parts))
    found = budget("heading", 6.0, gyro=NOTHING, accel=NOTHING, start=start)
    assert found.total == pytest.approx(math.hypot(0.012, 0.2))


LATE: tuple[Quantity, ...] = ("attitude", "velocity", "position")
RADIUS = G * (84.4 * 60.0 / (2.0 * math.pi)) ** 2


def with_schuler_feedback(rate: float, accel: float, start: Sequence[float]) -> Array:
    """Return tilt, velocity and position at 0, 6 ... 600 s; tilt' = rate - v / r."""

    def derivative(_: float, x: Array) -> list[float]:
        return [rate - x[1] / RADIUS, G * x[0] + accel, x[1]]

    times = np.linspace(0.0, 600.0, 101)
    found = solve_ivp(derivative, (0.0, 600.0), start, t_eval=times, rtol=1e-10, atol=1e-16)
    return np.asarray(found.y)


@pytest.mark.parametrize(
    ("gyro", "accel", "tilt", "overstated"),
    [
        (1e-6, 0.0, 0.0, [0.099, 0.047, 0.028]),
        (0.0, 1e-3, 0.0, [0.099, 0.047]),
        (0.0, 0.0, 1e-4, [0.360, 0.099, 0.047]),
    ],
)
def test_what_schuler_feedback_takes_off_a_bias(
    gyro: float, accel: float, tilt: float, overstated: list[float]
) -> None:
    start = uncalibrated(gyro_bias=gyro, accel_bias=accel, on_time=0.0, tilt=tilt)
    curved = with_schuler_feedback(gyro, accel, [tilt, 0.0, 0.0])[-len(overstated) :, -1]
    asked = LATE[-len(overstated) :]
    flat = [budget(q, 600.0, gyro=NOTHING, accel=NOTHING, start=start).total for q in asked]
    np.testing.assert_allclose(np.array(flat) / curved - 1.0, overstated, atol=6e-4)


def test_what_schuler_feedback_takes_off_white_noise() -> None:
    start = uncalibrated(gyro_bias=0.0, accel_bias=0.0, on_time=0.0)
    expected: dict[str, list[float]] = {"gyro": [0.095, 0.057, 0.034], "accel": [0.095, 0.057]}
    white = NoiseModel(N=1.0)
    for sensor, overstated in expected.items():
        pulse = [1.0, 0.0, 0.0] if sensor == "gyro" else [0.0, 1.0, 0.0]
        squares = with_schuler_feedback(0.0, 0.0, pulse)[-len(overstated) :] ** 2
        curved = np.sqrt(simpson(squares, dx=6.0, axis=1))
        models = {"gyro": NOTHING, "accel": NOTHING} | {sensor: white}
        asked = LATE[-len(overstated) :]
        flat = [budget(q, 600.0, **models, start=start).total for q in asked]
        np.testing.assert_allclose(np.array(flat) / curved - 1.0, overstated, atol=6e-4)


# Errors in the horizontal plane


def plane(sigma: float, *vectors: complex) -> Budget:
    """Return an error alike along both axes, and errors with directions."""
    contributions = [Contribution(ErrorSource("N", "accel"), sigma)]
    for vector in vectors:
        source = ErrorSource("scale_factor", "gyro", "turn")
        contributions.append(Contribution(source, abs(vector), vector=vector))
    return Budget(1.0, "position", contributions)


@pytest.mark.parametrize("confidence", [0.5, 0.95])
@pytest.mark.parametrize(
    ("sigma", "vectors", "spreads"),
    [
        (1.0, (), (1.0, 1.0)),
        (0.0, (3.0, 3.0j), (3.0, 3.0)),
        (1.0, (1j * math.sqrt(3.0),), (2.0, 1.0)),
        (1.0, (1.0 + 1.0j, 2.0 - 2.0j), (math.sqrt(9.0), math.sqrt(3.0))),
    ],
)
def test_a_radius_has_the_probability_in_the_plane(
    confidence: float, sigma: float, vectors: tuple[complex, ...], spreads: tuple[float, float]
) -> None:
    """The normal density with the spreads along its main axes, over the disk by quadrature."""
    z = float(ndtri((1.0 + confidence) / 2.0))
    radius = z * plane(sigma, *vectors).to_radius(confidence).total
    first, second = spreads

    def along(x: float) -> float:
        other = math.sqrt(radius**2 - x**2) / second
        return math.exp(-((x / first) ** 2) / 2.0) * math.erf(other / math.sqrt(2.0))

    inside = quad(along, -radius, radius)[0] / (first * math.sqrt(2.0 * math.pi))
    assert inside == pytest.approx(confidence, abs=1e-4)


def test_the_limit_of_a_radius_is_reached_earlier() -> None:
    """Rayleigh: the radius with 95 % is sqrt(-2 ln 0.05) of the sigma along each axis."""
    factor = math.sqrt(-2.0 * math.log(0.05)) / float(ndtri(0.975))
    start = uncalibrated(gyro_bias=0.0, accel_bias=0.0, on_time=0.0)
    accel = NoiseModel(N=1e-3)
    found = time_until(
        0.02 * factor,
        lambda t: budget("velocity", t, gyro=NOTHING, accel=accel, start=start).to_radius(0.95),
    )
    assert found == pytest.approx(400.0)
    # An error along one line keeps its size.
    assert plane(0.0, 3.0 - 4.0j).to_radius(0.95).total == pytest.approx(5.0)


# Time until a limit


@given(st.sampled_from(QUANTITIES), st.floats(-1.5, 3.0), st.floats(-1.0, 3.0), st.booleans())
@settings(max_examples=60)
def test_the_error_reaches_its_limit_at_the_time_found(
    quantity: Quantity, log_time: float, log_window: float, calibrated: bool
) -> None:
    window = 10.0**log_window
    start = (
        Start.calibrated(window)
        if calibrated
        else uncalibrated(gyro_bias=1e-3, accel_bias=0.02, on_time=window)
    )
    sensors = {"gyro": MTI_7_GYRO, "accel": MTI_7_ACCEL}
    limit = budget(quantity, 10.0**log_time, **sensors, start=start).total
    found = time_until(limit, partial(budget, quantity, **sensors, start=start))
    assert found == pytest.approx(10.0**log_time, rel=1e-6)


@given(st.sampled_from(QUANTITIES), log_times, st.floats(0.01, 1000.0), st.booleans())
def test_errors_grow_with_time(
    quantity: Quantity, time: float, window: float, calibrated: bool
) -> None:
    start = (
        Start.calibrated(window)
        if calibrated
        else uncalibrated(gyro_bias=1e-4, accel_bias=0.01, on_time=window)
    )
    model = NoiseModel(Q=1e-6, N=1e-4, B=1e-4, K=1e-6, R=1e-8, further=(GaussMarkov(1e-3, 5.0),))
    totals = [
        budget(quantity, time * factor, gyro=model, accel=model, start=start).total
        for factor in (1.0, 1.01, 1.5)
    ]
    assert totals == sorted(totals)


def test_the_first_crossing_of_a_line() -> None:
    # A sin(pi f t) / (pi f) / sqrt(2) reaches half of its maximum at a sixth of 1/f.
    start = uncalibrated(gyro_bias=0.0, accel_bias=0.0, on_time=0.0)
    gyro = NoiseModel(N=1e-9, sinusoids=(Sinusoid(1e-3, 0.01),))
    limit = 0.5 * 1e-3 / (math.pi * 0.01) / math.sqrt(2.0)
    attitude = partial(budget, "attitude", gyro=gyro, accel=NOTHING, start=start)
    found = time_until(limit, attitude, oscillates=True)
    assert found == pytest.approx(100.0 / 6.0, rel=1e-6)


def test_limits_that_are_passed_at_once_or_never() -> None:
    tilted = uncalibrated(gyro_bias=0.0, accel_bias=0.0, on_time=0.0, tilt=0.1)
    attitude, velocity = (
        partial(budget, quantity, gyro=NOTHING, accel=NOTHING, start=tilted)
        for quantity in ("attitude", "velocity")
    )
    assert time_until(0.05, attitude) == 0.0
    assert time_until(0.2, attitude) is None
    assert time_until(0.1 * G * 7.0, velocity) == pytest.approx(7.0)


# Gyrocompassing


def test_heading_from_white_noise() -> None:
    compass = Gyrocompass(gyro=NoiseModel(N=1e-6), latitude=math.radians(60.0), bias=0.0)
    expected = 1e-6 / math.sqrt(400.0) / (EARTH_RATE / 2.0)
    assert compass.heading(400.0).total == pytest.approx(expected)
    assert compass.time_needed(expected) == pytest.approx(400.0)
    # Positions share the time; half the differences are as good as the mean.
    for positions in (2, 6):
        turned = Gyrocompass(
            gyro=NoiseModel(N=1e-6), latitude=math.radians(60.0), positions=positions
        )
        assert turned.heading(400.0).total == pytest.approx(expected)


def test_a_floor_makes_a_heading_impossible() -> None:
    noise = NoiseModel(N=1e-6)
    compass = Gyrocompass(gyro=noise, latitude=0.0, bias=1e-6)
    assert compass.time_needed(1.01e-6 / EARTH_RATE) is not None
    assert compass.time_needed(0.99e-6 / EARTH_RATE) is None
    flicker = Gyrocompass(gyro=NoiseModel(N=1e-6, B=1e-6), latitude=0.0, bias=0.0)
    floor = math.sqrt(2.0 / math.pi) * 1e-6 / EARTH_RATE
    assert flicker.time_needed(1.01 * floor) is not None
    assert flicker.time_needed(0.99 * floor) is None
    # Half the difference of two means, with the Allan variance 2 ln 2 / pi B^2; the mean of these.
    for positions in (2, 4):
        turned = Gyrocompass(gyro=NoiseModel(N=1e-6, B=1e-6), latitude=0.0, positions=positions)
        floor = math.sqrt(2.0 * math.log(2.0) / math.pi / positions) * 1e-6 / EARTH_RATE
        assert turned.time_needed(1.01 * floor) is not None
        assert turned.time_needed(0.99 * floor) is None


def test_the_best_window_of_a_walk_is_found() -> None:
    # N^2/t + K^2 t/3 has its minimum 2 N K / sqrt(3) at t = sqrt(3) N/K.
    compass = Gyrocompass(gyro=NoiseModel(N=1e-6, K=1e-8), latitude=0.0, bias=0.0)
    best = math.sqrt(2.0 * 1e-14 / math.sqrt(3.0)) / EARTH_RATE
    found = compass.time_needed(best * (1.0 + 1e-6))
    assert found == pytest.approx(100.0 * math.sqrt(3.0), rel=1e-2)
    assert compass.time_needed(best * (1.0 - 1e-6)) is None


@pytest.mark.parametrize("positions", [1, 2, 4])
def test_a_line_counts_by_its_envelope_in_the_search(positions: int) -> None:
    gyro = NoiseModel(N=1e-6, sinusoids=(Sinusoid(1e-5, 2.0),))
    compass = Gyrocompass(gyro=gyro, latitude=0.5, bias=0.0, positions=positions)
    needed = compass.time_needed(0.01)
    assert needed is not None
    later = needed * np.linspace(1.0, 1.5, 400)
    assert max(compass.heading(float(t)).total for t in later) <= 0.01 * (1.0 + 1e-9)


def test_a_stated_bias_adds_to_the_noise() -> None:
    noise = Gyrocompass(gyro=MTI_7_GYRO, latitude=0.5).heading(60.0)
    assert noise.quantity == "heading"
    biased = Gyrocompass(gyro=MTI_7_GYRO, latitude=0.5, bias=1e-3).heading(60.0)
    bias = 1e-3 / (EARTH_RATE * math.cos(0.5))
    assert biased.total == pytest.approx(math.hypot(noise.total, bias))
    # Half turns take it off.
    turned = Gyrocompass(gyro=NOTHING, latitude=0.5, bias=1e-3, positions=2).heading(60.0)
    assert turned.total == 0.0


# Uncertainty


@pytest.mark.release
def test_limits_of_drawn_models() -> None:
    estimate = Estimate(
        "likelihood",
        {
            "Q": Parameter(None, "absent"),
            "N": Parameter(1e-4, lower=0.9e-4, upper=1.3e-4),
            "B": Parameter(None, "not_identified", lower=0.0, upper=3e-4, fitted=1e-4),
            "T_B": Parameter(50.0, "at_bound"),
            "K": Parameter(None, "absent", lower=0.0, upper=2e-6),
            "R": Parameter(1e-9, lower=-1e-9, upper=2e-9),
        },
        further=[
            {"B": Parameter(2e-4, lower=1e-4, upper=3e-4), "T_B": Parameter(9.0, lower=3, upper=30)}
        ],
        lines=[{"amplitude": Parameter(1e-3, lower=9e-4, upper=2e-3), "frequency": Parameter(0.3)}],
    )
    models = draw_models(estimate, 4000, np.random.default_rng(1))
    again = draw_models(estimate, 4000, np.random.default_rng(1))
    assert models == again

    def quantiles(values: list[float]) -> Array:
        return np.asarray(np.quantile(values, [0.025, 0.5, 0.975]))

    near = partial(np.testing.assert_allclose, rtol=0.08)
    near(quantiles([one.N for one in models]), [0.9e-4, 1e-4, 1.3e-4])
    near(quantiles([one.further[0].T_B for one in models]), [3.0, 9.0, 30.0])
    near(quantiles([one.sinusoids[0].amplitude for one in models]), [9e-4, 1e-3, 2e-3])
    near(np.quantile([one.R for one in models], [0.025, 0.975]), [-1e-9, 2e-9], rtol=0.15)
    near(np.quantile([one.B for one in models], [0.5, 0.975]), [1e-4, 3e-4])
    near(np.quantile([one.K for one in models], [0.5, 0.95]), [0.674 / 1.96 * 2e-6, 2e-6])
    assert min(one.B for one in models) == 0.0
    assert {one.T_B for one in models} == {50.0}
    assert {one.Q for one in models} == {0.0}
    assert {one.sinusoids[0].frequency for one in models} == {0.3}


def test_the_interval_of_a_budget() -> None:
    estimate = Estimate("likelihood", {"N": Parameter(1e-4, lower=0.8e-4, upper=1.5e-4)})
    models = draw_models(estimate, 3000, np.random.default_rng(2))
    start = Start.calibrated(10.0)
    budgets = [budget("heading", 5.0, gyro=m, accel=NOTHING, start=start) for m in models]
    best = budget("heading", 5.0, gyro=estimate.model, accel=NOTHING, start=start).total
    lower, upper = compute_limits([each.total for each in budgets], best)
    assert lower == pytest.approx(0.8 * best, rel=0.03)
    assert upper == pytest.approx(1.5 * best, rel=0.03)
