"""What turn-on bias, temperature, scale factor and vibration add to an error budget."""

import math
from itertools import pairwise
from typing import Any

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
    DATASHEET_KEY_OF_CAUSE,
    Figure,
    Use,
    collect_figures_in_use,
    levers,
    of_pulse,
    of_rise,
    of_squared_rise,
    read_datasheet_figures,
)
from imubench_pipeline.navigation.error_budget.parts import Contribution, Quantity
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated
from imubench_pipeline.settings.printed import IN_USE, Datasheet
from imubench_pipeline.words.verdicts import source_text
from tests.rows import typed

G = 9.80665
DEGREE = math.pi / 180
NOTHING = NoiseModel()
QUANTITIES: tuple[Quantity, ...] = ("attitude", "heading", "velocity", "position")
USE = Use(temperature_change=20.0, turns=2 * math.pi, speed_change=10.0, vibration=G, over=60.0)
CAUSES: tuple[Cause, ...] = (*DATASHEET_KEY_OF_CAUSE, "temperature_squared")


def figures(**sigmas: float) -> Any:
    return {cause: Figure(sigma=sigma, origin="datasheet") for cause, sigma in sigmas.items()}


EVERY_FIGURE = {cause: Figure(sigma=1e-3, origin="datasheet") for cause in CAUSES}


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
    found = budget(quantity, 60.0, gyro=NOTHING, accel=NOTHING, start=start, use=use, **given_)
    return {source_text(one.source): one.sigma for one in found.contributions if one.sigma}


def test_what_each_figure_adds_after_a_static_window() -> None:
    """A gyro of 0.01 deg/s/K, 0.1 % and 0.1 deg/s/g, an accelerometer of 1 mg/K, 0.2 %."""
    gyro = figures(turn_on_bias=1.0, temperature=1e-4, scale_factor=1e-3, g_sensitivity=2e-5)
    accel = figures(turn_on_bias=0.05 * G, temperature=1e-2, scale_factor=2e-3)
    accel |= figures(vibration_rectification=1e-5)
    given_ = {"gyro_figures": gyro, "accel_figures": accel}
    start = Start.calibrated(10.0)
    assert parts_of("heading", start, **given_) == {
        # Half of the whole change, on average.
        "gyro temperature": pytest.approx(1e-4 * 20.0 * 60.0 / 2.0),
        "gyro scale factor": pytest.approx(1e-3 * 2 * math.pi),
        "gyro g-sensitivity": pytest.approx(2e-5 * G * 60.0),
    }
    # The window takes off the bias; what it makes of it is a tilt of 50 mg over g.
    assert parts_of("attitude", start, **given_) == pytest.approx(
        parts_of("heading", start, **given_) | {"initial tilt by accel turn-on bias": 0.05}
    )
    assert parts_of("velocity", start, **given_) == {
        "gyro temperature": pytest.approx(G * 1e-4 * 20.0 * 60.0**2 / 6.0),
        "gyro g-sensitivity": pytest.approx(G * 2e-5 * G * 60.0**2 / 2.0),
        "accel temperature": pytest.approx(1e-2 * 20.0 * 60.0 / 2.0),
        "accel scale factor": pytest.approx(2e-3 * 10.0),
        "accel vibration rectification": pytest.approx(1e-5 * G**2 * 60.0),
    }
    assert parts_of("position", start, **given_)["accel scale factor"] == pytest.approx(
        # Speed comes evenly: half of the way that the whole change would make.
        2e-3 * 10.0 * 60.0 / 2.0
    )


def test_without_a_window_the_biases_of_the_datasheet_and_the_whole_change_stay() -> None:
    start = Start.uncalibrated(gyro_bias=None, accel_bias=0.1, on_time=60.0)
    known = figures(turn_on_bias=2e-3, repeatability=1e-3, temperature=1e-4)
    found = parts_of(
        "heading", start, use=Use(temperature_change=20.0, over=60.0), gyro_figures=known
    )
    assert found == {
        "gyro turn-on bias": pytest.approx(2e-3 * 60.0),
        "gyro repeatability": pytest.approx(1e-3 * 60.0),
        "gyro temperature": pytest.approx(1e-4 * 20.0 * 60.0),
    }
    # What the requirement states stands before what is printed.
    found = parts_of("velocity", start, use=Use(over=1.0), accel_figures=known)
    assert found == {"accel turn-on bias": pytest.approx(0.1 * 60.0)}


@pytest.mark.parametrize("quantity", QUANTITIES)
@given(st.booleans(), st.lists(st.sampled_from(CAUSES), unique=True))
@settings(max_examples=25)
def test_what_is_not_known_is_missing_and_what_is_adds_up(
    quantity: Quantity, calibrated: bool, unknown: list[Cause]
) -> None:
    """A figure is a part of the error or missed, unless another one speaks for it."""
    known = {cause: one for cause, one in EVERY_FIGURE.items() if cause not in unknown}
    start = (
        Start.calibrated(5.0)
        if calibrated
        else Start.uncalibrated(gyro_bias=None, accel_bias=None, on_time=5.0)
    )
    given_: dict[str, Any] = {"gyro": NOTHING, "accel": NOTHING, "start": start, "use": USE}
    whole = budget(quantity, 9.0, gyro_figures=EVERY_FIGURE, accel_figures=EVERY_FIGURE, **given_)
    found = budget(quantity, 9.0, gyro_figures=known, accel_figures=known, **given_)
    sources = {one.source: one for one in whole.contributions if one.figure and one.sigma}
    left = {one.source for one in found.contributions if one.figure and one.sigma}
    assert left == {name for name, one in sources.items() if one.source.source not in unknown}
    for one in found.missing:
        assert one.source.source in unknown
        assert one.lever * 1e-3 == pytest.approx(sources[one.source].sigma)
    missed = {one.source.source for one in found.missing}
    assert missed <= {"turn_on_bias", "temperature", "scale_factor", "g_sensitivity"} | {
        "vibration_rectification"
    }
    if {"turn_on_bias", "repeatability"} <= set(unknown) and not calibrated:
        assert "turn_on_bias" in missed
    squares = math.fsum(one.sigma**2 for one in found.contributions)
    assert found.total == pytest.approx(math.sqrt(squares))


@given(st.sampled_from(QUANTITIES), st.floats(-1.0, 2.5), st.booleans())
@settings(max_examples=40)
def test_the_limit_is_reached_at_the_time_found(
    quantity: Quantity, log_time: float, calibrated: bool
) -> None:
    start = (
        Start.calibrated(5.0)
        if calibrated
        else Start.uncalibrated(gyro_bias=None, accel_bias=None, on_time=5.0)
    )
    given_: dict[str, Any] = {
        "gyro": NoiseModel(N=1e-4),
        "accel": NoiseModel(N=1e-3),
        "start": start,
        "use": USE,
        "gyro_figures": EVERY_FIGURE,
        "accel_figures": EVERY_FIGURE,
    }
    limit = budget(quantity, 10.0**log_time, **given_).total
    assert time_until(limit, quantity, **given_) == pytest.approx(10.0**log_time, rel=1e-6)


def test_north_has_the_bias_of_the_gyro() -> None:
    known = figures(turn_on_bias=1e-6, repeatability=2e-6)
    compass = Gyrocompass(gyro=NoiseModel(N=1e-6), latitude=0.0, figures=known)
    found = compass.heading(400.0)
    biases = {
        source_text(one.source): one.sigma for one in found.contributions if not one.source.is_noise
    }
    assert biases == {
        "gyro turn-on bias": pytest.approx(1e-6 / EARTH_RATE),
        "gyro repeatability": pytest.approx(2e-6 / EARTH_RATE),
    }
    assert not found.assumptions and not found.missing
    assert compass.time_needed(2.2e-6 / EARTH_RATE) is None
    assert compass.time_needed(found.total) == pytest.approx(400.0)
    (missing,) = Gyrocompass(gyro=NoiseModel(N=1e-6), latitude=0.0).heading(9.0).missing
    assert (missing.source.source, missing.lever) == ("turn_on_bias", pytest.approx(1 / EARTH_RATE))


def test_nothing_happens_without_a_use() -> None:
    for measured in ("gyro", "accel"):
        found = levers(measured, 0, 9.0, Calibrated(1.0), Use(), seen=True)  # type: ignore[arg-type]  # one of two
        assert not list(found)
    stated = Uncalibrated(bias=0.1, on_time=0.0)
    assert not list(levers("gyro", 0, 9.0, stated, Use(), seen=True))
    with pytest.raises(ValueError, match="turns is -1"):
        Use(turns=-1.0)
    with pytest.raises(ValueError, match="over is 0"):
        Use(over=0.0)


# Figures of a datasheet


def sheet(**keys: Any) -> Datasheet:
    return Datasheet.model_validate({"gyro": keys})


@pytest.mark.parametrize(
    ("printed", "sigma", "kind"),
    [
        ({"value": 1, "kind": "1sigma"}, 1.0, "1sigma"),
        ({"value": 1, "kind": "typ"}, 1.0, "typ"),
        ({"value": 3, "kind": "max"}, 1.0, "max"),
        ({"value": [-2, 1], "kind": "range"}, 2.0 / math.sqrt(3.0), "range"),
        # A maximum says less than what is typical, and this less than what is stated as 1 sigma.
        ([{"value": 30, "kind": "max"}, {"value": 2, "kind": "typ"}], 2.0, "typ"),
        ([{"value": 5, "kind": "typ"}, {"value": 4, "kind": "1sigma"}], 4.0, "1sigma"),
        ([{"value": 5, "kind": "typ"}, {"value": 6, "kind": "typ"}], 6.0, "typ"),
        ({"value": {"x": 1, "yz": 2}, "kind": "typ"}, 2.0, "typ"),
    ],
)
def test_a_printed_figure_as_a_standard_deviation(printed: Any, sigma: float, kind: str) -> None:
    listed = printed if isinstance(printed, list) else [printed]
    found = read_datasheet_figures(
        sheet(offset=[one | {"unit": "deg/s"} for one in listed]), "gyro_z"
    )
    figure = found["turn_on_bias"]
    assert figure.sigma == pytest.approx(sigma * DEGREE)
    assert (figure.origin, figure.kind) == ("datasheet", kind)
    assert figure.convention


def test_what_is_not_printed_is_not_known_and_it_is_said_why() -> None:
    least = {"value": 1, "unit": "deg/s", "kind": "min"}
    option = {"value": 1, "unit": "deg/s/g", "kind": "typ", "option": "grade A"}
    found = read_datasheet_figures(
        sheet(offset=least, nonlinearity=None, g_sensitivity=option), "gyro_x"
    )
    assert {one.sigma for one in found.values()} == {None}
    reasons = {cause: one.reason or "" for cause, one in found.items()}
    assert "only a minimum" in reasons["turn_on_bias"]
    assert "does not publish" in reasons["nonlinearity"]
    assert "does not state" in reasons["scale_factor"]
    assert "grade A" in reasons["g_sensitivity"]
    assert set(DATASHEET_KEY_OF_CAUSE.values()) == set(IN_USE)


def test_units_of_ratios_and_of_vibration() -> None:
    keys = {
        "scale_factor_error": {"value": 0.1, "unit": "%"},
        "nonlinearity": {"value": 100, "unit": "ppm of FS"},
        "vibration_rectification": {"value": 2, "unit": "deg/h/g^2"},
    }
    found = read_datasheet_figures(sheet(**keys), "gyro_x")
    assert found["scale_factor"].sigma == pytest.approx(1e-3)
    assert found["nonlinearity"].sigma == pytest.approx(1e-4)
    assert found["vibration_rectification"].sigma == pytest.approx(2 * DEGREE / 3600 / G**2)


def test_what_a_log_tells_of_temperature_stands_before_the_datasheet() -> None:
    printed = sheet(temperature_coefficient={"value": 1, "unit": "deg/s/K"})
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
    assert "temperature_squared" not in found["gyro_x"]
    assert found["gyro_y"]["temperature"].origin == "datasheet"


# Runs of dead reckoning with drawn errors


def test_simulated_runs_agree() -> None:
    """4,000 runs of heading and of position in which everything is drawn, step by step.

    Over 20 seeds they differ from the closed form by 1.2 % (rms), 4.0 % at most.
    """
    rng = np.random.default_rng(5)
    runs, step, time = 4000, 0.05, 20.0
    use = Use(temperature_change=20.0, turns=3.0, speed_change=10.0, vibration=5.0, over=time)
    gyro = figures(temperature=1e-5, temperature_squared=4e-7, scale_factor=2e-3)
    gyro |= figures(g_sensitivity=1e-5)
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
    rate = rate + of_gyro["g_sensitivity"] * use.vibration
    turned = np.cumsum(rate + of_gyro["scale_factor"] * use.turns / time, axis=1) * step
    tilt = np.cumsum(rate, axis=1) * step - rate * step / 2
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
        assert sum(isinstance(one, Contribution) and one.sigma > 0.02 * closed for one in parts) > 3
