"""The Allan deviations of a recording as a small SVG, for readers without JavaScript and for mail.

Matplotlib would take longer for it than all pages of a recording.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from markupsafe import Markup

from imubench_pipeline.datasheets.class_limits import read_grade_limits
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.report.palette import AXIS_STYLES
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.typing import Array
from imubench_pipeline.words.numbers import number_text

_WIDTH, _HEIGHT = 1920, 800
_LEFT, _RIGHT, _TOP, _BOTTOM = 140, 1720, 60, 700
_GRADE_FILLS = ("#ffffff", "#f4f5f6", "#eaecee", "#e0e3e5")
_LINE_POINTS = 24  # of a model and of limits: more would not be seen


def draw_picture(views: Sequence[ChannelView], system: System) -> Markup:
    """Return an SVG of Allan deviations of axes: measured, 95 % limits, models, sensor grades."""
    unit = choose_page_unit(views[0].quantity, "adev", system)
    tau = np.concatenate([view.tau for view in views])
    adev = np.concatenate([view.adev for view in views]) * unit.per_si
    x_range = math.log10(tau.min()) - 0.1, math.log10(tau.max()) + 0.1
    y_range = math.log10(adev.min()) - 0.5, math.log10(adev.max()) + 0.3

    def places(x: Array, y: Array) -> str:
        with np.errstate(divide="ignore"):
            across = (np.log10(x) - x_range[0]) / (x_range[1] - x_range[0])
            up = (np.log10(y) - y_range[0]) / (y_range[1] - y_range[0])
        points = zip(
            _LEFT + (_RIGHT - _LEFT) * across,
            _BOTTOM - (_BOTTOM - _TOP) * np.clip(up, 0.0, 1.0),
            strict=True,
        )
        return " ".join(f"{x:.0f},{y:.0f}" for x, y in points)

    def text(x: float, y: float, words: str, more: str = "") -> str:
        return f'<text x="{x:.0f}" y="{y:.0f}" {more}>{words}</text>'

    parts = []
    wide = np.logspace(*x_range, 20)
    limits = read_grade_limits(views[0].quantity)
    top = np.full_like(wide, 10.0 ** y_range[1])
    for fill, name, limit in zip(
        _GRADE_FILLS, ("consumer", *limits), (None, *limits.values()), strict=True
    ):
        if limit:
            top = np.hypot(limit["N"] / np.sqrt(wide), FLOOR * limit["B"]) * unit.per_si
        path = f"{_LEFT},{_BOTTOM} {places(wide, top)} {_RIGHT},{_BOTTOM}"
        parts.append(f'<polygon points="{path}" fill="{fill}"/>')
        y = float(places(wide[-1:], top[-1:]).split(",")[1])
        if y < _BOTTOM - 28.0:
            parts.append(text(_RIGHT + 10, y + 28.0, name, 'fill="#5a636b"'))
    for place, (low, high) in enumerate((x_range, y_range)):
        for power in range(math.ceil(low), math.floor(high) + 1):
            share = (power - low) / (high - low)
            words = number_text(10.0**power, 3)
            if place == 0:
                x = _LEFT + (_RIGHT - _LEFT) * share
                line = f"M{x:.0f} {_TOP}V{_BOTTOM}"
                parts.append(text(x, _BOTTOM + 32, words, 'text-anchor="middle"'))
            else:
                y = _BOTTOM - (_BOTTOM - _TOP) * share
                line = f"M{_LEFT} {y:.0f}H{_RIGHT}"
                parts.append(text(_LEFT - 10, y + 8, words, 'text-anchor="end"'))
            parts.append(f'<path d="{line}" stroke="#c8ced2" stroke-width="2"/>')
    parts += _draw_curves(views, unit.per_si, places, text)
    parts.append(text(_LEFT, _HEIGHT - 20, f"Allan deviation ({unit.sign}), averaging time τ (s)"))
    # Numbers, units and names of channels, which need no escaping.
    return Markup(
        '<svg class="picture" role="img" aria-label="Allan deviation" '
        f'xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" '
        f'font-family="sans-serif" font-size="26">{"".join(parts)}</svg>'
    )


def _draw_curves(
    views: Sequence[ChannelView],
    scale: float,
    places: Callable[[Array, Array], str],
    text: Callable[[float, float, str, str], str],
) -> Iterator[str]:
    x = float(_LEFT)
    for view in views:
        colour = AXIS_STYLES[view.axis].light if view.axis in AXIS_STYLES else "#1b1b1b"
        yield text(x, 36, view.channel.replace("_", " "), f'fill="{colour}" font-weight="bold"')
        x += 150
        few = np.unique(np.linspace(0, len(view.tau) - 1, _LINE_POINTS).astype(int))
        limited = few[np.isfinite(view.lower[few]) & np.isfinite(view.upper[few])]
        edges = f"{places(view.tau[limited], view.upper[limited] * scale)} "
        edges += places(view.tau[limited[::-1]], view.lower[limited[::-1]] * scale)
        yield f'<polygon points="{edges}" fill="{colour}" opacity=".16"/>'
        dots = places(view.tau, view.adev * scale).replace(" ", "h0M")
        look = f'stroke="{colour}" stroke-width="10" stroke-linecap="round"'
        yield f'<path d="M{dots}h0" {look}/>'
        if view.recommended in view.parameters:
            model = np.sqrt(view.model(view.recommended).allan_variance(view.tau[few])) * scale
            line = places(view.tau[few], model)
            yield f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="4"/>'
