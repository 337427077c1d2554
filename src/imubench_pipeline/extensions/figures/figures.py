"""The figures of channels and of all sensors, their names, and their files."""

import base64
import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import pyarrow as pa
from matplotlib.figure import Figure

from imubench_pipeline.extensions.figures import comparison, curves
from imubench_pipeline.extensions.figures.style import set_style
from imubench_pipeline.report.practical import System
from imubench_pipeline.report.view import ChannelView, gather_recordings
from imubench_pipeline.tables.files import make_folder, make_schema, read, replace_file
from imubench_pipeline.tables.schemas import BY_RECORDING

Make = Callable[[], Figure | None]

CROSS_KINDS: dict[str, Callable[[Sequence[ChannelView], Sequence[str], System], Figure]] = {
    "comparison": comparison.draw_comparison_figure,
    "forest": comparison.draw_forest_figure,
}
"""Figures of one channel of all sensors."""

CHANNEL_KINDS: dict[str, Callable[[ChannelView, System], Figure | None]] = {
    "allan": curves.draw_allan_figure,
    "methods": curves.draw_methods_figure,
    "terms": curves.draw_terms_figure,
    "datasheet": curves.draw_datasheet_figure,
    "spectrum": curves.draw_spectrum_figure,
}
"""Figures of one channel of one recording; None where there is nothing to show."""

_COORDINATE_PATTERN = re.compile(rb' (?:d|x|y|points|transform)="[^"]*"')
_DECIMALS_PATTERN = re.compile(rb"(\.\d\d)\d+")


def list_cross_figures(
    views: Sequence[ChannelView],
    system: System = "practical",
    *,
    sensors: Sequence[str] | None = None,
    kinds: Sequence[str] = tuple(CROSS_KINDS),
) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Yield name and maker of each figure that compares sensors; ``sensors`` give the colours."""
    every = sorted({view.sensor for view in views}) if sensors is None else list(sensors)
    for channel in dict.fromkeys(view.channel for view in views):
        chosen = [view for view in views if view.channel == channel]
        for kind in kinds:
            name = "allan" if kind == "comparison" else kind
            yield f"{name}_{channel}", partial(CROSS_KINDS[kind], chosen, every, system)


def list_channel_figures(
    view: ChannelView, system: System = "practical", *, kinds: Sequence[str] = tuple(CHANNEL_KINDS)
) -> Iterator[tuple[str, Make]]:
    """Yield the name of each figure of a channel, and its maker, which may return None."""
    for kind in kinds:
        # A folder a recording: joined by any sign, two names could make the same one.
        name = f"{view.sensor}/{view.recording}/{view.channel}_{kind}"
        yield name, partial(CHANNEL_KINDS[kind], view, system)


def write_figures(tables: Iterable[Path], system: System, figures: Path) -> None:
    """Write the folder of figures that compare sensors; it appears when it is complete."""
    with make_folder(figures) as folder:
        for draw in list_drawings(
            {file.stem: read(file.stem, [file]) for file in tables}, system, folder
        ):
            draw()


def list_drawings(
    tables: Mapping[str, pa.Table],
    system: System,
    folder: Path,
    *,
    kinds: Sequence[str] = tuple(CROSS_KINDS),
) -> Sequence[Callable[[], None]]:
    """Return functions that each write a figure as SVG and PDF; missing tables count as empty."""
    folder.mkdir(parents=True, exist_ok=True)
    unused = {name: make_schema(name).empty_table() for name in BY_RECORDING}
    views = gather_recordings(unused | dict(tables))
    channels = [channel for view in views for channel in view.channels()]
    sensors = sorted({view.sensor for view in views})

    def draw(make: Callable[[], Figure], path: Path) -> None:
        figure = make()
        for kind in ("svg", "pdf"):
            save(figure, path.with_name(f"{path.name}.{kind}"))

    return [
        partial(draw, make, folder / name)
        for name, make in list_cross_figures(channels, system, sensors=sensors, kinds=kinds)
    ]


def save(figure: Figure, path: Path) -> None:
    """Write a figure atomically, in the format of its suffix; equal figures have equal bytes."""
    with replace_file(path) as temporary:
        temporary.write_bytes(_write_bytes(figure, path.suffix[1:]))


def encode_theory(system: System) -> str:
    """Return the characteristic curve as SVG in a data URI, for use in a page."""
    figure = _write_bytes(curves.draw_theory_figure(system), "svg")
    return "data:image/svg+xml;base64," + base64.b64encode(figure).decode()


def _write_bytes(figure: Figure, kind: str) -> bytes:
    # No date, and no version of the program that drew it.
    metadata = {"Title": str(figure.get_label()), "Creator": "imubench_pipeline"} | (
        {"Date": None} if kind == "svg" else {"Producer": None, "CreationDate": None}
    )
    buffer = io.BytesIO()
    with set_style():
        figure.savefig(buffer, format=kind, metadata=metadata)
    data = buffer.getvalue()
    if kind != "svg":
        return data
    # Smaller by a fifth: coordinates to a hundredth of a point.
    return _COORDINATE_PATTERN.sub(lambda match: _DECIMALS_PATTERN.sub(rb"\1", match[0]), data)
