"""The axes that Engers measured, as his tables 2 to 7 print them, and where the report has them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from imubench_pipeline.extensions.papers.claims import Claim
from imubench_pipeline.extensions.papers.evidence import Log

DEGREE = math.pi / 180.0
READ_AT = 3600.0
"""Cluster time at which the figures under "PSD" were read, s (section 2.2.4)."""

RECORDING = "sim_engers"
NO_LOG = "it takes the simulated log of this sensor"
NAMES = {"scc2130": "SCC2130", "mpu9250": "MPU-9250", "bno055": "BNO055"}
RATES = {"scc2130": 500.0, "mpu9250": 500.0, "bno055": 100.0}
"""Of his logs, Hz (section 3.7)."""

DATASHEETS = {"scc2130": 0.005, "mpu9250": 0.01, "bno055": 0.014}
"""PSD of the datasheets as Table 1 quotes it, (deg/s)/sqrt(Hz)."""

OF_NOISE = {"scc2130": "Table 5", "mpu9250": "Table 6", "bno055": "Table 7"}
OF_BIAS = {"scc2130": "Table 2", "mpu9250": "Table 3", "bno055": "Table 4"}
_UNITS = {
    "density": ("rad/s/sqrt(Hz)", "(°/s)/√Hz"),
    "rate": ("rad/s", "°/s"),
    "coefficient": ("rad/s/K", "(°/s)/K"),
}


@dataclass(frozen=True)
class Axis:
    """An axis as in tables 2 to 7, digit by digit."""

    sensor: str
    axis: str
    psd_as: str  # read at 1 h, deg/s
    bias_as: str  # deg/s
    floor_as: str  # of the curve, deg/s; printed per kelvin

    @property
    def psd(self) -> float:
        """Ordinate of the -1/2 line at 1 h, deg/s."""
        return float(self.psd_as)

    @property
    def bias(self) -> float:
        """Fixed drift, deg/s."""
        return float(self.bias_as)

    @property
    def floor(self) -> float:
        """Lowest point of the curve, deg/s."""
        return float(self.floor_as)

    @property
    def density(self) -> float:
        """N, if the figure under "PSD" is the ordinate at 1 h, (deg/s)/sqrt(Hz)."""
        return self.psd * math.sqrt(READ_AT)

    @property
    def name(self) -> str:
        """Sensor and axis in words."""
        return f"{NAMES[self.sensor]} {self.axis}"

    @property
    def log(self) -> Log:
        """The channel that is simulated of it."""
        return Log(self.sensor, RECORDING, f"gyro_{self.axis}")

    @property
    def page(self) -> str:
        """Its counterpart in the report."""
        return page_of(self.sensor, self.axis)

    def meeting(self, scaled: bool) -> float:
        """Return the cluster time at which the -1/2 line meets the floor, s.

        Scaled: of N as read at 1 h; else of the figure as if it were N.
        """
        return ((self.density if scaled else self.psd) / self.floor) ** 2


AXES = (
    Axis("scc2130", "x", "0.000075", "0.0981", "0.00041"),
    Axis("mpu9250", "x", "0.00086", "5.1740", "0.0164"),
    Axis("mpu9250", "y", "0.00080", "-3.3396", "0.015"),
    Axis("mpu9250", "z", "0.00255", "-6.0934", "0.039"),
    Axis("bno055", "x", "0.0032", "-5.3726", "0.02"),
    Axis("bno055", "y", "0.0035", "-5.0823", "0.0225"),
    Axis("bno055", "z", "0.00165", "-6.3640", "0.0065"),
)


def axes_of(sensor: str) -> dict[str, Axis]:
    """Return the axes of a sensor by name."""
    return {axis.axis: axis for axis in AXES if axis.sensor == sensor}


def page_of(sensor: str, axis: str = "x") -> str:
    """Return where the report shows an axis."""
    return f"boards.html#engers-{sensor}-gyro_{axis}"


def in_unit(quantity: str, claim: Claim) -> Claim:
    """Return a claim with the unit of a density, rate or coefficient, printed in degrees."""
    unit, printed = _UNITS[quantity]
    return replace(claim, unit=unit, printed_unit=printed, scale=DEGREE)
