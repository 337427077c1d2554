"""The figures of one channel: Allan deviation with models and datasheet, spectrum, theory."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from imubench_pipeline.datasheets.class_limits import read_grade_limits
from imubench_pipeline.extensions.figures import style
from imubench_pipeline.noise import FLOOR, NoiseModel, Term
from imubench_pipeline.report.palette import METHOD_STYLES, SUM_LOOK, TERM_LOOKS, TERM_NAMES
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView
from imubench_pipeline.words.estimates import status_text
from imubench_pipeline.words.numbers import NO_VALUE

_MAX_RATIO = 4.0  # largest ratio of model and measurement in the lower panel

_WRITTEN_BELOW = frozenset({"F", "K"})
"""Terms whose parameter is written below its point: the curve of the sum is above."""

_REPEATED_DASHES = ((0, (3, 1, 1, 1, 1, 1)), (0, (1, 1)))
_MAX_POINT_RATIO = 300.0
"""Maximum ratio of the curve to a point below it; more would compress the curve."""

_END_SHARE = 0.15
"""Share of the axis of tau at its end, in which a text is written to the left of its point."""

_FIGURE_NAMES = {"N": "$N$", "adev_minimum": "bias instability", "K": "$K$"}
_KIND_TEXTS: Mapping[str | None, str | None] = {"typ": None, "1sigma": "1σ"}
_LINE_DASHES = ((0, (4, 2)), (0, (1, 1.4)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)))
_UNIT_SIGNS = {"deg": "°", "sqrt(Hz)": "√Hz", "sqrt(h)": "√h", "sqrt(s)": "√s", "ug": "µg"}


def make_channel_axes(view: ChannelView, system: System, what: str) -> tuple[Figure, Axes, float]:
    """Return a figure of a channel, its axes, and the factor from SI to their unit."""
    unit = choose_page_unit(view.quantity, "adev", system)
    name, of = f"{view.sensor} / {view.recording}", style.name_channel(view.channel)
    rest = " (simulated)" * view.simulated + f": {of[0].lower()}{of[1:]}"
    figure = style.make_figure(style.SINGLE, 68.0, f"{name}{rest}: {what}")
    axes = figure.add_subplot()
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation ({unit.sign})")
    style.write_title(figure, name, rest)
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
        color=style.MEASURED,
        marker="o",
        markersize=2.2,
        linewidth=0.6,
        label=style.name_log(view),
        zorder=2.5,
    )


def draw_grade_bands(axes: Axes, quantity: str, scale: float) -> None:
    """Draw the bands of the grades behind the curves, named beside the axes where they fit."""
    low, high = axes.get_ylim()
    tau = np.geomspace(*axes.get_xlim(), 60)
    limits = read_grade_limits(quantity)
    edges = [np.hypot(one["N"] / np.sqrt(tau), FLOOR * one["B"]) * scale for one in limits.values()]
    edges = [np.full_like(tau, high), *edges, np.full_like(tau, low)]
    for place, name in enumerate(("consumer", *limits)):
        upper, lower = (np.clip(edge, low, high) for edge in edges[place : place + 2])
        axes.fill_between(tau, lower, upper, color=style.GRADE_SHADES[place], lw=0, zorder=0.0)
        ends = [float(axes.transData.transform((tau[-1], y))[1]) for y in (lower[-1], upper[-1])]
        figure = axes.figure.get_figure(root=True)
        if (ends[1] - ends[0]) * 72.0 / figure.dpi > style.measure_text(figure, name):
            axes.annotate(
                name,
                (1.0, float(np.sqrt(lower[-1] * upper[-1]))),
                xycoords=("axes fraction", "data"),
                xytext=(3.0, 0.0),
                textcoords="offset points",
                rotation=-90,
                va="center",
                color="0.35",
            )


def finish(figure: Figure, axes: Axes, view: ChannelView, scale: float, *more: float) -> Figure:
    """Finish a figure: axis limits for the curve and the levels ``more``, grades, legend."""
    limits = (view.lower, view.upper)
    near = [np.clip(limit, view.adev / 2.0, view.adev * 2.0) * scale for limit in limits]
    style.set_log_axis(axes, "x", style.compute_limits(view.tau))
    style.set_log_axis(
        axes, "y", style.compute_limits(view.adev * scale, *near, list(more), margin=1.4)
    )
    draw_grade_bands(axes, view.quantity, scale)
    style.draw_legend_below(figure, axes.get_legend_handles_labels()[0])
    return style.fix_layout(figure)


@style.set_style()
def draw_allan_figure(view: ChannelView, system: System = "practical") -> Figure:
    """Draw only the Allan deviation, with its 95 % limits (Silva et al., Figure 2)."""
    figure, axes, scale = make_channel_axes(view, system, "Allan deviation")
    draw_measured(axes, view, scale)
    return finish(figure, axes, view, scale)


@style.set_style()
def draw_methods_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the model of each method, and the reconstruction from the recommended one.

    The lower panel has the ratio of models and measured curve (Maia et al., Figures 2 to 5). None
    if no method gave a model.
    """
    models = {method: view.model(method) for method in view.parameters}
    models = {method: model for method, model in models.items() if model.terms}
    if not models:
        return None
    figure, axes, scale = make_channel_axes(view, system, "models of the methods")
    label = axes.get_ylabel()
    axes.remove()
    figure.set_figheight(92.0 / 25.4)
    axes, ratio = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2.6, 1.0]})
    axes.set_ylabel(label)
    ratio.set_xlabel("averaging time τ (s)")
    ratio.set_ylabel("ratio to log")
    draw_measured(axes, view, scale)
    ratio.fill_between(view.tau, view.lower / view.adev, view.upper / view.adev, color="0.8", lw=0)
    ratio.axhline(1.0, color=style.MEASURED, lw=0.6)
    _draw_reconstruction(axes, ratio, view, scale)
    relative = []
    for method, model in models.items():
        deviation = np.sqrt(model.allan_variance(view.tau))
        best = method == view.recommended
        width, order = (1.3, 3.0) if best else (0.9, 2.8)
        look = style.convert_line_style(METHOD_STYLES[method]) | {
            "linewidth": width,
            "zorder": order,
        }
        label = METHOD_NAMES[method] + " (recommended)" * best
        axes.plot(view.tau, deviation * scale, label=label, **look)
        ratio.plot(view.tau, deviation / view.adev, **look)
        relative.append(deviation / view.adev)
    near = np.clip(relative, 1 / _MAX_RATIO, _MAX_RATIO)
    style.set_log_axis(
        ratio, "y", style.compute_limits(near, view.lower / view.adev, margin=1.1), ticks=5
    )
    figure.align_ylabels()
    return finish(figure, axes, view, scale)


def _draw_reconstruction(axes: Axes, ratio: Axes, view: ChannelView, scale: float) -> None:
    """Draw the band of logs simulated from the recommended model, if there is one."""
    curve = view.reconstruction.get(view.recommended)
    if curve is None:
        return
    colour = METHOD_STYLES[view.recommended].light
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


@style.set_style()
def draw_terms_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw every term of the recommended model, their sum, and the points that show N, B and K.

    N is the white noise at tau = 1 s, 0.664 B the plateau of flicker noise or the peak of a
    Gauss-Markov process, K the random walk at tau = 3 s (Maia et al., Figure 1; Silva et al.,
    Figure 3). None if there is no model.
    """
    if view.recommended not in view.parameters:
        return None
    model = view.model(view.recommended)
    if not model.terms:
        return None
    figure, axes, scale = make_channel_axes(view, system, "terms of the noise model")
    draw_measured(axes, view, scale, limits=False)
    # Lines fold at the averaging times of the curve; between them they would be a smear.
    tau = view.tau if model.sinusoids else np.geomspace(view.tau[0], view.tau[-1], 200)
    smooth = [term for term in model.terms if term not in model.sinusoids]
    drawn: Counter[str] = Counter()
    for term in smooth:
        look = TERM_LOOKS[term.symbol]
        if repeated := min(drawn[term.symbol], len(_REPEATED_DASHES)):
            look = look | {"linestyle": _REPEATED_DASHES[repeated - 1]}
        drawn[term.symbol] += 1
        deviation = np.sqrt(term.allan_variance(tau)) * scale
        axes.plot(tau, deviation, label=_label_term(view, term, system), **look)
    name = "+".join(term.symbol for term in smooth)
    if model.sinusoids:
        lines = np.sqrt(NoiseModel(sinusoids=model.sinusoids).allan_variance(tau)) * scale
        label = f"{TERM_NAMES[view.quantity]['S']} ({len(model.sinusoids)})"
        axes.plot(tau, lines, label=label, **TERM_LOOKS["S"])
        name += " and lines"
    total = np.sqrt(model.allan_variance(tau)) * scale
    axes.plot(tau, total, label=f"sum: {name}", zorder=2.8, **SUM_LOOK)
    levels = []
    end = tau[-1] * (tau[0] / tau[-1]) ** _END_SHARE
    for term in smooth:
        reading = term.reading(float(tau[np.argmin(total)]))
        if reading is None:
            continue
        level, below = reading.level * scale, term.symbol in _WRITTEN_BELOW
        levels.append(level * (0.6 if below else 1.6))
        if reading.peak:
            axes.axhline(level, color=TERM_LOOKS[term.symbol]["color"], lw=0.5, ls=(0, (1, 2)))
        factor = "" if reading.factor == 1.0 else f"{reading.factor:.3f} "
        offset = (-5.0 if reading.tau > end else 5.0, -8.0 if below else 4.0)
        text = f"{factor}{style.SYMBOLS[reading.symbol]}"
        mark_point(axes, term.symbol, (reading.tau, level), text, offset, zorder=3.3)
    lowest = float(total.min()) / _MAX_POINT_RATIO
    return finish(figure, axes, view, scale, *(level for level in levels if level > lowest))


def mark_point(
    axes: Axes,
    symbol: str,
    point: tuple[float, float],
    text: str,
    offset: tuple[float, float],
    **look: Any,
) -> None:
    """Draw the point at which the parameter of a term is read, and a text at an offset in pt."""
    colour = TERM_LOOKS[symbol]["color"]
    edge = {"markeredgecolor": colour, "markeredgewidth": 0.9, "markerfacecolor": "white"}
    axes.plot(*point, ls="none", marker="o", markersize=4.0, zorder=3.2, **edge)
    side = "right" if offset[0] < 0.0 else "left"
    look = {"xytext": offset, "textcoords": "offset points", "color": colour, "ha": side} | look
    axes.annotate(text, look.pop("beside", point), **look)


def _label_term(view: ChannelView, term: Term, system: System) -> str:
    """Return the name of a term with its parameters, and their status if not estimated."""
    values, doubts = [], set()
    for symbol, value in term.values.items():
        unit, lower, upper = choose_page_unit(view.quantity, symbol, system), None, None
        for row in view.named(view.recommended, symbol):
            if row.value is not None and math.isclose(row.value, value):
                lower, upper = row.lower, row.upper
            elif row.value is None and row.fitted and math.isclose(row.fitted, value):
                doubts.add(f" ({status_text(row.status)})")
        size, _ = unit.estimate_texts(abs(value), lower, upper)
        values.append(f"{style.SYMBOLS[symbol]} = {size} {unit.sign}")
    name = TERM_NAMES[view.quantity][term.symbol]
    return f"{name}, {', '.join(values)}{''.join(sorted(doubts))}"


@style.set_style()
def draw_datasheet_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the curve and the recommended model with the lines that the datasheet prints.

    N is a line of slope -1/2, and K a line of slope +1/2. A bias instability is the level of the
    minimum, as vendors mean it. None if the datasheet has no such figure.
    """
    # Each reading once, with its value in SI.
    printed = {
        (row.statistic, row.comparable, row.sidedness, row.kind): row
        for row in view.datasheet
        if row.method == view.recommended and row.comparable and row.statistic in _FIGURE_NAMES
    }
    if not printed:
        return None
    figure, axes, scale = make_channel_axes(view, system, "with the datasheet")
    draw_measured(axes, view, scale)
    model = view.model(view.recommended)
    if model.terms:
        look = style.convert_line_style(METHOD_STYLES[view.recommended]) | {"zorder": 2.8}
        deviation = np.sqrt(model.allan_variance(view.tau)) * scale
        axes.plot(view.tau, deviation, label=METHOD_NAMES[view.recommended], **look)
    levels = []
    drawn: Counter[str] = Counter()
    for row in printed.values():
        dash = _LINE_DASHES[drawn[row.statistic] % len(_LINE_DASHES)]
        drawn[row.statistic] += 1
        line = np.full_like(view.tau, (row.comparable or 0.0) * scale)
        if row.statistic == "N":
            line /= np.sqrt(view.tau)
        elif row.statistic == "K":
            line *= np.sqrt(view.tau / 3.0)
        levels += [float(line.min()), float(line.max())]
        colour = TERM_LOOKS["F" if row.statistic == "adev_minimum" else row.statistic]["color"]
        unit = row.unit or ""
        for written, sign in _UNIT_SIGNS.items():
            unit = unit.replace(written, sign)
        reading = f"read as {row.sidedness}" if row.sidedness else None
        about = ", ".join(filter(None, [_KIND_TEXTS.get(row.kind, row.kind), reading]))
        number = NO_VALUE if row.printed is None else f"{row.printed:g}"
        text = f"datasheet {_FIGURE_NAMES[row.statistic]}: {number} {unit}"
        text += f" ({about})" if about else ""
        axes.plot(view.tau, line, color=colour, ls=dash, label=text)
    return finish(figure, axes, view, scale, *levels)


_SPECTRUM_METHOD = "likelihood"  # the method whose model the table ``spectrum`` has
_MOST_NAMED = 3
_LABEL_OFFSET = 0.05  # of the frequency axis: the height of a letter, and more
_TERM_POINTS = 200  # points of a term: it is smooth


@style.set_style()
def draw_spectrum_figure(view: ChannelView, system: System = "practical") -> Figure | None:
    """Draw the root of the two-sided spectrum, if any, with the model of the likelihood."""
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
        (used, style.MEASURED, style.MEASURED, f"{style.name_log(view)}, bins used"),
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
    style.set_log_axis(axes, "x", style.compute_limits(frequency))
    # Single ordinates scatter to almost 0; limits for them would hide the rest.
    low, high = np.nanquantile(level, [0.01, 1.0])
    style.set_log_axis(axes, "y", style.compute_limits([low, high], fitted, margin=1.6))
    style.draw_legend_below(figure, axes.get_legend_handles_labels()[0])
    return style.fix_layout(figure)


def _draw_lines(axes: Axes, view: ChannelView) -> None:
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


DEGREE_PER_HOUR = math.pi / 180.0 / 3600.0

CHARACTERISTIC = NoiseModel(
    N=20.0 * DEGREE_PER_HOUR, B=10.0 * DEGREE_PER_HOUR, K=0.4 * DEGREE_PER_HOUR
)
"""A gyroscope that shows each of the three slopes for a decade of tau or more: rad/s and s."""

_DRAWN_TAU = np.geomspace(1e-2, 1e5, 281)


@style.set_style()
def draw_theory_figure(system: System = "practical") -> Figure:
    """Draw the characteristic curve and its reading points (Maia et al., Silva et al., Fig. 1)."""
    unit = choose_page_unit("gyro", "adev", system)
    model = CHARACTERISTIC
    figure = style.make_figure(style.SINGLE, 68.0, "Characteristic curve of the Allan deviation")
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
    style.set_log_axis(axes, "x", (float(_DRAWN_TAU[0]), float(_DRAWN_TAU[-1])))
    style.set_log_axis(axes, "y", style.compute_limits(total, model.K * unit.per_si, margin=2.0))
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
    style.draw_legend_below(figure, axes.get_legend_handles_labels()[0])
    style.fix_layout(figure)
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
