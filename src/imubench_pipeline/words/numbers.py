"""Formatting of numbers: digits, rounding and nouns, for pages, terminal and tables."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Context, Decimal
from functools import cache

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MIN_PLAIN, _MAX_PLAIN = Decimal("0.0001"), 1_000_000
_MAX_DIGITS = 7


NO_VALUE = "–"
"""Text of a number that does not exist."""


def number_text(value: float | None, digits: int = 4) -> str:
    """Return a number rounded to some digits, with a power of ten where it is small or large.

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


def join_names(names: Sequence[str]) -> str:
    """Return names as a list in a sentence: ``x, y and z``."""
    return " and ".join(filter(None, (", ".join(names[:-1]), *names[-1:])))


def digits_by(
    value: float | None, lower: float | None, upper: float | None, otherwise: int = 3
) -> int:
    """Return the number of significant digits of a value and its limits, from its interval.

    The last digit is the first of half the interval, or the second where that begins with 1. They
    are two at least. Where there are no limits or no value, they are as many as ``otherwise``.
    """
    if lower is None or upper is None or not upper > lower or not value:
        return otherwise
    half = (upper - lower) / 2.0
    if not math.isfinite(half):
        return 2
    place = _find_first_digit(half)
    place -= half < 2.0 * 10.0**place
    return min(max(_find_first_digit(abs(value)) - place + 1, 2), _MAX_DIGITS)


def _find_first_digit(value: float) -> int:
    """Return the power of ten of the first digit, ignoring rounding errors below a power of ten."""
    return math.floor(math.log10(value) + 1e-9)


def limit_digits(lower: float | None, upper: float | None, least: int = 3) -> int:
    """Return the number of digits at which printed limits differ visibly."""
    if lower is None or upper is None or not upper > lower:
        return least
    ratio = max(abs(lower), abs(upper)) / (upper - lower)
    return min(max(least, math.ceil(math.log10(ratio)) + 1), _MAX_DIGITS)


def duration_text(seconds: float | None) -> str:
    """Return a time in a suitable unit; `NO_VALUE` if there is none."""
    if seconds is None:
        return NO_VALUE
    for size, name in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{number_text(seconds / size, 3)} {name}"
    return f"{number_text(seconds, 3)} s"


def rates_text(rate: float | None, of_channels: Iterable[float]) -> str:
    """Return the rates of the channels of a recording, Hz, the highest first.

    ``rate``: of the recording, Hz, used where no channel has an Allan variance.
    """
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
    """A unit in which a figure is shown: its sign, and the factor from SI."""

    sign: str
    per_si: float

    def text(self, value: float | None, digits: int = 4) -> str:
        """Return an SI value in this unit, rounded to some digits; a dash if there is none."""
        return number_text(None if value is None else value * self.per_si, digits)

    def digits(self, value: float | None, lower: float | None, upper: float | None) -> int:
        """Return the number of digits of an SI value and its limits in this unit."""
        if value is None or lower is None or upper is None:
            return digits_by(value, None, None)
        return digits_by(value * self.per_si, lower * self.per_si, upper * self.per_si)


def interval_text(lower: float | None, upper: float | None, unit: Unit, least: int = 3) -> str:
    """Return ``lower to upper``; a dash if they are not known."""
    if lower is None or upper is None:
        return NO_VALUE
    digits = limit_digits(lower, upper, least)
    return f"{unit.text(lower, digits)} to {unit.text(upper, digits)}"


def sentence(text: str | None) -> str:
    """Return a text as a sentence: a capital first, a full stop at the end; empty if none."""
    return text[:1].upper() + text[1:].rstrip(".") + "." if text else ""


def started_text(started: str | None) -> str:
    """Return date and time without the T and a zero fraction."""
    return _ISO.sub(r"\1 \2", started or "")


_ISO = re.compile(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d(?::\d\d)?)(?:\.0+(?!\d))?")
