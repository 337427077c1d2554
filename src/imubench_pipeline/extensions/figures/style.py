"""The look of the static figures: sizes, fonts, names, logarithmic axes and legends."""

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike

from imubench_pipeline.noise import PARAMETERS
from imubench_pipeline.report.palette import Appearance, Look
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView

SINGLE, DOUBLE = 88.0, 180.0
"""Widths of one and of two columns of a journal, mm."""

MEASURED = "black"
GRADE_SHADES = ("1.0", "0.975", "0.95", "0.925")
"""Grey of the bands of the grades, the worst grade first."""

FONT_SIZE = 7.0
"""pt; no text of a figure is smaller."""

_TITLE_SIZE = FONT_SIZE + 0.5
_EDGE_WIDTH = 4.0  # pt
_LEGEND_ROW_HEIGHT = 3.7  # mm
_HANDLE_WIDTH = 24.0  # pt: the sample of a line in a legend, and the space beside it
_COLUMN_GAP = 9.0  # pt: between columns of a legend
_MIN_SPAN = 0.7  # decades of an axis, below which its ticks would be too few
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# Newer releases of Matplotlib have a type of their own for the names of settings.
_STYLE_SETTINGS: Any = {
    "font.size": FONT_SIZE,
    "axes.labelsize": FONT_SIZE + 0.5,
    "axes.titlesize": _TITLE_SIZE,
    "axes.titlepad": 4.0,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.top": False,
    "ytick.minor.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.labelsize": FONT_SIZE,
    "ytick.labelsize": FONT_SIZE,
    "legend.fontsize": FONT_SIZE,
    "legend.frameon": False,
    "legend.borderpad": 0.2,
    "legend.labelspacing": 0.35,
    "legend.columnspacing": 1.2,
    "legend.handlelength": 2.8,
    "legend.handletextpad": 0.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.0,
    "lines.markeredgewidth": 0.6,
    # Without hinting a text has the same width in every format.
    "text.hinting": "none",
    # Text stays text: it can be searched, and edited for a journal.
    "svg.fonttype": "none",
    "svg.hashsalt": "imubench",
    "pdf.fonttype": 42,
}

_DASHES: dict[str, str | tuple[float, tuple[float, ...]]] = {
    "solid": "-",
    "dash": (0.0, (4.0, 2.0)),
    "dot": (0.0, (1.0, 1.4)),
    "dashdot": (0.0, (5.0, 1.5, 1.0, 1.5)),
    "longdash": (0.0, (8.0, 2.0)),
    "longdashdot": (0.0, (8.0, 2.0, 1.0, 2.0)),
    "11px,3px,5px,3px": (0.0, (8.0, 2.0, 4.0, 2.0)),
    "7px,3px,2px,3px,2px,3px": (0.0, (5.0, 1.5, 1.0, 1.5, 1.0, 1.5)),
}
_MARKERS = {"circle": "o", "square": "s", "diamond": "D", "triangle-up": "^", "triangle-down": "v"}
_MARKERS |= {"cross": "P", "x": "X", "star": "*"}


def _set(symbol: str) -> str:
    """Return a symbol in TeX notation."""
    letter, _, index = symbol.partition("_")
    letter = f"\\{letter}" if letter in ("beta", "omega", "sigma", "tau") else letter
    return letter + (f"_{index}" if len(index) < 2 else f"_{{{index}}}") * bool(index)


SYMBOLS = {
    symbol: f"$|{_set(symbol)}|$" if parameter.signed else f"${_set(symbol)}$"
    for symbol, parameter in PARAMETERS.items()
}
SYMBOLS |= {"B_curve": "$B$ of the curve", "sigma_min": r"$\sigma_\mathrm{min}$"}
SYMBOLS |= {"tau_min": r"$\tau_\mathrm{min}$"}
"""The parameters in TeX notation; R is a magnitude, since axes are logarithmic."""


def name_channel(channel: str) -> str:
    """Return a channel in words, such as ``Gyroscope, x axis``."""
    quantity, axis = channel.split("_", maxsplit=1)
    return f"{QUANTITY_NAMES[quantity]}, {axis} axis"


def name_log(view: ChannelView) -> str:
    """Return the name of the curve of a log: measured or simulated."""
    return "simulated log" if view.simulated else "measured"


@contextlib.contextmanager
def set_style() -> Iterator[None]:
    """Set the style of figures that are made or saved inside; user settings are ignored."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE_SETTINGS)
        yield


def convert_line_style(look: Appearance) -> Look:
    """Return colour and dash of an appearance as Matplotlib names them."""
    return {"color": look.light, "linestyle": _DASHES[look.dash]}


def convert_marker_style(look: Appearance, *, hollow: bool = False) -> Look:
    """Return the marker of an appearance as Matplotlib names it."""
    return {
        "marker": _MARKERS[look.marker],
        "markerfacecolor": "white" if hollow else look.light,
        "markeredgecolor": look.light,
    }


def make_figure(width: float, height: float, title: str) -> Figure:
    """Return an empty figure of a size in mm; the title is for the metadata of its file."""
    figure = Figure(figsize=(width / 25.4, height / 25.4))
    figure.set_label(title)
    return figure


def measure_text(figure: Figure, text: str) -> float:
    """Return the width of a text in the figure, pt."""
    drawn = figure.text(0.0, 0.0, text)
    width = drawn.get_window_extent().width * 72.0 / figure.dpi
    drawn.remove()
    return float(width)


def shorten_name(figure: Figure, name: str, width: float) -> str:
    """Return a name as plain text, shortened in the middle if it is wider than ``width`` pt."""
    text, length = name.replace("$", r"\$"), len(name)
    while length > 2 and (excess := measure_text(figure, text) / width) > 1.0:
        length = min(length - 1, int(length / excess))
        half = length // 2
        text = f"{name[: length - half]}…{name[len(name) - half :]}".replace("$", r"\$")
    return text


def write_title(figure: Figure, name: str, rest: str) -> None:
    """Write a title above all axes: a user-defined name and a text."""
    width = figure.get_figwidth() * 72.0
    enlarged = _TITLE_SIZE / FONT_SIZE
    room = (width - 2.0 * _EDGE_WIDTH) / enlarged - measure_text(figure, rest)
    figure.suptitle(
        shorten_name(figure, name, room) + rest,
        x=_EDGE_WIDTH / width,
        ha="left",
        fontsize=_TITLE_SIZE,
    )


def draw_legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Draw a legend below the axes, in as many columns as fit; the figure grows by its rows."""
    width, height = figure.get_size_inches()
    room = width * 72.0 - 2.0 * _EDGE_WIDTH
    labels = []
    for label in (str(handle.get_label()) for handle in handles):
        head, bracket, remark = label.rpartition(" (")
        fits = not bracket or measure_text(figure, label) <= room - _HANDLE_WIDTH
        labels.append(label if fits else f"{head}\n({remark}")
    widths = [measure_text(figure, label) + _HANDLE_WIDTH for label in labels]
    for columns in range(len(handles), 0, -1):
        # Matplotlib fills a legend column by column.
        parts = np.array_split(np.asarray(widths), columns)
        if sum(float(part.max()) for part in parts) + _COLUMN_GAP * (columns - 1) <= room:
            break
    rows = math.ceil(len(handles) / columns)
    # As many rows as before, but filled evenly.
    columns = math.ceil(len(handles) / rows)
    rows += sum(label.count("\n") for label in labels)
    figure.set_size_inches(width, height + rows * _LEGEND_ROW_HEIGHT / 25.4)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def fix_layout(figure: Figure) -> Figure:
    """Return a figure with a fixed layout, which is the same in every format."""
    # A figure that has an engine of its own is laid out, and drawn twice, whenever it is saved.
    ConstrainedLayoutEngine().execute(figure)
    return figure


def compute_limits(*values: ArrayLike, margin: float = 1.25) -> tuple[float, float]:
    """Return limits of a logarithmic axis for all values above 0, with some margin."""
    joined = np.concatenate([np.ravel(np.asarray(each, dtype=np.float64)) for each in values])
    positive = joined[np.isfinite(joined) & (joined > 0)]
    low, high = (positive.min(), positive.max()) if len(positive) else (1.0, 1.0)
    missing = max(0.0, _MIN_SPAN - math.log10(high / low)) / 2.0
    return float(low / margin / 10.0**missing), float(high * margin * 10.0**missing)


def set_log_axis(
    axes: Axes, name: Literal["x", "y"], limits: tuple[float, float], *, ticks: int = 8
) -> None:
    """Make an axis logarithmic, with about ``ticks`` labels at most.

    Decades are labelled, and ticks between them if there are few decades.
    """
    axes.set(**{f"{name}scale": "log", f"{name}lim": limits})
    axis = axes.xaxis if name == "x" else axes.yaxis
    low, high = limits
    span = math.log10(high / low)
    decades = math.floor(math.log10(high)) - math.ceil(math.log10(low)) + 1
    ordinary = low > 0.5e-3 and high < 2e4
    axis.set_major_locator(LogLocator(10.0, numticks=ticks))
    axis.set_major_formatter(FuncFormatter(_format_number if ordinary else _format_power))
    axis.set_minor_locator(LogLocator(10.0, subs=range(2, 10), numticks=ticks))
    # A power of ten is wide; between two of them there is no room for others.
    if (decades > 1 and span > 1.3) or (decades > 0 and not ordinary):
        axis.set_minor_formatter(NullFormatter())
        return
    labelled = (2, 3, 5) if span < 1.0 and ordinary else (2, 5)

    def format_between(value: float, _: int | None = None) -> str:
        factor = round(value / 10.0 ** _find_exponent(value))
        if factor not in labelled:
            return ""
        return _format_number(value) if ordinary else f"{factor}×{_format_power(value)}"

    axis.set_minor_formatter(FuncFormatter(format_between))


def _find_exponent(value: float) -> int:
    # The ticks are multiples of powers of ten, but for rounding.
    return math.floor(math.log10(value) + 1e-9)


def _format_number(value: float, _: int | None = None) -> str:
    return f"{value:g}"


def _format_power(value: float, _: int | None = None) -> str:
    return "10" + f"{_find_exponent(value):d}".translate(_SUPERSCRIPTS)
