"""Practical units of inertial errors, and the format of numbers on pages.

A page can show each quantity in several units (`list_page_units`). The first choice is the
practical one, the last is SI.
"""

from collections.abc import Mapping
from functools import cache

from imubench_pipeline.estimators.estimate import DIMENSIONS
from imubench_pipeline.model.comparisons import DatasheetRow, RepeatabilityRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS
from imubench_pipeline.settings.sensor import QUANTITIES
from imubench_pipeline.units import SI_UNITS, find_conversion
from imubench_pipeline.words.findings.base import System as System
from imubench_pipeline.words.numbers import NO_VALUE, Unit, number_text


def _make_signs(
    level: str, *, Q: str, N: str, K: str, R: str, psd: str, signal: str | None = None
) -> dict[str, str]:
    return {
        **{"Q": Q, "N": N, "N_sensor": N, "B": level, "B_curve": level, "sigma_min": level},
        **{"T_B": "s", "tau_min": "s", "K": K, "R": R},
        **{"adev": level, "psd": psd, "signal": signal or level},
        **{"sensitivity": f"{level}/K", "quadratic": f"{level}/K²"},
    }


_UNIT_CHOICES: dict[str, dict[str, dict[str, str]]] = {
    "gyro": {
        "°/h and °/√h": _make_signs(
            "°/h", Q="°", N="°/√h", K="°/h/√h", R="°/h/h", psd="°/s/√Hz", signal="°/s"
        ),
        "°/s": _make_signs("°/s", Q="°", N="°/s/√Hz", K="°/s/√s", R="°/s/s", psd="°/s/√Hz"),
        "SI: rad/s": _make_signs(
            "rad/s", Q="rad", N="rad/s/√Hz", K="rad/s/√s", R="rad/s²", psd="rad/s/√Hz"
        ),
    },
    "accel": {
        "µg and µg/√Hz": _make_signs(
            "µg", Q="m/s", N="µg/√Hz", K="µg/√h", R="µg/h", psd="µg/√Hz", signal="mg"
        ),
        "mg and m/s/√h": _make_signs("mg", Q="m/s", N="m/s/√h", K="mg/√h", R="mg/h", psd="mg/√Hz"),
        "SI: m/s²": _make_signs(
            "m/s²", Q="m/s", N="m/s²/√Hz", K="m/s²/√s", R="m/s³", psd="m/s²/√Hz"
        ),
    },
}

_FIGURE_SIGNS: dict[str, dict[str, str]] = {
    "gyro": {"full_scale": "°/s", "g_sensitivity": "°/s/g", "vibration_rectification": "°/s/g²"},
    "accel": {"full_scale": "g", "vibration_rectification": "mg/g²"},
}
_SIGNS_OF_RATIOS = {"ratio": "%", "ratio_temperature_coefficient": "%/K"}

_SIGNS_OF_DIMENSIONS: dict[System, dict[str, str]] = {
    "practical": {"angle": "°", "velocity": "m/s", "length": "m"},
    "si": {"angle": "rad", "velocity": "m/s", "length": "m"},
}


_PREFIXED_DIMENSIONS = ("velocity", "length")
_MIN_SIZE_OF_PREFIX = ((1e3, "k"), (0.1, ""), (1e-4, "m"), (0.0, "µ"))


def choose_page_unit(quantity: str, symbol: str, system: System) -> Unit:
    """Return the initial unit on pages of a parameter, ``adev``, ``signal`` or root of ``psd``."""
    return _find_unit(quantity, symbol, choose_first_units(system)[quantity])


def choose_figure_unit(quantity: str, figure: str, system: System) -> Unit:
    """Return the unit of a datasheet figure on pages; ``figure`` is its key in the sensor file."""
    dimension = FIGURE_DIMENSIONS[quantity][figure][0]
    sign = SI_UNITS[dimension]
    if system == "practical":
        sign = _FIGURE_SIGNS[quantity].get(figure) or _SIGNS_OF_RATIOS.get(dimension, sign)
    return _make_unit(sign, dimension)


def list_page_units() -> dict[str, dict[str, dict[str, Unit]]]:
    """Return quantity -> choice of units -> symbol -> unit, the practical choice first."""
    return {
        quantity: {
            name: {symbol: _find_unit(quantity, symbol, name) for symbol in symbols}
            for name, symbols in choices.items()
        }
        for quantity, choices in _UNIT_CHOICES.items()
    }


def choose_first_units(system: System) -> Mapping[str, str]:
    """Return the name of the initial choice of units on pages, by quantity."""
    place = 0 if system == "practical" else -1
    return {quantity: list(choices)[place] for quantity, choices in _UNIT_CHOICES.items()}


@cache
def _find_unit(quantity: str, symbol: str, choice: str) -> Unit:
    dimensions = DIMENSIONS[quantity]
    dimension = dimensions.get(symbol) or {
        "psd": f"{quantity}_density",
        "sensitivity": f"{quantity}_temperature_coefficient",
        "quadratic": f"{quantity}_temperature_curvature",
    }.get(symbol, QUANTITIES[quantity])
    signs = _UNIT_CHOICES[quantity][choice]
    # A parameter without its own unit has the unit of the first parameter of its dimension.
    alike = next((other for other in signs if dimensions.get(other) == dimension), symbol)
    return _make_unit(signs.get(symbol) or signs[alike], dimension, symbol)


def choose_unit(dimension: str, system: System, size: float | None = None) -> Unit:
    """Return the unit of an angle, velocity or length; ``size`` (SI) chooses a prefix, as in km."""
    if not size:
        return _make_unit(_SIGNS_OF_DIMENSIONS[system][dimension], dimension)
    return next(unit for least, unit in list_units_by_size(dimension, system) if abs(size) >= least)


def list_units_by_size(dimension: str, system: System) -> list[tuple[float, Unit]]:
    """Return the units of a dimension, the largest first, each with its smallest value in SI."""
    sign = _SIGNS_OF_DIMENSIONS[system][dimension]
    prefixed = system == "practical" and dimension in _PREFIXED_DIMENSIONS
    prefixes = _MIN_SIZE_OF_PREFIX if prefixed else ((0.0, ""),)
    return [(least, _make_unit(prefix + sign, dimension)) for least, prefix in prefixes]


def _make_unit(sign: str, dimension: str, parameter: str = "") -> Unit:
    factor, _ = find_conversion(sign, dimension)
    return Unit(sign, 1.0 / factor, parameter)


def format_temperature(row: RecordingRow) -> str:
    """Return the range of the temperature of a recording; empty if it is not known."""
    if row.temperature_min is None:
        return ""
    low, high = (number_text(end, 3) for end in (row.temperature_min, row.temperature_max))
    return f"{low} to {high} °C"


def format_printed(row: DatasheetRow | RepeatabilityRow) -> str:
    """Return the figure of a datasheet as printed; `NO_VALUE` if there is none."""
    if row.printed is None:
        return NO_VALUE
    sign = "±" if row.kind == "range" else ""
    return f"{sign}{row.printed:g} {row.unit or ''}".rstrip()
