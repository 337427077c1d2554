"""The curve of a channel with the lines of its datasheet (Maia et al., Figures 8 and 9)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from imubench_pipeline.model.comparisons import DatasheetRow
from imubench_pipeline.report.palette import method_appearance
from imubench_pipeline.report.practical import System
from imubench_pipeline.report.static_figures.curves import channel_axes, draw_measured, finish
from imubench_pipeline.report.static_figures.style import line_look, style
from imubench_pipeline.report.static_figures.terms import TERM_LOOKS
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView
from imubench_pipeline.words.numbers import NO_VALUE

_FIGURE_NAMES = {"N": "$N$", "adev_minimum": "bias instability", "K": "$K$"}
_KIND_TEXTS: Mapping[str | None, str | None] = {"typ": None, "1sigma": "1σ"}
_LINE_DASHES = ((0, (4, 2)), (0, (1, 1.4)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)))
_UNIT_SIGNS = (
    ("deg", "°"),
    ("sqrt(Hz)", "√Hz"),
    ("sqrt(h)", "√h"),
    ("sqrt(s)", "√s"),
    ("ug", "µg"),
)


@style()
def datasheet_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the curve and the recommended model with the lines that the datasheet prints.

    N is a line of slope -1/2, K one of +1/2; a bias instability is the level of the minimum, as
    vendors mean it. None where the datasheet has no such figure.
    """
    printed = _select_printed(view)
    if not printed:
        return None
    figure, axes, scale = channel_axes(view, system, "with the datasheet")
    draw_measured(axes, view, scale)
    model = view.model(view.recommended)
    if model.terms:
        axes.plot(
            view.tau,
            np.sqrt(model.allan_variance(view.tau)) * scale,
            label=METHOD_NAMES[view.recommended],
            zorder=2.8,
            **line_look(method_appearance(view.recommended)),
        )
    levels = []
    drawn: dict[str, int] = {}
    for row, comparable in printed:
        statistic = row.statistic
        number = drawn[statistic] = drawn.get(statistic, -1) + 1
        line = _compute_line(statistic, comparable, view.tau) * scale
        levels += [float(line.min()), float(line.max())]
        colour = TERM_LOOKS["F" if statistic == "adev_minimum" else statistic]["color"]
        axes.plot(
            view.tau,
            line,
            color=colour,
            ls=_LINE_DASHES[number % len(_LINE_DASHES)],
            label=_make_label(row),
        )
    return finish(figure, axes, view, scale, *levels)


def _select_printed(view: ChannelView) -> list[tuple[DatasheetRow, float]]:
    """Return the printed figures with a line, each reading once, with their values in SI."""
    chosen = {
        (row.statistic, row.comparable, row.sidedness, row.kind): (row, row.comparable)
        for row in view.datasheet
        if row.method == view.recommended and row.comparable and row.statistic in _FIGURE_NAMES
    }
    return list(chosen.values())


def _compute_line(statistic: str, value: float, tau: NDArray[np.float64]) -> NDArray[np.float64]:
    if statistic == "N":
        return value / np.sqrt(tau)
    if statistic == "K":
        return value * np.sqrt(tau / 3.0)
    return np.full_like(tau, value)


def _make_label(row: DatasheetRow) -> str:
    unit = row.unit or ""
    for written, sign in _UNIT_SIGNS:
        unit = unit.replace(written, sign)
    notes = [
        _KIND_TEXTS.get(row.kind, row.kind),
        f"read as {row.sidedness}" if row.sidedness else None,
    ]
    about = ", ".join(filter(None, notes))
    number = NO_VALUE if row.printed is None else f"{row.printed:g}"
    text = f"datasheet {_FIGURE_NAMES[row.statistic]}: {number} {unit}"
    return f"{text} ({about})" if about else text
