"""Draw the figures of all sensors for print."""

import json
from collections.abc import Iterable
from pathlib import Path

from imubench_pipeline.report.static_figures.files import draw_comparison
from imubench_pipeline.tables.files import make_folder, read


def write_figures(tables: Iterable[Path], settings: str, figures: Path) -> None:
    """Write a folder of figures; all appear together."""
    with make_folder(figures) as folder:
        draw_comparison(
            {path.stem: read(path.stem, [path]) for path in tables},
            json.loads(settings)["report"]["units"],
            folder,
        )
