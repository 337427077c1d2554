"""What hinders a reader, by the rules of accessibility that a program can check."""

from __future__ import annotations

from typing import Any

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

UNFOLD = "document.querySelectorAll('details').forEach(one => (one.open = true))"
"""What is folded away is read too."""


def faults(page: Page, **options: Any) -> list[str]:
    # It must not ask for the style sheet again, which a page from disk may not.
    asked = {"resultTypes": ["violations"], "preload": False, **options}
    return [
        f"{one['impact']}, {one['id']}: {node['target'][0]}: {node['failureSummary']}"
        for one in Axe().run(page, options=asked).response["violations"]
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


def hindrances(page: Page) -> list[str]:
    """Return what hinders a reader of a page of which every figure is drawn, by day or by night."""
    page.evaluate(UNFOLD)
    by_day = faults(page)
    page.emulate_media(color_scheme="dark")
    return by_day + faults(page, runOnly=["color-contrast"])
