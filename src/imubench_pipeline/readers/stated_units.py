"""Find the units that logs state, and compare them with the sensor file."""

import re
from dataclasses import dataclass

from imubench_pipeline.settings.sensor import CHANNELS, QUANTITIES, quantity_of
from imubench_pipeline.units import UnitError, find_conversion

_MAX_UNIT_LENGTH = 24
_MAX_TAILS = 6
_BRACKETED = re.compile(r"[(\[{<]([^()\[\]{}<>]*)[)\]}>]")
_SEPARATOR = re.compile(r"[\s_,:;|./-]+")
_UNIT_CHARACTERS = re.compile(r"(?:[^\W\d_]|[°º²µμ·*/^() -]|(?<!\d)[1-3](?!\d))+")
"""Texts that are parsed as a unit; names in a file may have any characters."""

_PER = r"[ _/.]*(?:p|per)?[ _/.]*"
_SPELLINGS: dict[str, tuple[tuple[str, str], ...]] = {
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


def parse_unit(text: str, dimension: str) -> str | None:
    """Return the unit that a text such as ``m_s2`` names, as in a sensor file; None if unknown."""
    text = text.strip()
    if not text or len(text) > _MAX_UNIT_LENGTH:
        return None
    for pattern, unit in _SPELLINGS[dimension]:
        if re.fullmatch(pattern, text, re.IGNORECASE):
            return unit
    if (
        dimension == "time"
        or not _UNIT_CHARACTERS.fullmatch(text)
        or text.count("^") > 1
        or "**" in text
    ):
        return None
    try:
        find_conversion(text, dimension)
    except UnitError:
        return None
    return text


def split_unit(label: str, dimension: str) -> tuple[str, str | None]:
    """Split a name such as ``Gyroscope x (rad/s)`` or ``accel_x_m_s2`` into name and unit.

    Texts in brackets, except numbers, are removed from the name. ``dimension``: such as ``time``.
    """
    unit = next(
        (unit for text in find_bracketed(label) if (unit := parse_unit(text, dimension))), None
    )
    name = _BRACKETED.sub(
        lambda bracket: bracket[0] if bracket[1].strip().isdigit() else " ", label
    )
    if unit is None:
        # The text after each separator, the longest first.
        text = name.rstrip()
        begin = max(len(text) - _MAX_UNIT_LENGTH, 0)
        places = [begin + separator.end() for separator in _SEPARATOR.finditer(text[begin:])]
        for place in places[-_MAX_TAILS:]:
            if 0 < place < len(text) and (unit := parse_unit(text[place:], dimension)):
                return name[:place], unit
    return name, unit


def find_bracketed(label: str) -> list[str]:
    """Return the texts in brackets in a name, except for numbers."""
    return [text for text in _BRACKETED.findall(label) if text.strip() and not text.isdigit()]


_MAX_SHOWN_NAME = 60


@dataclass(frozen=True)
class StatedUnit:
    """The unit that a log states for a channel."""

    unit: str  # unit in the notation of a sensor file
    where: str  # the place in the log


def find_stated_unit(channel: str, text: str | None, where: str, label: str) -> StatedUnit | None:
    """Return the unit that a log states for a channel in ``text`` or ``label``; None if unknown.

    ``where``: place of ``text`` in the log, in words.
    """
    if channel not in CHANNELS:
        return None
    dimension = QUANTITIES[quantity_of(channel)]
    unit = parse_unit(text or "", dimension)
    if unit is not None:
        return StatedUnit(unit, where)
    unit = parse_unit(label, dimension) or split_unit(label, dimension)[1]
    return None if unit is None else StatedUnit(unit, f"the name {label[:_MAX_SHOWN_NAME]!r}")
