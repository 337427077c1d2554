"""The page of the theory: the noise terms, and the terms of the glossary."""

from __future__ import annotations

from collections.abc import Mapping

from imubench_pipeline.report.glossary import read_glossary
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.static_figures.files import encode_figure
from imubench_pipeline.report.static_figures.theory import draw_theory_figure


def _make_context(site: Site) -> Mapping[str, object]:
    return {"figure": encode_figure(draw_theory_figure(site.system)), "terms": read_glossary()}


THEORY = Entry(file="theory.html", title="Theory", context=_make_context)
"""The page that the terms of all other pages link to."""
