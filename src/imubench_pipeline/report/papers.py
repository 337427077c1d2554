"""The page of the papers, line by line: what is printed, what is found, and why they differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from imubench_pipeline.experiments.papers.about import BASES, PAPERS, VERDICTS, About
from imubench_pipeline.report.practical import limit_digits, number_text
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.typing import Row


def _context(site: Site) -> dict[str, Any]:
    there = _pages(site)
    rows = site.rows("published")
    return {
        "bases": BASES,
        "verdicts": VERDICTS,
        "papers": [
            _paper(paper, own, there)
            for paper in PAPERS
            if (own := [row for row in rows if row["paper"] == paper.name])
        ],
    }


PAPERS_PAGE = Entry(
    file="papers.html",
    title="Papers",
    context=_context,
    tables=("published",),
    exists=lambda site: bool(site.rows("published")),
)
"""The page of every table, figure and equation of the papers of which the run has logs."""


def _pages(site: Site) -> set[str]:
    """Return the pages that a line may lead to."""
    of_recordings = {view.page for view in site.views if not view.left_out}
    return of_recordings | {file for file, _ in site.navigation}


def _paper(paper: About, rows: Sequence[Row], there: set[str]) -> dict[str, Any]:
    kinds = dict.fromkeys(row["place"].split()[0] for row in rows)
    verdicts = Counter(row["verdict"] for row in rows)
    return {
        "about": paper,
        "lines": [
            {
                **row,
                "kind": row["place"].split()[0],
                "page": row["page"] if (row["page"] or "").split("#")[0] in there else None,
                **cells(row),
            }
            for row in rows
        ],
        "counts": [(verdicts[verdict], verdict) for verdict in VERDICTS if verdicts[verdict]],
        "filters": {
            "kind": list(kinds),
            "verdict": list(dict.fromkeys(row["verdict"] for row in rows)),
            "basis": list(dict.fromkeys(row["basis"] for row in rows)),
        },
    }


def cells(row: Row) -> dict[str, str]:
    """Return what is found and the ratio of a row of ``published``, as texts.

    What is found is in the unit of the paper, so that it can be held beside what is printed.
    """
    found = ""
    if row["found"] is not None:
        digits = limit_digits(row["lower"], row["upper"], 3)
        shown = (row[name] for name in ("found", "lower", "upper"))
        value, lower, upper = (
            None if x is None else number_text(x / row["scale"], digits) for x in shown
        )
        unit = "" if row["printed_unit"] == "-" else f" {row['printed_unit']}"
        found = f"{value}{unit}"
        if lower is not None and upper is not None:
            found += f" ({lower} to {upper})"
    words = "; ".join(filter(None, (found, row["found_words"])))
    ratio = "–" if row["ratio"] is None else number_text(row["ratio"], 3)
    return {"found_text": words or "–", "ratio_text": ratio}
