"""Derive the statistics that vendors print from the estimates of a recording."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.datasheets.comparable import Comparable
from imubench_pipeline.earth import EARTH_RATE, STANDARD_GRAVITY
from imubench_pipeline.estimators.curve_bias import compute_curve_figures
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.words.reasons import datasheets as texts

_MAX_GRAVITY_DEVIATION = 0.027
"""m/s²; maximum deviation of gravity on the ground from its standard value."""

NO_TEMPERATURE_READINGS = Parameter(None, "not_shown", texts.NO_TEMPERATURE)
"""Sensitivity of a log without temperature readings."""

_MIN_VERTICAL_COSINE = math.cos(math.radians(15.0))
_MAX_NORM_ERROR_AT_REST = 0.15


def get_measured(entry: Comparable, estimate: Estimate, tau: NDArray[np.float64]) -> Parameter:
    """Return the estimate of the statistic that a printed figure is compared with, SI.

    Minimum and plateau are from `imubench_pipeline.estimators.curve_bias`, over the averaging times
    tau, s, shape (m,). The limits of any other point of the curve are at least as wide as 95 %: all
    amplitudes are at the same end of their intervals, and each correlation time at either end.
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
        return {
            name: Parameter(getattr(p, times if name == "T_B" else amplitudes)) if p.in_model else p
            for name, p in group.items()
        }

    for ends in product(("lower", "upper"), repeat=2):
        first, *further = (at(group, *ends) for group in groups)
        yield replace(estimate, parameters=first, further=further)


def compute_fixed_bias(channel: str, means: Mapping[str, float]) -> Parameter:
    """Return the magnitude of the fixed bias of a channel from a static recording, rad/s or m/s².

    For a gyro it is the magnitude of the mean, which includes the Earth's rotation. For a vertical
    accelerometer axis it is the norm of the three axes less standard gravity. On any other axis, a
    bias cannot be distinguished from a tilt. The limits are the uncertainty of the Earth's rate or
    gravity.
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
    deviation = norm - STANDARD_GRAVITY
    return _bound_size(deviation, _MAX_GRAVITY_DEVIATION, texts.NORM_LESS_GRAVITY)


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
