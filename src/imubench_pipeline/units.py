"""Convert the units of logs, settings and datasheets to SI and back.

The registry is our own: angles have a dimension, so that °/s and Hz cannot be confused; ``g`` is
standard gravity, or gram if only a mass is expected; ``LSB`` is a count.
"""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pint

_DIMENSIONS: dict[str, tuple[str, str]] = {
    "angular_rate": ("rad/s", "deg/s, deg/h, mrad/s or rad/s"),
    "acceleration": ("m/s^2", "m/s^2, g, mg or ug"),
    "temperature": ("degC", "degC or K"),
    "frequency": ("Hz", "Hz or kHz"),
    "time": ("s", "s, min, h, ms, us or ns"),
    "angle": ("rad", "deg, mrad or rad"),
    "velocity": ("m/s", "m/s or km/h"),
    "length": ("m", "m, km or cm"),
    "gyro_density": ("rad/s/sqrt(Hz)", "deg/s/sqrt(Hz), mdps/sqrt(Hz) or deg/sqrt(h)"),
    "accel_density": ("m/s^2/sqrt(Hz)", "ug/sqrt(Hz) or m/s/sqrt(h)"),
    "gyro_power_density": ("(rad/s)^2/Hz", "(deg/s)^2/Hz or (deg/h)^2/Hz"),
    "accel_power_density": ("(m/s^2)^2/Hz", "g^2/Hz or (m/s^2)^2/Hz"),
    "gyro_random_walk": ("rad/s/sqrt(s)", "deg/h/sqrt(h) or deg/s^(3/2)"),
    "accel_random_walk": ("m/s^2/sqrt(s)", "ug/sqrt(h) or m/s^(5/2)"),
    "gyro_quantization": ("rad", "deg or arcsec"),
    "accel_quantization": ("m/s", "m/s or mm/s"),
    "gyro_ramp": ("rad/s^2", "deg/h/h or deg/s^2"),
    "accel_ramp": ("m/s^3", "ug/h or m/s^3"),
    "gyro_temperature_coefficient": ("rad/s/K", "deg/s/K"),
    "accel_temperature_coefficient": ("m/s^2/K", "mg/K"),
    "gyro_temperature_curvature": ("rad/s/K^2", "deg/s/K^2"),
    "accel_temperature_curvature": ("m/s^2/K^2", "mg/K^2"),
    "gyro_acceleration_coefficient": ("rad/s/(m/s^2)", "deg/s/g or deg/h/g"),
    "gyro_vibration_coefficient": ("rad/s/(m/s^2)^2", "deg/s/g^2 or deg/h/g^2"),
    "accel_vibration_coefficient": ("m/s^2/(m/s^2)^2", "mg/g^2 or ug/g^2"),
    "gyro_step": ("rad/s/LSB", "mdps/LSB or deg/s/LSB"),
    "accel_step": ("m/s^2/LSB", "mg/LSB or m/s^2/LSB"),
    "gyro_sensitivity": ("LSB/(rad/s)", "LSB/(deg/s)"),
    "accel_sensitivity": ("LSB/(m/s^2)", "LSB/g or LSB/mg"),
    "ratio": ("1", "% or ppm"),
    "ratio_temperature_coefficient": ("1/K", "%/K or ppm/K"),
    "mass": ("kg", "g or kg"),
    "power": ("W", "W or mW"),
}
"""SI unit of each dimension, and examples of other units for errors."""

SI_UNITS: dict[str, str] = {name: si for name, (si, _) in _DIMENSIONS.items()}
"""SI unit of each dimension."""

_WRITTEN: dict[str, str] = {
    "temperature": "25 degC",
    "frequency": "100 Hz",
    "time": "10 s",
    "angle": "48 deg",
    "mass": "30 g",
}
"""How a quantity is written, where 1 of its first unit is an odd example."""

_DEFINITIONS = """
nano- = 1e-9 = n-
micro- = 1e-6 = u- = µ- = μ-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
kilo- = 1e3 = k-
second = [time] = s = sec
meter = [length] = m = metre
radian = [angle] = rad
kelvin = [temperature] = K
least_significant_bit = [count] = LSB = lsb
degree_Celsius = kelvin; offset: 273.15 = degC
minute = 60 * second = min
hour = 3600 * second = h = hr
day = 86400 * second = d
hertz = 1 / second = Hz
degree = 0.017453292519943295 * radian = deg
arcsecond = 4.84813681109536e-06 * radian = arcsec
degree_per_second = degree / second = dps
standard_gravity = 9.80665 * meter / second ** 2 = g = g0
gal = 0.01 * meter / second ** 2 = Gal
foot = 0.3048 * meter = ft
foot_per_second = foot / second = fps
percent = 0.01
ppm = 1e-6
kilogram = [mass] = kg
gram = 0.001 * kilogram
watt = [power] = W
"""


class UnitError(ValueError):
    """An unknown unit, or a unit of an unexpected dimension."""


@contextmanager
def add_key_to_errors(key: str) -> Iterator[None]:
    """Put a key in front of the message of a `UnitError` that the block raises."""
    try:
        yield
    except UnitError as error:
        raise UnitError(f"{key}{error}") from error


@lru_cache(maxsize=1)
def _registry() -> "pint.UnitRegistry[float]":
    import pint

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(None)
    for line in _DEFINITIONS.strip().splitlines():
        registry.define(line)
    return registry


_MEANT: tuple[tuple[str, str], ...] = (
    # text after a unit: a condition, a remark, the kind of value
    (r"(?:,|\bover\b).*$", ""),
    (r"\s*\((?:OCR|total|typ|max|min)\.?\)\s*$", ""),
    (r"[\s-]*(?:\(?\brms\b\)?|1\s*[σs]igma|1\s*σ)\s*$", ""),
    # signs
    (r"%", "percent"),
    (r"\b(percent|ppm)\s*(?:of\s+)?(?:FSR?|full[\s-]scale)\s*$", r"\1"),
    (r"²", "^2"),
    (r"³", "^3"),
    (r"−", "-"),
    (r"[·×]", "*"),
    (r"\bper\b", "/"),
    (r"(?:\bx|\*)\s*Hz\s*\^?\(?-1/2\)?", "/√Hz"),
    (r"\bm/s2\b", "m/s^2"),
    (r"\bmilli-(?=rad|deg|g)", "m"),
    # the degree sign: of temperature, or of an angle
    (r"[°º]\s*C\b|\bdeg\s*C\b|\bcelsius\b", "degC"),
    (r"[°º]", "deg"),
    # roots: √Hz, rt-Hz, root hour, sqrt(Hz), and V where text recognition saw no √
    (r"/\s*V\s*(?=(?:Hz|hr?)\b)", "/√"),
    (r"\b(?:rt|root)[\s-]*(?=[A-Za-z])", "√"),
    (r"\bsqrt\s*(?=\()", "√"),
    (r"√\s*\(\s*([A-Za-z]+)\s*\)", r"√\1"),
    (r"√\s*([A-Za-z]+)", r"(\1)**0.5"),
    (r"\bhour\b", "h"),
    (r"\bhr\b", "h"),
)
"""Spellings of vendors with their meaning, in the order of their replacement."""

_REWRITTEN = tuple((re.compile(written, re.IGNORECASE), meant) for written, meant in _MEANT)
_LOST_SIGN = re.compile(r"\(.*\blost\b.*\)")
_LEVEL = re.compile(r"\bdB\b")
_POWER_OF_TWO = re.compile(r"\*\s*2\s*\^\s*(-?\d+)\s*$")
_NO_ROOT = re.compile(r"/\s*(Hz|hr?)\s*$", re.IGNORECASE)


def _normalise(text: str) -> str:
    """Rewrite a vendor's spelling (°/√h, dps/rtHz, m/s²) as products and powers of units."""
    unit = text.strip()
    for written, meant in _REWRITTEN:
        unit = written.sub(meant, unit)
    unit = unit.replace("^", "**").strip()
    # A difference of temperatures is meant wherever degC is not alone.
    return unit if unit == "degC" else re.sub(r"\bdegC\b", "K", unit)


def _said(dimension: str) -> str:
    return dimension.replace("_", " ")


def _expected(dimension: str) -> str:
    return f"expected a unit of {_said(dimension)} such as {_DIMENSIONS[dimension][1]}"


def _parsed(unit: str) -> "tuple[float, pint.Unit]":
    """Return the power of two in a unit as a factor, and the unit of the registry.

    Raises a `UnitError` without the expected unit.
    """
    import pint

    if _LEVEL.search(unit):
        raise UnitError(
            f"{unit!r} is a level in decibels, not a unit: the figure is 10^(level/20) times the "
            "reference for an amplitude, 10^(level/10) for a power; state it in the unit of the "
            "reference"
        )
    if _LOST_SIGN.search(unit):
        raise UnitError(f"{unit!r} has lost a sign, such as √ or µ; state the intended unit")
    if len(unit) > _LONGEST:
        raise UnitError(f"{unit[:_LONGEST]!r}... has over {_LONGEST} characters; a unit is shorter")
    power = _POWER_OF_TWO.search(unit)
    text = _normalise(unit[: power.start()] if power else unit)
    if power and abs(int(power[1])) > _HIGHEST_POWER_OF_TWO:
        raise UnitError(f"cannot read {unit!r} as a unit: its power of 2 is too high")
    try:
        tokens = list(_tokens(text))
        exponents, place = ([], 1) if tokens == ["1"] else _product(tokens, 0)
        if place < len(tokens):
            raise UnitError(f"unexpected {tokens[place]!r}")
        found = _registry().parse_units("")
        for name, exponent in exponents:
            found = found * _registry().parse_units(name) ** exponent
    except pint.UndefinedUnitError:
        raise UnitError(f"unknown unit {unit!r}") from None
    except UnitError as error:
        raise UnitError(f"cannot read {unit!r} as a unit: {error}") from None
    return 2.0 ** int(power[1]) if power else 1.0, found


_LONGEST = 80  # letters of a unit; the longest that a vendor prints has 40

_HIGHEST_POWER_OF_TWO = 64
_HIGHEST_POWER = 12.0

_TOKEN = re.compile(
    r"\s*(?:(?P<name>[A-Za-zµμ_][A-Za-zµμ_0-9]*)|(?P<number>\d+(?:\.\d+)?)|(?P<sign>\*\*|[-*/()]))"
)


def _tokens(text: str) -> Iterator[str]:
    place = 0
    while text[place:].strip():
        found = _TOKEN.match(text, place)
        if not found:
            raise UnitError(f"unexpected {text[place:].strip()[0]!r}")
        yield found[0].strip()
        place = found.end()


def _product(tokens: list[str], place: int) -> tuple[list[tuple[str, float]], int]:
    """Return the units of a product with their exponents, and the end position."""
    exponents: list[tuple[str, float]] = []
    if tokens[place : place + 2] == ["1", "/"]:
        place += 1  # one over a unit
    else:
        exponents, place = _power(tokens, place)
    while place < len(tokens) and tokens[place] != ")":
        sign = 1.0
        if tokens[place] in ("*", "/"):
            sign = -1.0 if tokens[place] == "/" else 1.0
            place += 1
        more, place = _power(tokens, place)
        exponents += [(name, sign * exponent) for name, exponent in more]
    return exponents, place


def _power(tokens: list[str], place: int) -> tuple[list[tuple[str, float]], int]:
    """Return a unit or a bracket with its exponent, and the end position."""
    if place >= len(tokens):
        raise UnitError("a unit is missing at its end")
    token = tokens[place]
    if token == "(":
        exponents, place = _product(tokens, place + 1)
        if place >= len(tokens):
            raise UnitError("a bracket is not closed")
    elif token[0].isalpha() or token[0] == "_":
        exponents = [(token, 1.0)]
    else:
        raise UnitError(f"unexpected {token!r}")
    place += 1
    if place < len(tokens) and tokens[place] == "**":
        raised, place = _exponent(tokens, place + 1)
        exponents = [(name, exponent * raised) for name, exponent in exponents]
    if any(abs(exponent) > _HIGHEST_POWER for _, exponent in exponents):
        raise UnitError(f"a power is above {_HIGHEST_POWER:g}")
    return exponents, place


def _exponent(tokens: list[str], place: int) -> tuple[float, int]:
    """Return a number, or a ratio in brackets, and the end position."""
    bracket = tokens[place : place + 1] == ["("]
    exponent, place = _number(tokens, place + bracket)
    if bracket and tokens[place : place + 1] == ["/"]:
        divisor, place = _number(tokens, place + 1)
        if divisor == 0.0:
            raise UnitError("a power is divided by 0")
        exponent /= divisor
    if bracket and tokens[place : place + 1] != [")"]:
        raise UnitError("the text after ^ is not a number")
    return exponent, place + bracket


def _number(tokens: list[str], place: int) -> tuple[float, int]:
    sign = tokens[place : place + 1] == ["-"]
    digits = "".join(tokens[place + sign : place + sign + 1])
    if not digits[:1].isdigit():
        raise UnitError("the text after ^ is not a number")
    return (-1.0 if sign else 1.0) * float(digits), place + sign + 1


@lru_cache(maxsize=1)
def _targets() -> "dict[str, pint.Unit]":
    return {name: _registry().parse_units(_normalise(unit)) for name, unit in SI_UNITS.items()}


@lru_cache(maxsize=1024)
def find_conversion(unit: str, dimension: str) -> tuple[float, float]:
    """Return the factor and offset that convert a unit to SI: ``si = factor * value + offset``.

    Parameters
    ----------
    unit : str
        As a vendor writes it, for instance ``°/√h``, ``dps/√Hz`` or ``µg``; ``rms``, ``1σ`` or
        ``over -40..85`` after it is ignored.
    dimension : str
        A key of `SI_UNITS`.

    Raises
    ------
    UnitError
        If the unit is unknown, of another dimension, a level in decibels, or has lost a sign.
    """
    if unit.strip() == "?":
        raise UnitError(f"the unit '?' is left to fill in; {_expected(dimension)}")
    target = _targets()[dimension]
    gram = dimension == "mass" and unit.strip() == "g"
    try:
        power, source = _parsed("gram" if gram else unit)
    except UnitError as error:
        raise UnitError(f"{error}; {_expected(dimension)}") from error
    if source.dimensionality != target.dimensionality:
        others = [
            name
            for name, other in _targets().items()
            if other.dimensionality == source.dimensionality
        ]
        but = f" but of {_said(others[0])}" if others else f" (it has {source.dimensionality})"
        fault = f"{unit!r} is no unit of {_said(dimension)}{but}"
        rooted = _NO_ROOT.sub(r"/sqrt(\1)", unit)
        if rooted != unit and _parsed(rooted)[1].dimensionality == target.dimensionality:
            fault += f"; if the sign of a root was lost, write {rooted!r}"
        raise UnitError(f"{fault}; {_expected(dimension)}")
    zero, one = (_registry().Quantity(value, source).to(target).magnitude for value in (0.0, power))
    return float(one - zero), float(zero)


def find_dimension(unit: str, expected: tuple[str, ...]) -> str:
    """Return which of the ``expected`` dimensions, keys of `SI_UNITS`, a unit has.

    The first is the usual dimension: if the unit has none of them, the `UnitError` is about it.
    """
    for dimension in expected[1:]:
        try:
            find_conversion(unit, dimension)
        except UnitError:
            continue
        return dimension
    find_conversion(unit, expected[0])
    return expected[0]


def convert_to_si(value: float, unit: str, dimension: str) -> float:
    """Convert one value to the SI unit of its dimension (see `find_conversion`)."""
    factor, offset = find_conversion(unit, dimension)
    return factor * value + offset


def convert_from_si(value: float, unit: str, dimension: str) -> float:
    """Convert one SI value to ``unit`` (see `find_conversion`)."""
    factor, offset = find_conversion(unit, dimension)
    return (value - offset) / factor


def convert(value: Any, unit: str, to: str) -> Any:
    """Convert a figure from one unit to another of the same dimension.

    Parameters
    ----------
    value : float or ndarray
        In ``unit``.
    unit, to : str
        As vendors write them (see `find_conversion`).

    Returns
    -------
    float or ndarray
        In ``to``, in the shape of ``value``.

    Raises
    ------
    UnitError
        If a unit is unknown, or the units have different dimensions.

    Examples
    --------
    >>> round(convert(0.3, "deg/sqrt(h)", "mdps/sqrt(Hz)"), 6)
    5.0
    """
    _parsed(unit)
    wrong = UnitError(f"{unit!r} is no unit of an inertial sensor; expected one such as deg/h")
    for dimension in reversed(SI_UNITS):
        try:
            si = convert_to_si(value, unit, dimension)
        except UnitError:
            continue
        try:
            return convert_from_si(si, to, dimension)
        except UnitError as error:  # g may be a mass
            wrong = error
    raise wrong


def parse_setting(value: float | str, dimension: str, name: str) -> float:
    """Return a setting in SI, above 0, from a number in SI or from a text with its unit.

    ``value`` is, for instance, 100.0 or ``100 Hz``; ``dimension`` is a key of `SI_UNITS`; ``name``
    is the name of the setting, for errors. Raises a `UnitError` if a text is not a number with a
    unit of this dimension, and a ValueError if the value is not a finite number above 0.
    """
    if isinstance(value, str):
        with add_key_to_errors(f"{name}: "):
            number = parse_quantity(value, dimension)
    else:
        try:
            number = math.nan if isinstance(value, bool) else float(value)
        except (TypeError, ValueError):
            number = math.nan
    if not 0.0 < number < math.inf:
        example = _WRITTEN.get(dimension, f"1 {SI_UNITS[dimension]}")
        raise ValueError(
            f"{name} is {value!r}, expected a value of {_said(dimension)} above 0: a number in "
            f"{SI_UNITS[dimension]}, or a text with its unit, such as {example!r}"
        )
    return number


_QUANTITY = re.compile(r"^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\d\s.].*)$")


def parse_quantity(text: str, dimension: str) -> float:
    """Read a number with its unit, such as ``100 Hz``, into SI.

    Raises a `UnitError` if number or unit is missing, the dimension is another one, or the value
    is too large for a float.
    """
    number, unit = _number_and_unit(text, dimension)
    return _finite(convert_to_si(number, unit, dimension), text)


def parse_difference(text: str, dimension: str) -> float:
    """Read a difference with its unit into SI: 5 degC are 5 K, not 278 K (see `parse_quantity`)."""
    number, unit = _number_and_unit(text, dimension)
    factor, _ = find_conversion(unit, dimension)
    return _finite(factor * number, text)


def split_quantity(text: str) -> tuple[float, str]:
    """Return the number and the unit of a quantity of any dimension; raises a `UnitError`."""
    match = _QUANTITY.match(text)
    if not match:
        raise UnitError(f"{text[:_LONGEST]!r} is not a number with its unit; write it as '1 deg/h'")
    return float(match[1]), match[2]


def _finite(value: float, text: str) -> float:
    if not math.isfinite(value):
        raise UnitError(f"{str(text)[:_LONGEST]!r} is out of range; expected less than 1e308 in SI")
    return value


def _number_and_unit(text: str, dimension: str) -> tuple[float, str]:
    match = _QUANTITY.match(str(text))
    if not match:
        first = re.split(r", | or ", _DIMENSIONS[dimension][1])[0]
        raise UnitError(
            f"{str(text)[:_LONGEST]!r} is not a number with its unit; {_expected(dimension)}, "
            f"written like {_WRITTEN.get(dimension, f'1 {first}')!r}"
        )
    return float(match[1]), match[2]
