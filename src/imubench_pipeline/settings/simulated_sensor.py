"""A sensor model in a YAML file, with units; `simulate.models` converts it.

axes:
  gyro_x:
    N: 0.0103 deg/s/sqrt(Hz)
    B: 10 deg/h
    T_B: 200 s
    drift: {sensitivity: 0.015 deg/s/K, reference: 25 degC, lag: 5 min}

Nothing is computed here: every configuration loads this module.
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Self

from pydantic import AfterValidator, Field, model_validator

from imubench_pipeline.settings.sensor import QUANTITIES, Channel, quantity_of
from imubench_pipeline.settings.validation import Frequency, Strict, Text
from imubench_pipeline.units import UnitError, add_key_to_errors, parse_difference, parse_quantity


class _Figures(Strict):
    """Figures with units; ``{}`` in a dimension is the quantity, ``signal`` its own dimension."""

    dimensions: ClassVar[Mapping[str, str]]

    def si(self, channel: str) -> dict[str, float]:
        """Return the stated figures in SI, temperatures in degC; UnitError begins with the key.

        ``channel``: a channel, or its quantity.
        """
        quantity, figures = quantity_of(channel), {}
        for key, of in self.dimensions.items():
            if (text := getattr(self, key)) is not None:
                dimension = QUANTITIES[quantity] if of == "signal" else of.format(quantity)
                with add_key_to_errors(f"{key}: "):
                    figures[key] = parse_quantity(text, dimension)
        return figures


class ProcessSettings(_Figures):
    """A Gauss-Markov process."""

    dimensions: ClassVar = {"B": "signal", "T_B": "time"}
    B: Text
    T_B: Text


class LineSettings(_Figures):
    """A sinusoid."""

    dimensions: ClassVar = {"amplitude": "signal", "frequency": "frequency"}
    amplitude: Text
    frequency: Frequency


class DriftSettings(_Figures):
    """The drift with temperature."""

    dimensions: ClassVar = {
        "sensitivity": "{}_temperature_coefficient",
        "reference": "temperature",
        "quadratic": "{}_temperature_curvature",
        "lag": "time",
    }
    sensitivity: Text
    reference: Text = "25 degC"
    quadratic: Text | None = None
    lag: Text = "0 s"


class LowPassSettings(Strict):
    """A low-pass filter; first order by default."""

    cutoff: Frequency
    order: int = Field(1, ge=1, le=10, description="above 1: Butterworth")


class AxisSettings(_Figures):
    """One axis: its noise (N is two-sided, before the low-pass), and its other errors."""

    dimensions: ClassVar = {
        "N": "{}_density",
        "B": "signal",
        "T_B": "time",
        "K": "{}_random_walk",
        "R": "{}_ramp",
        "Q": "{}_quantization",
        **dict.fromkeys(("bias", "resolution", "full_scale"), "signal"),
    }
    N: Text | None = Field(None, description="white noise density, two-sided")
    B: Text | None = Field(
        None, description="bias instability (the curve's peak is 0.664 B); without T_B: flicker"
    )
    T_B: Text | None = Field(None, description="correlation time of the Gauss-Markov process")
    K: Text | None = Field(None, description="rate or acceleration random walk")
    R: Text | None = Field(None, description="ramp")
    Q: Text | None = Field(None, description="quantization noise")
    further: tuple[ProcessSettings, ...] = ()
    sinusoids: tuple[LineSettings, ...] = ()
    bias: Text | None = Field(None, description="constant bias")
    drift: DriftSettings | None = None
    low_pass: LowPassSettings | None = None
    scale_error: float = Field(0.0, description="relative: 0.01 is 1 %")
    resolution: Text | None = Field(None, description="step of the register")
    full_scale: Text | None = None

    @model_validator(mode="after")
    def _of_a_process(self) -> Self:
        if self.T_B is not None and self.B is None:
            raise ValueError("T_B is the correlation time of B, which is missing; state B")
        return self

    def check(self, channel: str) -> None:
        """Raise UnitError, with the key, if a unit has the wrong dimension for its figure."""
        self.si(channel)
        for number, process in enumerate(self.further):
            with add_key_to_errors(f"further.{number}."):
                process.si(channel)
        for number, line in enumerate(self.sinusoids):
            with add_key_to_errors(f"sinusoids.{number}."):
                line.si(channel)
        if self.drift is not None:
            with add_key_to_errors("drift."):
                self.drift.si(channel)


def _matrix(rows: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
    if len(rows) != 3 or any(len(row) != 3 for row in rows):
        raise ValueError("expected three rows of three numbers")
    return rows


Matrix = Annotated[tuple[tuple[float, ...], ...], AfterValidator(_matrix)]


class ImuSettings(Strict):
    """Settings that are common to all axes of a sensor."""

    misalignment: dict[str, Matrix] = Field(
        default_factory=dict,
        description="by quantity, gyro or accel: what x, y, z sense of the true x, y, z",
    )
    temperature_step: Text | None = Field(None, description="of the register of temperature")

    @model_validator(mode="after")
    def _of_the_sensor(self) -> Self:
        if unknown := set(self.misalignment) - set(QUANTITIES):
            raise ValueError(f"misalignment of {min(unknown)!r}; expected gyro or accel")
        if self.temperature_step is not None:
            parse_difference(self.temperature_step, "temperature")
        return self


class ModelSettings(ImuSettings):
    """The file of a sensor model."""

    sensor: Text | None = Field(None, description="name of the sensor file its logs go with")
    source: Text | None = Field(None, description="where the figures are from")
    axes: dict[Channel, AxisSettings] = Field(min_length=1)

    @model_validator(mode="after")
    def _of_the_axes(self) -> Self:
        check_axes(self.axes, "axes")
        return self


def check_axes(axes: Mapping[Channel, AxisSettings], key: str) -> None:
    """Raise ValueError, with the key, if a unit has the wrong dimension for its figure."""
    for channel, axis in axes.items():
        try:
            axis.check(channel)
        except UnitError as error:
            raise ValueError(f"{key}.{channel}.{error}") from error
