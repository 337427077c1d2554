"""Noise model of an inertial sensor, as the export to other programs takes it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.export.temperature import TemperatureEffect
from imubench_pipeline.noise import NoiseModel


class ExportError(ValueError):
    """Raised for an export that the program cannot load; says what is missing, or what to do."""


@dataclass(frozen=True)
class AxisNoise:
    """Noise model of one axis, SI, used for all axes of its quantity."""

    model: NoiseModel
    origin: str  # axis, recording and method of the model, in words
    notes: Sequence[str] = ()  # treatment of parameters without a plain value
    least_walk: float | None = None  # upper limit of an absent K, for programs that need a walk
    bounded: tuple[float, float] | None = None
    """Lowest and highest frequency of an overbound, Hz; None: the model is no overbound."""


@dataclass(frozen=True, kw_only=True)
class Imu:
    """The noise of a sensor.

    Raises ExportError if a number is out of range, or an inflation has no reason.
    """

    sensor: str
    rate: float  # of the samples that the program will get, Hz
    gyro: AxisNoise | None = None  # None: no estimate
    accel: AxisNoise | None = None
    horizon: float = 60.0
    """Longest time that the program predicts without a measurement, s. A replacement for a model
    that the program does not support has the same Allan variance at this time."""
    gravity: float = STANDARD_GRAVITY  # m/s^2
    inflation: float = 1.0  # factor on all densities and amplitudes, not on variances
    because: str | None = None
    """Reason of the inflation, or of the use of a recording that is excluded from decisions."""
    simulated: bool = False  # whether the recordings are simulated
    cautions: Sequence[str] = ()  # doubts about the recordings, and those that were left out
    temperature: Mapping[str, TemperatureEffect] = field(default_factory=dict)  # by quantity

    def __post_init__(self) -> None:
        for name in ("rate", "horizon", "gravity", "inflation"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ExportError(f"{name} is {value}, expected a number above 0")
        if not self.horizon * self.rate > 2.0:
            raise ExportError(f"the horizon of {self.horizon:g} s is shorter than two samples")
        if self.inflation != 1.0 and not (self.because or "").strip():
            raise ExportError(
                f"an inflation of {self.inflation:g} needs its reason: what is it for?"
            )

    @property
    def axes(self) -> dict[str, AxisNoise]:
        """The quantities that have an estimate, with the inflation in their models."""
        both = {"gyro": self.gyro, "accel": self.accel}
        return {
            name: replace(
                axis,
                model=inflate(axis.model, self.inflation),
                least_walk=axis.least_walk and axis.least_walk * self.inflation,
            )
            for name, axis in both.items()
            if axis is not None
        }

    def require_both(self) -> None:
        """Raise ExportError if there is no estimate of gyro or accelerometer."""
        missing = [name for name in ("gyro", "accel") if name not in self.axes]
        if missing:
            raise ExportError(
                f"{self.sensor}: no estimate of {' and '.join(missing)}, which this program needs"
            )


def inflate(model: NoiseModel, factor: float) -> NoiseModel:
    """Return a model with all densities and amplitudes times a factor; times stay."""
    return NoiseModel(
        Q=model.Q * factor,
        N=model.N * factor,
        B=model.B * factor,
        T_B=model.T_B,
        K=model.K * factor,
        R=model.R * factor,
        further=[term.scaled(factor) for term in model.further],
        sinusoids=[line.scaled(factor) for line in model.sinusoids],
    )


def compute_normal_gravity(latitude: float) -> float:
    """Return gravity on the WGS 84 ellipsoid, m/s^2, at a latitude in degrees; else ExportError.

    Somigliana's formula: NIMA TR8350.2, "Department of Defense World Geodetic System 1984",
    equation 4-1.
    """
    if not abs(latitude) <= 90.0:
        raise ExportError(f"the latitude is {latitude}, expected degrees from -90 to 90")
    square = math.sin(math.radians(latitude)) ** 2
    first_eccentricity_squared = 6.69437999014e-3
    return (
        9.7803253359
        * (1.0 + 1.931852652458e-3 * square)
        / math.sqrt(1.0 - first_eccentricity_squared * square)
    )
