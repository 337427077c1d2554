"""Figures of a datasheet, as a sensor file has them, and N of white noise as vendors state it.

N, SI, is two-sided: S(f) = N² at positive and negative frequencies, and σ²(τ) = N²/τ. It is the
angle or velocity random walk that vendors print. A one-sided density is √2 N. IEEE Std 952 and
Engers (2021, eq. 6-8) give the random walk in °/√h as 1/60 of a two-sided density in °/h/√Hz; the
60 only changes the unit.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from imubench_pipeline.settings.validation import Duration, Frequency, Strict, Text
from imubench_pipeline.units import UnitError, convert_to_si, find_dimension, parse_quantity

Sidedness = Literal["one-sided", "two-sided"]
Filter = Literal["stated", "first-order", "second-order"]

_NOISE_OVER_CUT_OFF: dict[Filter, float] = {
    "stated": 1.0,
    "first-order": math.pi / 2.0,
    "second-order": math.pi / (2.0 * math.sqrt(2.0)),
}


def convert_density(density: float, sidedness: Sidedness) -> float:
    """Return N from an amplitude density in rad/s/√Hz or m/s²/√Hz.

    N = density, or density / √2 if it is one-sided (Engers, eq. 7, two-sided as printed).
    """
    return density / math.sqrt(2.0) if sidedness == "one-sided" else density


def convert_power_density(density: float, sidedness: Sidedness) -> float:
    """Return N from a power spectral density, 0 or more, in (rad/s)²/Hz or (m/s²)²/Hz.

    N = √S, or √(S/2) if it is one-sided (Engers, eq. 6, two-sided as printed).
    """
    if density < 0:
        raise ValueError(f"the power density is {density:g}; expected 0 or more")
    return convert_density(math.sqrt(density), sidedness)


def noise_of_rms(rms: float, bandwidth: float, sidedness: Sidedness = "one-sided") -> float:
    """Return N from a standard deviation, rad/s or m/s², over a noise bandwidth above 0, Hz.

    N = rms / √(2 bandwidth): a band from 0, as vendors count it, has the power of both signs of
    frequency. It is rms / √bandwidth (Engers, eq. 8) if the bandwidth counts both (``two-sided``).
    """
    if bandwidth <= 0:
        raise ValueError(f"the noise bandwidth is {bandwidth:g} Hz; expected more than 0")
    return convert_density(rms / math.sqrt(bandwidth), sidedness)


def compute_noise_bandwidth(cut_off: float, filter_: Filter = "stated") -> float:
    """Return the noise bandwidth of a low-pass filter from its -3 dB frequency, both in Hz.

    It is π/2 times the cut-off with one pole, π/(2√2) times with a Butterworth filter of second
    order. ``stated``: ``cut_off`` is the noise bandwidth itself, as Bosch, TDK and ST compute.
    """
    return cut_off * _NOISE_OVER_CUT_OFF[filter_]


Value = float | tuple[float, ...] | dict[str, float]
Kind = Literal["typ", "max", "min", "range", "choices", "1sigma", "derived"]


def _number(value: object) -> float:
    """Return a finite number; YAML reads 5e-3 as text."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _printed_value(value: object) -> Value | None:
    try:
        if value is None:
            return None
        if isinstance(value, Mapping):
            axes = {str(key).lower(): _number(number) for key, number in value.items()}
            named = "".join(axes)
            if not named or not set(named) <= set("xyz") or len(set(named)) < len(named):
                raise ValueError
            return axes
        if isinstance(value, (list, tuple)):
            return tuple(_number(number) for number in value)
        return _number(value)
    except ValueError:
        shown = f"found {dict(value)}; " if isinstance(value, Mapping) else ""
        raise ValueError(
            f"{shown}expected a number, one for each axis such as {{xy: 60, z: 80}}, a list "
            "[low, high], or null: not published"
        ) from None


class PrintedFigure(Strict):
    """One figure of a datasheet, as printed."""

    value: Annotated[
        Value | None,
        BeforeValidator(
            _printed_value, json_schema_input_type=float | list[float] | dict[str, float] | None
        ),
    ] = Field(
        description="as printed, ± left out; by axis: {xy: 60, z: 80}; [low, high] of a range; "
        "null: not published"
    )
    unit: Text | None = Field(None, description="as the vendor writes it")
    kind: Kind = Field(
        "typ", description="choices: what can be selected; derived: computed from another figure"
    )
    sidedness: Literal["one-sided", "two-sided", "unknown"] = Field(
        "unknown", description="of a noise density: N is the one-sided density over sqrt(2)"
    )
    bandwidth: Frequency | None = Field(
        None, description="of an rms: the band, from 0, that it is stated for"
    )
    filter: Filter = Field(
        "stated",
        description="of an rms: stated, the bandwidth is the noise bandwidth, as Bosch, TDK and "
        "ST compute; or it is the cut-off of a filter of first or second order",
    )
    tau: Duration | None = Field(None, description="of an Allan deviation: its averaging time")
    option: Text | None = Field(
        None,
        description="grade, range or mode of the sensor with this figure; 'options' of the "
        "datasheet lists the options of the logged sensors",
    )
    condition: Text | None = Field(None, description="temperature, supply and the like, as printed")
    place: Text | None = Field(
        None, description="where it was read in the document, or sought: page, table or section"
    )
    evidence: Text | None = Field(None, description="source of the figure or its sidedness")
    source: Literal["primary", "secondary"] | None = Field(
        None, description="null: from the datasheet"
    )

    @model_validator(mode="after")
    def _consistent(self) -> "PrintedFigure":
        if self.value is None:
            return self
        if self.unit is None:
            raise ValueError("'unit' is missing; expected the unit of the figure as printed")
        if isinstance(self.value, tuple):
            if self.kind not in ("range", "choices"):
                raise ValueError(
                    f"value {list(self.value)} with kind {self.kind!r}; expected kind 'range' with "
                    "[low, high], or kind 'choices'"
                )
            ordered = len(self.value) == 2 and self.value[0] < self.value[1]
            if self.kind == "range" and not ordered:
                raise ValueError(f"value {list(self.value)}; expected [low, high] of the range")
        elif self.kind == "range":
            raise ValueError(f"value {self.value} with kind 'range'; expected [low, high]")
        else:
            numbers = self.value.values() if isinstance(self.value, dict) else [self.value]
            if any(number <= 0 for number in numbers):
                raise ValueError(f"value {self.value}; expected a figure above 0, without ±")
        return self

    def on_axis(self, axis: str) -> float | tuple[float, ...] | None:
        """Return the printed value for an axis, ``x``, ``y`` or ``z``; None if there is none."""
        if isinstance(self.value, dict):
            return next((v for axes, v in self.value.items() if axis in axes), None)
        return self.value

    @property
    def tau_s(self) -> float | None:
        """The averaging time of an Allan deviation, s."""
        return None if self.tau is None else parse_quantity(self.tau, "time")

    @property
    def bandwidth_hz(self) -> float | None:
        """The bandwidth of an rms, Hz."""
        return None if self.bandwidth is None else parse_quantity(self.bandwidth, "frequency")


def _listed(value: Any) -> Any:
    if isinstance(value, Mapping):
        return (PrintedFigure.model_validate(value),)
    listed = value if isinstance(value, (list, tuple)) else [value]
    if value is not None and not all(isinstance(each, (Mapping, PrintedFigure)) for each in listed):
        raise ValueError(
            "expected a figure such as {value: 3, unit: deg/h, kind: typ}, a list of them, or "
            "null: not published"
        )
    return value


Figures = Annotated[
    tuple[PrintedFigure, ...] | None,
    BeforeValidator(_listed, json_schema_input_type=PrintedFigure | list[PrintedFigure] | None),
]
"""A figure, or several where a vendor prints several; null: the vendor does not publish it."""


class QuantityDatasheet(Strict):
    """Datasheet figures of the gyro or the accelerometer; null: not published."""

    noise_density: Figures = Field(None, description="density, .../sqrt(Hz), or squared, .../Hz")
    random_walk: Figures = Field(
        None, description="angle or velocity random walk, deg/sqrt(h) or m/s/sqrt(h): N itself"
    )
    rms_noise: Figures = Field(None, description="standard deviation over a bandwidth")
    bias_instability: Figures = Field(
        None, description="in-run bias: the minimum of the curve of Allan deviation"
    )
    allan_deviation: Figures = Field(None, description="of the averaging time 'tau'")
    drift: Figures = Field(None, description="a drift that the document does not define further")
    rate_random_walk: Figures = Field(None, description="K")
    correlation_time: Figures = Field(None, description="T_B")
    offset: Figures = Field(
        None, description="zero-rate or zero-g offset, ±: the turn-on bias as it is delivered"
    )
    bias_repeatability: Figures = Field(None, description="offset from one run to another")
    temperature_coefficient: Figures = Field(None, description="offset per kelvin")
    temperature_total: Figures = Field(
        None, description="change of the offset over the temperature range of 'condition'"
    )
    temperature_rms: Figures = Field(
        None, description="rms of the offset while the temperature changes slowly"
    )
    scale_factor_error: Figures = Field(
        None, description="± of the scale factor or sensitivity, as % or ppm of itself"
    )
    scale_factor_temperature: Figures = Field(
        None, description="change of the scale factor per kelvin, as % or ppm of itself"
    )
    nonlinearity: Figures = Field(
        None, description="departure from the straight line, as % or ppm of full scale"
    )
    misalignment: Figures = Field(
        None, description="± of the angle between axes, or of an axis to the housing"
    )
    cross_axis: Figures = Field(None, description="signal of another axis, as % of it")
    g_sensitivity: Figures = Field(None, description="of a gyro's offset to acceleration")
    vibration_rectification: Figures = Field(
        None, description="change of the mean in vibration, per square of its rms acceleration"
    )
    full_scale: Figures = Field(None, description="±, of the sensor or to choose from")
    sensitivity: Figures = Field(None, description="unit per LSB, or LSB per unit")
    resolution: Figures = Field(None, description="smallest detectable change, such as deg/h")
    bandwidth: Figures = Field(None, description="-3 dB, of the sensor")

    @model_serializer(mode="wrap")
    def _as_written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Omit missing figures, which were not looked up; null means not published."""
        return {name: v for name, v in handler(self).items() if name in self.model_fields_set}

    def printed(self, name: str) -> tuple[PrintedFigure, ...]:
        """Return the published figures of one kind, such as ``noise_density``."""
        return tuple(figure for figure in getattr(self, name) or () if figure.value is not None)

    def looked_up(self, name: str) -> bool:
        """Return whether the sensor file has a figure ``name``, even as null (not published)."""
        return name in self.model_fields_set


def _dimensions(quantity: str, plain: str) -> dict[str, tuple[str, ...]]:
    noise = ("rms_noise", "bias_instability", "allan_deviation", "drift")
    bias = ("offset", "bias_repeatability", "temperature_total", "temperature_rms")
    return dict.fromkeys((*noise, *bias, "full_scale", "resolution"), (plain,)) | {
        "noise_density": (f"{quantity}_density", f"{quantity}_power_density"),
        "random_walk": (f"{quantity}_density",),
        "rate_random_walk": (f"{quantity}_random_walk",),
        "correlation_time": ("time",),
        "temperature_coefficient": (f"{quantity}_temperature_coefficient",),
        "scale_factor_error": ("ratio",),
        "scale_factor_temperature": ("ratio_temperature_coefficient",),
        "misalignment": ("angle",),
        "cross_axis": ("ratio",),
        "nonlinearity": ("ratio",),
        "vibration_rectification": (f"{quantity}_vibration_coefficient",),
        "sensitivity": (f"{quantity}_step", f"{quantity}_sensitivity"),
        "bandwidth": ("frequency",),
    }


FIGURE_DIMENSIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "gyro": _dimensions("gyro", "angular_rate")
    | {"g_sensitivity": ("gyro_acceleration_coefficient",)},
    "accel": _dimensions("accel", "acceleration"),
}
"""Dimensions that each datasheet figure may have, the usual one first, by quantity."""

SENSORS: Mapping[str, str] = {"gyro": "gyro", "accel": "accelerometer"}  # what measures it

_MAX_ACCELERATION_NOISE = 1.0  # largest printed noise density of an accelerometer, SI


def _check_unit(key: str, quantity: str, name: str, figure: PrintedFigure) -> None:
    """Raise for a wrong unit, and for values such as 400 g/√Hz, where µ was lost in a document."""
    dimensions = FIGURE_DIMENSIONS[quantity].get(name)
    if dimensions is None:
        raise ValueError(f"{key}: found under {quantity}; expected only under gyro")
    if figure.value is None or figure.unit is None:
        return
    unit = figure.unit
    try:
        dimension = find_dimension(unit, dimensions)
    except UnitError as error:
        mend = "; a figure by LSB is the 'sensitivity'" * ("LSB" in unit)
        raise ValueError(f"{key}.unit: {error}{mend}") from error
    if name in ("noise_density", "bias_instability") and quantity == "accel":
        for value in map(figure.on_axis, "xyz"):
            if (
                isinstance(value, float)
                and convert_to_si(value, unit, dimension) > _MAX_ACCELERATION_NOISE
            ):
                raise ValueError(
                    f"{key}: found {value:g} {unit}, which no accelerometer has; expected a value "
                    f"such as {value:g} u{unit.removeprefix('m')}: the prefix may be lost or wrong"
                )


class Datasheet(Strict):
    """A datasheet of a sensor."""

    document: Text | None = None
    missing: Text | None = Field(None, description="a document that was not to be had")
    revision: Text | None = Field(None, description="of the document, with its date")
    source: Literal["primary", "secondary"] | None = Field(
        None,
        description="primary: read in the vendor's document; secondary: quoted by somebody else",
    )
    options: tuple[Text, ...] = Field(
        (), description="grades, ranges and modes that the logged sensors have, such as [30 g]"
    )
    gyro: QuantityDatasheet | None = Field(
        default=QuantityDatasheet(), description="null: the sensor has no gyro"
    )
    accel: QuantityDatasheet | None = Field(
        default=QuantityDatasheet(), description="null: the sensor has no accelerometer"
    )

    @model_validator(mode="after")
    def _units(self) -> "Datasheet":
        for quantity in FIGURE_DIMENSIONS:
            sheet: QuantityDatasheet | None = getattr(self, quantity)
            for name in QuantityDatasheet.model_fields if sheet else ():
                figures: tuple[PrintedFigure, ...] = getattr(sheet, name) or ()
                for number, figure in enumerate(figures):
                    place = f".{number}" * (len(figures) > 1)
                    _check_unit(f"{quantity}.{name}{place}", quantity, name, figure)
        return self
