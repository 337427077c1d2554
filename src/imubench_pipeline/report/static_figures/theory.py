"""The characteristic curve of the Allan deviation (Figure 1 of Maia et al. and Silva et al.)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.static_figures.curves import mark_point
from imubench_pipeline.report.static_figures.style import (
    SINGLE,
    SUM_LOOK,
    TERM_LOOKS,
    compute_limits,
    draw_legend_below,
    fix_layout,
    make_figure,
    set_log_axis,
    set_style,
)

DEGREE_PER_HOUR = math.pi / 180.0 / 3600.0

CHARACTERISTIC = NoiseModel(
    N=20.0 * DEGREE_PER_HOUR, B=10.0 * DEGREE_PER_HOUR, K=0.4 * DEGREE_PER_HOUR
)
"""A gyroscope whose three slopes are seen, each over a decade or more: rad/s and s."""

_DRAWN_TAU = np.geomspace(1e-2, 1e5, 281)


@set_style()
def draw_theory_figure(system: System = "practical") -> Figure:
    """Draw a curve with white noise, bias instability and random walk, with the reading points."""
    unit = choose_page_unit("gyro", "adev", system)
    model = CHARACTERISTIC
    figure = make_figure(SINGLE, 68.0, "Characteristic curve of the Allan deviation")
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
    set_log_axis(axes, "x", (float(_DRAWN_TAU[0]), float(_DRAWN_TAU[-1])))
    set_log_axis(axes, "y", compute_limits(total, model.K * unit.per_si, margin=2.0))
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation σ(τ) ({unit.sign})")
    # The curve is flat where N / sqrt(tau) = K sqrt(tau / 3).
    flat = math.sqrt(3.0) * model.N / model.K
    white, walk, plateau = (x * unit.per_si for x in (model.N, model.K, FLOOR * model.B))
    mark_point(axes, "N", (1.0, white), "$N$: at τ = 1 s", (6.0, 6.0), va="center")
    mark_point(axes, "K", (3.0, walk), "$K$: at τ = 3 s", (7.0, -7.0), va="center")
    # Beside the point the three lines cross; at their end there is room.
    end = (float(_DRAWN_TAU[-1]), plateau)
    text = f"{FLOOR:.3f} $B$"
    mark_point(axes, "F", (flat, plateau), text, (-4.0, -6.0), beside=end, va="center")
    draw_legend_below(figure, axes.get_legend_handles_labels()[0])
    fix_layout(figure)
    # The angle of a slope on paper is known when the layout is.
    for tau, slope, text in ((0.05, -0.5, "−1/2"), (flat, 0.0, "0"), (2e4, 0.5, "+1/2")):
        level = math.sqrt(float(model.allan_variance(tau))) * unit.per_si
        ends = axes.transData.transform([(tau, level), (tau * 10.0, level * 10.0**slope)])
        angle = math.atan2(*(ends[1] - ends[0])[::-1])
        axes.annotate(
            f"slope {text}",
            (tau, level),
            xytext=(-5.0 * math.sin(angle), 5.0 * math.cos(angle)),
            textcoords="offset points",
            rotation=math.degrees(angle),
            rotation_mode="anchor",
            ha="center",
            va="bottom",
        )
    return figure
