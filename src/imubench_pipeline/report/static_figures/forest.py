"""The parameters of one channel of all sensors, each with its interval."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.report.palette import Appearance, sensor_appearances
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.static_figures.names import SYMBOLS, channel_name
from imubench_pipeline.report.static_figures.style import (
    DOUBLE,
    SINGLE,
    extent,
    legend_below,
    log_x,
    marker_look,
    new_figure,
    settled,
    shortened,
    style,
)
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.words.estimates import status_text

Kind = Literal["estimate", "not identified", "limit"]

_SLOT_HEIGHT = 2.6  # mm, of a recording where there is room
_MIN_ROW_HEIGHT = 4.2  # mm, of a sensor: its name must fit
_MAX_HEIGHT = 205.0  # mm, of all sensors: the figure stands on one page
_FRAME_HEIGHT = 16.0  # mm, title and axis
_MAX_INTERVAL_DECADES = 1.5
"""Maximum length of an interval beyond all values, decades."""

# A bar at the limit and an arrow to the left of it, in units of the bar.
_ARROW_MARKER = Path(
    [(0, -0.3), (0, 0.3), (0, 0), (-1, 0), (-0.75, 0.2), (-1, 0), (-0.75, -0.2)],
    [Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO, Path.LINETO],
)
_ARROW_SIZE = 4.5  # of a dot


@dataclass(frozen=True)
class Mark:
    """The mark of one estimate."""

    place: float  # distance from the top, mm
    kind: Kind
    # the estimate; of a limit the limit; of what is not identified what the model has
    value: float | None
    # lower, upper: 95 % limits
    lower: float | None = None
    upper: float | None = None


def marks(view: ChannelView, symbol: str, place: float, spread: float = 0.0) -> Iterator[Mark]:
    """Yield what is known of a parameter, one mark a component of the model.

    ``spread`` is the height for these about the place of the recording, in the same unit.
    """
    if view.recommended not in view.parameters:
        return
    rows = [row for row in view.named(view.recommended, symbol) if _is_shown(row)]
    for number, row in enumerate(rows):
        yield _make_mark(row, place + spread * ((number + 0.5) / len(rows) - 0.5))


def _is_shown(row: ParameterRow) -> bool:
    return row.value is not None or bool(row.upper)


def _make_mark(row: ParameterRow, place: float) -> Mark:
    lower, upper = row.lower, row.upper
    if lower is not None and lower < 0.0:
        # A ramp has a sign, and a logarithmic axis shows its size.
        if upper is None:
            lower = None
        else:
            lower, upper = (-upper, -lower) if upper <= 0.0 else (None, max(-lower, upper))
    if row.value is not None:
        return Mark(place, "estimate", abs(row.value), lower, upper)
    if not lower:
        return Mark(place, "limit", upper)
    fitted = None if row.fitted is None else abs(row.fitted)
    return Mark(place, "not identified", fitted, lower, upper)


@dataclass(frozen=True)
class _Block:
    """The row of one sensor: its recordings and where they stand, mm from the top."""

    sensor: str
    views: Sequence[ChannelView]
    top: float
    bottom: float

    @property
    def places(self) -> list[float]:
        step = (self.bottom - self.top) / (len(self.views) + 0.5)
        return [self.top + step * (number + 0.75) for number in range(len(self.views))]


@style()
def forest_figure(
    views: Sequence[ChannelView],
    sensors: Sequence[str],
    symbol: str | Sequence[str] = COMPARED,
    system: System = "practical",
) -> Figure:
    """Draw parameters of one channel across sensors, with their 95 % limits.

    A panel each; the look is by the place among all sensors of the run.
    """
    symbols = [symbol] if isinstance(symbol, str) else list(symbol)
    looks = sensor_appearances(list(sensors))
    blocks = _make_blocks(views, sensors)
    total = blocks[-1].bottom
    name = channel_name(views[0].channel)
    figure = new_figure(
        SINGLE if len(symbols) == 1 else DOUBLE,
        total + _FRAME_HEIGHT,
        f"{name}: {', '.join(symbols)} of all sensors",
    )
    panels = figure.subplots(1, len(symbols), sharey=True, squeeze=False)[0]
    kinds: set[str] = set()
    for panel, each in zip(panels, symbols, strict=True):
        kinds |= _draw_panel(
            panel, blocks, looks, each, system, ticks=7 if len(symbols) == 1 else 4
        )
    first = panels[0]
    first.set_ylim(total, 0.0)
    first.set_yticks([(block.top + block.bottom) / 2.0 for block in blocks])
    first.set_yticklabels([_name_block(figure, block) for block in blocks])
    for panel in panels:
        panel.tick_params(axis="y", length=0, which="both")
        panel.grid(visible=False, axis="y")
    first.set_title(name, loc="left")
    legend_below(figure, _make_legend(kinds))
    return settled(figure)


def _make_blocks(views: Sequence[ChannelView], sensors: Sequence[str]) -> list[_Block]:
    """Return the rows of the sensors; their height grows with the recordings, within a page."""
    by_sensor = {
        sensor: [view for view in views if view.sensor == sensor]
        for sensor in sensors
        if any(view.sensor == sensor for view in views)
    }
    slot = _SLOT_HEIGHT
    while True:
        heights = [max(_MIN_ROW_HEIGHT, slot * (len(each) + 0.5)) for each in by_sensor.values()]
        if sum(heights) <= max(_MAX_HEIGHT, _MIN_ROW_HEIGHT * len(heights)):
            break
        slot *= 0.95
    bottoms = np.cumsum(heights)
    return [
        _Block(sensor, of_sensor, float(bottom - height), float(bottom))
        for (sensor, of_sensor), height, bottom in zip(
            by_sensor.items(), heights, bottoms, strict=True
        )
    ]


def _name_block(figure: Figure, block: _Block) -> str:
    count = len(block.views)
    name = shortened(figure, block.sensor, 110.0)
    simulated = sum(view.simulated for view in block.views)
    if simulated not in (0, count):
        return f"{name} (n = {count}, {simulated} simulated)"
    words = [f"n = {count}"] * (count > 1) + ["simulated"] * (simulated > 0)
    return f"{name} ({', '.join(words)})" if words else name


def _draw_panel(
    axes: Axes,
    blocks: Sequence[_Block],
    looks: dict[str, Appearance],
    symbol: str,
    system: System,
    *,
    ticks: int,
) -> set[str]:
    """Draw one parameter of all sensors; return the kinds of marks there are."""
    unit = page_unit(blocks[0].views[0].quantity, symbol, system)
    drawn: list[Mark] = []
    truths: list[tuple[float, float]] = []
    for number, block in enumerate(blocks):
        if number % 2:
            axes.axhspan(block.top, block.bottom, color="0.955", lw=0, zorder=0.0)
        step = block.places[1] - block.places[0] if len(block.views) > 1 else _SLOT_HEIGHT
        of_block = [
            mark
            for view, place in zip(block.views, block.places, strict=True)
            for mark in marks(view, symbol, place, 0.8 * step)
        ]
        truths += [
            (place, view.truth[symbol].value * unit.per_si)
            for view, place in zip(block.views, block.places, strict=True)
            if symbol in view.truth and view.truth[symbol].value > 0.0
        ]
        _draw_marks(axes, of_block, looks[block.sensor], unit.per_si, step)
        if not of_block:
            _write_reason(axes, block, symbol)
        drawn += of_block
    if truths:
        axes.plot(
            [value for _, value in truths],
            [place for place, _ in truths],
            ls="none",
            color="black",
            marker="|",
            ms=6.0,
            mew=0.8,
            zorder=3.5,
        )
    _set_limits(axes, drawn, [value for _, value in truths], unit.per_si, ticks)
    axes.set_xlabel(f"{SYMBOLS[symbol]} ({unit.sign})")
    return {mark.kind for mark in drawn} | ({"truth"} if truths else set())


def _set_limits(
    axes: Axes, drawn: Sequence[Mark], truths: Sequence[float], scale: float, ticks: int
) -> None:
    """Set axis limits for all values and, within bounds, their intervals."""
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
    log_x(axes, extent(values, near, margin=1.6), ticks=ticks)


def _draw_marks(
    axes: Axes, of_block: Sequence[Mark], look: Appearance, scale: float, step: float
) -> None:
    """Draw the marks of one sensor; they are smaller where recordings stand close."""
    size = float(np.clip(step * 72.0 / 25.4 * 0.8, 1.2, 4.0))
    width = min(1.0, 0.3 * size)
    dots: dict[Kind, dict[str, Any]] = {
        "estimate": marker_look(look),
        "not identified": marker_look(look, hollow=True),
        "limit": {
            "marker": _ARROW_MARKER,
            "markerfacecolor": "none",
            "markeredgecolor": look.light,
        },
    }
    for kind, dot in dots.items():
        chosen = [mark for mark in of_block if mark.kind == kind]
        if not chosen:
            continue
        ranges = [mark for mark in chosen if mark.lower and mark.upper]
        if ranges:
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


def _write_reason(axes: Axes, block: _Block, symbol: str) -> None:
    """Write why a row of a panel is empty."""
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


def _make_legend(kinds: set[str]) -> list[Line2D]:
    """Return the legend of the marks, in black, because colour identifies the sensor."""
    black: dict[str, Any] = {"color": "black", "markersize": 4.0}
    samples = {
        "estimate": Line2D([], [], marker="o", label="estimate, 95 % limits", **black),
        "not identified": Line2D(
            [],
            [],
            marker="o",
            markerfacecolor="white",
            ls=(0, (2, 1)),
            label="not determined: fitted value, 95 % limits",
            **black,
        ),
        "limit": Line2D(
            [],
            [],
            ls="none",
            marker=_ARROW_MARKER,
            markerfacecolor="none",
            label="upper 95 % limit",
            color="black",
            markersize=_ARROW_SIZE * 4.0,
        ),
        "truth": Line2D(
            [], [], ls="none", marker="|", ms=6.0, color="black", label="truth of the simulation"
        ),
    }
    return [sample for kind, sample in samples.items() if kind in kinds] or [
        Line2D([], [], ls="none", label="no recording has a value")
    ]
