import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.units import SI_UNITS, UnitError, conversion, from_si, quantity_to_si, to_si

DEG = math.pi / 180
G = 9.80665


@pytest.mark.parametrize(
    ("value", "unit", "dimension", "si"),
    [
        (1, "deg/s", "angular_rate", DEG),
        (1, "°/s", "angular_rate", DEG),
        (1, "dps", "angular_rate", DEG),
        (1, "mdps", "angular_rate", DEG / 1e3),
        (3600, "deg/h", "angular_rate", DEG),
        (3600, "°/hr", "angular_rate", DEG),
        (1, "mrad/s", "angular_rate", 1e-3),
        (1, "g", "acceleration", G),
        (1, "mg", "acceleration", G / 1e3),
        (1, "µg", "acceleration", G / 1e6),
        (1, "μg", "acceleration", G / 1e6),
        (1, "m/s²", "acceleration", 1.0),
        (1, "mGal", "acceleration", 1e-5),
        (60, "deg/sqrt(h)", "gyro_density", DEG),
        (60, "°/√h", "gyro_density", DEG),
        (60, "°/√hr", "gyro_density", DEG),
        (60, "deg/rt-hr", "gyro_density", DEG),
        (1, "deg/s/sqrt(Hz)", "gyro_density", DEG),
        (1, "dps/√Hz", "gyro_density", DEG),
        (1, "(°/s)/√Hz", "gyro_density", DEG),
        (1, "dps/rtHz", "gyro_density", DEG),
        (1000, "mdps/√Hz", "gyro_density", DEG),
        (1, "rad/s^(1/2)", "gyro_density", 1.0),
        (1, "deg/√s", "gyro_density", DEG),
        (1, "µg/√Hz", "accel_density", G / 1e6),
        (60, "m/s/√h", "accel_density", 1.0),
        (1, "m/s^(3/2)", "accel_density", 1.0),
        (1, "°/h/√h", "gyro_random_walk", 8.080228e-8),
        (1, "deg/s^(3/2)", "gyro_random_walk", DEG),
        (1, "rad/s²/√Hz", "gyro_random_walk", 1.0),
        (60, "µg/√h", "accel_random_walk", G / 1e6),
        (1, "m/s^(5/2)", "accel_random_walk", 1.0),
        (1, "deg/s/K", "gyro_temperature_coefficient", DEG),
        (1, "dps/°C", "gyro_temperature_coefficient", DEG),
        (1, "mg/degC", "accel_temperature_coefficient", G / 1e3),
        (300, "K", "temperature", 26.85),
        (1, "kHz", "frequency", 1000.0),
        (1, "h", "time", 3600.0),
    ],
)
def test_known_conversions(value: float, unit: str, dimension: str, si: float) -> None:
    assert to_si(value, unit, dimension) == pytest.approx(si, rel=1e-7)


@given(
    st.sampled_from(
        [("deg/h", "angular_rate"), ("µg/√h", "accel_random_walk"), ("K", "temperature")]
    ),
    st.floats(-1e6, 1e6),
)
def test_round_trip(unit: tuple[str, str], value: float) -> None:
    assert from_si(to_si(value, *unit), *unit) == pytest.approx(value, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("dimension", SI_UNITS)
def test_si_units_are_their_own(dimension: str) -> None:
    assert conversion(SI_UNITS[dimension], dimension) == (pytest.approx(1.0), 0.0)


@pytest.mark.parametrize(
    ("unit", "dimension"),
    [
        ("deg", "angular_rate"),
        ("Hz", "angular_rate"),  # angles have a dimension: 1/s is not rad/s
        ("m/s", "acceleration"),
        ("deg/s", "gyro_density"),
        ("deg/√h", "angular_rate"),
        ("furlong", "acceleration"),
        ("", "acceleration"),
        ("deg//s", "angular_rate"),
    ],
)
def test_wrong_units_are_named(unit: str, dimension: str) -> None:
    with pytest.raises(UnitError) as error:
        conversion(unit, dimension)
    assert repr(unit) in str(error.value)
    assert "expected" in str(error.value)


def test_quantity_with_its_unit() -> None:
    assert quantity_to_si("100 Hz", "frequency") == 100.0
    assert quantity_to_si("1.5e-1 kHz", "frequency") == 150.0
    with pytest.raises(UnitError, match="number with its unit"):
        quantity_to_si("100", "frequency")
    with pytest.raises(UnitError, match="no unit of frequency"):
        quantity_to_si("100 s", "frequency")
