"""Draw results on axes of the user, who can continue to use them."""

import math
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.report.palette import SUM_LOOK, TERM_LOOKS, TERM_NAMES, assign_sensor_styles
from imubench_pipeline.report.practical import choose_page_unit
from imubench_pipeline.settings.extras import require_extra
from imubench_pipeline.words.numbers import Unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from imubench_pipeline.navigation.ratios import Ratio

_SAMPLE_UNIT = Unit("unit of the samples", 1.0)


def create_panels(names: Sequence[str], ax: "Axes | Sequence[Axes] | None" = None) -> Any:
    """Return axes, one for each name, shape (n,): the given ones, or new ones, three in a row.

    Raises ExtraError if matplotlib is not installed, and ValueError for another number of axes.
    """
    count = len(names)
    if ax is not None:
        given = np.atleast_1d(np.asarray(ax)).ravel()
        if len(given) != count:
            raise ValueError(f"ax= has {len(given)} axes; expected one each for {', '.join(names)}")
        return given
    with require_extra("workflow", "draw"):
        from matplotlib import pyplot as plt

    columns = min(count, 3)
    rows = math.ceil(count / columns)
    size = (5.0 * columns, 3.8 * rows)
    _, axes = plt.subplots(rows, columns, figsize=size, squeeze=False, layout="constrained")
    for unused in axes.ravel()[count:]:
        unused.set_axis_off()
    return axes.ravel()[:count]


def get_axes(ax: "Axes | None") -> Any:
    """Return the given axes, or new ones."""
    return create_panels([""])[0] if ax is None else ax


def choose_deviation_unit(quantity: str | None) -> Unit:
    """Return the unit of an Allan deviation in plots; the unit of the samples if not known."""
    return _SAMPLE_UNIT if quantity is None else choose_page_unit(quantity, "adev", "practical")


def draw_curves(axes: "Axes", curves: Mapping[str, AllanCurve], quantity: str | None) -> None:
    """Draw Allan deviations with 95 % limits, and the slopes of white noise and random walk."""
    unit = choose_deviation_unit(quantity)
    looks = cycle(assign_sensor_styles([*curves]).values())
    for (name, curve), look in zip(curves.items(), looks, strict=False):
        draw_measured(axes, curve, unit, name, look.light)
    _format_axes(axes, unit)
    # The slopes -1/2 of white noise and +1/2 of a random walk, through the ends of the first curve.
    curve = next(iter(curves.values()))
    limits = axes.get_xlim(), axes.get_ylim()
    last = max(int(np.searchsorted(curve.cluster_size, curve.samples / 9.0)) - 1, 0)
    for place, factor in ((0, 0.1**0.5), (last, 10.0**0.5)):
        tau, level = curve.tau[place], curve.deviation[place] * unit.per_si
        line = (tau, level), (10.0 * tau, factor * level)
        axes.axline(*line, color="0.6", linewidth=0.8, linestyle=":", zorder=1.0)
    axes.set(xlim=limits[0], ylim=limits[1])


def draw_measured(axes: "Axes", curve: AllanCurve, unit: Unit, name: str, colour: str) -> None:
    """Draw an Allan deviation with its 95 % limits."""
    lower, upper = (limit * unit.per_si for limit in curve.limits())
    axes.fill_between(curve.tau, lower, upper, color=colour, alpha=0.2, linewidth=0)
    axes.plot(curve.tau, curve.deviation * unit.per_si, color=colour, label=name, linewidth=1.2)


def draw_model(axes: "Axes", curve: AllanCurve, model: NoiseModel, quantity: str) -> None:
    """Draw a measured curve, the terms of a model, and their sum."""
    unit = choose_deviation_unit(quantity)
    draw_measured(axes, curve, unit, "log, 95 % limits", "black")
    for term in model.terms:
        values = ", ".join(
            f"{symbol} = {each.text(abs(value), 3)} {each.sign}"
            for symbol, value in term.values.items()
            for each in [choose_page_unit(quantity, symbol, "practical")]
        )
        deviation = np.sqrt(term.allan_variance(curve.tau)) * unit.per_si
        label = f"{TERM_NAMES[quantity][term.symbol]}, {values}"
        axes.plot(curve.tau, deviation, label=label, **TERM_LOOKS[term.symbol])
    if model.terms:
        total = np.sqrt(model.allan_variance(curve.tau, curve.rate)) * unit.per_si
        axes.plot(curve.tau, total, label=f"model: {model.name}", **SUM_LOOK)
        shown = np.concatenate([total, curve.deviation * unit.per_si])
        axes.set_ylim(float(shown.min()) / 5.0, float(shown.max()) * 2.0)
    _format_axes(axes, unit)


def draw_ratios(axes: "Axes", labels: Sequence[str], ratios: "Sequence[Ratio]") -> None:
    """Draw ratios with 95 % intervals in rows."""
    places = range(len(ratios), 0, -1)
    for place, ratio in zip(places, ratios, strict=True):
        lower, upper = ratio.lower or None, ratio.upper
        look: dict[str, Any] = {"color": "#0072B2", "linewidth": 1.5, "markersize": 5.0}
        if lower is not None and upper is not None:
            axes.plot([lower, upper], [place, place], **look)
        elif upper is not None:  # anything below
            axes.plot(upper, place, marker="<", **look)
        elif lower is not None:
            axes.plot(lower, place, marker=">", **look)
        if ratio.value is not None:
            axes.plot(ratio.value, place, marker="o", **look)
    axes.axvline(1.0, color="0.4", linewidth=0.8)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("{x:g}")
    axes.set_yticks(list(places), labels)
    axes.set_ylim(0.0, len(ratios) + 1.0)
    axes.grid(True, axis="x", color="0.9")


def _format_axes(axes: "Axes", unit: Unit) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("averaging time τ (s)")
    axes.set_ylabel(f"Allan deviation ({unit.sign})")
    axes.grid(True, which="major", color="0.9")
    axes.legend(fontsize="small", frameon=False)
