"""A sensor model as a YAML file has it, with its units.

sensor: bno055                       # the sensor file that its logs go with, if any
temperature_step: 1 K
misalignment: {gyro: [[1, 0.01, 0], [0, 1, 0], [0, 0, 1]]}
axes:
  gyro_x:
    noise: {N: 0.0103 deg/s/sqrt(Hz), B: 10 deg/h, T_B: 200 s, K: 2 deg/h/sqrt(h)}
    bias: -5.4 deg/s
    drift: {sensitivity: 0.015 deg/s/K, reference: 25 degC, lag: 5 min}
    low_pass: {cutoff: 64 Hz}
    resolution: 0.0625 deg/s
    full_scale: 2000 deg/s
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.sensor import QUANTITIES, Channel, quantity_of
from imubench_pipeline.sensor_model.imu import ImuModel
from imubench_pipeline.sensor_model.low_pass import LowPass
from imubench_pipeline.sensor_model.model import SensorModel, TemperatureDrift
from imubench_pipeline.units import UnitError, difference_to_si, quantity_to_si
from imubench_pipeline.validation import Frequency, Strict, Text


class ProcessSettings(Strict):
    """A Gauss-Markov process."""

    B: Text
    T_B: Text


class LineSettings(Strict):
    """A sinusoid."""

    amplitude: Text
    frequency: Frequency


class NoiseSettings(Strict):
    """The noise of an axis; N is two-sided, before the low-pass."""

    N: Text | None = None
    B: Text | None = Field(None, description="without T_B: flicker noise")
    T_B: Text | None = None
    K: Text | None = None
    R: Text | None = None
    Q: Text | None = None
    further: tuple[ProcessSettings, ...] = ()
    sinusoids: tuple[LineSettings, ...] = ()

    def si(self, quantity: str) -> NoiseModel:
        """Return the noise in SI."""
        plain = QUANTITIES[quantity]
        values = {
            name: quantity_to_si(text, dimension)
            for name, dimension in {
                "N": f"{quantity}_density",
                "B": plain,
                "T_B": "time",
                "K": f"{quantity}_random_walk",
                "R": f"{quantity}_ramp",
                "Q": f"{quantity}_quantization",
            }.items()
            if (text := getattr(self, name)) is not None
        }
        return NoiseModel(
            **values,
            further=[
                GaussMarkov(quantity_to_si(one.B, plain), quantity_to_si(one.T_B, "time"))
                for one in self.further
            ],
            sinusoids=[
                Sinusoid(
                    quantity_to_si(one.amplitude, plain),
                    quantity_to_si(one.frequency, "frequency"),
                )
                for one in self.sinusoids
            ],
        )


class DriftSettings(Strict):
    """The drift with temperature."""

    sensitivity: Text
    reference: Text = "25 degC"
    quadratic: Text | None = None
    lag: Text = "0 s"

    def si(self, quantity: str) -> TemperatureDrift:
        """Return the drift in SI."""
        curvature = 0.0
        if self.quadratic is not None:
            curvature = quantity_to_si(self.quadratic, f"{quantity}_temperature_curvature")
        return TemperatureDrift(
            sensitivity=quantity_to_si(self.sensitivity, f"{quantity}_temperature_coefficient"),
            reference=quantity_to_si(self.reference, "temperature"),
            quadratic=curvature,
            lag=quantity_to_si(self.lag, "time"),
        )


class LowPassSettings(Strict):
    """The low-pass."""

    cutoff: Frequency
    order: int = Field(1, ge=1, le=10, description="above 1: Butterworth")


class AxisSettings(Strict):
    """One axis."""

    noise: NoiseSettings = NoiseSettings()
    bias: Text | None = None
    drift: DriftSettings | None = None
    low_pass: LowPassSettings | None = None
    scale_error: float = Field(0.0, description="relative: 0.01 is 1 %")
    resolution: Text | None = Field(None, description="step of the register")
    full_scale: Text | None = None

    def si(self, channel: str) -> SensorModel:
        """Return the model in SI."""
        quantity = quantity_of(channel)
        plain = QUANTITIES[quantity]
        low_pass = self.low_pass
        return SensorModel(
            noise=self.noise.si(quantity),
            bias=0.0 if self.bias is None else quantity_to_si(self.bias, plain),
            drift=None if self.drift is None else self.drift.si(quantity),
            low_pass=None
            if low_pass is None
            else LowPass(quantity_to_si(low_pass.cutoff, "frequency"), low_pass.order),
            scale_error=self.scale_error,
            resolution=0.0 if self.resolution is None else quantity_to_si(self.resolution, plain),
            full_scale=None if self.full_scale is None else quantity_to_si(self.full_scale, plain),
        )


def _matrix(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len(rows) != 3 or any(len(row) != 3 for row in rows):
        raise ValueError("expected three rows of three numbers")
    return rows


Matrix = Annotated[tuple[tuple[float, ...], ...], AfterValidator(_matrix)]


class ModelSettings(Strict):
    """The file of a sensor model."""

    sensor: Text | None = Field(None, description="name of the sensor file its logs go with")
    source: Text | None = Field(None, description="where the figures are from")
    axes: dict[Channel, AxisSettings] = Field(min_length=1)
    misalignment: dict[str, Matrix] = Field(
        default_factory=dict,
        description="by quantity, gyro or accel: what x, y, z sense of the true x, y, z",
    )
    temperature_step: Text | None = Field(None, description="of the register of temperature")

    @model_validator(mode="after")
    def _usable(self) -> ModelSettings:
        if unknown := set(self.misalignment) - set(QUANTITIES):
            raise ValueError(f"misalignment of {min(unknown)!r}; expected gyro or accel")
        for channel, axis in self.axes.items():
            try:
                axis.si(channel)
            except (UnitError, ValueError) as error:
                raise ValueError(f"axes.{channel}: {error}") from error
        self.si()
        return self

    def si(self) -> ImuModel:
        """Return the model in SI."""
        step = self.temperature_step
        return ImuModel(
            axes={str(name): axis.si(name) for name, axis in self.axes.items()},
            misalignment={name: np.array(rows) for name, rows in self.misalignment.items()},
            temperature_step=0.0 if step is None else difference_to_si(step, "temperature"),
        )
