"""The noise of an inertial sensor as it is handed to another program."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.export.temperature import TemperatureEffect
from imubench_pipeline.noise import NoiseModel


class ExportError(ValueError):
    """What a program cannot load, with what is missing or what to do."""


@dataclass(frozen=True)
class AxisNoise:
    """The noise model of one axis, SI, which stands for all axes of its quantity.

    Attributes
    ----------
    origin : str
        In words: which axis of which recording, by which method.
    notes : sequence of str
        What a reader must know of single parameters: not identified, absent, and what was done.
    least_walk : float or None
        Upper limit of K, where K is absent: what stands in a program that needs a random walk.
    bounded : tuple of float, or None
        Lowest and highest frequency, Hz, between which the model is above the spectral density:
        of an overbound. None: it is no bound.
    """

    model: NoiseModel
    origin: str
    notes: Sequence[str] = ()
    least_walk: float | None = None
    bounded: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Imu:
    """The noise of a sensor.

    Attributes
    ----------
    rate : float
        Of the samples that the program will get, Hz.
    gyro, accel : AxisNoise or None
        None: no estimate.
    horizon : float
        How long the program goes without a measurement, s: where a model that a program cannot
        hold is replaced by a nearby one, they agree there.
    gravity : float
        m/s^2.
    inflation : float
        Factor on all densities and amplitudes, not on variances.
    because : str or None
        The reason for it, or for the use of a recording that does not decide.
    simulated : bool
        The recordings are.
    cautions : sequence of str
        What speaks against the recordings that were used, and which were left out.
    temperature : mapping of str to TemperatureEffect
        How the biases follow the temperature, by quantity.

    Raises
    ------
    ExportError
        If a number is out of range, or an inflation has no reason.
    """

    sensor: str
    rate: float
    gyro: AxisNoise | None = None
    accel: AxisNoise | None = None
    horizon: float = 60.0
    gravity: float = STANDARD_GRAVITY
    inflation: float = 1.0
    because: str | None = None
    simulated: bool = False
    cautions: Sequence[str] = ()
    temperature: Mapping[str, TemperatureEffect] = field(default_factory=dict)

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
                model=inflated(axis.model, self.inflation),
                least_walk=axis.least_walk and axis.least_walk * self.inflation,
            )
            for name, axis in both.items()
            if axis is not None
        }

    def both(self) -> tuple[AxisNoise, AxisNoise]:
        """Return gyro and accelerometer; ExportError if one is missing, which the program needs."""
        axes = self.axes
        missing = [name for name in ("gyro", "accel") if name not in axes]
        if missing:
            raise ExportError(
                f"{self.sensor}: no estimate of {' and '.join(missing)}, which this program needs"
            )
        return axes["gyro"], axes["accel"]


def inflated(model: NoiseModel, factor: float) -> NoiseModel:
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


def normal_gravity(latitude: float) -> float:
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
