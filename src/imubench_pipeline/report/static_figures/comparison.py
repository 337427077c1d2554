"""The curves of one axis of all sensors (Maia et al., Figures 6 and 7)."""

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
_MAX_SENSORS_IN_COLUMN = 6  # sensors, in a figure one column wide
_MOST_CURVES_IN_A_COLUMN = 30
_MAX_EQUAL_RECORDINGS = 3
"""Number of recordings of a sensor up to which all are drawn alike."""

_MARKERS_PER_SENSOR = 9  # on the curves of a sensor
_THIN_WIDTH, _PALE_OPACITY = 0.4, 0.45  # width in pt and opacity of a curve among many
_MAX_NAME_WIDTH = 200.0  # pt


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
    wide = len(groups) > _MAX_SENSORS_IN_COLUMN or len(views) > _MOST_CURVES_IN_A_COLUMN
    figure = new_figure(DOUBLE if wide else SINGLE, 95.0 if wide else 68.0, f"{name}: all sensors")
    axes = figure.add_subplot()
    handles = []
    for place, (sensor, simulated) in enumerate(ordered):
        of_group = groups[sensor, simulated]
        _draw(axes, of_group, looks[sensor], unit.per_si, place, bands=len(views) <= _MOST_BANDS)
        label = shortened(figure, sensor, _MAX_NAME_WIDTH) + _format_remarks(
            len(of_group), simulated
        )
        look = line_look(looks[sensor]) | marker_look(looks[sensor], hollow=simulated)
        handles.append(Line2D([], [], label=label, **look))
    if any(len(each) > _MAX_EQUAL_RECORDINGS for each in groups.values()):
        handles += [
            Line2D([], [], color="black", label="median of several recordings"),
            Line2D(
                [],
                [],
                color="black",
                alpha=_PALE_OPACITY,
                linewidth=_THIN_WIDTH,
                label="other recordings",
            ),
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
    """Draw the recordings of a sensor; if there are many, all but the middle one are thin."""
    lines = line_look(look)
    marked = views
    if len(views) > _MAX_EQUAL_RECORDINGS:
        middle = _find_middle(views)
        marked = [views[middle]]
        curves = [np.column_stack((view.tau, view.adev * scale)) for view in views]
        axes.add_collection(
            LineCollection(
                curves,
                colors=lines["color"],
                linestyles=lines["linestyle"],
                linewidths=_THIN_WIDTH,
                alpha=_PALE_OPACITY,
            ),
            autolim=False,
        )
    for number, view in enumerate(marked):
        if bands:
            axes.fill_between(
                view.tau, view.lower * scale, view.upper * scale, color=look.light, alpha=0.18, lw=0
            )
        step = max(1, len(view.tau) * len(marked) // _MARKERS_PER_SENSOR)
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


def _find_middle(views: Sequence[ChannelView]) -> int:
    """Return the index of the recording with the median level over the common averaging times."""
    first, last = max(view.tau[0] for view in views), min(view.tau[-1] for view in views)
    amid = math.sqrt(first * last)
    levels = [np.interp(amid, view.tau, view.adev) for view in views]
    return int(np.argsort(levels, kind="stable")[len(levels) // 2])


def _format_remarks(recordings: int, simulated: bool) -> str:
    words = [f"{recordings} recordings"] * (recordings > 1) + ["simulated"] * simulated
    return f" ({', '.join(words)})" if words else ""
