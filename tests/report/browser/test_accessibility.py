"""The pages by the rules of accessibility that a program can check."""

from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page

from tests.conftest import few
from tests.report.browser.made import Report
from tests.report.browser.reader import Open

KINDS = ("index", "recordings.html", "datasheets", "theory", "sensors/alpha", "devices/",
         "recordings/alpha/night 1")  # fmt: skip
ALIKE = ("made", "sensors/gamma", "recordings/alpha/night 2")


def faults(page: Page, **options: Any) -> list[str]:
    # It must not ask for the style sheet again, which a page from disk may not.
    asked = {"resultTypes": ["violations"], "preload": False, **options}
    return [
        f"{one['impact']}, {one['id']}: {node['target'][0]}: {node['failureSummary']}"
        for one in Axe().run(page, options=asked).response["violations"]
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


@pytest.mark.parametrize("kind", few(KINDS, ALIKE))
def test_nothing_hinders_a_reader(kind: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, bench.page(kind))
    reader.draw_all()
    # What is folded away is read too.
    reader.page.evaluate("document.querySelectorAll('details').forEach(one => (one.open = true))")
    assert faults(reader.page) == []
    reader.page.emulate_media(color_scheme="dark")
    assert faults(reader.page, runOnly=["color-contrast"]) == []
