"""Interpret the name of a column: quantity, axis, and whether the sensor measures it."""

import re
from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.readers.stated_units import split_unit
from imubench_pipeline.settings.sensor import QUANTITIES

Quantity = Literal["gyro", "accel", "temperature"]

DIMENSIONS: dict[Quantity, str] = {  # the dimension of the unit of each quantity
    "gyro": QUANTITIES["gyro"],
    "accel": QUANTITIES["accel"],
    "temperature": "temperature",
}

PLAIN, WEAK, WITHOUT_GRAVITY, DERIVED = range(4)
"""Ranks of names: the quantity is certain; it is uncertain; an acceleration that may exclude
gravity; a quantity derived from a measurement, such as a filter output or a bias."""

_MAX_LABEL_LENGTH = 200
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_AXES = ("x", "y", "z")
_AXES_OF_ROTATIONS = {"roll": "x", "pitch": "y", "yaw": "z"}
_GYRO = re.compile(
    r"gyr|ang(?:ular)?vel|ang(?:ular)?rate|ang(?:ular)?speed|rotationrate|rotrate|rateofturn|"
    r"turnrate|omega|bodyrate"
)
_ACCEL = re.compile(r"acc(?!ur)|specificforce|gforce")
_TEMPERATURE = re.compile(r"temp(?!or|l)")
_PATTERNS = dict(zip(DIMENSIONS, (_GYRO, _ACCEL, _TEMPERATURE), strict=True))
_OTHER_QUANTITIES = re.compile(
    r"ang(?:ular|le)?acc|alpha|quat|euler|orient|attitude|angle|inclin|heading|mag(?!ic)|baro|press"
)
_DERIVED_QUANTITIES = re.compile(
    r"freeacc|gravity|inertial|useracc|bias|offset|covar|varian|sigma|delta|jerk|filter|"
    r"smooth|status|world|earth|residual|error|valid|count$|delay|stamp|time"
)
_DERIVED_WORDS = frozenset(
    ("free", "user", "grav", "est", "ref", "var", "std", "cov", "cmd", "dv", "lpf", "ned", "enu")
)
_UNCERTAIN_NAMES = re.compile(r"uncal|noise")
_FILTERED_BY_BETAFLIGHT = frozenset(("accsmooth", "gyroadc"))
"""Its only acceleration, and its rates, are filtered: they are taken if there is nothing else."""

_BODY_FRAME_RATES, _BODY_FRAME_FORCES = frozenset(("wb", "wibb")), frozenset(("fb", "fibb"))
_LINEAR_ACCELERATION = re.compile(r"lin(?:ear)?acc")
_SHORT_NAMES: dict[str, tuple[Quantity, int]] = {  # short names, which must be a complete word
    **dict.fromkeys(("w", "om", "av"), ("gyro", PLAIN)),
    **dict.fromkeys(("rate", "rates", "g"), ("gyro", WEAK)),
    **dict.fromkeys(("a", "gf"), ("accel", PLAIN)),
    **dict.fromkeys(("f", "sf"), ("accel", WEAK)),
}


@dataclass(frozen=True)
class Meaning:
    """Quantity and axis that the name of a column means."""

    quantity: Quantity
    axis: str  # x, y or z; a number for numbered columns; empty if there is none
    stem: str  # the rest of the name, which is equal for the axes of one sensor
    unit: str | None  # the unit in the name
    rank: int  # `PLAIN`, `WEAK`, `WITHOUT_GRAVITY` or `DERIVED`


def interpret_label(label: str, context: str = "") -> Meaning | None:
    """Return what a column name in a table named ``context`` means; None if it is not inertial."""
    label = label[:_MAX_LABEL_LENGTH].replace("ω", "omega").replace("Ω", "omega")
    for quantity, dimension in DIMENSIONS.items():
        name, unit = split_unit(label, dimension)
        meant = _interpret_name(name)
        words = split_label(name)
        if meant is None and len(words) == 1 and (words[0] in _AXES or _is_axis_number(words[0])):
            by_context = find_quantity(context)
            if by_context is not None:
                meant = Meaning(by_context[0], words[0], "", None, by_context[1])
        if meant is None and unit is not None:
            meant = _interpret_by_unit(quantity, name, unit)
        if meant is not None and meant.quantity == quantity:
            return Meaning(quantity, meant.axis, meant.stem, unit, meant.rank)
    return None


def find_quantity(text: str) -> tuple[Quantity, int] | None:
    """Return the quantity in a text, such as a file name, and its rank; None if none or several."""
    words = split_label(text)
    joined = "".join(words)
    if joined in _BODY_FRAME_RATES | _BODY_FRAME_FORCES:
        return "gyro" if joined in _BODY_FRAME_RATES else "accel", PLAIN
    quantities = [quantity for quantity, pattern in _PATTERNS.items() if pattern.search(joined)]
    if len(quantities) != 1 or _OTHER_QUANTITIES.search(joined):
        return None
    return quantities[0], _rank_name(words, joined)


def split_label(label: str) -> list[str]:
    """Return the words of a name in lower case: ang, vel and x for ``AngVelX``."""
    return [word.lower() for word in _WORD.findall(label[:_MAX_LABEL_LENGTH])]


def _interpret_name(name: str) -> Meaning | None:
    words = split_label(name)
    joined = "".join(words)
    axis, rest, beside = _find_axis(words)
    if _TEMPERATURE.search(joined) and not _OTHER_QUANTITIES.search(joined):
        return Meaning("temperature", axis, joined, None, _rank_name(words, joined))
    if not axis:
        return None
    joined = "".join(rest)
    if _OTHER_QUANTITIES.search(joined):
        return None
    is_gyro = bool(_GYRO.search(joined)) or joined in _BODY_FRAME_RATES
    is_accel = bool(_ACCEL.search(joined)) or joined in _BODY_FRAME_FORCES
    if is_gyro != is_accel:
        return Meaning("gyro" if is_gyro else "accel", axis, joined, None, _rank_name(rest, joined))
    if is_gyro or not rest or axis.isdigit():
        return None
    if beside not in _SHORT_NAMES:
        return None
    quantity, rank = _SHORT_NAMES[beside]
    return Meaning(quantity, axis, joined, None, max(rank, _rank_name(rest, joined)))


def _interpret_by_unit(quantity: Quantity, name: str, unit: str) -> Meaning | None:
    words = split_label(name)
    axis, rest, _ = _find_axis(words)
    joined = "".join(rest)
    if quantity == "temperature":
        return Meaning(quantity, "", joined, None, WEAK) if words == ["t"] else None
    if not axis or axis.isdecimal() or _OTHER_QUANTITIES.search(joined):
        return None
    return Meaning(quantity, axis, joined, None, max(WEAK, _rank_name(rest, joined)))


def _rank_name(words: list[str], joined: str) -> int:
    if joined in _FILTERED_BY_BETAFLIGHT:
        return WEAK
    if _DERIVED_QUANTITIES.search(joined) or not _DERIVED_WORDS.isdisjoint(words):
        return DERIVED
    if _LINEAR_ACCELERATION.search(joined):
        return WITHOUT_GRAVITY
    return WEAK if _UNCERTAIN_NAMES.search(joined) else PLAIN


def _find_axis(words: list[str]) -> tuple[str, list[str], str]:
    """Return the axis of a name, its other words, and the word beside the axis."""
    for place in reversed(range(len(words))):
        word = words[place]
        rest = words[:place] + words[place + 1 :]
        if word in _AXES or (word[1:] == "out" and word[0] in _AXES):
            return word[0], rest, "".join(rest[max(place - 1, 0) :][:1])
        if word in _AXES_OF_ROTATIONS and rest and rest[-1] in ("rate", "speed", "vel", "velocity"):
            return _AXES_OF_ROTATIONS[word], [*rest[:-1], "rate"], "rate"
    for place in reversed(range(len(words))):
        word = words[place]
        for axis, base in ((word[-1], word[:-1]), (word[0], word[1:])):
            if axis in _AXES and (
                base in _SHORT_NAMES or _GYRO.search(base) or _ACCEL.search(base)
            ):
                return axis, [*words[:place], base, *words[place + 1 :]], base
    if words and _is_axis_number(words[-1]):
        return words[-1], words[:-1], ""
    return "", words, ""


def _is_axis_number(word: str) -> bool:
    return word.isdecimal() and len(word) <= 2
