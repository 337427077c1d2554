"""The pages of a report: single ones, and one for each recording, sensor and device."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from imubench_pipeline.registry import Hook
from imubench_pipeline.report import compare, made, recording, shortlist, start, theory
from imubench_pipeline.report.sensor import make_device_page, make_sensor_page
from imubench_pipeline.report.site import RECORDING_PAGES, Entry, Page, Site

_ADDED: Hook[Entry] = Hook("pages")

ENTRIES: Sequence[Entry] = (
    start.START,
    compare.COMPARE,
    start.RECORDINGS,
    start.DATASHEETS,
    shortlist.SHORTLIST,
    *sorted(_ADDED.objects(), key=lambda entry: entry.place),
    theory.THEORY,
    made.MADE,
)
"""The pages that exist once, in the order of the navigation; the first is the start page."""


def list_pages(site: Site) -> Iterator[Page]:
    """Yield the pages of the report, the start page last: it marks a finished report."""
    for view in site.views:
        kind = "" if view.left_out else view.row.kind
        yield recording.make_recording_page(
            site, view, RECORDING_PAGES.by_key().get(kind, recording.STATIC)
        )
    for sensor in site.sensors:
        yield make_sensor_page(site, sensor)
    for path in dict.fromkeys(view.device_page for view in site.views):
        if path is not None:
            yield make_device_page(site, path)
    first, *others = (entry for entry in site.entries if entry.exists(site))
    for entry in (*others, first):
        yield entry.page(site)
