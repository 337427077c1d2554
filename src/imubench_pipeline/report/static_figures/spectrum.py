"""The spectrum of a channel with the chosen model, its terms and its lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.static_figures.curves import make_channel_axes
from imubench_pipeline.report.static_figures.style import (
    MEASURED,
    SUM_LOOK,
    TERM_LOOKS,
    TERM_NAMES,
    compute_limits,
    draw_legend_below,
    fix_layout,
    name_log,
    set_log_axis,
    set_style,
)
from imubench_pipeline.report.view import ChannelView

_SPECTRUM_METHOD = "likelihood"  # the method whose model the table ``spectrum`` has

_MOST_NAMED = 3
_LABEL_OFFSET = 0.05  # of the frequency axis: the height of a letter, and more
_TERM_POINTS = 200  # points of a term: it is smooth


@set_style()
def draw_spectrum_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the root of the two-sided spectrum with the model of the likelihood.

    None where there is no spectrum.
    """
    if not view.spectrum:
        return None
    unit = choose_page_unit(view.quantity, "psd", system)
    figure, axes, _ = make_channel_axes(view, system, "spectrum")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"root of the two-sided density ({unit.sign})")
    spectrum = view.spectrum
    frequency = spectrum["frequency"]
    level, fitted, lower, upper = (
        np.sqrt(density) * unit.per_si
        for density in (spectrum["density"], spectrum["fitted"], *view.bin_limits())
    )
    is_fitted = bool(np.isfinite(fitted).any())
    if is_fitted:
        band = "95 % of bins by the fit"
        axes.fill_between(frequency, lower, upper, color="0.87", lw=0, label=band)
    used = spectrum["used"] > 0
    dot = {"ls": "none", "marker": "o", "markersize": 1.8, "markeredgewidth": 0.4, "zorder": 2.4}
    for chosen, face, edge, label in (
        (used, MEASURED, MEASURED, f"{name_log(view)}, bins used"),
        (~used, "white", "0.6", "bins left out"),
    ):
        if chosen.any():
            look: dict[str, Any] = dot | {"markerfacecolor": face, "markeredgecolor": edge}
            axes.plot(frequency[chosen], level[chosen], label=label, **look)
    if _SPECTRUM_METHOD in view.parameters:
        grid = np.geomspace(frequency[0], frequency[-1], _TERM_POINTS)
        interval = view.tau[0]  # the first cluster is one sample
        for term in view.model(_SPECTRUM_METHOD).terms:
            # As sampled, so that the terms add up to the fit.
            density = term.sampled_spectrum(2.0 * np.pi * grid * interval, interval) * interval
            if density.any():
                label, look = TERM_NAMES[view.quantity][term.symbol], TERM_LOOKS[term.symbol]
                root = np.sqrt(density) * unit.per_si
                axes.plot(grid, root, lw=0.8, label=label, zorder=2.8, **look)
    if is_fitted:
        name = next((f": {row.model}" for row in view.models if row.chosen), "")
        axes.plot(frequency, fitted, label=f"fit by likelihood{name}", zorder=3.0, **SUM_LOOK)
    _draw_lines(axes, view)
    set_log_axis(axes, "x", compute_limits(frequency))
    # Single ordinates scatter to almost 0; limits for them would hide the rest.
    low, high = np.nanquantile(level, [0.01, 1.0])
    set_log_axis(axes, "y", compute_limits([low, high], fitted, margin=1.6))
    draw_legend_below(figure, axes.get_legend_handles_labels()[0])
    return fix_layout(figure)


def _draw_lines(axes: Axes, view: ChannelView) -> None:
    """Draw the spectral lines, the largest with their frequency."""
    frequency = view.spectrum["frequency"]
    apart = (frequency[-1] / frequency[0]) ** _LABEL_OFFSET
    named: list[float] = []
    look = TERM_LOOKS["S"]
    strongest = sorted(view.lines, key=lambda row: -(row.ratio or 0.0))
    for number, row in enumerate(strongest):
        line = row.frequency
        label = f"{TERM_NAMES[view.quantity]['S']} ({len(strongest)})" if number == 0 else None
        axes.axvline(line, lw=0.5, label=label, zorder=1.5, **look)
        crowded = any(1.0 / apart < line / other < apart for other in named)
        if len(named) == _MOST_NAMED or crowded:
            continue
        named.append(line)
        axes.annotate(
            f"{line:.4g} Hz",
            (line, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(-1.0, -3.0),
            textcoords="offset points",
            rotation=90,
            ha="right",
            va="top",
            color=look["color"],
        )
