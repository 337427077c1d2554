"""Whether figures can be those of a resting inertial sensor in the unit that is stated."""

from __future__ import annotations

import math
from collections.abc import Mapping

from imubench_pipeline.findings import Finding

_GRAVITY = 9.80665
_TOLERANCE = 0.15
_MISREAD = (
    (1.0, "the figures look like g; state unit g"),
    (1000.0, "the figures look like mg; state unit mg"),
    (_GRAVITY**2, "the figures look like m/s²; state unit m/s^2, and not g"),
    (_GRAVITY**2 / 1000.0, "the figures look like m/s²; state unit m/s^2, and not mg"),
    (_GRAVITY / 1000.0, "the figures look like g; state unit g, and not mg"),
    (_GRAVITY * 1000.0, "the figures look like mg; state unit mg, and not g"),
)
"""Norm in m/s² of gravity that was read in a wrong unit."""

_LOUD = math.radians(0.25)
_QUIET = math.radians(2e-4)
"""White noise that no MEMS gyro has, rad/s/√Hz: twenty times that of a usual one, or a tenth of
the best."""

_DEGREES = math.degrees(1.0)
_LARGEST_OFFSET = math.radians(30.0)


def gravity(means: Mapping[str, float]) -> Finding | None:
    """Check that the norm of a resting accelerometer is that of gravity.

    Parameters
    ----------
    means : mapping of str to float
        Mean of each accelerometer axis, m/s²; nothing is said unless all three are there.
    """
    axes = [means.get(f"accel_{axis}") for axis in "xyz"]
    if any(value is None for value in axes):
        return None
    norm = math.sqrt(sum((value or 0.0) ** 2 for value in axes))
    if abs(norm / _GRAVITY - 1.0) <= _TOLERANCE:
        return None
    advice = "check unit, scale, offset and columns of the accelerometer"
    if norm < 0.05 * _GRAVITY:
        advice = "gravity seems to be taken off already (linear acceleration); use the raw figures"
    for _, words in _misread(norm):
        advice = words
    detail = f"the mean acceleration has a norm of {norm:.4g} m/s², expected {_GRAVITY:.4g}"
    return Finding("gravity_norm", "warning", f"{detail}: {advice}", norm)


def factor_of_gravity(norm: float) -> float | None:
    """Return by what accelerations are to be multiplied if their unit was mixed up.

    Parameters
    ----------
    norm : float
        Of the mean acceleration of a sensor at rest, m/s² as stated.

    Returns
    -------
    float or None
        None where it is that of gravity in no other unit.
    """
    return next((_GRAVITY / misread for misread, _ in _misread(norm)), None)


def _misread(norm: float) -> list[tuple[float, str]]:
    """Return the norms of gravity in a wrong unit that a norm may be, with what to state."""
    return [one for one in _MISREAD if abs(norm / one[0] - 1.0) <= _TOLERANCE]


def gyro_noise(densities: Mapping[str, float]) -> list[Finding]:
    """Check that gyros are as noisy as gyros are.

    Parameters
    ----------
    densities : mapping of str to float
        White noise density of each gyro axis, roughly, rad/s/√Hz.
    """
    found = []
    for channel, density in densities.items():
        shown = math.degrees(density)
        if density > _LOUD:
            detail = (
                f"{channel} has a noise of {shown:.3g} °/s/√Hz, twenty times that of a MEMS gyro: "
                f"are the figures in °/s, and not rad/s? It would be {shown / _DEGREES:.3g} then"
            )
        elif density < _QUIET:
            detail = (
                f"{channel} has a noise of {shown:.3g} °/s/√Hz, which no MEMS gyro reaches: are "
                f"the figures in rad/s, and not °/s? It would be {shown * _DEGREES:.3g} then"
            )
        else:
            continue
        found.append(Finding("suspicious_unit", "warning", detail, density, channel))
    return found


def gyro_offset(means: Mapping[str, float]) -> list[Finding]:
    """Check that the mean of a resting gyro is an offset and not a rotation.

    Parameters
    ----------
    means : mapping of str to float
        Mean of each channel, rad/s or m/s².
    """
    return [
        Finding(
            "large_offset",
            "warning",
            f"{channel} has a mean of {math.degrees(mean):.4g} °/s: is the sensor at rest, and is "
            "the unit right?",
            mean,
            channel,
        )
        for channel, mean in means.items()
        if channel.startswith("gyro") and abs(mean) > _LARGEST_OFFSET
    ]
