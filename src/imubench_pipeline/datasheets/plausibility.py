"""Whether figures can be those of a resting inertial sensor in the unit that is stated.

It is told from the levels that a recording leaves, beside what the file of its sensor prints: so an
edit of a datasheet need not read the log again.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from imubench_pipeline.datasheets.expected import Expected, expected
from imubench_pipeline.datasheets.rates import implausible_rates
from imubench_pipeline.datasheets.suspicion import NEAR_PRINTED
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.recordings.quality.rotation import GravityTurn
from imubench_pipeline.recordings.quality_file import Quality
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor, quantity_of
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.units import conversion, from_si

Level = Mapping[str, Any]
"""Of a channel, as `imubench_pipeline.recordings.quality.levels.kept_level` returns it."""

_TOLERANCE = 0.15
"""Part of gravity that the mean of an accelerometer may be off."""

_FAR = 2.5
"""Times beyond what is usual from which a noise is suspicious: above 10 times or below 0.16 times
what a datasheet prints, and of a gyro without one above 0.15 °/s/√Hz or below 2e-4."""

_EXPLAINED = 1.5
"""Times beyond what is usual that a noise may be in the unit that is asked for instead."""

_UNEVEN = 4.0
"""Times the noise of both other axes of a sensor, either way, from which one is in doubt."""

_EVEN = 2.5
"""Times by which those two may differ from each other for that."""

_UNTIMED = 2.5
"""Times a printed noise, either way, from which it is in doubt where no stamps tell the rate: N
goes with its root, and a stated rate that is ten times wrong is 3.2 times."""

_SAME = 1.5
"""Times by which its noise may be off theirs in the unit that is asked for instead."""

_UNITS: Mapping[str, Sequence[str]] = {
    "gyro": ("rad/s", "deg/s", "mdeg/s", "mrad/s", "deg/h"),
    "accel": ("m/s^2", "g", "mg", "ug"),
}
"""In which loggers write, the usual ones first."""

_SHOWN = {"gyro": ("°/s/√Hz", "gyro_density"), "accel": ("µg/√Hz", "accel_density")}

_TILTED = math.radians(10.0)
"""Turn of gravity over a log that no drift of an accelerometer makes: 0.17 g."""

_TILTING = math.radians(1.0)
_AGREES = 0.25
"""The same where gyros turn with it, and part of its rate that they may be off."""


def implausible(
    channels: Mapping[str, Level],
    gravity: GravityTurn | None,
    sensor: Sensor | None,
    *,
    static: bool = True,
) -> list[Finding]:
    """Return what speaks against a sensor at rest whose figures are in the stated unit.

    Parameters
    ----------
    channels : mapping of str to mapping
        The levels of each channel.
    gravity : GravityTurn or None
        How gravity turns against the sensor.
    sensor : Sensor or None
        What its file says; None: there is none.
    static : bool
        The sensor was to be at rest.
    """
    of = {quantity: expected(sensor, quantity) for quantity in QUANTITIES}
    rates = {name: level["rate"] for name, level in channels.items()}
    found = implausible_rates(rates, {name: of[quantity_of(name)].bandwidth for name in channels})
    if not found:  # else the density is that of another time
        found += _noise(channels, of)
        found += _unlike(channels, of, {f.channel for f in found})
    if gravity is None or gravity.swept < _TILTED:  # its mean is not gravity then
        found += _gravity(channels)
    if static:
        mending = {f.channel: f.value for f in found if f.finding == "suspicious_unit"}
        means = {
            name: level["mean"] * mending.get(name, 1.0)
            for name, level in channels.items()
            if quantity_of(name) == "gyro"
        }
        found += [*_turning(means, of["gyro"])] or [*_tilting(means, gravity)]
    return found


def implausible_of(quality: Quality, sensor: Sensor | None) -> list[dict[str, Any]]:
    """Return the rows of findings on what can be of no sensor at rest in its unit.

    Parameters
    ----------
    quality : Quality
    sensor : Sensor or None
        What the file of the sensor says; None: there is none.
    """
    about = quality.recording
    turn = GravityTurn(**quality.gravity) if quality.gravity else None
    static = about.get("kind", "static") == "static"
    found = implausible(quality.channels, turn, sensor, static=static)
    return [dict(finding.row(about["sensor"], about["recording"])) for finding in found]


def mistakes(unit: str, quantity: str) -> Iterator[tuple[str, float]]:
    """Yield the units that may be meant instead of one, and the factor that mends the figures.

    Parameters
    ----------
    unit : str
        As stated.
    quantity : str
        ``gyro`` or ``accel``.
    """
    dimension = QUANTITIES[quantity]
    stated = conversion(unit, dimension)[0]
    for other in _UNITS[quantity]:
        factor = conversion(other, dimension)[0] / stated
        if not math.isclose(factor, 1.0):
            yield other, factor


def _gravity(channels: Mapping[str, Level]) -> Iterator[Finding]:
    """Yield what the mean of three accelerometers tells, which is gravity."""
    axes = [f"accel_{axis}" for axis in "xyz"]
    if not set(axes) <= channels.keys():
        return
    norm = math.hypot(*(channels[name]["mean"] for name in axes))
    if abs(norm / STANDARD_GRAVITY - 1.0) <= _TOLERANCE:
        return
    units = {channels[name]["unit"] for name in axes}
    unit = units.pop()
    detail = f"the mean acceleration has a norm of {norm:.4g} m/s², expected {STANDARD_GRAVITY:.4g}"
    for other, factor in mistakes(unit, "accel") if not units else ():
        if abs(norm * factor / STANDARD_GRAVITY - 1.0) <= _TOLERANCE:
            said = f"{detail}: are the figures in {other}, and not {unit}? {_MEND}"
            for name in axes:
                yield Finding("suspicious_unit", "warning", said, factor, name)
            return
    advice = "check unit, scale, offset and columns of the accelerometer"
    if norm < 0.05 * STANDARD_GRAVITY:
        advice = "gravity seems to be taken off already (linear acceleration); use the raw figures"
    yield Finding("gravity_norm", "warning", f"{detail}: {advice}", norm)


_MEND = "state the right 'unit' in the sensor file"


def _noise(channels: Mapping[str, Level], of: Mapping[str, Expected]) -> Iterator[Finding]:
    """Yield the channels whose noise is usual in another unit alone."""
    weighed = {f"accel_{axis}" for axis in "xyz"} <= channels.keys()
    for name, level in channels.items():
        quantity = quantity_of(name)
        usual = of[quantity].noise
        if usual is None or (quantity == "accel" and weighed):
            continue  # gravity tells better
        low, high = level["density"]
        if low > _FAR * usual[1]:
            shown = low
        elif high is not None and high < usual[0] / _FAR:
            shown = high
        else:
            continue
        high = math.inf if high is None else high
        for unit, factor in mistakes(level["unit"], quantity):
            if low * factor <= _EXPLAINED * usual[1] and high * factor >= usual[0] / _EXPLAINED:
                sign, dimension = _SHOWN[quantity]
                figures = [from_si(x, sign, dimension) for x in (shown, shown * factor, *usual)]
                detail = (
                    f"{name} has a noise of {figures[0]:.3g} {sign}; usual "
                    f"{of[quantity].noise_from} are {figures[2]:.3g} to {figures[3]:.3g}: are the "
                    f"figures in {unit}, and not {level['unit']}? It would be {figures[1]:.3g} "
                    f"then; {_MEND}"
                )
                yield Finding("suspicious_unit", "warning", detail, factor, name)
                break


def _unlike(
    channels: Mapping[str, Level], of: Mapping[str, Expected], told: Collection[str | None]
) -> Iterator[Finding]:
    """Yield the channels whose noise is far from what is printed, or from both other axes.

    What a wrong scale or range, another sensor or one axis in another unit leaves, where no unit
    explains the figure by itself.
    """
    untimed = False
    for name, level in channels.items():
        if name in told:
            continue
        quantity = quantity_of(name)
        sign, dimension = _SHOWN[quantity]
        low, high = level["density"]
        high = math.inf if high is None else high
        printed = of[quantity].printed
        timed = level.get("timed", True)
        near = NEAR_PRINTED if timed else _UNTIMED
        if printed is not None and (low > near * printed or near * high < printed):
            shown = low if low > printed else high
            figures = [from_si(x, sign, dimension) for x in (shown, printed)]
            rate = "" if timed else f"the stated rate of {level['rate']:g} Hz, "
            detail = (
                f"{name} has a noise of {figures[0]:.3g} {sign}, {shown / printed:.3g} times the "
                f"{figures[1]:.3g} that its datasheet prints: check {rate}scale, range and column "
                "of the channel, and whether it is this sensor"
            )
            far = low > NEAR_PRINTED * printed or NEAR_PRINTED * high < printed
            if far or not untimed:  # a wrong rate is that of all channels: it is told once
                untimed = untimed or not timed
                of_channel = name if timed or far else None
                yield Finding(
                    "noise_unlike_datasheet", "warning", detail, shown / printed, of_channel
                )
            continue
        others = [f"{quantity}_{axis}" for axis in "xyz" if f"{quantity}_{axis}" != name]
        ratio = _ratio(level, [channels[one] for one in others if one in channels])
        if ratio is not None:
            shown = low if ratio > 1.0 else high
            explained = (
                f"is it in {unit}, and not {level['unit']}? Check"
                for unit, factor in mistakes(level["unit"], quantity)
                if 1.0 / _SAME < ratio * factor < _SAME
            )
            detail = (
                f"the noise of {name} is {ratio:.3g} times that of {' and '.join(others)}, "
                f"{from_si(shown, sign, dimension):.3g} {sign}, as axes of one sensor hardly ever "
                f"have: {next(explained, 'check')} unit, scale and column of this axis"
            )
            yield Finding("axis_unlike", "warning", detail, ratio, name)


def _ratio(level: Level, others: Sequence[Level]) -> float | None:
    """Return how many times the noise of two axes alike a third has; None: not far off."""
    if len(others) < 2 or any(one["density"][1] is None for one in (level, *others)):
        return None
    least = min(one["density"][0] for one in others)
    most = max(one["density"][1] for one in others)
    low, high = level["density"]
    if not (least > 0.0 and high > 0.0) or most > _EVEN * least:
        return None
    if low > _UNEVEN * most:
        return float(low / max(one["density"][0] for one in others))
    if _UNEVEN * high < least:
        return float(high / min(one["density"][1] for one in others))
    return None


def _turning(means: Mapping[str, float], usual: Expected) -> Iterator[Finding]:
    """Yield the gyros whose mean no offset explains."""
    for name, mean in means.items():
        if abs(mean) > usual.offset:
            detail = (
                f"{name} has a mean of {math.degrees(mean):.4g} °/s, more than the "
                f"{math.degrees(usual.offset):.3g} °/s that an offset may be {usual.offset_from}: "
                "the sensor turns, or its unit is another"
            )
            yield Finding("turning", "warning", detail, mean, name)


def _tilting(means: Mapping[str, float], gravity: GravityTurn | None) -> Iterator[Finding]:
    """Yield a turn that gravity shows, alone or together with the gyros."""
    if gravity is None or gravity.swept < _TILTING:
        return
    seen = np.array(gravity.rate)
    rate = float(np.linalg.norm(seen))
    gyro = np.array([means.get(f"gyro_{axis}", np.nan) for axis in "xyz"])
    # The accelerometers do not show what turns about the vertical.
    along = float(gyro @ seen) / rate
    together = abs(along / rate - 1.0) < _AGREES
    if gravity.swept < _TILTED and not together:
        return
    beside = f", and the gyros {math.degrees(along):.3g} °/s about that axis" if together else ""
    detail = (
        f"gravity turns against the sensor by {math.degrees(gravity.swept):.3g}° in all, steadily "
        f"at {math.degrees(rate):.3g} °/s{beside}: the sensor turns, or is tilted"
    )
    yield Finding("turning", "warning", detail, rate)
