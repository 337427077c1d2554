"""Contributions of figures that a static log does not show to an error budget."""

import cmath
import json
import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.states import Cause
from imubench_pipeline.navigation.error_budget.budget import Start, budget, time_until
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.navigation.error_budget.in_use import (
    Figure,
    Use,
    collect_figures_in_use,
    list_levers,
    of_pulse,
    of_rise,
    of_squared_rise,
    read_figures,
    read_stated_figures,
    state_figures,
)
from imubench_pipeline.navigation.error_budget.parts import Quantity
from imubench_pipeline.navigation.error_budget.turns import Turn
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated
from imubench_pipeline.words.verdicts import source_text
from tests.rows import typed
from tests.starts import uncalibrated
from tests.test_class_limits import sensor

G = 9.80665
DEGREE = math.pi / 180
NOTHING = NoiseModel()
QUANTITIES: tuple[Quantity, ...] = ("attitude", "heading", "velocity", "position")
USE = Use(temperature_change=20.0, turns=2 * math.pi, speed_change=10.0, vibration=G, over=60.0)
ANGLE = math.sqrt(3.0) * G / (2 * math.pi * 10.0)
"""Velocity of the vibration of three axes, m/s: the angle by a g-sensitivity of 1, rms."""


def figures(**sigmas: float) -> Any:
    return {cause: Figure(sigma=sigma, origin="datasheet") for cause, sigma in sigmas.items()}


@given(st.integers(0, 2), st.floats(0.1, 30.0), st.floats(0.1, 30.0))
def test_growth_is_the_integral_of_what_grows(order: int, time: float, over: float) -> None:
    """The integral of (t - s)^m / m! z(s), by quadrature."""
    courses = {
        of_pulse: lambda s: float(s < over),
        of_rise: lambda s: min(s / over, 1.0),
        of_squared_rise: lambda s: min(s / over, 1.0) ** 2,
    }
    for closed, course in courses.items():

        def weighted(s: float, course: Any = course) -> float:
            return (time - s) ** order / math.factorial(order) * float(course(s))

        ends = sorted({0.0, min(over, time), time})
        parts = [quad(weighted, a, b)[0] for a, b in pairwise(ends)]
        assert closed(order, time, over) == pytest.approx(sum(parts), rel=1e-6, abs=1e-12)


def parts_of(quantity: Quantity, start: Start, use: Use = USE, **given_: Any) -> dict[str, float]:
    """Return the error after a minute by source; the ways of one figure are independent."""
    found = budget(quantity, 60.0, gyro=NOTHING, accel=NOTHING, start=start, use=use, **given_)
    parts: dict[str, float] = {}
    for one in found.contributions:
        if one.sigma > 1e-15:  # rounding, where a closed form is zero
            name = source_text(one.source)
            parts[name] = math.hypot(parts.get(name, 0.0), one.sigma)
    return parts


def test_what_each_figure_adds_after_a_static_window() -> None:
    """A gyro of 0.01 deg/s/K, 0.1 % and 0.1 deg/s/g, an accelerometer of 1 mg/K, 0.2 %."""
    gyro = figures(turn_on_bias=1.0, temperature=1e-4, scale_factor=1e-3, g_sensitivity=2e-5)
    gyro |= figures(scale_factor_temperature=3e-5, nonlinearity=4e-4)
    accel = figures(turn_on_bias=0.05 * G, temperature=1e-2, scale_factor=2e-3, misalignment=5e-3)
    accel |= figures(vibration_rectification=1e-5)
    given_ = {"gyro_figures": gyro, "accel_figures": accel}
    start = Start.calibrated(10.0)
    assert parts_of("heading", start, **given_) == {
        # Half of the whole change, on average.
        "gyro temperature": pytest.approx(1e-4 * 20.0 * 60.0 / 2.0),
        "gyro scale factor": pytest.approx(1e-3 * 2 * math.pi),
        "gyro scale factor over temperature": pytest.approx(3e-5 * 20.0 * 2 * math.pi),
        "gyro nonlinearity": pytest.approx(4e-4 * 2 * math.pi),
        # Vibration averages to zero; the angle swings about its first phase.
        "gyro g-sensitivity": pytest.approx(2e-5 * math.hypot(10.0, math.sqrt(2.0) * ANGLE)),
    }
    # The window takes off the bias; what it makes of it is a tilt of 50 mg over g. The turn is
    # about the vertical, so that the scale factor tilts nothing.
    heading = parts_of("heading", start, **given_)
    assert parts_of("attitude", start, **given_) == pytest.approx(
        {name: heading[name] for name in ("gyro temperature", "gyro g-sensitivity")}
        | {"initial tilt from accel turn-on bias": 0.05}
        | {"initial tilt from accel misalignment": 5e-3}
    )
    assert parts_of("velocity", start, **given_) == {
        "gyro temperature": pytest.approx(G * 1e-4 * 20.0 * 60.0**2 / 6.0),
        # The angle by the speed grows evenly, the one by vibration is there from the beginning.
        "gyro g-sensitivity": pytest.approx(G * 2e-5 * math.hypot(10.0 * 60.0 / 2.0, ANGLE * 60.0)),
        "accel temperature": pytest.approx(1e-2 * 20.0 * 60.0 / 2.0),
        "accel scale factor": pytest.approx(2e-3 * 10.0),
        "accel misalignment": pytest.approx(5e-3 * 10.0),
        "accel vibration rectification": pytest.approx(1e-5 * G**2 * 60.0),
        # A full circle: on average the bias that levelling hid is there once.
        "accel turn-on bias in the turn": pytest.approx(0.05 * G * 60.0),
        "accel misalignment in the turn": pytest.approx(5e-3 * G * 60.0),
    }
    assert parts_of("position", start, **given_)["accel scale factor"] == pytest.approx(
        # Speed comes evenly: half of the way that the whole change would make.
        2e-3 * 10.0 * 60.0 / 2.0
    )


def test_without_a_window_the_biases_of_the_datasheet_and_the_whole_change_stay() -> None:
    start = uncalibrated(gyro_bias=None, accel_bias=0.1, on_time=60.0)
    known = figures(turn_on_bias=2e-3, temperature=1e-4)
    found = parts_of(
        "heading", start, use=Use(temperature_change=20.0, over=60.0), gyro_figures=known
    )
    assert found == {
        "gyro turn-on bias": pytest.approx(2e-3 * 60.0),
        "gyro temperature": pytest.approx(1e-4 * 20.0 * 60.0),
    }
    # What the requirement states stands before what is printed.
    found = parts_of("velocity", start, use=Use(over=1.0), accel_figures=known)
    assert found == {"accel turn-on bias": pytest.approx(0.1 * 60.0)}


# Turns at speed


def integrate(function: Callable[[float], complex], time: float, *kinks: float) -> complex:
    """Return the integral from 0 to a time by quadrature."""
    total = 0j
    for start, end in pairwise(sorted({0.0, *(kink for kink in kinks if kink < time), time})):
        total += quad(lambda s: function(s).real, start, end)[0]
        total += 1j * quad(lambda s: function(s).imag, start, end)[0]
    return total


@pytest.mark.parametrize("time", [8.0, 20.0, 31.0])
@pytest.mark.parametrize("angle", [0.3, math.pi, 7.0])
def test_errors_in_a_turn_are_integrals_of_the_acceleration(time: float, angle: float) -> None:
    """Double integrals by quadrature, in the turn and after it."""
    over, speed = 20.0, 3.0
    turn, rate = Turn(angle, over, speed), angle / over

    def heading(s: float) -> float:
        return rate * min(s, over)

    def centripetal(s: float) -> complex:
        return 1j * rate * speed * cmath.exp(1j * heading(s)) if s < over else 0j

    def scale_factor(s: float) -> complex:  # the heading error turns the acceleration
        return 1j * heading(s) * centripetal(s)

    def misalignment(s: float) -> complex:  # the tilt is the integral of the projected rate
        return G * -1j * (cmath.exp(1j * heading(s)) - 1.0)

    for closed, acceleration in (
        (turn.scale_factor, scale_factor),
        (turn.misalignment, misalignment),
        (turn.accelerometer, centripetal),
    ):
        velocity = integrate(acceleration, time, over)
        position = integrate(lambda s, a=acceleration: (time - s) * a(s), time, over)
        assert closed(0, time) == pytest.approx(velocity, abs=1e-9)
        assert closed(1, time) == pytest.approx(position, abs=1e-9)
    across = integrate(lambda s: 1j * heading(s) * speed * cmath.exp(1j * heading(s)), time, over)
    assert turn.cross_track(time) == pytest.approx(across, abs=1e-9)


def test_a_full_circle_at_speed_by_hand() -> None:
    """360 deg in a minute at 2 m/s: the vehicle and the centripetal acceleration come back."""
    use = Use(turns=2 * math.pi, speed=2.0, over=60.0)
    start = Start.calibrated(10.0)
    known = figures(scale_factor=1e-3, misalignment=1e-3, g_sensitivity=1e-5)
    given_ = {"gyro_figures": known, "accel_figures": figures(scale_factor=1e-2, turn_on_bias=0.01)}
    rate = 2 * math.pi / 60.0
    assert parts_of("heading", start, use, **given_) == {
        "gyro scale factor": pytest.approx(1e-3 * 2 * math.pi),
        "gyro g-sensitivity in the turn": pytest.approx(1e-5 * 2.0 * 2 * math.pi),
    }
    # The velocity is s 2 pi v across the way; the tilt was 2 e at most, and is e on average.
    assert parts_of("velocity", start, use, **given_) == {
        "gyro scale factor in the turn": pytest.approx(1e-3 * 2 * math.pi * 2.0),
        "gyro misalignment in the turn": pytest.approx(1e-3 * G * 60.0),
        "gyro g-sensitivity in the turn": pytest.approx(
            1e-5 * 2.0 * math.hypot(2 * math.pi * 2.0, G * 60.0)
        ),
        # The turn carries the bias around; the tilt that cancelled it stays behind.
        "accel turn-on bias in the turn": pytest.approx(0.01 * 60.0),
    }
    assert parts_of("attitude", start, use, gyro_figures=known) == {
        "gyro misalignment in the turn": pytest.approx(2e-3),
        "gyro g-sensitivity in the turn": pytest.approx(2.0 * 2e-5),
    }
    # The accelerometer's: integral of v (exp(i psi) - 1), whose first part is zero.
    position = parts_of("position", start, use, **given_)
    assert position["accel scale factor in the turn"] == pytest.approx(1e-2 * 2.0 * 60.0)
    assert position["gyro scale factor in the turn"] == pytest.approx(
        1e-3 * 2.0 / rate * 2 * math.pi * 2.0
    )


def test_the_cross_track_error_is_the_speed_times_the_integral_of_the_heading() -> None:
    """1 deg/h/sqrt(h) on a straight way of two minutes at 3 m/s, and an initial error of 1 deg."""
    gyro, use = NoiseModel(N=1e-4), Use(speed=3.0, temperature_change=10.0, over=120.0)
    start = uncalibrated(gyro_bias=2e-5, accel_bias=None, on_time=0.0, heading=DEGREE)
    known = figures(temperature=1e-6)
    found = budget(
        "cross_track", 120.0, gyro=gyro, accel=NOTHING, start=start, use=use, gyro_figures=known
    )
    assert {source_text(one.source): one.sigma for one in found.contributions if one.sigma} == {
        "gyro N": pytest.approx(3.0 * 1e-4 * math.sqrt(120.0**3 / 3.0)),
        "gyro turn-on bias": pytest.approx(3.0 * 2e-5 * 120.0**2 / 2.0),
        "gyro temperature": pytest.approx(3.0 * 1e-5 * 120.0**2 / 2.0),
        "initial heading": pytest.approx(DEGREE * 360.0),
    }


@given(st.sampled_from(QUANTITIES), st.floats(-1.0, 2.5), st.booleans())
@settings(max_examples=40)
def test_the_limit_is_reached_at_the_time_found(
    quantity: Quantity, log_time: float, calibrated: bool
) -> None:
    start = (
        Start.calibrated(5.0)
        if calibrated
        else uncalibrated(gyro_bias=None, accel_bias=None, on_time=5.0)
    )
    every = figures(**dict.fromkeys(get_args(Cause), 1e-3))
    given_: dict[str, Any] = {
        "gyro": NoiseModel(N=1e-4),
        "accel": NoiseModel(N=1e-3),
        "start": start,
        "use": USE,
        "gyro_figures": every,
        "accel_figures": every,
    }
    limit = budget(quantity, 10.0**log_time, **given_).total
    found = time_until(limit, partial(budget, quantity, **given_))
    assert found == pytest.approx(10.0**log_time, rel=1e-6)


def test_north_has_the_biases_at_one_position_and_the_temperature_at_all() -> None:
    """At 45 deg the tilt of 1 mg, 1 mrad, is the heading error of the levelling."""
    compass: dict[str, Any] = {
        "gyro": NoiseModel(N=1e-6),
        "accel": NoiseModel(N=1e-3),
        "latitude": math.pi / 4,
        "figures": figures(turn_on_bias=2e-7, temperature=1e-8),
        "accel_figures": figures(turn_on_bias=1e-3 * G),
        "temperature_change": 8.0,
    }
    north = EARTH_RATE / math.sqrt(2.0)
    noise = [1e-6 / 20.0 / north, 1e-3 / 20.0 / G]
    for positions, others in (
        (1, [2e-7 / north, 1e-3, 1e-8 * 4.0 / north]),
        (2, [1e-8 * 2.0 / north]),
        (4, [1e-8 * 1.0 / north]),
    ):
        at = Gyrocompass(**compass, positions=positions)
        assert at.heading(400.0).total == pytest.approx(math.hypot(*noise, *others))
        assert at.time_needed(at.heading(400.0).total) == pytest.approx(400.0)
        # No time removes the figures.
        assert at.time_needed(0.99 * math.hypot(*others)) is None


def test_nothing_happens_without_a_use() -> None:
    for measured in ("gyro", "accel"):
        found = list_levers(measured, 0, 9.0, Calibrated(1.0), Use(), direct=True)  # type: ignore[arg-type]  # one of two
        assert not list(found)
    stated = Uncalibrated(bias=0.1, on_time=0.0)
    assert not list(list_levers("gyro", 0, 9.0, stated, Use(), direct=True))


# Figures of a sensor


def test_each_figure_is_printed_or_a_limit_of_the_class() -> None:
    printed = sensor({"scale_factor_error": {"value": 0.6, "unit": "%", "kind": "max"}})
    found = read_figures(printed, "gyro")
    scale = found["scale_factor"]
    assert (scale.sigma, scale.origin, scale.best) == (pytest.approx(2e-3), "datasheet", None)
    # Of consumer gyros, the LSM9DS1 has the largest offset, 30 deg/s, the ICM-45686 0.3 deg/s.
    bias = found["turn_on_bias"]
    assert bias.origin == "class limit"
    assert (bias.sigma, bias.best) == pytest.approx((30 * DEGREE, 0.3 * DEGREE), rel=1e-3)
    assert bias.at("in_use") == bias
    assert (bias.at("likely").sigma, bias.at("best").sigma) == (bias.likely, bias.best)
    assert {*found} == {*get_args(Cause)} - {"temperature_squared"}
    assert {*read_figures(None, "accel")} == {*found} - {"g_sensitivity"}
    stated = json.loads(json.dumps(state_figures(printed)))
    assert read_stated_figures(stated)["gyro"] == found


def test_what_a_log_tells_of_temperature_stands_before_the_datasheet() -> None:
    printed = {"gyro": figures(temperature=DEGREE, scale_factor=1e-3), "accel": figures()}
    rows = [
        {"channel": "gyro_x", "parameter": name, "status": status, "value": value,
         "lower": -3e-4, "upper": -1e-4}
        for name, status, value in (
            ("sensitivity", "ok", -2e-4), ("quadratic", "absent", None), ("lag", "ok", 9.0),
        )
    ]  # fmt: skip
    found = collect_figures_in_use(printed, ["gyro_x", "gyro_y"], typed(TemperatureRow, rows))
    measured = found["gyro_x"]["temperature"]
    assert (measured.sigma, measured.origin) == (2e-4, "measured")
    assert measured.spread == pytest.approx(1e-4 / 1.96)
    assert found["gyro_x"].keys() == {"temperature", "scale_factor"}
    assert found["gyro_y"] == found["gyro"] == printed["gyro"]


# Runs of dead reckoning with drawn errors


def test_simulated_runs_agree() -> None:
    """4,000 runs of heading and of position in which everything is drawn, step by step.

    Over 20 seeds they differ from the closed form by 1.2 % (rms), 4.0 % at most.
    """
    rng = np.random.default_rng(5)
    runs, step, time = 4000, 0.05, 20.0
    use = Use(temperature_change=20.0, turns=3.0, speed_change=10.0, vibration=5.0,
              vibration_frequency=0.5, over=time)  # fmt: skip
    gyro = figures(temperature=1e-5, temperature_squared=4e-7, scale_factor=2e-3)
    gyro |= figures(g_sensitivity=1e-4)
    accel = figures(temperature=1e-3, scale_factor=5e-3, vibration_rectification=4e-4)
    at = (np.arange(round(time / step)) + 0.5) * step
    change = use.temperature_change * at / time

    def drawn(known: dict[str, Figure]) -> dict[str, Any]:
        return {
            cause: (one.sigma or 0.0) * rng.standard_normal((runs, 1))
            for cause, one in known.items()
        }

    of_gyro, of_accel = drawn(gyro), drawn(accel)
    rate = of_gyro["temperature"] * change + of_gyro["temperature_squared"] * change**2
    rate = rate + of_gyro["g_sensitivity"] * use.speed_change / time
    turned = np.cumsum(rate + of_gyro["scale_factor"] * use.turns / time, axis=1) * step
    tilt = np.cumsum(rate, axis=1) * step - rate * step / 2
    # The integral of a vibration of three axes that begins at any phase.
    frequency, phase = 2 * np.pi * 0.5, rng.uniform(0.0, 2 * np.pi, (3, runs, 1))
    own = gyro["g_sensitivity"].sigma * rng.standard_normal((3, runs, 1))
    swing = np.sin(frequency * at + phase) - np.sin(phase)
    angle = math.sqrt(2.0) * use.vibration / frequency * np.sum(own * swing, axis=0)
    turned, tilt = turned + angle, tilt + angle
    shaken = math.sqrt(2.0) * use.vibration * np.sin(2 * np.pi * 7.3 * at)
    force = of_accel["temperature"] * change + of_accel["vibration_rectification"] * shaken**2
    force = force + of_accel["scale_factor"] * use.speed_change / time + G * tilt
    velocity = np.cumsum(force, axis=1) * step
    position = np.sum(velocity - force * step / 2, axis=1) * step
    given_: dict[str, Any] = {"gyro": NOTHING, "accel": NOTHING, "start": Start.calibrated(5.0)}
    given_ |= {"use": use, "gyro_figures": gyro, "accel_figures": accel}
    errors: dict[Quantity, Any] = {"heading": turned[:, -1], "position": position}
    for quantity, simulated in errors.items():
        closed = budget(quantity, time, **given_).total
        assert math.sqrt(np.mean(simulated**2)) == pytest.approx(closed, rel=0.05)
        parts = budget(quantity, time, **given_).contributions
        assert sum(one.sigma > 0.02 * closed for one in parts) > 3
