"""What hinders a reader, by the rules of accessibility that a program can check."""

from __future__ import annotations

from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

UNFOLD = "document.querySelectorAll('details').forEach(one => (one.open = true))"
"""What is folded away is read too."""

ALIKE = """() => {
  const style = document.createElement("style");
  style.textContent = ".main-svg, tbody tr:nth-child(n + 4), section.channel ~ section.channel"
    + " { display: none }";
  document.head.append(style);
}"""
"""Put away what another's script draws, and what is like what stands above it: the rules take as
long over each line and each channel. Before a release they read all of it."""


def faults(page: Page, **options: Any) -> list[str]:
    # It must not ask for the style sheet again, which a page from disk may not.
    asked = {"resultTypes": ["violations"], "preload": False, **options}
    return [
        f"{one['impact']}, {one['id']}: {node['target'][0]}: {node['failureSummary']}"
        for one in Axe().run(page, options=asked).response["violations"]
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


def hindrances(page: Page, *, by_night: bool = True, whole: bool = False) -> list[str]:
    """Return what hinders a reader of a page of which every figure is drawn, by day or by night."""
    page.evaluate(UNFOLD)
    if not whole:
        page.evaluate(ALIKE)
    found = faults(page)
    if by_night:
        page.emulate_media(color_scheme="dark")
        found += faults(page, runOnly=["color-contrast"])
    return found
