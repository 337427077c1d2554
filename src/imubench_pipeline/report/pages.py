"""The pages of a report: those that there is one of, and those of each recording and sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from imubench_pipeline.extensions.aided import page as navigated
from imubench_pipeline.extensions.calibration import page_positions as positions
from imubench_pipeline.extensions.calibration import page_rate_table as rate_table
from imubench_pipeline.extensions.earth_rate import page as earth_rate
from imubench_pipeline.extensions.earth_rate import page_turned as turned
from imubench_pipeline.extensions.fusion import boards
from imubench_pipeline.extensions.papers import page as papers
from imubench_pipeline.report import compare, fusion, made, recording, shortlist, start, theory
from imubench_pipeline.report.sensor import device_page, sensor_page
from imubench_pipeline.report.site import Entry, Page, Site

ENTRIES: Sequence[Entry] = (
    start.START,
    compare.COMPARE,
    start.RECORDINGS,
    start.DATASHEETS,
    shortlist.SHORTLIST,
    navigated.NAVIGATION,
    fusion.FUSION,
    boards.BOARDS,
    earth_rate.EARTH_RATE_PAGE,
    papers.PAPERS_PAGE,
    theory.THEORY,
    made.MADE,
)
"""The pages that there is one of, in the order of the navigation; the first is the start page."""

_STATIC = ("recording.html.jinja", recording.context)
_OF_KIND: Mapping[str, tuple[str, recording.Context]] = {
    "two_position": ("turned.html.jinja", turned.context),
    "rate_table": ("rate_table.html.jinja", rate_table.context),
    "positions": ("positions.html.jinja", positions.context),
}
"""Template and context of the page of a recording that is not static, by its kind."""


def pages(site: Site) -> Iterator[Page]:
    """Yield the pages of the report, the start page last: it stands for the finished report."""
    for view in site.views:
        kind = "" if view.left_out else view.row.kind
        yield recording.page_of(site, view, *_OF_KIND.get(kind, _STATIC))
    for sensor in site.sensors:
        yield sensor_page(site, sensor)
    for path in dict.fromkeys(view.device_page for view in site.views):
        if path is not None:
            yield device_page(site, path)
    first, *others = (entry for entry in site.entries if entry.exists(site))
    for entry in (*others, first):
        yield entry.page(site)
