"""The curves of one axis of all sensors (000, Figures 6 and 7)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from imubench_pipeline.report.palette import Appearance, sensor_appearances
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.static_figures.names import channel_name
from imubench_pipeline.report.static_figures.style import (
    DOUBLE,
    SINGLE,
    extent,
    legend_below,
    line_look,
    log_x,
    log_y,
    marker_look,
    new_figure,
    settled,
    shortened,
    style,
)
from imubench_pipeline.report.view import ChannelView

_MOST_BANDS = 8
_MOST_IN_A_COLUMN = 6  # sensors, in a figure one column wide
_MOST_CURVES_IN_A_COLUMN = 30
_FEW = 3
"""Recordings of a sensor that are drawn alike; of more, one stands for the others."""

_MARKS = 9  # on the curves of a sensor
_THIN, _PALE = 0.4, 0.45  # width in pt and opacity of a curve among many
_LONGEST_NAME = 200.0  # pt


@style()
def comparison_figure(
    views: Sequence[ChannelView], sensors: Sequence[str], system: System = "practical"
) -> Figure:
    """Draw the Allan deviation of one channel of several sensors.

    A sensor has the same colour, dash and marker in every figure, by its place among all sensors of
    the run; a marker of a simulated log is hollow.
    """
    looks = sensor_appearances(list(sensors))
    groups: dict[tuple[str, bool], list[ChannelView]] = {}
    for view in views:
        groups.setdefault((view.sensor, view.simulated), []).append(view)
    ordered = sorted(groups, key=lambda group: (sensors.index(group[0]), group[1]))

    unit = page_unit(views[0].quantity, "adev", system)
    name = channel_name(views[0].channel)
    wide = len(groups) > _MOST_IN_A_COLUMN or len(views) > _MOST_CURVES_IN_A_COLUMN
    figure = new_figure(DOUBLE if wide else SINGLE, 95.0 if wide else 68.0, f"{name}: all sensors")
    axes = figure.add_subplot()
    handles = []
    for place, (sensor, simulated) in enumerate(ordered):
        of_group = groups[sensor, simulated]
        _draw(axes, of_group, looks[sensor], unit.per_si, place, bands=len(views) <= _MOST_BANDS)
        label = shortened(figure, sensor, _LONGEST_NAME) + _about(len(of_group), simulated)
        look = line_look(looks[sensor]) | marker_look(looks[sensor], hollow=simulated)
        handles.append(Line2D([], [], label=label, **look))
    if any(len(each) > _FEW for each in groups.values()):
        handles += [
            Line2D([], [], color="black", label="of several recordings: the middle one"),
            Line2D([], [], color="black", alpha=_PALE, linewidth=_THIN, label="and the others"),
        ]
    log_x(axes, extent(*(view.tau for view in views)))
    log_y(axes, extent(*(view.adev * unit.per_si for view in views), margin=1.5))
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation ({unit.sign})")
    axes.set_title(name, loc="left")
    legend_below(figure, handles)
    return settled(figure)


def _draw(
    axes: Axes,
    views: Sequence[ChannelView],
    look: Appearance,
    scale: float,
    place: int,
    *,
    bands: bool,
) -> None:
    """Draw the recordings of a sensor; of many all are thin but the middle one."""
    lines = line_look(look)
    marked = views
    if len(views) > _FEW:
        middle = _middle(views)
        marked = [views[middle]]
        curves = [np.column_stack((view.tau, view.adev * scale)) for view in views]
        axes.add_collection(
            LineCollection(
                curves,
                colors=lines["color"],
                linestyles=lines["linestyle"],
                linewidths=_THIN,
                alpha=_PALE,
            ),
            autolim=False,
        )
    for number, view in enumerate(marked):
        if bands:
            axes.fill_between(
                view.tau, view.lower * scale, view.upper * scale, color=look.light, alpha=0.18, lw=0
            )
        step = max(1, len(view.tau) * len(marked) // _MARKS)
        # Sensors and recordings begin at different points, so that markers seldom coincide.
        start = (3 * place + number * step // len(marked)) % step
        axes.plot(
            view.tau,
            view.adev * scale,
            **lines,
            **marker_look(look, hollow=view.simulated),
            linewidth=1.0 if len(marked) == 1 else 0.8,
            markevery=(start, step),
            zorder=2.5,
        )


def _middle(views: Sequence[ChannelView]) -> int:
    """Return which recording has the middle level, amid the averaging times that all have."""
    first, last = max(view.tau[0] for view in views), min(view.tau[-1] for view in views)
    amid = math.sqrt(first * last)
    levels = [np.interp(amid, view.tau, view.adev) for view in views]
    return int(np.argsort(levels, kind="stable")[len(levels) // 2])


def _about(recordings: int, simulated: bool) -> str:
    words = [f"{recordings} recordings"] * (recordings > 1) + ["simulated"] * simulated
    return f" ({', '.join(words)})" if words else ""
