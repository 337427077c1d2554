import contextlib
import math
import re
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.units import (
    SI_UNITS,
    UnitError,
    convert_from_si,
    convert_to_si,
    find_conversion,
    find_dimension,
    parse_quantity,
)

# value, unit, dimension, SI; computed by hand: 1 deg = 0.0174532925199 rad, 1 g = 9.80665 m/s²
KNOWN = [
    (1, "deg/s", "angular_rate", 0.0174532925),
    (1, "°/s", "angular_rate", 0.0174532925),
    (1, "dps", "angular_rate", 0.0174532925),
    (250, "mdps", "angular_rate", 0.00436332313),
    (1, "deg/h", "angular_rate", 4.84813681e-6),
    (15.041, "°/hr", "angular_rate", 7.29208258e-5),
    (3600, "deg/h 1σ", "angular_rate", 0.0174532925),
    (1, "mrad/s", "angular_rate", 1e-3),
    (2, "milli-rad/s 1σ", "angular_rate", 2e-3),
    (0.1, "°/s-rms", "angular_rate", 0.00174532925),
    (60, "mdps RMS", "angular_rate", 0.00104719755),
    (10, "°/h rms, dT<=1°C/min", "angular_rate", 4.84813681e-5),
    (30, "º/s over -40..85 (total)", "angular_rate", 0.523598776),
    (4096, "deg/s*2^-12", "angular_rate", 0.0174532925),
    (1, "g", "acceleration", 9.80665),
    (1, "g0", "acceleration", 9.80665),
    (1, "mg", "acceleration", 9.80665e-3),
    (8, "mg(RMS)", "acceleration", 0.0784532),
    (1, "µg", "acceleration", 9.80665e-6),
    (1, "μg", "acceleration", 9.80665e-6),
    (1, "m/s²", "acceleration", 1.0),
    (1, "mGal", "acceleration", 1e-5),
    (0.008, "deg/s/sqrt(Hz)", "gyro_density", 1.396263402e-4),
    (1, "º/s /√Hz", "gyro_density", 0.0174532925),
    (1, "(°/s)/√Hz", "gyro_density", 0.0174532925),
    (1, "dps/rtHz", "gyro_density", 0.0174532925),
    (1, "°/s x Hz-1/2", "gyro_density", 0.0174532925),
    (1, "°/sec/√Hz rms", "gyro_density", 0.0174532925),
    (1, "mdps/√Hz", "gyro_density", 1.74532925e-5),
    (1, "mdps/VHz (OCR)", "gyro_density", 1.74532925e-5),
    (1, "deg/h/√Hz", "gyro_density", 4.84813681e-6),
    (1, "deg/sqrt(h)", "gyro_density", 2.90888209e-4),
    (0.34, "°/√hr", "gyro_density", 9.89019909e-5),
    (60, "deg/rt-hr", "gyro_density", 0.0174532925),
    (60, "°/rt hour", "gyro_density", 0.0174532925),
    (0.0122, "deg/√s", "gyro_density", 2.12930169e-4),
    (1, "rad/s^(1/2)", "gyro_density", 1.0),
    (120, "µg/√Hz", "accel_density", 1.176798e-3),
    (0.23, "mg/√Hz rms", "accel_density", 2.2555295e-3),
    (1, "m/s/√h", "accel_density", 0.0166666667),
    (1, "m/sec/√hr", "accel_density", 0.0166666667),
    (1, "fps/√hr", "accel_density", 0.00508),
    (1, "ft/s/√hr", "accel_density", 0.00508),
    (1, "m/s^(3/2)", "accel_density", 1.0),
    (1, "(°/s)²/Hz", "gyro_power_density", 3.04617420e-4),
    (1, "(deg/h)^2/Hz", "gyro_power_density", 2.35044305e-11),
    (1, "g²/Hz", "accel_power_density", 96.1703842),
    (1, "°/h/√h", "gyro_random_walk", 8.080228e-8),
    (6.8314e-5, "deg/s^(3/2)", "gyro_random_walk", 1.19230422e-6),
    (1, "°/s/√h", "gyro_random_walk", 2.90888209e-4),
    (1, "rad/s²/√Hz", "gyro_random_walk", 1.0),
    (1, "µg/√h", "accel_random_walk", 1.63444167e-7),
    (1, "m/s³/√Hz", "accel_random_walk", 1.0),
    (1, "m/s^(5/2)", "accel_random_walk", 1.0),
    (1, "deg", "gyro_quantization", 0.0174532925),
    (1, "arcsec", "gyro_quantization", 4.84813681e-6),
    (1, "deg/h/h", "gyro_ramp", 1.34670467e-9),
    (1, "ug/h", "accel_ramp", 2.72406944e-9),
    (0.05, "dps/°C", "gyro_temperature_coefficient", 8.72664626e-4),
    (1, "°/s per K", "gyro_temperature_coefficient", 0.0174532925),
    (1.5, "mg/degC", "accel_temperature_coefficient", 0.014709975),
    (1, "deg/s/g", "gyro_acceleration_coefficient", 1.77974054e-3),
    (1, "deg/s/g^2", "gyro_vibration_coefficient", 1.81483028e-4),
    (1, "mg/g²", "accel_vibration_coefficient", 1.01971621e-4),
    (0.5, "%", "ratio", 5e-3),
    (0.1, "% of FS", "ratio", 1e-3),
    (200, "ppm", "ratio", 2e-4),
    (30, "g", "mass", 0.03),
    (1.2, "kg", "mass", 1.2),
    (250, "mW", "power", 0.25),
    (4.375, "mdps/LSB", "gyro_step", 7.63581548e-5),
    (0.061, "mg/LSB", "accel_step", 5.9820565e-4),
    (131, "LSB/(º/s)", "gyro_sensitivity", 7505.74711),
    (1, "LSB/mg", "accel_sensitivity", 101.971621),
    (16384, "LSB/g", "accel_sensitivity", 1670.70304),
    (300, "K", "temperature", 26.85),
    (1, "kHz", "frequency", 1000.0),
    (1, "h", "time", 3600.0),
]


@pytest.mark.parametrize(("value", "unit", "dimension", "si"), KNOWN)
def test_known_conversions(value: float, unit: str, dimension: str, si: float) -> None:
    assert convert_to_si(value, unit, dimension) == pytest.approx(si, rel=3e-9)


@pytest.mark.parametrize(("unit", "dimension"), sorted({(row[1], row[2]) for row in KNOWN}))
@given(value=st.floats(-1e6, 1e6))
def test_every_unit_goes_there_and_back(unit: str, dimension: str, value: float) -> None:
    there = convert_to_si(value, unit, dimension)
    assert convert_from_si(there, unit, dimension) == pytest.approx(value, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("dimension", SI_UNITS)
def test_si_units_are_their_own(dimension: str) -> None:
    assert find_conversion(SI_UNITS[dimension], dimension) == (pytest.approx(1.0), 0.0)


# Each meaning of the collection of spellings: dimension, and the factor of its first spelling
# or, where the spellings differ, of each.
MEANINGS: dict[str, tuple[str, float | dict[str, float]]] = {
    "gyro amplitude density": ("gyro_density", 0.0174532925),
    "same, ST/TDK/Bosch": ("gyro_density", 1.74532925e-5),
    "gyro density, MicroStrain": ("gyro_density", 4.84813681e-6),
    "ARW N (two-sided": ("gyro_density", 2.90888209e-4),
    "ARW N (paper 003)": ("gyro_density", 0.0174532925),
    "N (paper 000": ("gyro_density", 1.0),
    "accel amplitude density": ("accel_density", {"mg": 9.80665e-3, "": 9.80665e-6}),
    "VRW N": ("accel_density", 0.0166666667),
    "VRW, US": ("accel_density", 0.00508),
    "N accel": ("accel_density", 1.0),
    "bias instability, in-run": ("angular_rate", 4.84813681e-6),
    "accel bias instability": (
        "acceleration",
        {"mGal": 1e-5, "mg": 9.80665e-3, "": 9.80665e-6},
    ),
    "rms at a stated": (
        "angular_rate acceleration",
        {"mg": 9.80665e-3, "mdps": 1.74532925e-5, "milli-rad": 1e-3, "": 0.0174532925},
    ),
    "true PSD": (
        "gyro_power_density accel_power_density",
        {"g²": 96.1703842, "(deg/h": 2.35044305e-11, "": 3.04617420e-4},
    ),
    "RRW K": (
        "gyro_random_walk",
        {"°/s/√h": 2.90888209e-4, "deg/h": 8.080228e-8, "rad": 1.0, "": 0.0174532925},
    ),
    "accel RW K": ("accel_random_walk", {"µg": 1.63444167e-7, "": 1.0}),
    "quantisation step": (
        "gyro_step accel_step gyro_sensitivity accel_sensitivity angular_rate",
        {
            "mdps/": 1.74532925e-5,
            "LSB/(": 57.2957795,
            "mg/": 9.80665e-3,
            "LSB/mg": 101.971621,
            "LSB/g": 0.101971621,
            "deg/s*2^-12": 4.26105774e-6,
            "rad": 1.0,
            "": 0.0174532925,
        },
    ),
    "offset temperature": (
        "gyro_temperature_coefficient angular_rate",
        {"mdps": 1.74532925e-5, "°/h": 4.84813681e-6, "": 0.0174532925},
    ),
}
EXPLAINED = re.compile(r"\(.*lost.*\)|^dB")


def test_every_spelling_of_the_collection_is_read_or_explained(shared: Path) -> None:
    collection = yaml.safe_load((shared / "facts/unit_zoo.yaml").read_text())
    read = explained = 0
    for entry in collection:
        key = next(key for key in MEANINGS if entry["means"].startswith(key))
        names, factors = MEANINGS[key]
        dimensions = tuple(names.split())
        for unit in entry["written"]:
            if EXPLAINED.search(unit):
                with pytest.raises(UnitError, match=r"has lost a sign|a level in decibels"):
                    find_dimension(unit, dimensions)
                explained += 1
                continue
            known = factors if isinstance(factors, dict) else {"": factors}
            factor = next(factor for start, factor in known.items() if unit.startswith(start))
            found, offset = find_conversion(unit, find_dimension(unit, dimensions))
            assert (found, offset) == (pytest.approx(factor, rel=3e-9), 0.0), unit
            read += 1
    assert (read, explained) == (82, 3)


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
        ("5 deg/s", "angular_rate"),
        ("LSB", "angular_rate"),
    ],
)
def test_wrong_units_are_named(unit: str, dimension: str) -> None:
    with pytest.raises(UnitError) as error:
        find_conversion(unit, dimension)
    assert repr(unit) in str(error.value)
    assert "expected" in str(error.value)


@pytest.mark.parametrize(
    ("unit", "dimension", "said"),
    [
        ("deg/h", "gyro_density", "no unit of gyro density but of angular rate"),
        ("µg/√Hz", "gyro_density", "no unit of gyro density but of accel density"),
        ("(°/s)²/Hz", "gyro_density", "no unit of gyro density but of gyro power density"),
        ("dps/°C", "angular_rate", "angular rate but of gyro temperature coefficient"),
        ("º/s over -40..85", "gyro_temperature_coefficient", "coefficient but of angular rate"),
        ("LSB/g", "accel_step", "no unit of accel step but of accel sensitivity"),
        ("m/s^7", "acceleration", r"no unit of acceleration \(it has "),
    ],
)
def test_both_dimensions_are_named(unit: str, dimension: str, said: str) -> None:
    with pytest.raises(UnitError, match=said):
        find_conversion(unit, dimension)


@pytest.mark.parametrize(
    ("unit", "dimension", "said"),
    [
        ("mdps/ Hz", "gyro_density", "sign of a root was lost, write 'mdps/sqrt(Hz)'"),
        ("deg/h", "gyro_density", "sign of a root was lost, write 'deg/sqrt(h)'"),
        ("m/s/h", "accel_density", "sign of a root was lost, write 'm/s/sqrt(h)'"),
        ("mdps/ Hz (lost root)", "gyro_density", "has lost a sign"),
        ("g/√Hz (micro lost)", "accel_density", "has lost a sign"),
        ("dB re 1 g/√Hz", "accel_density", "10^(level/20) times the reference"),
    ],
)
def test_a_spelling_that_lost_a_sign_is_not_guessed(unit: str, dimension: str, said: str) -> None:
    with pytest.raises(UnitError) as error:
        find_conversion(unit, dimension)
    assert said in str(error.value)


def test_which_of_several_dimensions() -> None:
    noise = ("gyro_density", "gyro_power_density")
    assert find_dimension("dps/√Hz", noise) == "gyro_density"
    assert find_dimension("(dps)²/Hz", noise) == "gyro_power_density"
    with pytest.raises(UnitError, match="expected a unit of gyro density"):
        find_dimension("g", noise)


def test_quantity_with_its_unit() -> None:
    assert parse_quantity("100 Hz", "frequency") == 100.0
    assert parse_quantity("1.5e-1 kHz", "frequency") == 150.0
    assert parse_quantity("8.4e-5 rad/√s", "gyro_density") == 8.4e-5
    with pytest.raises(UnitError, match="number with its unit"):
        parse_quantity("100", "frequency")
    with pytest.raises(UnitError, match="no unit of frequency but of time"):
        parse_quantity("100 s", "frequency")


@pytest.mark.parametrize(
    ("dimension", "said"),
    [
        ("angle", "deg, mrad or rad, written like '48 deg'"),
        ("time", "s, min, h, ms, us or ns, written like '10 s'"),
        ("temperature", "degC or K, written like '25 degC'"),
        ("frequency", "Hz or kHz, written like '100 Hz'"),
        ("gyro_ramp", "deg/h/h or deg/s^2, written like '1 deg/h/h'"),
    ],
)
def test_a_number_without_unit_is_told_how_it_is_written(dimension: str, said: str) -> None:
    with pytest.raises(UnitError) as error:
        parse_quantity("48", dimension)
    assert str(error.value).endswith(f"such as {said}")
    assert parse_quantity(said.split("'")[1], dimension) != 0.0


def test_the_printed_pair_of_a_data_sheet() -> None:
    # ADIS16470: 0.008 °/s/√Hz, one-sided, and 0.34 °/√h
    density = convert_to_si(0.008, "°/s/√Hz", "gyro_density")
    assert convert_from_si(density / math.sqrt(2), "°/√h", "gyro_density") == pytest.approx(
        0.339, abs=5e-4
    )


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9**9 rad/s", "(9**9)**(9**9)", "rad/s*9**9**9", "m^(9^9)", "m^(1/0)",
        "m^" + 70 * "9", "2 rad/s", "rad/s + 1", "rad/s//s", "m**2 3", "m**-", "m**(2", "()",
        "(m", "m)", "*m", "m*", "-m", "1e9 m", "0x10", "m[0]", "os.system('ls')",
        "__import__('os')", 90 * "(", 10**6 * "m",
    ],
)  # fmt: skip
def test_an_expression_is_no_unit_and_nothing_computes_it(text: str) -> None:
    with pytest.raises(UnitError) as caught:
        convert_to_si(1.0, text, "angular_rate")
    assert len(str(caught.value)) < 300


@given(st.text(max_size=60), st.sampled_from(sorted(SI_UNITS)))
def test_any_text_is_a_unit_or_an_error_that_says_so(text: str, dimension: str) -> None:
    with contextlib.suppress(UnitError):
        factor, offset = find_conversion(text, dimension)
        assert math.isfinite(factor) and factor > 0.0 and math.isfinite(offset)


@pytest.mark.parametrize(
    ("written", "factor"),
    [
        ("m/s^(3/2)", None),
        ("m s^-1", 1.0),
        ("m*s**(-1)", 1.0),
        ("1/(s/m)", 1.0),
        ("km/(h)", 1 / 3.6),
        ("s^(-2/2) m", 1.0),
    ],
)
def test_products_quotients_and_powers(written: str, factor: float | None) -> None:
    if factor is None:
        with pytest.raises(UnitError, match="no unit of velocity"):
            find_conversion(written, "velocity")
    else:
        assert find_conversion(written, "velocity")[0] == pytest.approx(factor, rel=1e-15)
