"""The Allan deviation of one channel: alone, and with the models of the methods."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.report.palette import method_appearance
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.static_figures.names import entitled, log_name
from imubench_pipeline.report.static_figures.style import (
    MEASURED,
    SINGLE,
    entitle,
    extent,
    legend_below,
    line_look,
    log_x,
    log_y,
    new_figure,
    settled,
    style,
)
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView

_MAX_RATIO = 4.0
"""Largest ratio of model and measurement in the lower panel."""


def channel_axes(view: ChannelView, system: System, what: str) -> tuple[Figure, Axes, float]:
    """Return a figure of a channel, its axes, and the factor from SI to their unit."""
    unit = page_unit(view.quantity, "adev", system)
    name, rest = entitled(view)
    figure = new_figure(SINGLE, 68.0, f"{name}{rest}: {what}")
    axes = figure.add_subplot()
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation ({unit.sign})")
    entitle(figure, name, rest)
    return figure, axes, unit.per_si


def draw_measured(axes: Axes, view: ChannelView, scale: float, *, limits: bool = True) -> None:
    """Draw the curve of the log, with its 95 % limits."""
    if limits:
        axes.fill_between(
            view.tau, view.lower * scale, view.upper * scale, color="0.8", lw=0, label="95 % limits"
        )
    axes.plot(
        view.tau,
        view.adev * scale,
        color=MEASURED,
        marker="o",
        markersize=2.2,
        linewidth=0.6,
        label=log_name(view),
        zorder=2.5,
    )


def finish(figure: Figure, axes: Axes, view: ChannelView, scale: float, *more: float) -> Figure:
    """Set axis limits for the curve, further levels and, within bounds, the 95 % limits."""
    near = [
        np.clip(limit, view.adev / 2.0, view.adev * 2.0) * scale
        for limit in (view.lower, view.upper)
    ]
    log_x(axes, extent(view.tau))
    log_y(axes, extent(view.adev * scale, *near, list(more), margin=1.4))
    legend_below(figure, axes.get_legend_handles_labels()[0])
    return settled(figure)


@style()
def allan_figure(view: ChannelView, system: System = "practical") -> Figure:
    """Draw the Allan deviation with its 95 % limits alone (Silva et al., Figure 2)."""
    figure, axes, scale = channel_axes(view, system, "Allan deviation")
    draw_measured(axes, view, scale)
    return finish(figure, axes, view, scale)


@style()
def methods_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the model of each method, and the reconstruction from the recommended one.

    The lower panel has the ratio of models and measured curve (Maia et al., Figures 2 to 5). None
    if no method gave a model.
    """
    models = {method: view.model(method) for method in view.parameters}
    models = {method: model for method, model in models.items() if model.terms}
    if not models:
        return None
    figure, axes, scale = channel_axes(view, system, "models of the methods")
    axes.remove()
    figure.set_figheight(92.0 / 25.4)
    axes, ratio = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2.6, 1.0]})
    axes.set_ylabel(f"Allan deviation ({page_unit(view.quantity, 'adev', system).sign})")
    ratio.set_xlabel("averaging time τ (s)")
    ratio.set_ylabel("ratio to log")
    draw_measured(axes, view, scale)
    ratio.fill_between(view.tau, view.lower / view.adev, view.upper / view.adev, color="0.8", lw=0)
    ratio.axhline(1.0, color=MEASURED, lw=0.6)
    _draw_reconstruction(axes, ratio, view, scale)
    deviations = [
        _draw_model(axes, ratio, view, method, model, scale) for method, model in models.items()
    ]
    relative = np.clip([each / view.adev for each in deviations], 1 / _MAX_RATIO, _MAX_RATIO)
    log_y(ratio, extent(relative, view.lower / view.adev, margin=1.1), ticks=5)
    figure.align_ylabels()
    return finish(figure, axes, view, scale)


def _draw_model(
    axes: Axes, ratio: Axes, view: ChannelView, method: str, model: NoiseModel, scale: float
) -> NDArray[np.float64]:
    deviation = np.sqrt(model.allan_variance(view.tau))
    best = method == view.recommended
    look = line_look(method_appearance(method)) | {
        "linewidth": 1.3 if best else 0.9,
        "zorder": 3.0 if best else 2.8,
    }
    label = METHOD_NAMES[method] + " (recommended)" * best
    axes.plot(view.tau, deviation * scale, label=label, **look)
    ratio.plot(view.tau, deviation / view.adev, **look)
    return deviation


def _draw_reconstruction(axes: Axes, ratio: Axes, view: ChannelView, scale: float) -> None:
    """Draw the band of logs simulated from the recommended model, if there is one."""
    curve = view.reconstruction.get(view.recommended)
    if curve is None:
        return
    colour = method_appearance(view.recommended).light
    for panel, unit, name in (
        (axes, np.full_like(curve["tau"], scale), "95 % of reconstructions"),
        (ratio, 1.0 / np.interp(curve["tau"], view.tau, view.adev), None),
    ):
        panel.fill_between(
            curve["tau"],
            curve["lower"] * unit,
            curve["upper"] * unit,
            color=colour,
            alpha=0.2,
            lw=0,
            label=name,
        )
        panel.plot(
            curve["tau"],
            curve["reconstructed"] * unit,
            color=colour,
            ls="none",
            marker="D",
            markersize=2.0,
            markerfacecolor="white",
            markeredgewidth=0.5,
            label="reconstruction" if name else None,
        )
