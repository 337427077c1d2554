"""Number of significant digits of a printed value, from its interval."""

from __future__ import annotations

import math

_MAX_DIGITS = 7


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
    """Return the power of ten of the first digit; a rounding error below a power of ten is none."""
    return math.floor(math.log10(value) + 1e-9)
