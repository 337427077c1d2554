"""What the papers print, beside what the run found."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from imubench_pipeline.experiments.papers.evidence import Evidence
from imubench_pipeline.experiments.papers.registry import published_rows
from imubench_pipeline.tables import build, read, write_arrow


def write_published(tables: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Write the table ``published``, as Parquet and CSV; `tables` are joined ones of the run."""
    evidence = Evidence({path.stem: read(path.stem, [path]) for path in tables})
    published = build("published", published_rows(evidence))
    for output in outputs:
        write_arrow(published, output)
