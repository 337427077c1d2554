"""Compare measured values with printed figures.

A verdict applies to the whole 95 % interval of the measurement. If the interval crosses a boundary,
the verdict is ``not sure``, and the reason names the possible ones.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.datasheets.comparable import (
    SENSITIVITY,
    Comparable,
    read_bias_comparables,
    read_comparables,
)
from imubench_pipeline.earth import EARTH_RATE, STANDARD_GRAVITY
from imubench_pipeline.estimators.curve_bias import compute_curve_figures
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.words.reasons import datasheets as texts
from imubench_pipeline.words.reasons.pools import status_reason

_MAX_GRAVITY_DEVIATION = 0.027
"""m/s²; maximum deviation of gravity on the ground from its standard value."""

NO_TEMPERATURE_READINGS = Parameter(None, "not_shown", texts.NO_TEMPERATURE)
"""Sensitivity of a log without temperature readings."""

_MIN_VERTICAL_COSINE = math.cos(math.radians(15.0))
_MAX_NORM_ERROR_AT_REST = 0.15


def get_measured(entry: Comparable, estimate: Estimate, tau: NDArray[np.float64]) -> Parameter:
    """Return the measured value, with limits, to compare with a printed figure, SI.

    Minimum and plateau are from `imubench_pipeline.estimators.curve_bias`, at averaging times
    ``tau``, s, shape (m,). The limits at any other point are the extremes of the curve and of four
    more: all amplitudes at their lower or upper limits, and all T_B at their lower or upper limits.
    """
    statistic = entry.statistic
    if statistic in ("plateau", "adev_minimum"):
        # An estimate that was made by hand has only its terms.
        of_curve = estimate.curve or compute_curve_figures(estimate.model, tau)
        if statistic == "plateau":
            top = of_curve["B_curve"]
            value, lower, upper = (
                None if each is None else each * FLOOR for each in (top.value, top.lower, top.upper)
            )
            return replace(top, value=value, lower=lower, upper=upper)
        return of_curve["sigma_min"]
    if statistic != "adev":
        return estimate.parameters[statistic]
    at = entry.tau or math.nan
    if not len(tau) or not tau[0] <= at <= tau[-1]:
        return Parameter(None, "not_shown", texts.curve_not_shown(at))
    ends = _list_interval_ends(estimate)
    point, *points = (
        math.sqrt(float(each.model.allan_variance(np.array([at]))[0])) for each in (estimate, *ends)
    )
    if not points:
        return Parameter(point)
    return Parameter(point, lower=min(point, *points), upper=max(point, *points))


def _list_interval_ends(estimate: Estimate) -> Iterator[Estimate]:
    """Yield the estimate at the ends of its intervals; nothing if an interval is missing."""
    groups = [estimate.parameters, *estimate.further]
    in_model = [p for group in groups for p in group.values() if p.in_model]
    if any(p.lower is None or p.upper is None for p in in_model):
        return

    def at(group: Mapping[str, Parameter], amplitudes: str, times: str) -> dict[str, Parameter]:
        found = {
            name: Parameter(getattr(p, times if name == "T_B" else amplitudes)) if p.in_model else p
            for name, p in group.items()
        }
        if (time := found.get("T_B")) and time.value == 0.0:
            # As T_B goes to 0, the Allan variance of the process does so too.
            found |= {"B": Parameter(0.0), "T_B": Parameter(None, "absent")}
        return found

    for ends in product(("lower", "upper"), repeat=2):
        first, *further = (at(group, *ends) for group in groups)
        yield replace(estimate, parameters=first, further=further)


def compute_fixed_bias(channel: str, means: Mapping[str, float]) -> Parameter:
    """Return the magnitude of the fixed bias of a channel from a static recording, rad/s or m/s².

    For a gyro it is the magnitude of the mean, which includes the Earth's rotation. For a vertical
    accelerometer axis it is the norm of the three axes minus standard gravity. On any other axis, a
    bias cannot be distinguished from a tilt. The limits allow for the unknown part of the Earth's
    rate, or of gravity.
    """
    if channel.startswith("gyro"):
        return _bound_size(means[channel], EARTH_RATE, texts.EARTH_RATE_IN_MEAN)
    axes = [means.get(f"accel_{axis}") for axis in "xyz"]
    if any(value is None for value in axes):
        return Parameter(None, "not_shown", texts.GRAVITY_NEEDS_THREE_AXES)
    norm = math.hypot(*(value or 0.0 for value in axes))
    if abs(norm / STANDARD_GRAVITY - 1.0) > _MAX_NORM_ERROR_AT_REST:
        return Parameter(None, "not_shown", texts.mean_is_not_gravity(norm))
    if abs(means[channel]) < _MIN_VERTICAL_COSINE * norm:
        return Parameter(None, "not_shown", texts.AXIS_NOT_VERTICAL)
    return _bound_size(norm - STANDARD_GRAVITY, _MAX_GRAVITY_DEVIATION, texts.NORM_LESS_GRAVITY)


def _bound_size(value: float, unknown: float, reason: str) -> Parameter:
    size = abs(value)
    return Parameter(size, "ok", reason, max(size - unknown, 0.0), size + unknown)


def compute_sensitivity(
    rows: Iterable[TemperatureRow], lowest: float | None, highest: float | None
) -> Parameter:
    """Return the magnitude of the temperature sensitivity of a channel, rad/s/K or m/s²/K.

    The reason states the reference temperature and the range, °C. If the temperature effect was not
    removed from the log, only the upper limit is useful. If the effect cannot be separated from
    time, there is neither value nor limit.
    """
    by_parameter = {row.parameter: row for row in rows}
    row = by_parameter.get("sensitivity")
    if row is None:
        return NO_TEMPERATURE_READINGS
    bends = by_parameter["quadratic"].value is not None
    reference = by_parameter["T_0"].value
    assert reference is not None  # of every fit
    at = texts.slope_at(reference, lowest, highest, bends=bends)
    lower, upper = row.lower, row.upper
    if row.value is None or lower is None or upper is None:
        return Parameter(None, "not_identified", row.reason or texts.NO_INTERVAL)
    largest = max(abs(lower), abs(upper))
    if not row.compensated:
        return Parameter(None, "not_identified", f"{row.reason}; {at}", 0.0, largest)
    least = 0.0 if lower <= 0.0 <= upper else min(abs(lower), abs(upper))
    return Parameter(abs(row.value), "ok", at, least, largest)


_TYPICAL_KINDS = ("typ", "1sigma", "derived")


@dataclass(frozen=True)
class Delta:
    """Comparison of one printed figure with one estimate: a row of the table ``datasheet``."""

    quantity: str
    statistic: str
    printed: float | None
    unit: str | None
    kind: str | None
    condition: str | None
    sidedness: str | None
    comparable: float | None
    comparable_lower: float | None
    comparable_upper: float | None
    measured: float | None
    lower: float | None
    upper: float | None
    verdict: str
    reasons: tuple[str, ...]
    delta: float | None = None
    delta_lower: float | None = None
    delta_upper: float | None = None


def deltas(
    datasheet: Datasheet,
    channel: str,
    estimate: Estimate,
    tau: NDArray[np.float64],
    tolerance: float,
) -> Iterator[Delta]:
    """Compare an estimate, SI, with a datasheet: one row for each interpretation of its figures.

    ``tau``, shape (m,), s, are the averaging times at which the curve is accurate enough to find
    its minimum. ``tolerance`` is the largest relative difference that is ``as printed``.
    """
    for entry in read_comparables(datasheet, channel):
        yield compare(entry, get_measured(entry, estimate, tau), tolerance)


def bias_deltas(
    datasheet: Datasheet,
    channel: str,
    means: Mapping[str, float],
    tolerance: float,
    sensitivity: Parameter | None = None,
) -> Iterator[Delta]:
    """Compare the fixed bias of a recording and its temperature sensitivity with the datasheet.

    The rows are the offset; the temperature coefficient, if one is printed; and the printed figures
    of repeatability and temperature that cannot be compared with one log. ``means`` has the mean of
    every channel of the recording, rad/s or m/s². ``tolerance`` is as in `deltas`. ``sensitivity``
    is the result of `compute_sensitivity`, None without readings of the temperature.
    """
    bias = compute_fixed_bias(channel, means)
    for entry in read_bias_comparables(datasheet, channel):
        found = bias
        if entry.statistic == SENSITIVITY:
            found = sensitivity or NO_TEMPERATURE_READINGS
        elif entry.quantity != "offset":
            found = Parameter(None)
        elif bias.value is None and entry.figure:
            entry = replace(entry, value=None, lower=None, upper=None, obstacle=bias.reason)
        yield compare(entry, found, tolerance)


def compare(entry: Comparable, parameter: Parameter, tolerance: float) -> Delta:
    """Compare a printed figure with its measured value, SI.

    Without limits, the verdict follows from the value alone. ``delta`` is measured / comparable -
    1, with its least and largest value within both intervals. The tolerance is as in `deltas`.
    """
    figure = entry.figure
    tau = f"τ = {figure.tau}" if figure and figure.tau else None  # of an Allan deviation
    value, lower, upper = parameter.value, parameter.lower, parameter.upper
    row = Delta(
        quantity=entry.quantity,
        statistic=entry.statistic,
        printed=entry.printed,
        unit=figure.unit if figure else None,
        kind=figure.kind if figure else None,
        condition=", ".join(filter(None, (tau, figure.condition))) or None if figure else None,
        sidedness=entry.sidedness,
        comparable=entry.value,
        comparable_lower=entry.lower,
        comparable_upper=entry.upper,
        measured=value,
        lower=lower,
        upper=upper,
        verdict="not published" if entry.looked_up else "not looked up",
        reasons=(entry.reason,) if entry.reason else (),
    )
    if figure is None:
        return row
    if entry.value is None:
        return replace(
            row, verdict="not comparable (condition)", reasons=tuple(filter(None, [entry.obstacle]))
        )
    if value is None:
        reason = status_reason(parameter.status, parameter.reason)
        if upper is not None:
            least = _classify_value(entry, lower or 0.0, tolerance)
            if least == _classify_value(entry, upper, tolerance) != "as printed":
                return replace(row, verdict=least, reasons=(texts.limits_decide(reason),))
        return replace(row, verdict="not measured", reasons=(reason,))
    row = replace(
        row,
        delta=_compute_relative_difference(value, entry.value),
        delta_lower=_compute_relative_difference(lower, entry.upper),
        delta_upper=_compute_relative_difference(upper, entry.lower),
    )
    low, high = (value, value) if lower is None or upper is None else (lower, upper)
    least, largest = (_classify_value(entry, end, tolerance) for end in (low, high))
    reasons = [reason for reason in (entry.reason, parameter.reason) if reason]
    if least != largest:
        reasons.append(texts.interval_spans(least, largest))
    return replace(row, verdict=least if least == largest else "not sure", reasons=tuple(reasons))


def _classify_value(entry: Comparable, value: float, tolerance: float) -> str:
    assert entry.figure is not None and entry.value is not None
    if entry.figure.kind in ("max", "range"):
        if value > entry.value:
            return "worse than max"
        return "better than typ" if value < (entry.least or 0.0) else "as printed"
    if value > entry.value * (1.0 + tolerance):
        return "worse than typ"
    return "better than typ" if value < entry.value * (1.0 - tolerance) else "as printed"


def _compute_relative_difference(value: float | None, printed: float | None) -> float | None:
    """Return the relative difference; None without two numbers, the printed one positive."""
    if value is None or printed is None or printed <= 0:
        return None
    return value / printed - 1.0


@dataclass(frozen=True)
class CurveRms:
    """Distance between a measured curve and the lines of a datasheet."""

    sidedness: str | None  # of the printed noise density, in this reading
    # N, floor: the printed figures of the two lines, SI
    N: float | None
    floor: float | None
    rms: float  # root mean square over tau of measured minus printed Allan deviation, rad/s or m/s²
    rms_log10: float  # rms of the difference of log10, decades


def curve_rms(
    printed: Sequence[Comparable], tau: NDArray[np.float64], adev: NDArray[np.float64]
) -> list[CurveRms]:
    """Compare a measured curve with the lines N/√τ and bias instability of a datasheet.

    The lines add as variances: σ²(τ) = N²/τ + floor². If a datasheet prints only one line, that one
    is used. If N may be one-sided or two-sided, there are two results. Typical figures are
    preferred. ``printed`` are the figures of a channel; ``adev`` is the measured Allan deviation
    above 0, rad/s or m/s², at ``tau``, s; both have shape (m,).
    """
    noises: list[Comparable | None] = [*_select_typical(printed, "N")]
    floors: list[Comparable | None] = [*_select_typical(printed, "adev_minimum")]
    distances = []
    for noise, floor in product(noises or [None], floors[:1] or [None]):
        if noise is None and floor is None:
            continue
        N, bottom = (line.value if line else None for line in (noise, floor))
        side = noise.sidedness if noise else None
        line = np.sqrt((N or 0.0) ** 2 / tau + (bottom or 0.0) ** 2)
        absolute, relative = adev - line, np.log10(adev / line)
        rms, rms_log10 = (float(np.sqrt(np.mean(each**2))) for each in (absolute, relative))
        distances.append(CurveRms(side, N, bottom, rms, rms_log10))
    return distances


def _select_typical(printed: Sequence[Comparable], statistic: str) -> list[Comparable]:
    """Return the typical figures of a statistic, or the others if there are none."""
    with_value = [row for row in printed if row.statistic == statistic and row.value is not None]
    typical = [row for row in with_value if row.figure and row.figure.kind in _TYPICAL_KINDS]
    return typical or with_value
