"""The units in which engineers state inertial errors, and numbers as they are printed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.sensor import QUANTITIES
from imubench_pipeline.units import conversion

System = Literal["practical", "si"]


@dataclass(frozen=True)
class PageUnit:
    """A unit of the page: its sign, and the factor from SI."""

    sign: str
    per_si: float

    def text(self, value: float | None, digits: int = 4) -> str:
        """Return a SI value in this unit, rounded to some digits; a dash where there is none."""
        if value is None:
            return "–"
        return f"{value * self.per_si:.{digits}g}"


_PRACTICAL: dict[str, dict[str, str]] = {
    "gyro": {
        "Q": "°",
        "N": "°/√h",
        "B": "°/h",
        "T_B": "s",
        "K": "°/h/√h",
        "R": "°/h/h",
        "adev": "°/h",
        "psd": "°/s/√Hz",
    },
    "accel": {
        "Q": "m/s",
        "N": "µg/√Hz",
        "B": "µg",
        "T_B": "s",
        "K": "µg/√h",
        "R": "µg/h",
        "adev": "µg",
        "psd": "µg/√Hz",
    },
}
_SI: dict[str, dict[str, str]] = {
    "gyro": {
        "Q": "rad",
        "N": "rad/s/√Hz",
        "B": "rad/s",
        "T_B": "s",
        "K": "rad/s/√s",
        "R": "rad/s²",
        "adev": "rad/s",
        "psd": "rad/s/√Hz",
    },
    "accel": {
        "Q": "m/s",
        "N": "m/s²/√Hz",
        "B": "m/s²",
        "T_B": "s",
        "K": "m/s²/√s",
        "R": "m/s³",
        "adev": "m/s²",
        "psd": "m/s²/√Hz",
    },
}


_OF_DIMENSION: dict[System, dict[str, str]] = {
    "practical": {"angle": "°", "velocity": "m/s", "length": "m"},
    "si": {"angle": "rad", "velocity": "m/s", "length": "m"},
}


def unit_of(dimension: str, system: System) -> PageUnit:
    """Return the unit in which a page shows an angle, a velocity or a length."""
    sign = _OF_DIMENSION[system][dimension]
    factor, _ = conversion(sign, dimension)
    return PageUnit(sign, 1.0 / factor)


def duration_text(seconds: float) -> str:
    """Return a time in the unit in which it is easily read."""
    for size, name in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.3g} {name}"
    return f"{seconds:.3g} s"


def page_unit(quantity: str, symbol: str, system: System) -> PageUnit:
    """Return the unit in which a page shows a parameter, or ``adev``, of a quantity."""
    sign = (_PRACTICAL if system == "practical" else _SI)[quantity][symbol]
    dimension = {
        "Q": f"{quantity}_quantization",
        "R": f"{quantity}_ramp",
        "psd": f"{quantity}_density",
        "N": f"{quantity}_density",
        "K": f"{quantity}_random_walk",
        "T_B": "time",
    }.get(symbol, QUANTITIES[quantity])
    factor, _ = conversion(sign, dimension)
    return PageUnit(sign, 1.0 / factor)
