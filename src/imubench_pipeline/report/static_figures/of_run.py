"""The figures that every run draws: those of all sensors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

from imubench_pipeline.report.practical import System
from imubench_pipeline.report.static_figures.files import cross_figures, save
from imubench_pipeline.report.view import recording_views
from imubench_pipeline.tables import schema
from imubench_pipeline.tables.schemas import BY_RECORDING


def draw_comparison(tables: Mapping[str, pa.Table], system: System, folder: Path) -> None:
    """Write the figures of each channel of all sensors, as SVG and PDF.

    Of joined tables; those of recordings that are left out count as empty.
    """
    folder.mkdir(parents=True, exist_ok=True)
    unused = {name: schema(name).empty_table() for name in BY_RECORDING}
    views = recording_views(unused | dict(tables))
    channels = [channel for view in views for channel in view.channels()]
    sensors = sorted({view.sensor for view in views})
    for name, make in cross_figures(channels, system, sensors=sensors):
        figure = make()
        for kind in ("svg", "pdf"):
            save(figure, folder / f"{name}.{kind}")
