"""What the names of columns mean, as tools write them."""

from __future__ import annotations

import pytest

from imubench_pipeline.readers.inspection.names import (
    DERIVED,
    PLAIN,
    WEAK,
    WITHOUT_GRAVITY,
    interpret_label,
)
from imubench_pipeline.readers.stated_units import parse_unit
from imubench_pipeline.units import UnitError, find_conversion

MEANT = {
    "gyro_x": ("gyro", "x", None, PLAIN),
    "GyrY": ("gyro", "y", None, PLAIN),
    "wz": ("gyro", "z", None, PLAIN),
    "Gyroscope x (rad/s)": ("gyro", "x", "rad/s", PLAIN),
    "angular_velocity.x": ("gyro", "x", None, PLAIN),
    "AngularVelocityX": ("gyro", "x", None, PLAIN),
    "imu.gyro[1]": ("gyro", "1", None, PLAIN),
    "rate_x": ("gyro", "x", None, WEAK),
    "gx": ("gyro", "x", None, WEAK),
    "gyroRotationX(rad/s)": ("gyro", "x", "rad/s", PLAIN),
    "gyr_z_dps": ("gyro", "z", "deg/s", PLAIN),
    "gyro_x_bias": ("gyro", "x", None, DERIVED),
    "angular_velocity_covariance[1]": ("gyro", "1", None, DERIVED),
    "XGYRO_OUT (°/sec)": ("gyro", "x", "deg/s", PLAIN),
    "\N{GREEK SMALL LETTER OMEGA}_x [°/s]": ("gyro", "x", "deg/s", PLAIN),
    "acc_x": ("accel", "x", None, PLAIN),
    "ax": ("accel", "x", None, PLAIN),
    "ax_g": ("accel", "x", "g", PLAIN),
    "AccX": ("accel", "x", None, PLAIN),
    "xAccl": ("accel", "x", None, PLAIN),
    "ACCELEROMETER X (m/s²)": ("accel", "x", "m/s^2", PLAIN),
    "Linear Acceleration x (m/s^2)": ("accel", "x", "m/s^2", WITHOUT_GRAVITY),
    "FreeAcc_X": ("accel", "x", None, DERIVED),
    "motionUserAccelerationX(G)": ("accel", "x", "g", DERIVED),
    "accel_x_m_s2": ("accel", "x", "m/s^2", PLAIN),
    "temp": ("temperature", "", None, PLAIN),
    "Temperature (°C)": ("temperature", "", "degC", PLAIN),
    "T(°C)": ("temperature", "", "degC", WEAK),
    "temp_c": ("temperature", "", "degC", PLAIN),
}
NOTHING = [
    *("mag_x", "Mag_X", "x", "q_x", "Euler_X", "gyroAngleX", "AngleX(°)", "angular_acceleration_x"),
    *(
        "pressure",
        "template",
        "Accuracy_x",
        "position.x",
        "roll",
        "yaw (deg)",
        "max",
        "",
        "latitude",
    ),
    *("velocity_x (m/s)", "orientation.x", "b_x", "index", "GRAVITATION"),
]


@pytest.mark.parametrize("name", MEANT)
def test_a_name_means(name: str) -> None:
    found = interpret_label(name)
    assert found is not None
    assert (found.quantity, found.axis, found.unit, found.rank) == MEANT[name]


@pytest.mark.parametrize("name", NOTHING)
def test_a_name_means_nothing_of_an_inertial_sensor(name: str) -> None:
    assert interpret_label(name) is None


def test_an_axis_alone_means_what_its_table_is_called() -> None:
    found = interpret_label("x", "Gyroscope")
    assert found is not None and found.quantity == "gyro"
    found = interpret_label("y", "Linear Accelerometer")
    assert found is not None and (found.quantity, found.rank) == ("accel", WITHOUT_GRAVITY)


SPELLED = {
    "angular_rate": {
        "rad/s": ["rad/s", "rads", "radps", "rad_s", "rad_per_s", "RAD/S", "rad/sec"],
        "deg/s": ["deg/s", "°/s", "º/s", "dps", "DPS", "deg_s", "degps", "degrees/sec"],
        "mdps": ["mdps", "mdeg/s"],
        "mrad/s": ["mrad/s", "mrad_s"],
        "deg/h": ["deg/h", "deg/hr", "°/hour"],
    },
    "acceleration": {
        "m/s^2": ["m/s^2", "m/s2", "m_s2", "mps2", "m/s²", "m/s/s", "m/s**2", "ms^-2", "m s^-2"],
        "g": ["g", "G", "g's"],
        "mg": ["mg", "mG", "milli-g"],
        "ug": ["ug", "µg"],
    },
    "temperature": {"degC": ["degC", "°C", "C", "deg C", "Celsius"], "K": ["K", "kelvin"]},
    "time": {"s": ["s", "sec", "Seconds"], "ms": ["ms", "millis"], "us": ["us", "µs", "usec"],
             "ns": ["ns", "nsec"]},
}  # fmt: skip


@pytest.mark.parametrize("dimension", SPELLED)
def test_units_as_tools_write_them(dimension: str) -> None:
    for unit, spellings in SPELLED[dimension].items():
        for written in spellings:
            found = parse_unit(written, dimension)
            assert found is not None, written
            assert find_conversion(found, dimension) == pytest.approx(
                find_conversion(unit, dimension)
            )


@pytest.mark.parametrize("text", ["rps", "rpm", "LSB", "counts", "raw", "1/s", "", "g/s", "?"])
def test_what_is_no_unit_of_a_rate(text: str) -> None:
    assert parse_unit(text, "angular_rate") is None
    with pytest.raises(UnitError):
        find_conversion(text, "angular_rate")
