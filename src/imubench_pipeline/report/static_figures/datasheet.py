"""The curve of a channel with the lines of its datasheet (000, Figures 8 and 9)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from imubench_pipeline.report.palette import method_appearance
from imubench_pipeline.report.practical import System
from imubench_pipeline.report.static_figures.curves import channel_axes, draw_measured, finish
from imubench_pipeline.report.static_figures.style import line_look, style
from imubench_pipeline.report.static_figures.terms import TERM_LOOKS
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView
from imubench_pipeline.typing import Row

_NAMES = {"N": "$N$", "adev_minimum": "bias instability", "K": "$K$"}
_DASHES = ((0, (4, 2)), (0, (1, 1.4)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)))
_SIGNS = (("deg", "°"), ("sqrt(Hz)", "√Hz"), ("sqrt(h)", "√h"), ("sqrt(s)", "√s"), ("ug", "µg"))


@style()
def datasheet_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the curve and the recommended model with the lines that the datasheet prints.

    N is a line of slope -1/2, K one of +1/2; a bias instability is the level of the minimum, as
    vendors mean it. None where the datasheet has no such figure.
    """
    rows = _printed(view)
    if not rows:
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
    for row in rows:
        statistic = row["statistic"]
        number = drawn[statistic] = drawn.get(statistic, -1) + 1
        line = _line(statistic, row["comparable"], view.tau) * scale
        levels += [float(line.min()), float(line.max())]
        colour = TERM_LOOKS["F" if statistic == "adev_minimum" else statistic]["color"]
        axes.plot(
            view.tau,
            line,
            color=colour,
            ls=_DASHES[number % len(_DASHES)],
            label=_label(row),
        )
    return finish(figure, axes, view, scale, *levels)


def _printed(view: ChannelView) -> list[Row]:
    """Return the figures that have a line, each reading of them once."""
    chosen = {
        (row["statistic"], row["comparable"], row["sidedness"], row["kind"]): row
        for row in view.datasheet
        if row["method"] == view.recommended and row["comparable"] and row["statistic"] in _NAMES
    }
    return list(chosen.values())


def _line(statistic: str, value: float, tau: NDArray[np.float64]) -> NDArray[np.float64]:
    if statistic == "N":
        return value / np.sqrt(tau)
    if statistic == "K":
        return value * np.sqrt(tau / 3.0)
    return np.full_like(tau, value)


def _label(row: Row) -> str:
    unit = row["unit"]
    for written, sign in _SIGNS:
        unit = unit.replace(written, sign)
    kind = {"typ": None, "1sigma": "1σ"}.get(row["kind"], row["kind"])
    notes = [
        kind,
        f"read as {row['sidedness']}" if row["sidedness"] else None,
    ]
    about = ", ".join(filter(None, notes))
    text = f"datasheet {_NAMES[row['statistic']]}: {row['printed']:g} {unit}"
    return f"{text} ({about})" if about else text
