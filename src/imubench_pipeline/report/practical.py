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

    def text(self, value: float | None) -> str:
        """Return a SI value in this unit with four digits; a dash where there is none."""
        if value is None:
            return "–"
        return f"{value * self.per_si:.4g}"


_PRACTICAL: dict[str, dict[str, str]] = {
    "gyro": {"N": "°/√h", "B": "°/h", "K": "°/h/√h", "T_B": "s", "adev": "°/h"},
    "accel": {"N": "µg/√Hz", "B": "µg", "K": "µg/√h", "T_B": "s", "adev": "µg"},
}
_SI: dict[str, dict[str, str]] = {
    "gyro": {"N": "rad/s/√Hz", "B": "rad/s", "K": "rad/s/√s", "T_B": "s", "adev": "rad/s"},
    "accel": {"N": "m/s²/√Hz", "B": "m/s²", "K": "m/s²/√s", "T_B": "s", "adev": "m/s²"},
}


def page_unit(quantity: str, symbol: str, system: System) -> PageUnit:
    """Return the unit in which a page shows a parameter, or ``adev``, of a quantity."""
    sign = (_PRACTICAL if system == "practical" else _SI)[quantity][symbol]
    dimension = {
        "N": f"{quantity}_density",
        "K": f"{quantity}_random_walk",
        "T_B": "time",
    }.get(symbol, QUANTITIES[quantity])
    factor, _ = conversion(sign, dimension)
    return PageUnit(sign, 1.0 / factor)
