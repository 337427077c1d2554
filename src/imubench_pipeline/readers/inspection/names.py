"""What the name of a column means: quantity, axis, and whether the sensor measures it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.readers.stated_units import divided
from imubench_pipeline.settings.sensor import QUANTITIES

Quantity = Literal["gyro", "accel", "temperature"]

DIMENSIONS: dict[Quantity, str] = {
    "gyro": QUANTITIES["gyro"],
    "accel": QUANTITIES["accel"],
    "temperature": "temperature",
}
"""The dimension of the unit of each quantity."""

PLAIN, WEAK, WITHOUT_GRAVITY, DERIVED = range(4)
"""How sure a name is: it says the quantity; it may mean another; it is an acceleration that may
lack gravity; what a filter or the vendor made of a measurement, or about one."""

_LONGEST = 200
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_AXES = ("x", "y", "z")
_ABOUT_AXES = {"roll": "x", "pitch": "y", "yaw": "z"}
_GYRO = re.compile(
    r"gyr|ang(?:ular)?vel|ang(?:ular)?rate|ang(?:ular)?speed|rotationrate|rotrate|rateofturn|"
    r"turnrate|omega|bodyrate"
)
_ACCEL = re.compile(r"acc(?!ur)|specificforce|gforce")
_TEMPERATURE = re.compile(r"temp(?!or|l)")
_PATTERNS: dict[Quantity, re.Pattern[str]] = {
    "gyro": _GYRO,
    "accel": _ACCEL,
    "temperature": _TEMPERATURE,
}
_OTHER = re.compile(
    r"ang(?:ular|le)?acc|alpha|quat|euler|orient|attitude|angle|inclin|heading|mag(?!ic)|baro|press"
)
_DERIVED = re.compile(
    r"freeacc|gravity|inertial|useracc|bias|offset|covar|varian|sigma|noise|delta|jerk|filter|"
    r"smooth|status|world|earth|residual|error|valid|count$|delay|stamp|time"
)
_DERIVED_WORDS = frozenset(
    ("free", "user", "grav", "est", "ref", "var", "std", "cov", "cmd", "dv", "lpf", "ned", "enu")
)
_LINEAR = re.compile(r"lin(?:ear)?acc")
_SHORT: dict[str, tuple[Quantity, int]] = {
    "w": ("gyro", PLAIN),
    "om": ("gyro", PLAIN),
    "av": ("gyro", PLAIN),
    "rate": ("gyro", WEAK),
    "rates": ("gyro", WEAK),
    "g": ("gyro", WEAK),
    "a": ("accel", PLAIN),
    "f": ("accel", WEAK),
    "sf": ("accel", WEAK),
    "gf": ("accel", PLAIN),
}
"""Names so short that they must be the whole of a word."""


@dataclass(frozen=True)
class Meaning:
    """What a name says."""

    quantity: Quantity
    axis: str
    """x, y or z; a number where columns are counted; empty: none."""
    stem: str
    """The rest of the name: the axes of one sensor have the same."""
    unit: str | None
    """The unit that is in the name."""
    rank: int
    """`PLAIN`, `WEAK`, `WITHOUT_GRAVITY` or `DERIVED`."""


def meaning(label: str, context: str = "") -> Meaning | None:
    """Return what the name of a column means; None: no figure of an inertial sensor.

    ``context``: the name of its table or file, which says the quantity where the label says an axis
    alone.
    """
    label = label[:_LONGEST].replace("ω", "omega").replace("Ω", "omega")
    for quantity, dimension in DIMENSIONS.items():
        name, unit = divided(label, dimension)
        meant = _meant(name)
        if meant is None and (axis := _bare_axis(name)):
            by_context = quantity_of_text(context)
            if by_context is not None:
                meant = Meaning(by_context[0], axis, "", None, by_context[1])
        if meant is None and unit is not None:
            meant = _told_by_unit(quantity, name, unit)
        if meant is not None and meant.quantity == quantity:
            return Meaning(quantity, meant.axis, meant.stem, unit, meant.rank)
    return None


def quantity_of_text(text: str) -> tuple[Quantity, int] | None:
    """Return the one quantity that a text such as the name of a file says, and its rank."""
    words = words_of(text)
    joined = "".join(words)
    quantities = [quantity for quantity, pattern in _PATTERNS.items() if pattern.search(joined)]
    if len(quantities) != 1 or _OTHER.search(joined):
        return None
    return quantities[0], _rank(words, joined)


def words_of(label: str) -> list[str]:
    """Return the words of a name in small letters: of ``AngVelX``, ang, vel and x."""
    return _words(label[:_LONGEST])


def _words(text: str) -> list[str]:
    return [word.lower() for word in _WORDS.findall(text)]


def _bare_axis(name: str) -> str:
    """Return the axis of a name that says nothing else; empty: it says more, or none."""
    words = _words(name)
    if len(words) == 1 and (words[0] in _AXES or _is_place(words[0])):
        return words[0]
    return ""


def _meant(name: str) -> Meaning | None:
    words = _words(name)
    joined = "".join(words)
    axis, rest, beside = _axis_of(words)
    if _TEMPERATURE.search(joined) and not _OTHER.search(joined):
        return Meaning("temperature", axis, joined, None, _rank(words, joined))
    if not axis:
        return None
    joined = "".join(rest)
    if _OTHER.search(joined):
        return None
    is_gyro, is_accel = bool(_GYRO.search(joined)), bool(_ACCEL.search(joined))
    if is_gyro != is_accel:
        return Meaning("gyro" if is_gyro else "accel", axis, joined, None, _rank(rest, joined))
    if is_gyro or not rest or axis.isdigit():
        return None
    short = _SHORT.get(beside)
    if short is None:
        return None
    rank = _rank(rest, joined)
    return Meaning(short[0], axis, joined, None, max(short[1], rank))


def _told_by_unit(quantity: Quantity, name: str, unit: str) -> Meaning | None:
    """Return what a name means of which only the unit says the quantity."""
    words = _words(name)
    axis, rest, _ = _axis_of(words)
    joined = "".join(rest)
    if quantity == "temperature":
        return Meaning(quantity, "", joined, None, WEAK) if words == ["t"] else None
    if not axis or axis.isdecimal() or _OTHER.search(joined):
        return None
    return Meaning(quantity, axis, joined, None, max(WEAK, _rank(rest, joined)))


def _rank(words: list[str], joined: str) -> int:
    if _DERIVED.search(joined) or not _DERIVED_WORDS.isdisjoint(words):
        return DERIVED
    if _LINEAR.search(joined):
        return WITHOUT_GRAVITY
    return WEAK if "uncal" in joined else PLAIN


def _axis_of(words: list[str]) -> tuple[str, list[str], str]:
    """Return the axis of a name, its other words, and the word beside the axis."""
    for place in reversed(range(len(words))):
        word = words[place]
        rest = words[:place] + words[place + 1 :]
        if word in _AXES or (word[1:] == "out" and word[0] in _AXES):
            return word[0], rest, "".join(rest[max(place - 1, 0) :][:1])
        if word in _ABOUT_AXES and rest and rest[-1] in ("rate", "speed", "vel", "velocity"):
            return _ABOUT_AXES[word], [*rest[:-1], "rate"], "rate"
    for place in reversed(range(len(words))):
        word = words[place]
        for axis, base in ((word[-1], word[:-1]), (word[0], word[1:])):
            if axis in _AXES and (base in _SHORT or _GYRO.search(base) or _ACCEL.search(base)):
                return axis, [*words[:place], base, *words[place + 1 :]], base
    if words and _is_place(words[-1]):
        return words[-1], words[:-1], ""
    return "", words, ""


def _is_place(word: str) -> bool:
    return word.isdecimal() and len(word) <= 2
