"""The terms of a noise model and their sum, with the points where they are read."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from imubench_pipeline.noise import NoiseModel, Term
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.static_figures.curves import channel_axes, draw_measured, finish
from imubench_pipeline.report.static_figures.names import SYMBOLS, TERM_NAMES
from imubench_pipeline.report.static_figures.style import style
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.words.estimates import status_text

TERM_LOOKS: dict[str, dict[str, Any]] = {
    "Q": {"color": "#9A6B00", "linestyle": (0, (1, 1.4))},
    "N": {"color": "#0072B2", "linestyle": (0, (4, 2))},
    "F": {"color": "#D55E00", "linestyle": (0, (5, 1.5, 1, 1.5))},
    "GM": {"color": "#D55E00", "linestyle": (0, (5, 1.5))},
    "K": {"color": "#B3508C", "linestyle": (0, (8, 2))},
    "R": {"color": "#7A4B3A", "linestyle": (0, (8, 2, 1, 2))},
    "S": {"color": "#5B5FC7", "linestyle": (0, (2, 1))},
}
"""Colour and dash of each term, the same in every figure."""

_WRITTEN_BELOW = frozenset({"F", "K"})
"""Terms whose parameter is written below its point: the curve of the sum is above."""

SUM_LOOK: dict[str, Any] = {"color": "#008F6B", "linestyle": "-", "linewidth": 1.2}

_REPEATED_LOOKS: list[dict[str, Any]] = [
    {"linestyle": (0, (3, 1, 1, 1, 1, 1))},
    {"linestyle": (0, (1, 1))},
]

_MAX_POINT_RATIO = 300.0
"""Maximum ratio of the curve to a point below it; more would compress the curve."""

_END_SHARE = 0.15
"""Share of the axis of tau at its end, in which a text is written to the left of its point."""


@style()
def terms_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw every term of the recommended model, their sum, and where N, B and K are read.

    N is the white noise at tau = 1 s, 0.664 B the plateau of flicker noise or the peak of a
    Gauss-Markov process, K the random walk at tau = 3 s (Maia et al., Figure 1; Silva et al.,
    Figure 3). None if there is no model.
    """
    if view.recommended not in view.parameters:
        return None
    model = view.model(view.recommended)
    if not model.terms:
        return None
    figure, axes, scale = channel_axes(view, system, "terms of the noise model")
    draw_measured(axes, view, scale, limits=False)
    # Lines fold at the averaging times of the curve; between them they would be a smear.
    tau = view.tau if model.sinusoids else np.geomspace(view.tau[0], view.tau[-1], 200)
    smooth = [term for term in model.terms if term not in model.sinusoids]
    for term, look in _list_looks(smooth):
        deviation = np.sqrt(term.allan_variance(tau)) * scale
        axes.plot(tau, deviation, label=term_label(view, term, system), **look)
    name = "+".join(term.symbol for term in smooth)
    if model.sinusoids:
        lines = np.sqrt(NoiseModel(sinusoids=model.sinusoids).allan_variance(tau)) * scale
        label = f"{TERM_NAMES[view.quantity]['S']} ({len(model.sinusoids)})"
        axes.plot(tau, lines, label=label, **TERM_LOOKS["S"])
        name += " and lines"
    total = np.sqrt(model.allan_variance(tau)) * scale
    axes.plot(tau, total, label=f"sum: {name}", zorder=2.8, **SUM_LOOK)
    levels = _mark_readings(axes, smooth, scale, tau, floor_tau=float(tau[np.argmin(total)]))
    lowest = float(total.min()) / _MAX_POINT_RATIO
    return finish(figure, axes, view, scale, *(level for level in levels if level > lowest))


def _list_looks(terms: Sequence[Term]) -> Iterator[tuple[Term, dict[str, Any]]]:
    """Yield the terms with their looks; a repeated term has another dash."""
    drawn: Counter[str] = Counter()
    for term in terms:
        dash = (
            _REPEATED_LOOKS[min(drawn[term.symbol], len(_REPEATED_LOOKS)) - 1]
            if drawn[term.symbol]
            else {}
        )
        drawn[term.symbol] += 1
        yield term, TERM_LOOKS[term.symbol] | dash


def mark_point(axes: Axes, symbol: str, tau: float, level: float) -> None:
    """Draw the point of a curve at which the parameter of a term is read."""
    axes.plot(
        tau,
        level,
        ls="none",
        marker="o",
        markersize=4.0,
        markerfacecolor="white",
        markeredgecolor=TERM_LOOKS[symbol]["color"],
        markeredgewidth=0.9,
        zorder=3.2,
    )


def _mark_readings(
    axes: Axes, terms: Sequence[Term], scale: float, tau: NDArray[np.float64], floor_tau: float
) -> list[float]:
    """Mark the points at which the terms have the values of their parameters.

    ``scale`` is from SI to the unit of the axes, which show ``tau``; the curve is lowest at
    ``floor_tau``. Returned are the levels that the axes must hold: of points and of texts.
    """
    levels = []
    for term in terms:
        reading = term.reading(floor_tau)
        if reading is None:
            continue
        where, level = reading.tau, reading.level
        factor = "" if reading.factor == 1.0 else f"{reading.factor:.3f} "
        colour = TERM_LOOKS[term.symbol]["color"]
        at_end = where > tau[-1] * (tau[0] / tau[-1]) ** _END_SHARE
        below = term.symbol in _WRITTEN_BELOW
        levels.append(level * scale * (0.6 if below else 1.6))
        if reading.peak:
            axes.axhline(level * scale, color=colour, lw=0.5, ls=(0, (1, 2)))
        mark_point(axes, term.symbol, where, level * scale)
        axes.annotate(
            f"{factor}{SYMBOLS[reading.symbol]}",
            (where, level * scale),
            xytext=(-5.0 if at_end else 5.0, -8.0 if below else 4.0),
            ha="right" if at_end else "left",
            textcoords="offset points",
            color=colour,
            zorder=3.3,
            annotation_clip=True,
        )
    return levels


def term_label(view: ChannelView, term: Term, system: System) -> str:
    """Return the name of a term with its parameters, and their status if not estimated."""
    values = ", ".join(
        f"{SYMBOLS[symbol]} = {unit.text(abs(value), 3)} {unit.sign}"
        for symbol, value in term.values.items()
        for unit in [page_unit(view.quantity, symbol, system)]
    )
    doubts = {
        status_text(row.status)
        for symbol, value in term.values.items()
        for row in view.named(view.recommended, symbol)
        if row.value is None and row.fitted is not None
        if math.isclose(row.fitted, value)
    }
    return f"{TERM_NAMES[view.quantity][term.symbol]}, {values}" + "".join(
        f" ({doubt})" for doubt in sorted(doubts)
    )
