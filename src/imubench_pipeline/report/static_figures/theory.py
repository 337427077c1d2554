"""The characteristic curve of the Allan deviation (Figure 1 of Maia et al. and Silva et al.)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.static_figures.style import (
    SINGLE,
    extent,
    legend_below,
    log_x,
    log_y,
    new_figure,
    settled,
    style,
)
from imubench_pipeline.report.static_figures.terms import SUM_LOOK, TERM_LOOKS, mark_point

DEGREE_PER_HOUR = math.pi / 180.0 / 3600.0

CHARACTERISTIC = NoiseModel(
    N=20.0 * DEGREE_PER_HOUR, B=10.0 * DEGREE_PER_HOUR, K=0.4 * DEGREE_PER_HOUR
)
"""A gyroscope whose three slopes are seen, each over a decade or more: rad/s and s."""

_DRAWN_TAU = np.geomspace(1e-2, 1e5, 281)


@style()
def theory_figure(system: System = "practical") -> Figure:
    """Draw a curve with white noise, bias instability and random walk, with the reading points."""
    unit = page_unit("gyro", "adev", system)
    model = CHARACTERISTIC
    figure = new_figure(SINGLE, 68.0, "Characteristic curve of the Allan deviation")
    axes = figure.add_subplot()
    total = np.sqrt(model.allan_variance(_DRAWN_TAU)) * unit.per_si
    for symbol, label, term in (
        ("N", "white noise: $N$ / √τ", NoiseModel(N=model.N)),
        ("F", f"bias instability: {FLOOR:.3f} $B$", NoiseModel(B=model.B)),
        ("K", "random walk: $K$ √(τ / 3)", NoiseModel(K=model.K)),
    ):
        deviation = np.sqrt(term.allan_variance(_DRAWN_TAU)) * unit.per_si
        axes.plot(_DRAWN_TAU, deviation, label=label, lw=0.8, **TERM_LOOKS[symbol])
    axes.plot(_DRAWN_TAU, total, label="Allan deviation of the sum", zorder=2.8, **SUM_LOOK)
    log_x(axes, (float(_DRAWN_TAU[0]), float(_DRAWN_TAU[-1])))
    log_y(axes, extent(total, model.K * unit.per_si, margin=2.0))
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation σ(τ) ({unit.sign})")
    flat = _find_flat_tau(model)
    white, walk = model.N * unit.per_si, model.K * unit.per_si
    mark_point(axes, "N", 1.0, white)
    _write(axes, "N", 1.0, white, "$N$: at τ = 1 s", (6.0, 6.0))
    mark_point(axes, "K", 3.0, walk)
    _write(axes, "K", 3.0, walk, "$K$: at τ = 3 s", (7.0, -7.0))
    plateau = FLOOR * model.B * unit.per_si
    mark_point(axes, "F", flat, plateau)
    # Beside the point the three lines cross; at their end there is room.
    _write(axes, "F", float(_DRAWN_TAU[-1]), plateau, f"{FLOOR:.3f} $B$", (-4.0, -6.0))
    legend_below(figure, axes.get_legend_handles_labels()[0])
    settled(figure)
    # How steep a slope looks is known when the layout is.
    for tau, slope, text in ((0.05, -0.5, "−1/2"), (flat, 0.0, "0"), (2e4, 0.5, "+1/2")):
        level = math.sqrt(float(model.allan_variance(tau))) * unit.per_si
        _write_slope(axes, tau, level, slope, f"slope {text}")
    return figure


def _find_flat_tau(model: NoiseModel) -> float:
    """Return the tau of the flat part of the curve, where N / sqrt(tau) = K sqrt(tau / 3)."""
    return math.sqrt(3.0) * model.N / model.K


def _write(
    axes: Axes, symbol: str, tau: float, level: float, text: str, offset: tuple[float, float]
) -> None:
    axes.annotate(
        text,
        (tau, level),
        xytext=offset,
        textcoords="offset points",
        color=TERM_LOOKS[symbol]["color"],
        ha="right" if offset[0] < 0.0 else "left",
        va="center",
    )


def _write_slope(axes: Axes, tau: float, level: float, slope: float, text: str) -> None:
    """Write beside the curve, along it."""
    ends = axes.transData.transform([(tau, level), (tau * 10.0, level * 10.0**slope)])
    angle = math.degrees(math.atan2(*(ends[1] - ends[0])[::-1]))
    axes.annotate(
        text,
        (tau, level),
        xytext=(5.0 * math.sin(math.radians(-angle)), 5.0 * math.cos(math.radians(angle))),
        textcoords="offset points",
        rotation=angle,
        rotation_mode="anchor",
        ha="center",
        va="bottom",
    )
