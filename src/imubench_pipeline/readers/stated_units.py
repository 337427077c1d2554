"""Units that logs state themselves, held against those that the sensor file states."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from imubench_pipeline.settings.sensor import CHANNELS, QUANTITIES, ColumnSource, quantity_of
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.units import UnitError, conversion

_LONGEST = 24
_TAILS = 6
_BRACKETED = re.compile(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]")
_SEPARATOR = re.compile(r"[\s_,:;|./-]+")
_PLAIN = re.compile(r"(?:[^\W\d_]|[°º²µμ·*/^() -]|(?<!\d)[1-3](?!\d))+")
"""What is handed on to be read as a unit: the names in a file may be anything."""

_PER = r"[ _/.]*(?:p|per)?[ _/.]*"
_SPELLED: dict[str, tuple[tuple[str, str], ...]] = {
    "angular_rate": (
        (rf"mrads?{_PER}s(?:ec)?(?:ond)?", "mrad/s"),
        (rf"(?:rads?|radians?){_PER}s(?:ec)?(?:ond)?", "rad/s"),
        (rf"mdeg{_PER}s(?:ec)?(?:ond)?|mdps", "mdps"),
        (rf"(?:degs?|degrees?|°|º){_PER}s(?:ec)?(?:ond)?|dps", "deg/s"),
        (rf"(?:degs?|degrees?|°|º){_PER}h(?:r|our)?", "deg/h"),
    ),
    "acceleration": (
        (rf"m(?:et(?:er|re)s?)?{_PER}s(?:ec)?[ _/]*(?:\^|\*\*)?-?(?:2|²|q)|mpss|m/s/s", "m/s^2"),
        (r"gs?|g's|gee", "g"),
        (r"mgs?|milli-?gs?", "mg"),
        (r"[uµμ]gs?|micro-?gs?", "ug"),
    ),
    "temperature": ((r"(?:deg|°|º)?[ _]?c(?:elsius)?", "degC"), (r"k(?:elvin)?", "K")),
    "time": (
        (r"s|secs?|seconds?", "s"),
        (r"ms|msecs?|millis|milliseconds?", "ms"),
        (r"[uµμ]s|usecs?|micros|microseconds?", "us"),
        (r"ns|nsecs?|nanos|nanoseconds?", "ns"),
        (r"mins?|minutes?", "min"),
        (r"h|hrs?|hours?", "h"),
    ),
}


def unit_of(text: str, dimension: str) -> str | None:
    """Return the unit that a text is, as a sensor file may state it.

    Parameters
    ----------
    text : str
        Such as ``rad/s``, ``m_s2`` or ``dps``.
    dimension : str
        A key of `imubench_pipeline.units.SI_UNITS`.

    Returns
    -------
    str or None
        None: it is no unit of that dimension that is known.
    """
    text = text.strip()
    if not text or len(text) > _LONGEST:
        return None
    for pattern, unit in _SPELLED[dimension]:
        if re.fullmatch(pattern, text, re.IGNORECASE):
            return unit
    if dimension == "time" or not _PLAIN.fullmatch(text) or text.count("^") > 1 or "**" in text:
        return None
    try:
        conversion(text, dimension)
    except UnitError:
        return None
    return text


def divided(label: str, dimension: str) -> tuple[str, str | None]:
    """Divide a name such as ``Gyroscope x (rad/s)`` or ``accel_x_m_s2`` into name and unit.

    Parameters
    ----------
    dimension : str
        Of the unit that is looked for.

    Returns
    -------
    name : str
        Without the unit, and without what stands in brackets and is no number.
    unit : str or None
    """
    unit = next((unit for text in bracketed(label) if (unit := unit_of(text, dimension))), None)
    name = _BRACKETED.sub(
        lambda bracket: bracket[0] if bracket[1].strip().isdigit() else " ", label
    )
    if unit is None:
        for start, tail in _tails(name):
            unit = unit_of(tail, dimension)
            if unit is not None:
                return name[:start], unit
    return name, unit


def bracketed(label: str) -> list[str]:
    """Return what stands in brackets in a name and is no number."""
    return [text for text in _BRACKETED.findall(label) if text.strip() and not text.isdigit()]


def _tails(name: str) -> Iterator[tuple[int, str]]:
    """Yield what stands behind each separator, the longest first, and where."""
    text = name.rstrip()
    begin = max(len(text) - _LONGEST, 0)
    places = [begin + separator.end() for separator in _SEPARATOR.finditer(text[begin:])]
    for place in places[-_TAILS:]:
        if 0 < place < len(text):
            yield place, text[place:]


_OTHER = 1.5
"""Ratio of two units that are not the same: the nearest ones, mg and cm/s², are 1.02 apart, and no
logger writes both; then come mrad/s and °/s, 17 apart. A scale may hold a calibration."""

_LONGEST_NAME = 60


@dataclass(frozen=True)
class StatedUnit:
    """The unit of a channel as the log itself states it."""

    unit: str
    """As a sensor file would state it."""
    where: str
    """The place in the log."""


def stated(channel: str, text: str | None, where: str, label: str) -> StatedUnit | None:
    """Return the unit that a log states of a channel; None: none that is understood.

    Parameters
    ----------
    channel : str
        Or what is beside channels, of which nothing is returned.
    text, where : str
        What stands where units do, and where that is.
    label : str
        The name of the column, which may have the unit in it.
    """
    if channel not in CHANNELS:
        return None
    dimension = QUANTITIES[quantity_of(channel)]
    unit = unit_of(text or "", dimension)
    if unit is not None:
        return StatedUnit(unit, where)
    unit = unit_of(label, dimension) or divided(label, dimension)[1]
    return None if unit is None else StatedUnit(unit, f"the name {label[:_LONGEST_NAME]!r}")


def contradictions(
    file: str, sources: Mapping[str, ColumnSource], units: Mapping[str, StatedUnit]
) -> list[Finding]:
    """Return the channels of which log and sensor file state units that are not the same.

    Parameters
    ----------
    file : str
        Name of the log.
    sources : mapping of str to ColumnSource
        What the sensor file states.
    units : mapping of str to StatedUnit
        What the log states.
    """
    findings = []
    for channel, in_log in units.items():
        source = sources[channel]
        dimension = QUANTITIES[quantity_of(channel)]
        read = conversion(source.unit, dimension)[0] * abs(source.scale)
        factor = conversion(in_log.unit, dimension)[0] / read
        if 1.0 / _OTHER < factor < _OTHER:
            continue
        scaled = "" if source.scale == 1 else f", times {source.scale:g}"
        detail = (
            f"{file} states {in_log.unit} for {channel} ({in_log.where}), the sensor file "
            f"{source.unit}{scaled} (log.channels.{channel}.unit), which is used; if the log is "
            f"right, the figures are to be multiplied by {factor:.5g}: mend the one that is wrong"
        )
        findings.append(Finding("unit_contradicts", "warning", detail, factor, channel))
    return findings
