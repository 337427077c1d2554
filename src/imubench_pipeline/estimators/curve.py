"""Reading of N, K, B and T_B from the slopes of an Allan deviation (Maia et al., section 2.2).

A parameter whose slope is not visible has no value, but a reason.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.estimate import Estimate, Parameter, not_shown
from imubench_pipeline.noise import FLOOR, PEAK_TAU
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves as texts

_SLOPE_WINDOW = 0.5  # Width of the window for a local slope, decades of tau
_OCTAVE = math.log10(2.0)  # Distance of tau, in decades, below which estimates are correlated
_WHITE_TOLERANCE = 0.06
_WALK_TOLERANCE = 0.06
_WALK_MAX_TOLERANCE = 0.2
_WALK_SPANS = np.arange(0.4, 2.01, 0.1)
_WALK_MIN_SLOPE = 0.2
_RISE_SIGMAS = 3.0
_MIN_POINTS = 4


@dataclass(frozen=True)
class _Curve:
    """The usable part of a curve: logarithms to base 10, and standard errors of the deviation."""

    tau: Array
    deviation: Array
    error: Array

    def slope(self, inside: NDArray[np.bool_]) -> tuple[float, float]:
        """Return the weighted slope of the points inside, and its standard error."""
        weight = self.error[inside] ** -2
        centred = self.tau[inside] - np.average(self.tau[inside], weights=weight)
        moment = float(weight @ centred**2)
        slope = float(weight @ (centred * self.deviation[inside])) / moment
        # Points crowd an octave, but an octave holds about one independent estimate.
        spacing = float(np.median(np.diff(self.tau[inside])))
        crowd = max(1.0, _OCTAVE / spacing)
        return slope, math.sqrt(crowd / moment)

    def level(self, inside: NDArray[np.bool_] | slice, slope: float, tau: float) -> float:
        """Fit a line of given slope to the points inside; return its deviation at ``tau``."""
        weight = self.error[inside] ** -2
        offset = np.average(self.deviation[inside] - slope * self.tau[inside], weights=weight)
        return float(10.0 ** (offset + slope * math.log10(tau)))


def read(curve: AllanCurve, *, longest: float = 1 / 9) -> Estimate:
    """Read the parameters from the slopes of an Allan deviation.

    N is the value at tau = 1 s of the fitted -1/2 line, K the value at 3 s of the fitted +1/2 line
    at the end of the curve, B the minimum divided by 0.664, and T_B its tau divided by 1.89, in SI.
    A parameter without such a slope is ``not_shown``, with the reason. ``longest`` is the longest
    tau that is read, as a fraction of the log: beyond it, the curve is too uncertain.
    """
    used = curve.cluster_size <= longest * curve.samples
    if not (curve.variance[used] > 0).all():
        return not_shown("curve", texts.REPEATED_SAMPLES)
    # Where samples are missing, white noise is averaged over fewer than n: as at a shorter tau.
    thinned = np.sqrt(curve.cluster_size / curve.averaged)[used]
    points = _Curve(
        np.log10(curve.tau[used]),
        np.log10(curve.deviation[used]),
        1.0 / (math.log(10.0) * np.sqrt(2.0 * curve.edf[used])),
    )
    points_used = int(used.sum())
    if points_used < _MIN_POINTS:
        return not_shown("curve", texts.few_points(points_used, longest, _MIN_POINTS))
    bias, time = _read_minimum(points)
    N, K = _read_white(points, thinned), _read_walk(points)
    sigma, tau = bias, time
    if bias.value is not None and time.value is not None:
        sigma, tau = Parameter(bias.value * FLOOR), Parameter(time.value * PEAK_TAU)
    figures = {"B_curve": bias, "sigma_min": sigma, "tau_min": tau}
    return Estimate("curve", {"N": N, "B": bias, "T_B": time, "K": K}, curve=figures)


def _read_white(points: _Curve, thinned: Array) -> Parameter:
    slopes = np.full(len(points.tau), np.nan)
    for i, centre in enumerate(points.tau):
        inside = np.abs(points.tau - centre) <= _SLOPE_WINDOW / 2 + 1e-9
        if inside.sum() >= 3:
            slope, error = points.slope(inside)
            if error < 0.25:
                slopes[i] = slope
    if not np.isfinite(slopes).any():
        return Parameter(None, "not_shown", texts.SHORT_CURVE)
    # The ends have one-sided windows; the first run of the right slope is the white noise.
    close = np.abs(slopes + 0.5) <= _WHITE_TOLERANCE
    edges = np.flatnonzero(np.diff(np.concatenate(([0], close.astype(np.int8), [0]))))
    runs = [slice(*ends) for ends in edges.reshape(-1, 2) if ends[1] - ends[0] >= 3]
    if not runs:
        low, high = np.nanmin(slopes), np.nanmax(slopes)
        return Parameter(None, "not_shown", texts.no_white_slope(float(low), float(high)))
    excess = float(np.average(thinned[runs[0]], weights=points.error[runs[0]] ** -2))
    return Parameter(points.level(runs[0], -0.5, 1.0) / excess)


def _read_minimum(points: _Curve) -> tuple[Parameter, Parameter]:
    lowest = int(np.argmin(points.deviation))
    later = slice(lowest + 1, None)
    rise = points.deviation[later] - points.deviation[lowest]
    error = np.hypot(points.error[later], points.error[lowest])
    fall = points.deviation[0] - points.deviation[lowest]
    reason = None
    if lowest == 0 or fall < _RISE_SIGMAS * math.hypot(points.error[0], points.error[lowest]):
        reason = texts.NO_FALL
    elif not (rise > _RISE_SIGMAS * error).any():
        reason = texts.no_rise(float(10.0 ** points.tau[lowest]), _RISE_SIGMAS)
    if reason:
        nothing = Parameter(None, "not_shown", reason)
        return nothing, nothing
    bias = float(10.0 ** points.deviation[lowest]) / FLOOR
    time = float(10.0 ** points.tau[lowest]) / PEAK_TAU
    return Parameter(bias, reason=texts.READ_AT_MINIMUM), Parameter(time)


def _read_walk(points: _Curve) -> Parameter:
    """Read K from the longest stretch at the end of the curve that has the slope +1/2."""
    lowest = int(np.argmin(points.deviation))
    best: NDArray[np.bool_] | None = None
    steepest = -np.inf
    for span in _WALK_SPANS:
        inside = points.tau >= points.tau[-1] - span - 1e-9
        inside[: lowest + 1] = False
        if inside.sum() < 4:
            continue
        slope, error = points.slope(inside)
        steepest = max(steepest, slope)
        allowed = max(_WALK_TOLERANCE, min(error, _WALK_MAX_TOLERANCE))
        if abs(slope - 0.5) <= allowed and slope - 2 * error > _WALK_MIN_SLOPE:
            best = inside
    if best is None:
        shown = float(steepest) if np.isfinite(steepest) else None
        return Parameter(None, "not_shown", texts.no_walk_slope(shown))
    return Parameter(points.level(best, 0.5, 3.0))
