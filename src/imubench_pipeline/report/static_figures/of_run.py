"""The figures that every run draws: those of all sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import pyarrow as pa
from matplotlib.figure import Figure

from imubench_pipeline.report.practical import System
from imubench_pipeline.report.static_figures.files import CROSS_KINDS, cross_figures, save
from imubench_pipeline.report.view import recording_views
from imubench_pipeline.tables import schema
from imubench_pipeline.tables.schemas import BY_RECORDING


def draw_comparison(tables: Mapping[str, pa.Table], system: System, folder: Path) -> None:
    """Write the figures of each channel of all sensors, as SVG and PDF.

    Of joined tables; those of recordings that are left out count as empty.
    """
    for draw in figures_of(tables, system, folder):
        draw()


def figures_of(
    tables: Mapping[str, pa.Table],
    system: System,
    folder: Path,
    *,
    kinds: Sequence[str] = tuple(CROSS_KINDS),
) -> Sequence[Callable[[], None]]:
    """Return a function for each figure of all sensors that writes it."""
    folder.mkdir(parents=True, exist_ok=True)
    unused = {name: schema(name).empty_table() for name in BY_RECORDING}
    views = recording_views(unused | dict(tables))
    channels = [channel for view in views for channel in view.channels()]
    sensors = sorted({view.sensor for view in views})
    return [
        partial(_draw, make, folder / name)
        for name, make in cross_figures(channels, system, sensors=sensors, kinds=kinds)
    ]


def _draw(make: Callable[[], Figure], path: Path) -> None:
    figure = make()
    for kind in ("svg", "pdf"):
        save(figure, path.with_name(f"{path.name}.{kind}"))
