"""Check whether the data of a static recording are plausible in the stated units.

The checks use the levels that are stored with a recording, and the sensor file. The log is not read
again after an edit of a datasheet.

Noise and means are compared with the printed figures, or with usual ones. The sampling rate is
compared with the range of the sensor, and a finding names the unit of time that would explain it.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.datasheets.comparable import read_bias_comparables
from imubench_pipeline.datasheets.suspicion import MAX_FACTOR_FROM_PRINTED, printed_figures
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.quality.levels import Level
from imubench_pipeline.recordings.quality.rotation import GravityTurn
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor, quantity_of
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.units import convert_to_si, find_conversion
from imubench_pipeline.words.findings import plausibility as texts
from imubench_pipeline.words.findings.samples import Motion

_MAX_FACTOR_BELOW_PRINTED = 2.5
"""Maximum usual factor below a printed noise density. `levels.density_of` is not lowered by a
low-pass filter."""

_USUAL_GYRO_DENSITY = (math.radians(5e-4), math.radians(0.06))
"""rad/s/√Hz: wider than the range of the MEMS sensors of the catalogue, 0.0015 to 0.035 °/s/√Hz."""

_MAX_OFFSET = math.radians(30.0)
_MIN_OFFSET_LIMIT = math.radians(2.0)
_MAX_OFFSET_OF_CLASS = {"industrial": math.radians(12.0), "tactical": _MIN_OFFSET_LIMIT}
"""rad/s. The shipped sensor files print at most 3 °/s (typ) for industrial sensors, 0.2 °/s for
tactical ones, and 20 °/s for others."""

_OFFSET_FACTOR_OF_KIND = {"max": 1.5}
_OFFSET_FACTOR_OF_TYPICAL = 4.0
"""Maximum ratio of an offset to the printed one: if typ and max are both printed, max is three
times typ, and mounting adds to it."""

MIN_RATE, MIN_RATE_STATED, _MAX_RATE = 1.05, 0.105, 1e4
"""Limits of the sampling rate of any log, Hz. Stamps in ms that are read as s give at most 1 Hz for
a log of 1 kHz, and 0.1 Hz for one of 100 Hz. A slower log is plausible if its rate is stated."""

MIN_RATE_OF_NOISE = 25.0
"""Hz. Usual sensors have a bandwidth of 10 Hz or more: slower samples may fold noise into N."""

_MAX_LOG_RATE_PER_BANDWIDTH = 100.0
_MAX_SAMPLING_RATE_PER_BANDWIDTH = 10.0
"""Maximum rate of a log, and of a sensor, divided by the printed bandwidth. The sensors of the
shipped sensor files are sampled at 2 to 8 times their bandwidth."""

_USUAL_RATE = 100.0
_TIME_UNIT_PENALTIES: Mapping[float, float] = {60.0: 1.0, 1e3: 0.0, 1e6: 0.0, 1e9: 0.0}
"""Usual rate, Hz; and ratios of two units of time, each with a penalty in decades from the usual
rate. Minutes have a penalty, since a sensor file cannot state them."""

_GRAVITY_TOLERANCE = 0.15  # maximum error of the mean acceleration, as a fraction of gravity

_SUSPICIOUS_NOISE_FACTOR = 2.5
"""Noise is suspicious beyond this factor outside the usual range: above 10 times or below 0.16
times the printed figure, or for a gyro without one, above 0.15 °/s/√Hz or below 2e-4."""

_USUAL_OFFSET = math.radians(5.0)
_SUSPICIOUS_NOISE_WITH_MEAN, _SUSPICIOUS_PRODUCT = 1.6, 6.0
"""Noise of a gyro is suspicious also beyond a smaller factor above its usual range, if the product
with the factor of its mean above 5 °/s is large: 12 for degrees that are called radians."""

_MAX_EXPLAINED_FACTOR = 1.5
"""Maximum factor outside the usual range for noise in the suggested unit."""

_MIN_SUSPICIOUS_AXIS_RATIO = 4.0
"""Minimum ratio of the noise of one axis to both others, either way, for a finding."""

_MAX_RATIO_OF_OTHER_AXES = 2.5  # maximum ratio of the noise of those two to each other

_MAX_FACTOR_WITHOUT_STAMPS = 2.5
"""Maximum ratio to the printed noise, either way, if the rate is not known from time stamps. N is
proportional to the root of the rate: a stated rate that is 10 times wrong changes N 3.2 times."""

_MAX_EXPLAINED_AXIS_RATIO = 1.5  # maximum ratio of its noise to theirs in the suggested unit

_LOGGER_UNITS: Mapping[str, Sequence[str]] = {
    "gyro": ("rad/s", "deg/s", "mdeg/s", "mrad/s", "deg/h"),
    "accel": ("m/s^2", "g", "mg", "ug"),
}
"""Units that loggers write, the most common first."""

_MIN_TURN_OF_GRAVITY = math.radians(10.0)
"""Minimum turn of gravity over a log, rad. No accelerometer drifts so far: 0.17 g."""

_MIN_TURN_WITH_GYROS = math.radians(1.0)
_MAX_RATE_DISAGREEMENT = 0.25
"""Minimum turn of gravity if the gyros agree with it; maximum relative difference of the rates."""


@dataclass(frozen=True)
class Expected:
    """Usual levels of a quantity of a static sensor."""

    noise: tuple[float, float] | None  # least and most white noise density, SI/√Hz, two-sided
    offset: float = _MAX_OFFSET  # largest mean of a gyro that an offset explains, rad/s
    offset_of: str | None = None  # "datasheet" or the price class that limits it; None: any gyro
    bandwidth: float | None = None  # the widest that is printed, Hz
    printed: float | None = None  # white noise density that the datasheet prints, SI/√Hz, two-sided


def expected(sensor: Sensor | None, quantity: str) -> Expected:
    """Return the usual levels of a quantity, from the sensor's file or else for any sensor."""
    usual = _USUAL_GYRO_DENSITY if quantity == "gyro" else None
    if sensor is None:
        return Expected(usual)
    printed = printed_figures(sensor, quantity).get("N")
    noise = (
        usual
        if printed is None
        else (printed / _MAX_FACTOR_BELOW_PRINTED, printed * MAX_FACTOR_FROM_PRINTED)
    )
    # Widest printed bandwidth, Hz
    assert quantity in QUANTITIES
    sheet = getattr(sensor.datasheet, quantity)
    widest = [
        convert_to_si(value, figure.unit, "frequency")
        for figure in (sheet.printed("bandwidth") if sheet else ())
        for axis in "xyz"
        for value in np.ravel(figure.on_axis(axis) or ()).tolist()
    ]
    return Expected(noise, *_find_max_offset(sensor), max(widest, default=None), printed)


def _find_max_offset(sensor: Sensor) -> tuple[float, str | None]:
    """Return the largest offset of the gyro of a sensor, rad/s, and its source."""
    printed = [
        row.value * _OFFSET_FACTOR_OF_KIND.get(row.figure.kind, _OFFSET_FACTOR_OF_TYPICAL)
        for axis in "xyz"
        for row in read_bias_comparables(sensor.datasheet, f"gyro_{axis}")
        if row.quantity in ("offset", "bias_repeatability")
        and row.figure is not None
        and row.value is not None
    ]
    if printed:
        return min(max(*printed, _MIN_OFFSET_LIMIT), _MAX_OFFSET), "datasheet"
    words = (sensor.price_class or "").lower().replace(",", " ").split()
    word = next((word for word in words if word in _MAX_OFFSET_OF_CLASS), None)
    if word is None:
        return _MAX_OFFSET, None
    return _MAX_OFFSET_OF_CLASS[word], word


def implausible_rates(
    rates: Mapping[str, float], bandwidths: Mapping[str, float | None], stated: float | None = None
) -> list[Finding]:
    """Return a finding for each sampling rate that no sensor is likely to have.

    ``rates``, Hz, and ``bandwidths``, the largest that the datasheet prints, Hz, are by channel;
    ``stated`` is the rate in the sensor file, Hz. The values of the findings are the factors that
    correct the times.
    """
    slowest = MIN_RATE if stated is None else MIN_RATE_STATED
    by_rate: dict[tuple[float, float], list[str]] = {}
    for name, rate in rates.items():
        fastest, bandwidth = _MAX_RATE, bandwidths[name]
        if bandwidth is not None:
            fastest = max(_MAX_RATE, _MAX_SAMPLING_RATE_PER_BANDWIDTH * bandwidth)
            fastest = min(fastest, _MAX_LOG_RATE_PER_BANDWIDTH * bandwidth)
        if not slowest <= rate <= fastest:
            by_rate.setdefault((rate, fastest), []).append(name)
    findings = []
    for (rate, fastest), names in by_rate.items():
        sign = 1.0 if rate > fastest else -1.0
        factor = min(
            (factor**sign for factor in _TIME_UNIT_PENALTIES),
            key=lambda factor: (
                abs(math.log10(rate / factor / _USUAL_RATE))
                + _TIME_UNIT_PENALTIES[round(factor**sign)]
            ),
        )
        statable = MIN_RATE_STATED <= rate < slowest
        data = texts.RateImplausible(rate, slowest, fastest, factor, statable)
        channels = [None] if len(names) == len(rates) else names
        findings += [find(data, "warning", factor, channel) for channel in channels]
    return findings


def implausible(
    channels: Mapping[str, Level],
    gravity: GravityTurn | None,
    sensor: Sensor | None,
    *,
    static: bool = True,
    moved: bool = False,
) -> list[Finding]:
    """Return findings on data that are implausible for a static sensor in the stated units.

    They are based on the levels of each channel, on the rotation of gravity relative to the sensor,
    and on the sensor file. ``static``: the sensor should be at rest. ``moved``: it was moved, so
    that noise and means are not checked.
    """
    of = {quantity: expected(sensor, quantity) for quantity in QUANTITIES}
    rates = {name: level.rate for name, level in channels.items()}
    findings = implausible_rates(
        rates,
        {name: of[quantity_of(name)].bandwidth for name in channels},
        _find_stated_rate(sensor, rates),
    )
    slow = {name: rate for name, rate in rates.items() if rate < MIN_RATE_OF_NOISE}
    if slow and not findings:
        least, channel = min(slow.values()), None if len(slow) == len(rates) else min(slow)
        findings.append(find(texts.SlowSampling(least), "note", least, channel))
    if moved:
        rates_of_gyros = {n: one.mean for n, one in channels.items() if quantity_of(n) == "gyro"}
        return [*findings, *_check_gravity_turn(rates_of_gyros, gravity)]
    if not any(f.finding == texts.RateImplausible.code for f in findings):
        findings += _check_noise(channels, of)
        findings += _compare_noise(channels, of, {f.channel for f in findings})
    if gravity is None or gravity.swept < _MIN_TURN_OF_GRAVITY:  # its mean is not gravity then
        findings += _check_gravity(channels)
    if static:
        mending = {f.channel: f.value for f in findings if f.finding == "suspicious_unit"}
        means = {
            name: level.mean * mending.get(name, 1.0)
            for name, level in channels.items()
            if quantity_of(name) == "gyro"
        }
        largest, source = of["gyro"].offset, of["gyro"].offset_of
        turning = [
            find(texts.Turning(mean, largest=largest, offset_of=source), "warning", mean, name)
            for name, mean in means.items()
            if abs(mean) > largest
        ]
        findings += turning or _check_gravity_turn(means, gravity)
    return findings


def _find_stated_rate(sensor: Sensor | None, rates: Mapping[str, float]) -> float | None:
    """Return the rate in the sensor file, Hz; dates and times of day have no unit to mistake."""
    if sensor is None:
        return None
    time = sensor.log.time
    dated = time is not None and time.format is not None
    return sensor.log.rate_hz or (min(rates.values(), default=None) if dated else None)


def implausible_of(quality: Quality, sensor: Sensor | None) -> list[FindingRow]:
    """Return the finding rows about data that are implausible for a static sensor."""
    about, static = quality.recording, quality.recording.kind == "static"
    moved = any(finding.finding == Motion.code for finding in quality.findings)
    findings = implausible(quality.channels, quality.gravity, sensor, static=static, moved=moved)
    return [finding.row(about.sensor, about.recording) for finding in findings]


def mistakes(unit: str, quantity: str) -> Iterator[tuple[str, float]]:
    """Yield units that may be meant instead of ``unit``, with the factor that corrects data."""
    dimension = QUANTITIES[quantity]
    stated = find_conversion(unit, dimension)[0]
    for other in _LOGGER_UNITS[quantity]:
        factor = find_conversion(other, dimension)[0] / stated
        if not math.isclose(factor, 1.0):
            yield other, factor


def _check_gravity(channels: Mapping[str, Level]) -> Iterator[Finding]:
    axes = [f"accel_{axis}" for axis in "xyz"]
    if not set(axes) <= channels.keys():
        return
    norm = math.hypot(*(channels[name].mean for name in axes))
    if abs(norm / STANDARD_GRAVITY - 1.0) <= _GRAVITY_TOLERANCE:
        return
    units = {channels[name].unit for name in axes}
    unit = units.pop()
    for other, factor in mistakes(unit, "accel") if not units else ():
        if abs(norm * factor / STANDARD_GRAVITY - 1.0) <= _GRAVITY_TOLERANCE:
            data = texts.SuspiciousUnit(unit, other, factor, gravity=norm)
            for name in axes:
                yield find(data, "warning", factor, name)
            return
    yield find(texts.GravityNorm(norm, removed=norm < 0.05 * STANDARD_GRAVITY), "warning", norm)


def _check_noise(channels: Mapping[str, Level], of: Mapping[str, Expected]) -> Iterator[Finding]:
    """Yield a finding for each channel whose noise is usual only in another unit."""
    weighed = {f"accel_{axis}" for axis in "xyz"} <= channels.keys()
    gyros = [level for name, level in channels.items() if quantity_of(name) == "gyro"]
    mean = math.hypot(*(level.mean for level in gyros))
    largest_mean = max((abs(level.mean) for level in gyros), default=0.0)
    quietest = min((level.density[0] for level in gyros), default=0.0)
    for name, level in channels.items():
        quantity = quantity_of(name)
        usual = of[quantity].noise
        if usual is None or (quantity == "accel" and weighed):
            continue  # gravity is the better test
        low, high = level.density
        least = quietest / usual[1]  # a wrong unit concerns all axes
        together = quantity == "gyro" and least > _SUSPICIOUS_NOISE_WITH_MEAN
        together &= mean > _USUAL_OFFSET and least * mean / _USUAL_OFFSET > _SUSPICIOUS_PRODUCT
        if low > _SUSPICIOUS_NOISE_FACTOR * usual[1] or together:
            shown = low
        elif high is not None and high < usual[0] / _SUSPICIOUS_NOISE_FACTOR:
            shown = high
        else:
            continue
        high = math.inf if high is None else high
        likely = [
            (unit, factor)
            for unit, factor in mistakes(level.unit, quantity)
            if low * factor <= _MAX_EXPLAINED_FACTOR * usual[1]
            and high * factor >= usual[0] / _MAX_EXPLAINED_FACTOR
        ]
        if not likely:
            continue
        # First a unit in which the means are usual, too, then one with noise within the range.
        unit, factor = min(
            likely,
            key=lambda one: (
                quantity == "gyro" and largest_mean * one[1] > of["gyro"].offset,
                low * one[1] < usual[0] or high * one[1] > usual[1],
            ),
        )
        data = texts.SuspiciousUnit(
            level.unit,
            unit,
            factor,
            noise=shown,
            usual=usual,
            printed=of[quantity].printed is not None,
            mean=mean if together else None,
        )
        yield find(data, "warning", factor, name)


def _compare_noise(
    channels: Mapping[str, Level], of: Mapping[str, Expected], doubted: Collection[str | None]
) -> Iterator[Finding]:
    """Yield a finding for each channel whose noise is unlike the datasheet or the other axes."""
    untimed = False
    for name, level in channels.items():
        if name in doubted:  # another unit explains it
            continue
        quantity = quantity_of(name)
        low, high = level.density
        high = math.inf if high is None else high
        printed = of[quantity].printed
        timed = level.timed
        near = MAX_FACTOR_FROM_PRINTED if timed else _MAX_FACTOR_WITHOUT_STAMPS
        if printed is not None and (low > near * printed or near * high < printed):
            shown = low if low > printed else high
            stated_rate = None if timed else level.rate
            far = (
                low > MAX_FACTOR_FROM_PRINTED * printed or MAX_FACTOR_FROM_PRINTED * high < printed
            )
            if far or not untimed:  # a wrong rate affects all channels: report it once
                untimed = untimed or not timed
                of_channel = name if timed or far else None
                unlike = texts.NoiseUnlikeDatasheet(name, shown, printed, stated_rate)
                yield find(unlike, "warning", shown / printed, of_channel)
            continue
        others = [f"{quantity}_{axis}" for axis in "xyz" if f"{quantity}_{axis}" != name]
        ratio = _compute_axis_ratio(level, [channels[axis] for axis in others if axis in channels])
        if ratio is not None:
            shown = low if ratio > 1.0 else high
            explained = (
                unit
                for unit, factor in mistakes(level.unit, quantity)
                if 1.0 / _MAX_EXPLAINED_AXIS_RATIO < ratio * factor < _MAX_EXPLAINED_AXIS_RATIO
            )
            data = texts.AxisUnlike(tuple(others), ratio, shown, level.unit, next(explained, None))
            yield find(data, "warning", ratio, name)


def _compute_axis_ratio(level: Level, others: Sequence[Level]) -> float | None:
    """Return the ratio of the noise of an axis to two similar ones; None if not suspicious."""
    low, high = level.density
    lows = [axis.density[0] for axis in others]
    highs = [axis.density[1] for axis in others if axis.density[1] is not None]
    if high is None or not len(others) == len(highs) >= 2:
        return None
    least, most = min(lows), max(highs)
    if not (least > 0.0 and high > 0.0) or most > _MAX_RATIO_OF_OTHER_AXES * least:
        return None
    if low > _MIN_SUSPICIOUS_AXIS_RATIO * most:
        return low / max(lows)
    if _MIN_SUSPICIOUS_AXIS_RATIO * high < least:
        return high / min(highs)
    return None


def _check_gravity_turn(
    means: Mapping[str, float], gravity: GravityTurn | None
) -> Iterator[Finding]:
    """Yield a finding if gravity turns, by itself or in agreement with the gyros."""
    if gravity is None or gravity.swept < _MIN_TURN_WITH_GYROS:
        return
    seen = np.array(gravity.rate)
    rate = float(np.linalg.norm(seen))
    gyro = np.array([means.get(f"gyro_{axis}", np.nan) for axis in "xyz"])
    # The accelerometers do not show a rotation about the vertical.
    along = float(gyro @ seen) / rate
    together = abs(along / rate - 1.0) < _MAX_RATE_DISAGREEMENT
    if gravity.swept < _MIN_TURN_OF_GRAVITY and not together:
        return
    data = texts.Turning(rate, swept=gravity.swept, gyro_rate=along if together else None)
    yield find(data, "warning", rate)
