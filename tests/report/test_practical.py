import math
import re
from decimal import ROUND_HALF_UP, Decimal

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from imubench_pipeline.model.comparisons import DatasheetRow
from imubench_pipeline.report.practical import (
    choose_first_units,
    choose_page_unit,
    choose_unit,
    format_printed,
    list_page_units,
)
from imubench_pipeline.words import numbers
from imubench_pipeline.words.numbers import (
    Unit,
    count_digits,
    degrees_text,
    duration_text,
    interval_text,
    number_text,
    percent_text,
)

ASCII = str.maketrans("−⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "--0123456789")
SYMBOLS = {
    *(
        "Q",
        "N",
        "N_sensor",
        "B",
        "T_B",
        "K",
        "R",
        "B_curve",
        "sigma_min",
        "tau_min",
        "adev",
        "psd",
        "signal",
    ),
    *("sensitivity", "quadratic"),
}


def rounded(value: float, digits: int) -> Decimal:
    """Decimal's own rounding of the exact value of a float, half away from zero."""
    exact = Decimal(value)
    if not exact:
        return exact
    return exact.quantize(Decimal((0, (1,), exact.adjusted() - digits + 1)), ROUND_HALF_UP)


def number_of(text: str) -> Decimal:
    mantissa, _, power = text.partition("×10")
    return Decimal(mantissa.translate(ASCII)).scaleb(int(power.translate(ASCII) or 0))


magnitudes = st.builds(
    lambda sign, mantissa, power: sign * mantissa * 10.0**power,
    st.sampled_from([-1.0, 1.0]),
    st.floats(1.0, 9.999999999999),
    st.integers(-30, 30),
)


@given(magnitudes, st.integers(1, 7))
@example(999.95, 4)
@example(9.9995e-5, 4)
@example(-2.5, 1)
@example(999_999.5, 6)
@example(0.5, 1)
@example(12345.67, 7)
@example(8210.3, 5)
def test_a_number_is_rounded_as_decimal_arithmetic_rounds_it(value: float, digits: int) -> None:
    text = number_text(value, digits)
    assert number_of(text) == rounded(value, digits)
    plain = abs(rounded(value, digits))
    assert ("×10" in text) == (not Decimal("1e-4") <= plain < 10**6)
    mantissa = text.partition("×10")[0].lstrip("−")
    assert re.fullmatch(r"[0-9]+(\.[0-9]*[1-9])?", mantissa)
    assert text.startswith("−") == (value < 0)
    assert "-" not in text
    if "×10" in text:
        assert 1 <= Decimal(mantissa) < 10
        assert re.search(r"×10⁻?[¹²³⁴⁵⁶⁷⁸⁹][⁰¹²³⁴⁵⁶⁷⁸⁹]*$", text)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0.0, 4, "0"),
        (-0.0, 4, "0"),
        (1.0, 4, "1"),
        (-1.5, 4, "−1.5"),
        (0.00012345, 3, "0.000123"),
        (0.0001, 4, "0.0001"),
        (0.00009999, 4, "9.999×10⁻⁵"),
        (0.000099999, 4, "0.0001"),
        (999_949.0, 4, "999900"),
        (999_951.0, 4, "1×10⁶"),
        (-1.2345e-12, 3, "−1.23×10⁻¹²"),
        (6.02214e23, 2, "6×10²³"),
        (math.inf, 4, "∞"),
        (-math.inf, 4, "−∞"),
    ],
)
def test_numbers_as_they_are_printed(value: float, digits: int, text: str) -> None:
    assert number_text(value, digits) == text


@pytest.mark.parametrize(
    ("quantity", "symbol", "choice", "sign", "per_si"),
    [
        # 180 / pi = 57.29578°; 3600 s in an hour, 60 √s in √h; 1 g = 9.80665 m/s².
        ("gyro", "B", 0, "°/h", 206264.806),
        ("gyro", "adev", 0, "°/h", 206264.806),
        ("gyro", "N", 0, "°/√h", 3437.74677),
        ("gyro", "K", 0, "°/h/√h", 206264.806 * 60),
        ("gyro", "R", 0, "°/h/h", 206264.806 * 3600),
        ("gyro", "Q", 0, "°", 57.2957795),
        ("gyro", "psd", 0, "°/s/√Hz", 57.2957795),
        ("gyro", "signal", 0, "°/s", 57.2957795),
        ("gyro", "T_B", 0, "s", 1.0),
        ("gyro", "N", 1, "°/s/√Hz", 57.2957795),
        ("gyro", "K", 1, "°/s/√s", 57.2957795),
        ("gyro", "R", 1, "°/s/s", 57.2957795),
        ("accel", "B", 0, "µg", 101971.6213),
        ("accel", "N", 0, "µg/√Hz", 101971.6213),
        ("accel", "psd", 0, "µg/√Hz", 101971.6213),
        ("accel", "K", 0, "µg/√h", 101971.6213 * 60),
        ("accel", "R", 0, "µg/h", 101971.6213 * 3600),
        ("accel", "Q", 0, "m/s", 1.0),
        ("accel", "signal", 0, "mg", 101.9716213),
        ("accel", "N", 1, "m/s/√h", 60.0),
        ("accel", "B", 1, "mg", 101.9716213),
        ("accel", "K", 1, "mg/√h", 101.9716213 * 60),
        ("accel", "R", 1, "mg/h", 101.9716213 * 3600),
    ],
)
def test_units_of_pages_are_worth_what_books_say(
    quantity: str, symbol: str, choice: int, sign: str, per_si: float
) -> None:
    unit = list(list_page_units()[quantity].values())[choice][symbol]
    assert unit.sign == sign
    assert unit.per_si == pytest.approx(per_si, rel=2e-9)


def test_every_choice_has_every_symbol_and_the_last_is_si() -> None:
    for quantity, choices in list_page_units().items():
        for name, units in choices.items():
            assert set(units) == SYMBOLS, (quantity, name)
        last = list(choices.values())[-1]
        assert all(unit.per_si == pytest.approx(1.0, rel=1e-12) for unit in last.values())
        assert not any(mark in unit.sign for unit in last.values() for mark in "°gh")


@pytest.mark.parametrize(("system", "place"), [("practical", 0), ("si", -1)])
def test_a_page_opens_in_the_units_of_the_settings(system: str, place: int) -> None:
    for quantity, choices in list_page_units().items():
        assert choose_first_units(system)[quantity] == list(choices)[place]
        for symbol, unit in list(choices.values())[place].items():
            assert choose_page_unit(quantity, symbol, system) == unit


@pytest.mark.parametrize(
    ("dimension", "system", "sign", "per_si"),
    [
        ("angle", "practical", "°", 57.2957795),
        ("angle", "si", "rad", 1.0),
        ("velocity", "practical", "m/s", 1.0),
        ("length", "si", "m", 1.0),
    ],
)
def test_units_of_errors(dimension: str, system: str, sign: str, per_si: float) -> None:
    unit = choose_unit(dimension, system)
    assert unit.sign == sign
    assert unit.per_si == pytest.approx(per_si, rel=2e-9)


def test_a_value_has_the_unit_of_engineers_and_none_is_a_dash() -> None:
    degree_an_hour = math.pi / 180 / 3600
    unit = choose_page_unit("gyro", "B", "practical")
    assert unit.text(degree_an_hour) == "1"
    assert unit.text(12.3456 * degree_an_hour, 3) == "12.3"
    assert unit.text(None) == "–"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.5, "0.5 s"),
        (119.0, "119 s"),
        (120.0, "2 min"),
        (7199.0, "120 min"),
        (7200.0, "2 h"),
        (36 * 3600.0, "36 h"),
        (172_799.0, "48 h"),
        (172_800.0, "2 days"),
        (1e9, "11600 days"),
    ],
)
def test_duration_text_uses_readable_units(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


def test_an_interval_needs_both_ends() -> None:
    unit = Unit("x", 10.0)
    assert interval_text(0.1234, 2.0, unit) == interval_text(0.1234, 2.0, unit, 1.0) == "1.2 to 20"
    assert interval_text(1.234, 2.0, unit, 1.5) == "12 to 20"
    for lower, upper in ((None, 2.0), (0.1, None)):
        assert interval_text(lower, upper, unit) == "–"


@given(magnitudes, st.floats(1e-4, 1.0))
def test_the_ends_of_an_interval_are_seen_to_differ(lower: float, width: float) -> None:
    upper = lower + abs(lower) * width
    begin, _, end = interval_text(lower, upper, Unit("x", 1.0)).partition(" to ")
    assert number_of(begin) < number_of(end)
    digits = count_digits(None, lower, upper)
    assert 2 <= digits <= 7
    # No more digits than needed: the last one is a twentieth of the width or more.
    if digits > 2:
        assert 10.0 ** (2 - digits) * max(abs(lower), abs(upper)) > 0.0495 * (upper - lower)


@pytest.mark.parametrize(
    ("lower", "upper", "digits"),
    [
        (None, 1.0, 2),
        (1.0, None, 3),
        (1.0, 1.0, 3),
        (0.9, 1.1, 3),
        (0.9999, 1.0001, 6),
        (1.0, 1.0 + 1e-12, 7),
        (0.0, 1.0, 2),
    ],
)
def test_limits_have_as_many_digits_as_tell_them_apart(
    lower: float | None, upper: float | None, digits: int
) -> None:
    assert count_digits(None, lower, upper) == digits


def test_the_digits_of_a_parameter_have_limits_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numbers, "DIGITS", {**numbers.DIGITS, "B": (4, 5)})
    unit = Unit("x", 1.0, "B")
    assert unit.text(1.23456) == "1.235"
    assert unit.estimate_texts(1.23456, 1.0, 1.5) == ("1.235", "1 to 1.5")
    assert unit.estimate_texts(1.23456, 1.2345599, 1.2345601) == ("1.2346", "1.2346 to 1.2346")
    assert unit.estimate_texts(None, None, 1.23456) == ("–", "below 1.235")
    assert Unit("x", 1.0, "N").estimate_texts(1.23456, 1.0, 1.5) == ("1.2", "1 to 1.5")


def test_what_is_not_there_is_a_dash() -> None:
    assert number_text(None) == number_text(float("nan")) == "–"
    assert duration_text(None) == percent_text(None) == "–"
    assert degrees_text(None) == "–"
    assert format_printed(figure(printed=None, unit="deg/h")) == "–"
    assert format_printed(figure(printed=4.0, unit=None)) == "4"


def figure(*, printed: float | None, unit: str | None) -> DatasheetRow:
    return DatasheetRow(
        sensor="a",
        recording="r",
        channel="gyro_x",
        method="mean",
        quantity="offset",
        statistic="mean",
        printed=printed,
        unit=unit,
        verdict="not sure",
    )
