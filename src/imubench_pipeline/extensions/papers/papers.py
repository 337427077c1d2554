"""What the papers print, beside what the run found."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from imubench_pipeline.extensions.papers.about import MAIA
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.lines import published_rows
from imubench_pipeline.extensions.papers.panel import panel_rows
from imubench_pipeline.tables import build, read, write_arrow


def write_published(tables: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Write the tables ``published`` and ``accuracy``, as Parquet and CSV.

    `tables` are joined ones of the run, and parts of one table of recordings. Both are empty where
    it has no log of a paper.
    """
    parts: dict[str, list[Path]] = {}
    for path in tables:
        parts.setdefault(path.stem, []).append(path)
    evidence = Evidence({name: read(name, paths) for name, paths in parts.items()})
    of_maia = any(evidence.has(*log) for log in MAIA.logs)
    made = {
        "published": build("published", published_rows(evidence)),
        "accuracy": build("accuracy", panel_rows() if of_maia else ()),
    }
    for output in outputs:
        write_arrow(made[output.stem], output)
