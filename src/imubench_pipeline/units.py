"""Every unit that a log, a setting or a datasheet writes, converted to SI and back.

The registry is ours: angles have a dimension of their own, so that °/s and Hz, or rad/s and
1/s, cannot be mixed up, and ``g`` is standard gravity, not gram.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint

STANDARD_GRAVITY = 9.80665
"""m/s² in one g."""

SI_UNITS: dict[str, str] = {
    "angular_rate": "rad/s",
    "acceleration": "m/s^2",
    "temperature": "degC",
    "frequency": "Hz",
    "time": "s",
    "gyro_density": "rad/s/sqrt(Hz)",
    "accel_density": "m/s^2/sqrt(Hz)",
    "gyro_random_walk": "rad/s/sqrt(s)",
    "accel_random_walk": "m/s^2/sqrt(s)",
    "gyro_quantization": "rad",
    "accel_quantization": "m/s",
    "gyro_ramp": "rad/s^2",
    "accel_ramp": "m/s^3",
    "gyro_temperature_coefficient": "rad/s/K",
    "accel_temperature_coefficient": "m/s^2/K",
}
"""The dimensions that the project knows, each with the SI unit that it is kept in."""

_EXAMPLES: dict[str, str] = {
    "angular_rate": "deg/s, deg/h, mrad/s or rad/s",
    "acceleration": "m/s^2, g, mg or ug",
    "temperature": "degC or K",
    "frequency": "Hz or kHz",
    "time": "s, ms, us or ns",
    "gyro_density": "deg/s/sqrt(Hz), mdps/sqrt(Hz) or deg/sqrt(h)",
    "accel_density": "ug/sqrt(Hz) or m/s/sqrt(h)",
    "gyro_random_walk": "deg/h/sqrt(h) or deg/s^(3/2)",
    "accel_random_walk": "ug/sqrt(h) or m/s^(5/2)",
    "gyro_quantization": "deg or arcsec",
    "accel_quantization": "m/s or mm/s",
    "gyro_ramp": "deg/h/h or deg/s^2",
    "accel_ramp": "ug/h or m/s^3",
    "gyro_temperature_coefficient": "deg/s/K",
    "accel_temperature_coefficient": "mg/K",
}

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = u- = µ- = μ-
milli- = 1e-3 = m-
kilo- = 1e3 = k-
second = [time] = s = sec
meter = [length] = m = metre
radian = [angle] = rad
kelvin = [temperature] = K
degree_Celsius = kelvin; offset: 273.15 = degC
minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second = d
hertz = 1 / second = Hz
degree = 0.017453292519943295 * radian = deg
degree_per_second = degree / second = dps
standard_gravity = 9.80665 * meter / second ** 2 = g = g0
gal = 0.01 * meter / second ** 2 = Gal
foot = 0.3048 * meter = ft
foot_per_second = foot / second = fps
"""


class UnitError(ValueError):
    """A unit that is not known, or that has another dimension than the one expected."""


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[float]:
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    for line in _DEFINITIONS.strip().splitlines():
        registry.define(line)
    return registry


def _normalise(text: str) -> str:
    """Rewrite a vendor's spelling (°/√h, dps/rtHz, m/s²) as an expression for the registry."""
    unit = re.sub(
        r"[\s-]*(\(?\brms\b\)?|1\s*[σs]igma|1\s*σ)\s*$", "", text.strip(), flags=re.IGNORECASE
    )
    unit = re.sub(r"\bx\s*Hz\s*\^?-1/2", "/sqrt(Hz)", unit)
    unit = re.sub(r"\bm/s2\b", "m/s^2", unit)
    for written, meant in (("²", "^2"), ("³", "^3"), ("−", "-"), ("·", "*"), ("×", "*")):
        unit = unit.replace(written, meant)
    unit = re.sub(r"[°º]\s*C\b|\bdeg\s*C\b|\bcelsius\b", "degC", unit, flags=re.IGNORECASE)
    unit = re.sub(r"[°º]", "deg", unit)
    unit = re.sub(r"√\s*\(?\s*([A-Za-z]+)\s*\)?", r"sqrt(\1)", unit)
    unit = re.sub(r"\b(?:rt|root)[\s-]*([A-Za-z]+)", r"sqrt(\1)", unit)
    unit = re.sub(r"sqrt\s*\(\s*([A-Za-z]+)\s*\)", r"(\1)**0.5", unit, flags=re.IGNORECASE)
    unit = re.sub(r"\^\s*\(\s*(\d+)\s*/\s*(\d+)\s*\)", _power, unit)
    unit = unit.replace("^", "**")
    unit = re.sub(r"\b(hour|Hr)\b", "h", unit)
    # A difference of temperatures is meant wherever degC is not alone.
    return unit if unit == "degC" else re.sub(r"\bdegC\b", "K", unit)


def _power(match: re.Match[str]) -> str:
    return f"**{int(match[1]) / int(match[2])}"


def _expected(dimension: str) -> str:
    return f"expected a unit of {dimension.replace('_', ' ')} such as {_EXAMPLES[dimension]}"


@lru_cache(maxsize=1024)
def _converter(unit: str, dimension: str) -> tuple[float, float]:
    import pint

    registry = _registry()
    target = registry.Quantity(1.0, _normalise(SI_UNITS[dimension])).units
    try:
        if "//" in unit:
            raise pint.UndefinedUnitError(unit)
        source = registry.parse_units(_normalise(unit))
        zero, one = (registry.Quantity(value, source).to(target).magnitude for value in (0.0, 1.0))
    except pint.UndefinedUnitError as error:
        raise UnitError(f"unknown unit {unit!r}; {_expected(dimension)}") from error
    except pint.DimensionalityError as error:
        raise UnitError(
            f"{unit!r} is no unit of {dimension.replace('_', ' ')}; {_expected(dimension)}"
        ) from error
    except Exception as error:  # the registry raises many kinds on text that is no unit
        raise UnitError(f"cannot read {unit!r} as a unit; {_expected(dimension)}") from error
    return float(one - zero), float(zero)


def conversion(unit: str, dimension: str) -> tuple[float, float]:
    """Return ``(factor, offset)`` with ``si = factor * value + offset``.

    Parameters
    ----------
    unit : str
        As a vendor writes it, for instance ``°/√h``, ``dps/√Hz`` or ``µg``.
    dimension : str
        A key of `SI_UNITS`.

    Raises
    ------
    UnitError
        If the unit is unknown or of another dimension; the text names what was expected.
    """
    return _converter(unit, dimension)


def to_si(value: float, unit: str, dimension: str) -> float:
    """Convert one value to the SI unit of its dimension (see `conversion`)."""
    factor, offset = conversion(unit, dimension)
    return factor * value + offset


def from_si(value: float, unit: str, dimension: str) -> float:
    """Convert one SI value to ``unit`` (see `conversion`)."""
    factor, offset = conversion(unit, dimension)
    return (value - offset) / factor


_QUANTITY = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.].*)$")


def quantity_to_si(text: str, dimension: str) -> float:
    """Read a number with its unit, such as ``100 Hz``, into SI.

    Raises
    ------
    UnitError
        If there is no number, no unit, or a unit of another dimension.
    """
    match = _QUANTITY.match(str(text))
    if not match:
        raise UnitError(
            f"{text!r} is not a number with its unit; {_expected(dimension)}, "
            f"written like '100 {SI_UNITS[dimension]}'"
        )
    return to_si(float(match[1]), match[2], dimension)
