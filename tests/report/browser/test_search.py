"""The search finds what it is asked for, by the keyboard alone, and opens it."""

from pathlib import Path

import pytest

from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import Open, Reader


@pytest.fixture(params=few(["folder"], ["one file"]))
def opened(request: pytest.FixtureRequest, read: Open, bench: Report) -> Reader:
    if request.param == "folder":
        return read(bench.folder, "sensors/beta.html")
    alone: Path = request.getfixturevalue("alone")
    return read(alone.parent, f"{alone.name}#/sensors/beta.html")


def test_a_search_by_the_keyboard(opened: Reader) -> None:
    page = opened.page
    page.keyboard.press("/")
    page.keyboard.type("night missing")
    found = page.locator(".search a")
    found.first.wait_for()
    assert found.all_inner_texts() == ["Vendor & Sons A-1: night 1 (+20 C) recording"]
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    page.wait_for_function("document.querySelector('h1').textContent.includes('night 1')")
    assert page.get_by_role("heading", level=1).inner_text().endswith(made.NIGHT.recording)
    field = page.get_by_role("searchbox", name="Search everything")
    field.fill("qqq")
    page.get_by_text("0 found").wait_for()
    field.press("Escape")
    assert field.input_value() == ""
