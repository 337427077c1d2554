"""The papers, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from imubench_pipeline.extensions.papers import engers, maia, silva
from imubench_pipeline.extensions.papers.claims import Paper, rows_of
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.tables import PublishedRow

PAPERS: Sequence[Paper] = (maia.PAPER, silva.PAPER, engers.PAPER)


def published_rows(evidence: Evidence) -> Iterator[PublishedRow]:
    """Yield the rows of the table ``published`` for the papers with logs in the run."""
    for paper in PAPERS:
        if any(evidence.has(*log) for log in paper.about.logs):
            yield from rows_of(paper, evidence)


def rows_without_a_run() -> Iterator[PublishedRow]:
    """Yield the rows that need printed figures and closed forms only, and no log."""
    for paper in PAPERS:
        for row in rows_of(paper, Evidence()):
            if row.basis in ("computed", "checked"):
                yield row
