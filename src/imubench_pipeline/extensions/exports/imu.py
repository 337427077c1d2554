"""Noise and temperature effect of an inertial sensor, as exports to other programs take them."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from imubench_pipeline.extensions.exports import reasons as texts
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.words.numbers import number_text, percent_text

AXES = "xyz"

_MAX_RELATIVE_ERROR = 0.5
"""Max. half-width of the 95 % interval over s; a correction then removes at least half."""

_MIN_TEMPERATURE_RANGE = 2.0
"""K. PX4 updates a correction only after a change of 1 K (update_offsets_gyro); in a smaller range
about T_0 it would not correct anything."""


@dataclass(frozen=True)
class TemperatureEffect:
    """Effect of temperature on the biases of a quantity, for programs that correct or simulate it.

        bias(T) - bias(T_0) = s (T - T_0) + q (T - T_0)^2,

    as `estimators.thermal` fits it to one recording of one device. A wrong correction is worse than
    none, and none of the programs models a thermal lag. An axis is therefore left out, with the
    reason, unless the log determines s accurately enough.

    ``slope`` and ``square`` are s and q of each axis with a usable estimate, rad/s or m/s² per K
    and K²; q only for axes with a quadratic term.
    """

    reference: float = 0.0  # T_0, the temperature of zero effect, °C
    low: float = 0.0  # range of the temperature of the recording, °C
    high: float = 0.0
    slope: Mapping[str, float] = field(default_factory=dict)
    square: Mapping[str, float] = field(default_factory=dict)
    notes: Sequence[str] = ()  # source of each axis, and reasons for omitted axes


def find_temperature_effect(
    rows: Iterable[TemperatureRow], recording: RecordingRow, quantity: str, horizon: float
) -> TemperatureEffect:
    """Return the effect of temperature on a quantity in one recording.

    `rows` are the rows of the recording. An axis whose thermal lag may exceed the `horizon` is left
    out; the horizon is the longest time that the program predicts without a measurement, s.
    """
    low, high = recording.temperature_min, recording.temperature_max
    by_axis: dict[str, dict[str, TemperatureRow]] = {}
    for row in rows:
        of, axis = row.channel.split("_")
        if of == quantity:
            by_axis.setdefault(axis, {})[row.parameter] = row
    if not by_axis or low is None or high is None:
        return TemperatureEffect(
            notes=[f"not included, as {recording.recording} has no temperature readings"]
        )
    reference = _require_value(min(by_axis.items())[1]["T_0"])
    unit = {"gyro": "rad/s", "accel": "m/s^2"}[quantity]
    slope: dict[str, float] = {}
    square: dict[str, float] = {}
    notes = [texts.temperature_range(reference, recording.recording, recording.device, low, high)]
    for axis in AXES:
        if axis not in by_axis:
            notes.append(texts.axis_not_included(axis, texts.NO_TEMPERATURE_FIT))
            continue
        fit = by_axis[axis]
        reason = _find_objection(fit, high - low, horizon)
        if reason is not None:
            notes.append(texts.axis_not_included(axis, reason))
            continue
        s, q = fit["sensitivity"], fit["quadratic"].value or 0.0
        # The axes of one quantity may come from files whose mean temperatures differ.
        slope[axis] = _require_value(s) + 2.0 * q * (reference - _require_value(fit["T_0"]))
        if q:
            square[axis] = q
        limits, lag = (s.lower, s.upper), fit["lag"].upper
        notes.append(texts.axis_slope(axis, _require_value(s), limits, q, unit, lag))
    return TemperatureEffect(reference, float(low), float(high), slope, square, notes)


def _require_value(row: TemperatureRow) -> float:
    """Return the value of T_0 or of a usable sensitivity; ValueError if it has none."""
    if row.value is None:
        raise ValueError(f"{row.channel}: {row.parameter} has no value: {row.reason}")
    return row.value


def _find_objection(fit: Mapping[str, TemperatureRow], span: float, horizon: float) -> str | None:
    """Return the reason against a correction with a fit; None if it is safe."""
    s, lag = fit["sensitivity"], fit["lag"]
    if s.value is None or s.lower is None or s.upper is None:
        return texts.status_reason("the sensitivity", s.status, s.reason)
    if not s.compensated:
        return texts.effect_not_shown(s.reason)
    error = 0.5 * (s.upper - s.lower) / abs(s.value)
    if error > _MAX_RELATIVE_ERROR:
        return (
            f"the sensitivity is known to {percent_text(error, 2)}, from noise and the resolution "
            f"of the temperature, and {percent_text(_MAX_RELATIVE_ERROR, 2)} is needed"
        )
    if span < _MIN_TEMPERATURE_RANGE:
        return (
            f"the temperature varies by only {number_text(span, 2)} K, and "
            f"{number_text(_MIN_TEMPERATURE_RANGE)} K is needed"
        )
    if lag.status != "absent":
        longest = lag.upper
        if longest is None:
            return texts.status_reason("its lag", lag.status, lag.reason)
        if longest > horizon:
            return (
                f"it may lag the temperature by {number_text(longest, 3)} s, more than the horizon "
                f"of {number_text(horizon)} s, and the program has no lag"
            )
    return None


class ExportError(ValueError):
    """Raised for an export that the program cannot load; the message states the remedy."""


@dataclass(frozen=True)
class AxisNoise:
    """Noise model of one axis, SI, which represents all axes of its quantity."""

    model: NoiseModel
    origin: str  # axis, recording and method of the model, in words
    notes: Sequence[str] = ()  # treatment of parameters without a plain value
    slow_limited: bool = False  # K is an upper limit: no log determines a slow term
    bounded: tuple[float, float] | None = None
    """Lowest and highest frequency of an overbound, Hz; None: the model is no overbound."""
    each: Mapping[str, "AxisNoise"] = field(default_factory=dict)
    """The axes x, y and z that have an estimate, for programs that take three numbers."""

    def inflated(self, factor: float) -> "AxisNoise":
        """Return the noise with all densities and amplitudes multiplied by a factor."""
        return replace(
            self,
            model=self.model.scaled(factor),
            each={letter: axis.inflated(factor) for letter, axis in self.each.items()},
        )


def split_axes(axes: Mapping[str, AxisNoise]) -> dict[str, AxisNoise]:
    """Split the noise of each quantity into axes with names such as ``gyro x``.

    A quantity keeps its name for axes without an estimate, and where it is not split: if all axes
    are equal, or its model is an overbound.
    """
    split: dict[str, AxisNoise] = {}
    for name, axis in axes.items():
        differ = any(one.model != axis.model for one in axis.each.values())
        own = axis.each if differ and not axis.bounded else {}
        split |= {f"{name} {letter}": own[letter] for letter in AXES if letter in own}
        if len(own) < len(AXES):
            split[name] = axis
    return split


@dataclass(frozen=True, kw_only=True)
class Imu:
    """Noise of a sensor, with settings of an export; ExportError if a setting is invalid."""

    sensor: str
    rate: float  # of the samples that the program will get, Hz
    estimated: Mapping[str, AxisNoise]  # gyro, accel, or both, without the inflation
    horizon: float = 60.0
    """Longest time that the program predicts without a measurement, s. A replacement for a model
    that the program does not support has the same Allan variance at this time."""
    inflation: float = 1.0  # factor on all densities and amplitudes, not on variances
    because: str | None = None
    """Reason of the inflation, or of the use of a recording that is excluded from decisions."""
    simulated: bool = False  # whether the recordings are simulated
    cautions: Sequence[str] = ()  # doubts about the recordings, and those that were left out
    temperature: Mapping[str, TemperatureEffect] = field(default_factory=dict)  # by quantity
    mode: str = ""  # the mode of the file (`modes`) in words
    ros_topic: str = "/imu0"  # of the samples

    def __post_init__(self) -> None:
        for name in ("rate", "horizon", "inflation"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ExportError(f"{name} is {value}, expected a number above 0")
        if not self.horizon * self.rate > 2.0:
            least = f"two samples; expected more than {2.0 / self.rate:g} s"
            raise ExportError(f"the horizon of {self.horizon:g} s is not longer than {least}")
        if self.inflation != 1.0 and not (self.because or "").strip():
            raise ExportError(f"an inflation of {self.inflation:g} needs a reason: state 'because'")

    @property
    def axes(self) -> dict[str, AxisNoise]:
        """The quantities that have an estimate, with the inflation in their models."""
        return {name: axis.inflated(self.inflation) for name, axis in self.estimated.items()}

    def require_both(self) -> None:
        """Raise ExportError if there is no estimate of gyro or accelerometer."""
        missing = [name for name in ("gyro", "accel") if name not in self.axes]
        if missing:
            raise ExportError(
                f"{self.sensor}: no estimate of {' and '.join(missing)}; this program needs gyro "
                "and accel: use logs of both"
            )
