"""The appearance of sensors and methods in all figures: colour, dash and marker.

The colours are from Okabe and Ito, for colour-blind readers. Pale ones are darkened on light
pages and dark ones lightened on dark pages, for a contrast of 3 : 1 with the background.
"""

from dataclasses import dataclass
from typing import Any

from imubench_pipeline.noise import TERMS


@dataclass(frozen=True)
class Appearance:
    """The appearance of a line in a figure."""

    light: str  # colour on a light background
    dark: str  # colour on a dark background
    dash: str  # as Plotly names it, or lengths
    marker: str  # as Plotly names it


_COLOURS = (
    ("#0072B2", "#4DA3D9"),
    ("#D55E00", "#F08A3C"),
    ("#008F6B", "#2EC4A0"),
    ("#B3508C", "#DB8FBC"),
    ("#9A6B00", "#E0A82E"),
    ("#666666", "#B8B8B8"),
    ("#7A4B3A", "#C69A88"),
    ("#5B5FC7", "#A3A6F2"),
)
TERM_COLOURS = tuple(
    {"light": light, "dark": dark}
    for place, (light, dark) in enumerate(_COLOURS)
    if place not in (2, 5)  # too close to the green of the best method, and to grey
)
"""Colours of the terms of a model and of the sources of an error, by their place."""

AXIS_STYLES = {
    axis: Appearance(*_COLOURS[place], "solid", marker)
    for place, (axis, marker) in enumerate((("x", "circle"), ("y", "square"), ("z", "diamond")))
}

_MARKERS = ("circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x")
_DASHES = ("solid", "dash", "dot", "dashdot", "longdash")
_INK_COLOURS = ("#1b1b1b", "#e8e8e8")
_INK_SHARES = (0.0, 0.5, 0.25, 0.75)
_STYLES_PER_DASH = len(_INK_SHARES) * len(_MARKERS)  # recordings with the same dash

METHOD_STYLES = {
    "robust": Appearance("#1B6F3A", "#5FC98A", "11px,3px,5px,3px", "star"),
    "likelihood": Appearance("#008F6B", "#2EC4A0", "solid", "diamond"),
    "likelihood_gm": Appearance("#9A6B00", "#E0A82E", "longdash", "square"),
    "compensated": Appearance("#5B5FC7", "#A3A6F2", "longdashdot", "x"),
    "curve": Appearance("#D55E00", "#F08A3C", "dash", "triangle-up"),
    "paper": Appearance("#B3508C", "#DB8FBC", "dashdot", "triangle-down"),
    "weighted": Appearance("#0072B2", "#4DA3D9", "dot", "cross"),
    "authors": Appearance("#7A4B3A", "#C69A88", "7px,3px,2px,3px,2px,3px", "circle"),
}

Look = dict[str, Any]

TERM_LOOKS: dict[str, Look] = {
    "Q": {"color": "#9A6B00", "linestyle": (0, (1, 1.4))},
    "N": {"color": "#0072B2", "linestyle": (0, (4, 2))},
    "F": {"color": "#D55E00", "linestyle": (0, (5, 1.5, 1, 1.5))},
    "GM": {"color": "#D55E00", "linestyle": (0, (5, 1.5))},
    "K": {"color": "#B3508C", "linestyle": (0, (8, 2))},
    "R": {"color": "#7A4B3A", "linestyle": (0, (8, 2, 1, 2))},
    "S": {"color": "#5B5FC7", "linestyle": (0, (2, 1))},
}

SUM_LOOK: Look = {"color": "#008F6B", "linestyle": "-", "linewidth": 1.2}

_QUANTITY_WORDS = {
    "gyro": {"signal": "rate", "integral": "angle"},
    "accel": {"signal": "acceleration", "integral": "velocity"},
}
TERM_NAMES = {
    quantity: {kind.symbol: kind.standard_name.format(**words) for kind in TERMS}
    for quantity, words in _QUANTITY_WORDS.items()
}


def assign_sensor_styles(sensors: list[str]) -> dict[str, Appearance]:
    """Return the appearance of each sensor by its place in the list; after 8, colours repeat."""
    looks = {}
    for place, sensor in enumerate(sensors):
        colour, turn = place % len(_COLOURS), place // len(_COLOURS)
        marker = _MARKERS[(place + turn) % len(_MARKERS)]
        looks[sensor] = Appearance(*_COLOURS[colour], _DASHES[turn % len(_DASHES)], marker)
    return looks


def make_recording_styles(sensor_style: Appearance) -> list[Appearance]:
    """Return styles for the recordings of a sensor: ``sensor_style``, then variants of it."""
    own = sensor_style
    first, shades = _MARKERS.index(own.marker), len(_INK_SHARES)
    dashes = [own.dash, *(dash for dash in _DASHES if dash != own.dash)]
    return [
        Appearance(
            _mix_colours(own.light, _INK_COLOURS[0], _INK_SHARES[place % shades]),
            _mix_colours(own.dark, _INK_COLOURS[1], _INK_SHARES[place % shades]),
            dashes[place // _STYLES_PER_DASH],
            _MARKERS[(first + place) % len(_MARKERS)],
        )
        for place in range(2 * _STYLES_PER_DASH)
    ]


def _mix_colours(colour: str, ink: str, share: float) -> str:
    pairs = ((int(one[at : at + 2], 16) for one in (colour, ink)) for at in (1, 3, 5))
    return "#" + "".join(f"{round(a + share * (b - a)):02X}" for a, b in pairs)
