"""The figures of the report, as SVG that a page can hold."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from imubench_pipeline.noise import FLOOR
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView

# Okabe and Ito's palette, told apart by the colour-blind; black is the measurement.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B")
_METHOD_STYLE = {
    "likelihood": ("#009E73", "-"),
    "likelihood_gm": ("#E69F00", (0, (5, 1))),
    "curve": ("#D55E00", "--"),
    "paper": ("#CC79A7", "-."),
    "weighted": ("#0072B2", ":"),
}
_LINES = ("-", "--", ":", "-.")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")

mpl.rcParams.update(
    {
        "svg.fonttype": "none",
        "svg.hashsalt": "imubench",
        "font.size": 9,
        "axes.grid": True,
        "axes.grid.which": "both",
        "grid.alpha": 0.25,
        "grid.linewidth": 0.5,
        "legend.fontsize": 8,
        "lines.linewidth": 1.4,
    }
)


def _axes(quantity: str, system: System) -> tuple[Figure, Axes, float]:
    figure = Figure(figsize=(6.4, 5.0), layout="constrained")
    axes = figure.add_subplot()
    unit = page_unit(quantity, "adev", system)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation ({unit.sign})")
    return figure, axes, unit.per_si


def _legend(figure: Figure, axes: Axes) -> None:
    """Name the lines below the axes, where they hide nothing."""
    lines, names = axes.get_legend_handles_labels()
    figure.legend(lines, names, loc="outside lower center", ncols=2, frameon=False)


def _svg(figure: Figure) -> str:
    """Return a figure as a data URI."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()


def channel_figure(view: ChannelView, system: System) -> str:
    """Draw the measured curve with limits, and each method's model and reconstruction."""
    figure, axes, scale = _axes(view.quantity, system)
    what = "simulated log" if view.simulated else "measured"
    axes.fill_between(
        view.tau, view.lower * scale, view.upper * scale, color="0.75", lw=0, label="95 % limits"
    )
    axes.plot(view.tau, view.adev * scale, color="black", marker="o", ms=2.5, label=what)
    for method, curve in view.reconstruction.items():
        colour, style = _METHOD_STYLE[method]
        best = method == view.recommended
        if best:
            axes.fill_between(
                curve["tau"],
                curve["lower"] * scale,
                curve["upper"] * scale,
                color=colour,
                alpha=0.15,
                lw=0,
                label="95 % band of reconstructions",
            )
        model = np.sqrt(view.model(method).allan_variance(curve["tau"]))
        label = METHOD_NAMES[method]
        axes.plot(
            curve["tau"], model * scale, color=colour, ls=style, lw=1.6 if best else 1, label=label
        )
        if best:
            axes.plot(
                curve["tau"],
                curve["reconstructed"] * scale,
                color=colour,
                ls="none",
                marker=".",
                ms=3,
                label="a log simulated from it",
            )
    _legend(figure, axes)
    return _svg(figure)


def spectrum_figure(view: ChannelView, system: System) -> str | None:
    """Draw the root of the two-sided spectrum with the chosen model and the lines, if known."""
    if not view.spectrum:
        return None
    figure = Figure(figsize=(6.4, 5.0), layout="constrained")
    axes = figure.add_subplot()
    unit = page_unit(view.quantity, "psd", system)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("frequency f (Hz)")
    axes.set_ylabel(f"root of the two-sided density ({unit.sign})")
    spectrum = view.spectrum
    used = spectrum["used"] > 0
    for chosen, colour, label in (
        (used, "black", "bins used"),
        (~used, "0.6", "bins left out: lines, or beyond the band"),
    ):
        if chosen.any():
            axes.plot(
                spectrum["frequency"][chosen],
                np.sqrt(spectrum["density"][chosen]) * unit.per_si,
                color=colour,
                ls="none",
                marker=".",
                ms=3,
                label=label,
            )
    colour, style = _METHOD_STYLE["likelihood"]
    axes.plot(
        spectrum["frequency"],
        np.sqrt(spectrum["fitted"]) * unit.per_si,
        color=colour,
        ls=style,
        label=f"likelihood: {next(row['model'] for row in view.models if row['chosen'])}",
    )
    for number, line in enumerate(view.lines):
        axes.axvline(
            line["frequency"],
            color="#D55E00",
            lw=0.6,
            ls=":",
            label="lines" if number == 0 else None,
        )
    _legend(figure, axes)
    return _svg(figure)


def comparison_figure(views: Sequence[ChannelView], sensors: Sequence[str], system: System) -> str:
    """Draw the curves of the same axis of several sensors (000, Figures 6 and 7).

    A sensor has the same colour and mark in every figure: its place among ``sensors``. Its
    recordings differ in their lines.
    """
    figure, axes, scale = _axes(views[0].quantity, system)
    recordings: dict[str, list[str]] = {}
    for view in views:
        place = sensors.index(view.sensor)
        of_sensor = recordings.setdefault(view.sensor, [])
        of_sensor.append(view.recording)
        axes.plot(
            view.tau,
            view.adev * scale,
            color=_COLOURS[place % len(_COLOURS)],
            ls=_LINES[(len(of_sensor) - 1) % len(_LINES)],
            marker=_MARKERS[place % len(_MARKERS)],
            ms=3,
            markevery=8,
            label=view.label,
        )
    _legend(figure, axes)
    return _svg(figure)


def datasheet_figure(view: ChannelView, system: System) -> str | None:
    """Draw the curve with the lines of the datasheet (000, Figures 8 and 9), if it has any."""
    rows = [
        row
        for row in view.datasheet
        if row["method"] == view.recommended
        and row["comparable"] is not None
        and row["statistic"] in ("N", "adev_minimum")
    ]
    if not rows:
        return None
    figure, axes, scale = _axes(view.quantity, system)
    what = "simulated log" if view.simulated else "measured"
    axes.plot(view.tau, view.adev * scale, color="black", marker="o", ms=2.5, label=what)
    for method, curve in view.reconstruction.items():
        if method == view.recommended:
            colour, style = _METHOD_STYLE[method]
            model = np.sqrt(view.model(method).allan_variance(curve["tau"]))
            axes.plot(
                curve["tau"], model * scale, color=colour, ls=style, label=METHOD_NAMES[method]
            )
    lines = {"one-sided": ":", "two-sided": "-.", None: "--"}
    for row in rows:
        level = row["comparable"] * scale
        if row["quantity"] == "N":
            reading = f", read as {row['sidedness']}" if row["sidedness"] else ""
            axes.plot(
                view.tau,
                level / np.sqrt(view.tau),
                color="#009E73",
                ls=lines[row["sidedness"]],
                label=f"datasheet N = {row['printed']:g} {row['unit']}{reading}",
            )
        else:
            axes.axhline(
                level,
                color="#E69F00",
                ls="--",
                label=f"datasheet bias instability {row['printed']:g} {row['unit']} "
                f"({FLOOR:.3f} B)",
            )
    _legend(figure, axes)
    return _svg(figure)
