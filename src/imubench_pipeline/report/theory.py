"""The page of the theory: the noise terms, and the terms of the glossary."""

from __future__ import annotations

from collections.abc import Mapping

from imubench_pipeline.report.glossary import glossary
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.static_figures.files import figure_text
from imubench_pipeline.report.static_figures.theory import theory_figure


def _make_context(site: Site) -> Mapping[str, object]:
    return {"figure": figure_text(theory_figure(site.system)), "terms": glossary()}


THEORY = Entry(file="theory.html", title="Theory", context=_make_context)
"""The page that the terms of all other pages link to."""
