"""Effect of temperature on the bias, for programs that correct or simulate it.

    bias(T) - bias(T_0) = s (T - T_0) + q (T - T_0)^2,

as `estimators.thermal` fits it to one recording of one device. A wrong correction is worse than
none, and none of the programs models a thermal lag. An axis is therefore left out, with the reason,
unless the log determines s accurately enough.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.words.estimates import STATUS_WORDS

AXES = "xyz"

_MAX_RELATIVE_ERROR = 0.5
"""Max. half-width of the 95 % interval over s; a correction then removes at least half."""

_MIN_TEMPERATURE_RANGE = 2.0
"""K. PX4 updates a correction only after a change of 1 K (update_offsets_gyro); in a smaller range
about T_0 it would not correct anything."""


@dataclass(frozen=True)
class TemperatureEffect:
    """Effect of temperature on the biases of a quantity.

    ``slope`` and ``square`` are s and q of each axis with a usable estimate, rad/s or m/s² per K
    and K²; q only for axes with a quadratic term.
    """

    reference: float = 0.0  # T_0, the temperature of zero effect, °C
    low: float = 0.0  # range of the temperature of the recording, °C
    high: float = 0.0
    slope: Mapping[str, float] = field(default_factory=dict)
    square: Mapping[str, float] = field(default_factory=dict)
    notes: Sequence[str] = ()  # source of each axis, and reasons for omitted axes


def temperature_effect(
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
        why = f"{recording.recording} has no readings of the temperature"
        return TemperatureEffect(notes=[f"left out: {why}"])
    reference = _require_value(min(by_axis.items())[1]["T_0"])
    unit = {"gyro": "rad/s", "accel": "m/s^2"}[quantity]
    slope: dict[str, float] = {}
    square: dict[str, float] = {}
    notes = [
        f"T_0 = {reference:.2f} degC, of recording {recording.recording}, device "
        f"{recording.device}: it holds for that device, from {low:.2f} to {high:.2f} degC"
    ]
    for axis in AXES:
        if axis not in by_axis:
            notes.append(f"axis {axis} left out: no fit of the temperature")
            continue
        fit = by_axis[axis]
        reason = _find_objection(fit, high - low, horizon)
        if reason is not None:
            notes.append(f"axis {axis} left out: {reason}")
            continue
        s, q = fit["sensitivity"], fit["quadratic"].value or 0.0
        # The axes of one quantity may come from files whose mean temperatures differ.
        slope[axis] = _require_value(s) + 2.0 * q * (reference - _require_value(fit["T_0"]))
        if q:
            square[axis] = q
        longest = fit["lag"].upper
        lag = "no lag" if longest is None else f"a lag of up to {longest:.3g} s is not corrected"
        bends = f", square {q:.3e} {unit}/K^2" if q else ""
        notes.append(
            f"axis {axis}: {s.value:.4e} {unit}/K, 95 % limits {s.lower:.3e} to "
            f"{s.upper:.3e}{bends}; {lag}"
        )
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
        return f"the sensitivity is {STATUS_WORDS[s.status]}: {s.reason}"
    if not s.compensated:
        return f"the log does not show it: {s.reason}"
    error = 0.5 * (s.upper - s.lower) / abs(s.value)
    if error > _MAX_RELATIVE_ERROR:
        return (
            f"it is known to {100 * error:.0f} % only, by the noise and by what the register of "
            f"the temperature leaves open; {100 * _MAX_RELATIVE_ERROR:.0f} % is needed"
        )
    if span < _MIN_TEMPERATURE_RANGE:
        return (
            f"the temperature varies by {span:.2g} K only; {_MIN_TEMPERATURE_RANGE:g} K is needed"
        )
    if lag.status != "absent":
        longest = lag.upper
        if longest is None:
            return f"its lag is {STATUS_WORDS[lag.status]}: {lag.reason}"
        if longest > horizon:
            return (
                f"it may lag the temperature by {longest:.3g} s, longer than the horizon of "
                f"{horizon:g} s, and the program has no lag"
            )
    return None
