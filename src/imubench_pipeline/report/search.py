"""The index of the search: all named entries, and their addresses."""

import json
from collections.abc import Callable, Iterable, Iterator
from urllib.parse import quote

from imubench_pipeline.registry import Hook
from imubench_pipeline.report.glossary import find_term, read_glossary
from imubench_pipeline.report.site import Site

Found = tuple[str, str, str, str]
"""Kind, title, address (page and section), and further words for the search."""


Search = Callable[[Site], Iterable[Found]]

_ADDED: Hook[Search] = Hook("search")


def make_search_index(site: Site) -> str:
    """Return the index of the search as JSON: a list of `Found`."""
    return json.dumps(list(_list_entries(site)), ensure_ascii=False, separators=(",", ":"))


def _list_entries(site: Site) -> Iterator[Found]:
    for sensor in site.sensors:
        about = site.settings["sensors"].get(sensor, {}).get("price_class") or ""
        yield "sensor", site.names[sensor], quote(site.sensor_page(sensor)), f"{sensor} {about}"
    for view in site.views:
        findings = (find_term(row.finding).name for row in view.findings)
        state = [*dict.fromkeys(findings), *(["simulated"] if view.simulated else [])]
        if view.left_out:
            state += [view.row.status, view.row.reason or ""]
        words = f"{view.sensor} {view.row.device} {', '.join(state)}"
        yield "recording", f"{site.names[view.sensor]}: {view.name}", quote(view.page), words
    devices = {view.device_page: view for view in site.views if view.device_page}
    for page, view in devices.items():
        yield "device", f"{site.names[view.sensor]}: device {view.row.device}", quote(page), ""
    for name, requirement in site.settings["requirements"].items():
        yield "requirement", requirement["title"], f"index.html#requirement-{name}", name
    for entry_of in site.existing:
        yield "page", entry_of.title, entry_of.file, entry_of.about
    for entry in read_glossary().values():
        yield "term", entry.name, f"theory.html#{entry.section}", entry.short
    for entries_of in _ADDED.objects():
        yield from entries_of(site)
