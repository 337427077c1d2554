"""Formatting of numbers: digits, rounding and nouns, for pages, terminal and tables."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Context, Decimal
from functools import cache

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MIN_PLAIN, _MAX_PLAIN = Decimal("0.0001"), 1_000_000

DIGITS: Mapping[str, tuple[int, int]] = {"default": (2, 7)}
"""Minimum and maximum digits of a value by parameter, such as ``B``."""

_DIGITS_WITHOUT_INTERVAL = 3


NO_VALUE = "–"
"""Text of a number that does not exist."""


def number_text(value: float | None, digits: int = 4) -> str:
    """Return a number with ``digits`` significant digits, and a power of ten if small or large.

    None and NaN are `NO_VALUE`. Halves are rounded away from zero. ``numberText`` in
    ``report/static/numbers.js`` gives the same texts; a test compares them.
    """
    if value is None or math.isnan(value):
        return NO_VALUE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    exact = Decimal(value)
    rounded = _rounding(digits).create_decimal(exact)
    if rounded == 0 or _MIN_PLAIN <= abs(rounded) < _MAX_PLAIN:
        text = _without_zeros(format(abs(rounded), "f"))
    else:
        mantissa, exponent = f"{abs(rounded):.{digits - 1}e}".split("e")
        power = str(int(exponent)).translate(_SUPERSCRIPTS)
        text = f"{_without_zeros(mantissa)}×10{power}"
    return "−" + text if rounded < 0 else text


@cache
def _rounding(digits: int) -> Context:
    return Context(prec=digits, rounding=ROUND_HALF_UP)


def _without_zeros(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def counted(number: int, singular: str, plural: str | None = None) -> str:
    """Return a number with its noun: ``1 recording``, ``3 recordings``."""
    return f"{number} {singular if number == 1 else plural or singular + 's'}"


def join_names(names: Sequence[str], by: str = "and") -> str:
    """Return names as a list in a sentence, with ``by`` before the last: ``x, y and z``."""
    return f" {by} ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def join_first(texts: Sequence[str], most: int) -> str:
    """Return the first texts of a list, and how many more there are."""
    more = len(texts) - most
    return "; ".join(texts[:most]) + (f"; and {more} more" if more > 0 else "")


def digit_limits(parameter: str = "") -> tuple[int, int]:
    """Return the least and greatest number of significant digits; by default, of any parameter."""
    return DIGITS.get(parameter) or DIGITS["default"]


def count_digits(
    value: float | None, lower: float | None, upper: float | None, parameter: str = ""
) -> int:
    """Return the number of significant digits of a value and its limits, from its interval.

    The last digit is at the place of the first digit of half the interval, or of the second if it
    begins with 1. There are more digits if the limits would be equal as printed. An upper limit
    without a value is an interval from 0. ``report/static/numbers.js`` does the same.
    """
    least, most = digit_limits(parameter)
    digits = _DIGITS_WITHOUT_INTERVAL
    lower = 0.0 if value is None and lower is None else lower
    if lower is not None and upper is not None and upper > lower:
        half = (upper - lower) / 2.0
        if not math.isfinite(half):
            return least
        largest = max(abs(lower), abs(upper))
        place = _find_first_digit(half)
        place -= half < 2.0 * 10.0**place
        digits = _find_first_digit(abs(value or largest)) - place + 1
        digits = max(digits, math.ceil(math.log10(largest / (upper - lower))) + 1)
    return min(max(digits, least), most)


def _find_first_digit(value: float) -> int:
    """Return the power of ten of the first digit, ignoring rounding errors below a power of ten."""
    return math.floor(math.log10(value) + 1e-9)


def duration_text(seconds: float | None, digits: int = 3) -> str:
    """Return a time, given in s, in a suitable unit; `NO_VALUE` if there is none."""
    if seconds is None:
        return NO_VALUE
    for size, name in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{number_text(seconds / size, digits)} {name}"
    return f"{number_text(seconds, digits)} s"


def rates_text(rate: float | None, of_channels: Iterable[float]) -> str:
    """Return the rates of the channels, Hz, the highest first; without any, ``rate``."""
    rates = sorted({float(f"{each:.6g}") for each in of_channels}, reverse=True)
    texts = list(dict.fromkeys(map(number_text, rates))) or [number_text(rate)]
    return f"{join_names(texts)} Hz"


def percent_text(share: float | None, digits: int = 3) -> str:
    """Return a fraction in per cent; `NO_VALUE` if there is none."""
    return NO_VALUE if share is None else f"{number_text(100.0 * share, digits)} %"


def degrees_text(angle: float | None, digits: int = 4) -> str:
    """Return an angle, given in rad, in degrees; `NO_VALUE` if there is none."""
    return NO_VALUE if angle is None else f"{number_text(math.degrees(angle), digits)}°"


@dataclass(frozen=True)
class Unit:
    """A unit in which a figure is shown: its symbol, and its value of one SI unit."""

    sign: str
    per_si: float
    parameter: str = ""  # sets the number of digits, as in `DIGITS`

    def text(self, value: float | None, digits: int | None = None) -> str:
        """Return an SI value in this unit; ``digits`` None: by `digits`; a dash without a value."""
        if digits is None:
            digits = self.digits(value, None, None)
        return number_text(None if value is None else value * self.per_si, digits)

    def digits(self, value: float | None, lower: float | None, upper: float | None) -> int:
        """Return the number of digits of an SI value and its limits in this unit."""
        if upper is None or (lower is None and value is not None):  # no interval
            return count_digits(1.0, None, None, self.parameter)
        value, lower, upper = (
            None if size is None else size * self.per_si for size in (value, lower, upper)
        )
        return count_digits(value, lower, upper, self.parameter)

    def estimate_texts(
        self, value: float | None, lower: float | None, upper: float | None
    ) -> tuple[str, str]:
        """Return an SI value and its interval, or ``below`` an upper limit, as texts."""
        digits = self.digits(value, lower, upper)
        if value is None and not lower and upper is not None:
            return NO_VALUE, f"below {self.text(upper, digits)}"
        return self.text(value, digits), interval_text(lower, upper, self, value)


def interval_text(
    lower: float | None, upper: float | None, unit: Unit, value: float | None = None
) -> str:
    """Return ``lower to upper`` (SI) in a unit, to the digits of ``value``; a dash if unknown."""
    if lower is None or upper is None:
        return NO_VALUE
    digits = unit.digits(value, lower, upper)
    return f"{unit.text(lower, digits)} to {unit.text(upper, digits)}"


def sentence(text: str | None) -> str:
    """Return a text as a sentence: a capital first, a full stop at the end; empty if none."""
    return text[:1].upper() + text[1:].rstrip(".") + "." if text else ""


def started_text(started: str | None) -> str:
    """Return date and time without the T and a zero fraction."""
    return _ISO.sub(r"\1 \2", started or "")


_ISO = re.compile(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d(?::\d\d)?)(?:\.0+(?!\d))?")
