"""What the papers print, in the order in which they are shown, beside what the run found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from imubench_pipeline.extensions.papers.claims import rows_of
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.panel import panel_rows
from imubench_pipeline.extensions.papers.printed import KEYS, read_paper
from imubench_pipeline.extensions.papers.tables import PublishedRow
from imubench_pipeline.tables import build, read, write_arrow

PAPERS = tuple(read_paper(key) for key in KEYS)
"""In the order in which they are shown."""


def write_published(tables: Iterable[Path], outputs: Iterable[Path]) -> None:
    """Write the tables ``published`` and ``accuracy``, as Parquet and CSV.

    `tables` are joined ones of the run, and parts of one table of recordings. Both are empty where
    it has no log of a paper.
    """
    parts: dict[str, list[Path]] = {}
    for path in tables:
        parts.setdefault(path.stem, []).append(path)
    evidence = Evidence({name: read(name, paths) for name, paths in parts.items()})
    of_maia = any(evidence.has(*log) for log in read_paper("maia").logs)
    made = {
        "published": build("published", published_rows(evidence)),
        "accuracy": build("accuracy", panel_rows() if of_maia else ()),
    }
    for output in outputs:
        write_arrow(made[output.stem], output)


def published_rows(evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` for the papers with logs in the run."""
    for paper in PAPERS:
        if any(evidence.has(*log) for log in paper.logs):
            yield from rows_of(paper, evidence)


def rows_without_a_run() -> Iterator[PublishedRow]:
    """Yield the rows that need printed figures and closed forms only, and no log."""
    for paper in PAPERS:
        for row in rows_of(paper, Evidence()):
            if row.basis in ("computed", "checked"):
                yield row
