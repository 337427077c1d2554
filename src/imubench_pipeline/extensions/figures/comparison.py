"""One channel of all sensors: the curves, and the parameters with their intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.extensions.figures import style
from imubench_pipeline.report.palette import Appearance, assign_sensor_styles
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words.estimates import status_text

_MOST_BANDS = 8
_MAX_SENSORS_IN_COLUMN = 6  # sensors, in a figure one column wide
_MOST_CURVES_IN_A_COLUMN = 30
_MAX_EQUAL_RECORDINGS = 3  # number of recordings of a sensor up to which all are drawn alike
_MARKERS_PER_SENSOR = 9  # on the curves of a sensor
_THIN_WIDTH, _PALE_OPACITY = 0.4, 0.45  # width in pt and opacity of a curve among many
_MAX_NAME_WIDTH = 200.0  # pt
Kind = Literal["estimate", "not identified", "limit"]
_SLOT_HEIGHT = 2.6  # mm, of a recording where there is room
_MIN_ROW_HEIGHT = 4.2  # mm, of a sensor: its name must fit
_MAX_HEIGHT = 205.0  # mm, of all sensors: the figure fits on one page
_FRAME_HEIGHT = 16.0  # mm, title and axis
_MAX_INTERVAL_DECADES = 1.5  # maximum length of an interval beyond all values, decades

# A bar at the limit and an arrow to the left of it, in units of the bar.
_ARROW_MARKER = Path(
    [(0, -0.3), (0, 0.3), (0, 0), (-1, 0), (-0.75, 0.2), (-1, 0), (-0.75, -0.2)],
    [Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO, Path.LINETO],
)
_ARROW_SIZE = 4.5  # of a dot


@style.set_style()
def draw_comparison_figure(
    views: Sequence[ChannelView], sensors: Sequence[str], system: System = "practical"
) -> Figure:
    """Draw the Allan deviation of one channel of several sensors (Maia et al., Figures 6 and 7).

    A sensor has the same colour, dash and marker in every figure, by its place among all sensors of
    the run; a marker of a simulated log is hollow.
    """
    looks = assign_sensor_styles(list(sensors))
    groups = group_rows(views, lambda view: (view.sensor, view.simulated))
    ordered = sorted(groups, key=lambda group: (sensors.index(group[0]), group[1]))

    unit = choose_page_unit(views[0].quantity, "adev", system)
    name = style.name_channel(views[0].channel)
    wide = len(groups) > _MAX_SENSORS_IN_COLUMN or len(views) > _MOST_CURVES_IN_A_COLUMN
    figure = style.make_figure(
        style.DOUBLE if wide else style.SINGLE, 95.0 if wide else 68.0, f"{name}: all sensors"
    )
    axes = figure.add_subplot()
    handles = []
    for place, (sensor, simulated) in enumerate(ordered):
        of_group = groups[sensor, simulated]
        bands = len(views) <= _MOST_BANDS
        _draw_sensor(axes, of_group, looks[sensor], unit.per_si, place, bands=bands)
        recordings = len(of_group)
        words = [f"{recordings} recordings"] * (recordings > 1) + ["simulated"] * simulated
        label = style.shorten_name(figure, sensor, _MAX_NAME_WIDTH)
        label += f" ({', '.join(words)})" if words else ""
        look = style.convert_line_style(looks[sensor]) | style.convert_marker_style(
            looks[sensor], hollow=simulated
        )
        handles.append(Line2D([], [], label=label, **look))
    if any(len(each) > _MAX_EQUAL_RECORDINGS for each in groups.values()):
        handles.append(Line2D([], [], color="black", label="median of several recordings"))
        pale: dict[str, Any] = {"alpha": _PALE_OPACITY, "linewidth": _THIN_WIDTH}
        handles.append(Line2D([], [], color="black", label="other recordings", **pale))
    style.set_log_axis(axes, "x", style.compute_limits(*(view.tau for view in views)))
    style.set_log_axis(
        axes, "y", style.compute_limits(*(view.adev * unit.per_si for view in views), margin=1.5)
    )
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation ({unit.sign})")
    axes.set_title(name, loc="left")
    style.draw_legend_below(figure, handles)
    return style.fix_layout(figure)


def _draw_sensor(
    axes: Axes,
    views: Sequence[ChannelView],
    look: Appearance,
    scale: float,
    place: int,
    *,
    bands: bool,
) -> None:
    """Draw the recordings of a sensor; if there are many, all but the middle one are thin."""
    lines = style.convert_line_style(look)
    marked = views
    if len(views) > _MAX_EQUAL_RECORDINGS:
        # Its level is the median at the middle of the common averaging times.
        first, last = max(view.tau[0] for view in views), min(view.tau[-1] for view in views)
        amid = math.sqrt(first * last)
        levels = [np.interp(amid, view.tau, view.adev) for view in views]
        marked = [views[int(np.argsort(levels, kind="stable")[len(levels) // 2])]]
        axes.add_collection(
            LineCollection(
                [np.column_stack((view.tau, view.adev * scale)) for view in views],
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
            **style.convert_marker_style(look, hollow=view.simulated),
            linewidth=1.0 if len(marked) == 1 else 0.8,
            markevery=(start, step),
            zorder=2.5,
        )


@dataclass(frozen=True)
class Mark:
    """The mark of one estimate in the figure that compares parameters."""

    place: float  # distance from the top, mm
    kind: Kind
    value: float | None  # by kind: estimate, fitted value that is not identified, or limit
    lower: float | None = None  # 95 % limits
    upper: float | None = None


def make_mark(view: ChannelView, symbol: str, place: float) -> Mark | None:
    """Return the mark of a parameter at a place, mm from the top; None without value or limit."""
    rows = view.named(view.recommended, symbol) if view.recommended in view.parameters else []
    for row in rows:
        if row.value is not None:
            return Mark(place, "estimate", row.value, row.lower, row.upper)
        if row.upper:
            kind: Kind = "not identified" if row.lower else "limit"
            value = row.fitted if row.lower else row.upper
            return Mark(place, kind, value, row.lower, row.upper if row.lower else None)
    return None


@dataclass(frozen=True)
class _Block:
    """The row of one sensor: its recordings and their positions, mm from the top."""

    sensor: str
    views: Sequence[ChannelView]
    top: float
    bottom: float

    @property
    def places(self) -> list[float]:
        step = (self.bottom - self.top) / (len(self.views) + 0.5)
        return [self.top + step * (number + 0.75) for number in range(len(self.views))]


@style.set_style()
def draw_forest_figure(
    views: Sequence[ChannelView],
    sensors: Sequence[str],
    system: System = "practical",
) -> Figure:
    """Draw parameters of one channel of all sensors, with 95 % limits: a panel per parameter."""
    looks = assign_sensor_styles(list(sensors))
    # The height of the row of a sensor grows with its recordings, up to a page in all.
    by_sensor = {sensor: [view for view in views if view.sensor == sensor] for sensor in sensors}
    by_sensor = {sensor: own for sensor, own in by_sensor.items() if own}
    slot = _SLOT_HEIGHT
    while True:
        heights = [max(_MIN_ROW_HEIGHT, slot * (len(each) + 0.5)) for each in by_sensor.values()]
        if sum(heights) <= max(_MAX_HEIGHT, _MIN_ROW_HEIGHT * len(heights)):
            break
        slot *= 0.95
    rows = zip(by_sensor.items(), heights, np.cumsum(heights), strict=True)
    blocks = [
        _Block(sensor, own, float(bottom - height), float(bottom))
        for (sensor, own), height, bottom in rows
    ]
    total = blocks[-1].bottom
    name = style.name_channel(views[0].channel)
    figure = style.make_figure(
        style.DOUBLE, total + _FRAME_HEIGHT, f"{name}: {', '.join(COMPARED)} of all sensors"
    )
    panels = figure.subplots(1, len(COMPARED), sharey=True)
    kinds: set[str] = set()
    for panel, symbol in zip(panels, COMPARED, strict=True):
        kinds |= _draw_panel(panel, blocks, looks, symbol, system)
    first = panels[0]
    first.set_ylim(total, 0.0)
    first.set_yticks([(block.top + block.bottom) / 2.0 for block in blocks])
    names = []
    for block in blocks:
        count, simulated = len(block.views), sum(view.simulated for view in block.views)
        words = [f"n = {count}"] * (count > 1)
        if simulated:
            words.append("simulated" if simulated == count else f"{simulated} simulated")
        about = f" ({', '.join(words)})" if words else ""
        names.append(style.shorten_name(figure, block.sensor, 110.0) + about)
    first.set_yticklabels(names)
    for panel in panels:
        panel.tick_params(axis="y", length=0, which="both")
        panel.grid(visible=False, axis="y")
    first.set_title(name, loc="left")
    style.draw_legend_below(figure, _make_legend(kinds))
    return style.fix_layout(figure)


def _draw_panel(
    axes: Axes,
    blocks: Sequence[_Block],
    looks: dict[str, Appearance],
    symbol: str,
    system: System,
) -> set[str]:
    """Draw one parameter of all sensors; return the kinds of marks that occur."""
    unit = choose_page_unit(blocks[0].views[0].quantity, symbol, system)
    drawn: list[Mark] = []
    truths: list[tuple[float, float]] = []
    for number, block in enumerate(blocks):
        if number % 2:
            axes.axhspan(block.top, block.bottom, color="0.955", lw=0, zorder=0.0)
        step = block.places[1] - block.places[0] if len(block.views) > 1 else _SLOT_HEIGHT
        marks = (
            make_mark(view, symbol, place)
            for view, place in zip(block.views, block.places, strict=True)
        )
        of_block = [mark for mark in marks if mark is not None]
        truths += [
            (place, view.truth[symbol].value * unit.per_si)
            for view, place in zip(block.views, block.places, strict=True)
            if symbol in view.truth and view.truth[symbol].value > 0.0
        ]
        _draw_marks(axes, of_block, looks[block.sensor], unit.per_si, step)
        if not of_block:
            statuses = {
                status_text(row.status)
                for view in block.views
                if view.recommended in view.parameters
                for row in view.named(view.recommended, symbol)
            }
            axes.annotate(
                ", ".join(sorted(statuses)) or "not estimated",
                (0.0, (block.top + block.bottom) / 2.0),
                xycoords=("axes fraction", "data"),
                xytext=(3.0, 0.0),
                textcoords="offset points",
                va="center",
                color="0.4",
            )
        drawn += of_block
    places, values = zip(*truths, strict=True) if truths else ((), ())
    if truths:
        axes.plot(values, places, marker="|", ms=6.0, mew=0.8, ls="none", color="black", zorder=3.5)
    _set_limits(axes, drawn, values, unit.per_si)
    axes.set_xlabel(f"{style.SYMBOLS[symbol]} ({unit.sign})")
    return {mark.kind for mark in drawn} | ({"truth"} if truths else set())


def _set_limits(axes: Axes, drawn: Sequence[Mark], truths: Sequence[float], scale: float) -> None:
    values = [mark.value * scale for mark in drawn if mark.value] + list(truths)
    # The arrow of a limit needs room at its left.
    values += [mark.value * scale / 2.5 for mark in drawn if mark.value and mark.kind == "limit"]
    ends = [end * scale for mark in drawn for end in (mark.lower, mark.upper) if end]
    values = values or ends
    if not values:
        axes.set_xticks([])
        return
    reach = 10.0**_MAX_INTERVAL_DECADES
    near = np.clip(ends, min(values) / reach, max(values) * reach)
    style.set_log_axis(axes, "x", style.compute_limits(values, near, margin=1.6), ticks=4)


def _draw_marks(
    axes: Axes, of_block: Sequence[Mark], look: Appearance, scale: float, step: float
) -> None:
    """Draw the marks of one sensor; they are smaller where recordings are close."""
    size = float(np.clip(step * 72.0 / 25.4 * 0.8, 1.2, 4.0))
    width = min(1.0, 0.3 * size)
    dots: dict[Kind, dict[str, Any]] = {
        "estimate": style.convert_marker_style(look),
        "not identified": style.convert_marker_style(look, hollow=True),
        "limit": style.convert_marker_style(look)
        | {"marker": _ARROW_MARKER, "markerfacecolor": "none"},
    }
    for kind, dot in dots.items():
        chosen = [mark for mark in of_block if mark.kind == kind]
        if not chosen:
            continue
        if ranges := [mark for mark in chosen if mark.lower and mark.upper]:
            axes.hlines(
                [mark.place for mark in ranges],
                [mark.lower * scale for mark in ranges if mark.lower],
                [mark.upper * scale for mark in ranges if mark.upper],
                color=look.light,
                lw=width,
                ls="-" if kind == "estimate" else (0, (2, 1)),
            )
        shown = [mark for mark in chosen if mark.value]
        axes.plot(
            [mark.value * scale for mark in shown if mark.value],
            [mark.place for mark in shown],
            ls="none",
            ms=_ARROW_SIZE * size if kind == "limit" else size,
            markeredgewidth=width,
            zorder=3.0,
            **dot,
        )


def _make_legend(kinds: set[str]) -> list[Line2D]:
    """Return the legend of the marks, in black, because colour identifies the sensor."""
    dot: dict[str, Any] = {"marker": "o", "markersize": 4.0}
    open_dot = dot | {"markerfacecolor": "white", "ls": (0, (2, 1))}
    arrow = {"marker": _ARROW_MARKER, "markersize": _ARROW_SIZE * 4.0, "markerfacecolor": "none"}
    samples: dict[str, tuple[str, dict[str, Any]]] = {
        "estimate": ("estimate, 95 % limits", dot),
        "not identified": ("not determined: fitted value, 95 % limits", open_dot),
        "limit": ("upper 95 % limit", arrow | {"ls": "none"}),
        "truth": ("truth of the simulation", {"marker": "|", "ms": 6.0, "ls": "none"}),
    }
    shown = [
        Line2D([], [], color="black", label=label, **look)
        for kind, (label, look) in samples.items()
        if kind in kinds
    ]
    return shown or [Line2D([], [], ls="none", label="no recording has a value")]
