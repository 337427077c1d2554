"""Assumptions and reasons of error budgets, by a log or by a data sheet."""

from collections.abc import Mapping, Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.units import convert_from_si
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import Unit, interval_text, join_names

_NUMBERS: Mapping[str, str] = {
    "sigma": "value",
    "lower": "lower limit",
    "upper": "upper limit",
    "within": "probability",
    "limit": "limit to meet",
}
"""Numbers of an error that a verdict needs."""

_FIGURE_UNITS: Mapping[tuple[str, str], tuple[str, str]] = {
    ("gyro", "N"): ("°/√h", "gyro_density"),
    ("gyro", "B"): ("°/h", "angular_rate"),
    ("gyro", "K"): ("°/h/√h", "gyro_random_walk"),
    ("accel", "N"): ("µg/√Hz", "accel_density"),
    ("accel", "B"): ("µg", "acceleration"),
    ("accel", "K"): ("µg/√h", "accel_random_walk"),
}

STATED_SIGMA = "1σ as stated"
PRINTED_SIGMA = "1σ as printed"
TYPICAL_AS_SIGMA = "typical figure taken as 1σ"
RANGE_AS_UNIFORM = "uniform distribution over the printed range, its end is √3 σ"
MAXIMUM_AS_SIGMAS = "maximum taken as 3σ"
OF_THIS_UNIT = "of this unit, at the mean temperature of the log"


NOT_STATED = "the sensor file does not state it"
NOT_KNOWN = "not known"


def bias_not_known(quantity: str) -> str:
    """Return the note that a budget has no turn-on bias of ``gyro`` or ``accel``."""
    return f"the turn-on bias of the {SENSORS[quantity]} is not known and not included"


HEADING_BIAS_NOT_KNOWN = f"{bias_not_known('gyro')}. The heading error is at least this"


def figure_not_known(name: str, reason: str = "") -> str:
    return f"{name}: not known" + (f" ({reason})" if reason else "")


def not_recorded(quantity: str) -> str:
    return f"the recording has no {SENSORS[quantity]}"


def noise_not_known(channels: Sequence[str], reason: str | None) -> str:
    names = join_names(list(map(channel_name, channels)))
    return f"the noise of {names} is not known: {reason or 'the log does not show it'}"


def channel_not_used(channel: str, reason: str | None) -> str:
    return f"{channel_name(channel)} is not used, as {noise_not_known([channel], reason)}"


def parameter_status(symbol: str, channel: str, status: Status) -> str:
    return f"{symbol} of {channel_name(channel)} is {STATUS_WORDS[status]}"


def independent_draws(method: str, channel: str) -> str:
    return (
        f"method {method} gives separate intervals for the parameters of {channel_name(channel)}: "
        "the interval of the error may be too wide"
    )


def missing_numbers(names: Sequence[str]) -> str:
    """Return the missing numbers of an error; ``names``: column names."""
    return f"the error has {join_names([f'no {_NUMBERS[name]}' for name in names])}"


def no_quantity(quantity: str) -> str:
    return f"it has no {SENSORS[quantity]}"


def no_density(quantity: str) -> str:
    return f"no noise density of the {SENSORS[quantity]} is published"


def any_option(quantity: str, options: Sequence[str]) -> str:
    return f"{SENSORS[quantity]}: any of the options {', '.join(options)}"


def either_side(quantity: str, symbol: str) -> str:
    return (
        f"{SENSORS[quantity]} {symbol}: the data sheet does not say whether the density is one- or "
        "two-sided, so both are considered"
    )


def only_maximum(quantity: str, symbol: str) -> str:
    return (
        f"{SENSORS[quantity]} {symbol}: only a maximum is printed, and the typical figure may be "
        "better"
    )


def assumed_range(quantity: str, symbol: str, low: float, high: float, source: str) -> str:
    """Return the range that is assumed for a figure, SI, with its source."""
    unit = Unit("s", 1.0, symbol)
    if symbol != "T_B":
        sign, dimension = _FIGURE_UNITS[quantity, symbol]
        unit = Unit(sign, convert_from_si(1.0, sign, dimension), symbol)
    limits = interval_text(low, high, unit) if high > low else unit.text(low)
    return f"{SENSORS[quantity]} {symbol}: {limits} {unit.sign}, {source}"


def range_source(sensors: Sequence[str], price_class: str, *, measured: bool) -> str:
    """Return the source of an assumed range; ``price_class`` is empty if it is from all classes."""
    source = "measured sensors" if measured else "data sheets"
    which = f"class {price_class}" if price_class else "any class, as its own has none"
    return f"as in {source} of {which} ({', '.join(sensors)})"


def floor_and_minimum(quantity: str) -> str:
    return (
        f"{SENSORS[quantity]} B: the printed figure in the best case, and as the minimum of the "
        "curve in the worst"
    )


def neither_printed_nor_measured(quantity: str, symbols: Sequence[str]) -> str:
    return (
        f"{SENSORS[quantity]} {join_names(list(symbols))}: not published, and not measured of any "
        "sensor"
    )


def flicker_assumed(quantity: str) -> str:
    return f"{SENSORS[quantity]} B: flicker noise, as no T_B is known"
