"""The page of the theory: the noise terms, and every word of the glossary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from imubench_pipeline.extensions.papers.tables import AccuracyRow
from imubench_pipeline.report.glossary import glossary
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.static_figures.files import figure_text
from imubench_pipeline.report.static_figures.theory import theory_figure
from imubench_pipeline.words.numbers import number_text


def _context(site: Site) -> dict[str, Any]:
    return {
        "figure": figure_text(theory_figure(site.system)),
        "terms": glossary(),
        "reading": words_of_reading(site.rows(AccuracyRow)),
    }


THEORY = Entry(file="theory.html", title="Theory", context=_context, tables=("accuracy",))
"""The page that the terms of all others lead to."""


def words_of_reading(rows: Sequence[AccuracyRow]) -> str:
    """Return what comes of reading the curve, by the table ``accuracy``; empty where that is."""
    of_curve = {row.parameter: row for row in rows if row.method == "curve"}
    if not of_curve:
        return ""
    bias, walk = of_curve["B"], of_curve["K"]
    off = ""
    if bias.bias is not None:
        size = number_text(100.0 * abs(bias.bias), 2)
        off = f", {size} % too {'small' if bias.bias < 0 else 'large'}"
    return (
        f"In {bias.logs} simulated logs of 10 h it finds B in {bias.given or 'none'}{off}, "
        f"and K in {walk.given or 'none'}: "
    )
