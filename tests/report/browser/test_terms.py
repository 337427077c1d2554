"""Terms explain themselves where they stand, and lead to the theory."""

import pytest
from playwright.sync_api import Locator, expect

from imubench_pipeline.report.glossary import read_glossary
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import Open, Reader


def tip(reader: Reader) -> Locator:
    return reader.page.get_by_role("tooltip")


def test_a_term_explains_itself_under_the_pointer(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    term = reader.page.locator("main [data-term=allan_deviation]").first
    expect(tip(reader)).to_have_count(0)
    reader.show(term).hover()
    expect(tip(reader)).to_have_text(read_glossary()["allan_deviation"].short)
    assert term.get_attribute("aria-describedby") == "tip"
    assert tip(reader).get_attribute("id") == "tip"
    reader.page.mouse.move(0, 0)
    expect(tip(reader)).to_have_count(0)
    assert term.get_attribute("aria-describedby") is None


def test_a_term_explains_itself_under_the_keyboard(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    term = reader.page.locator("main [data-term=allan_deviation]").first
    term.focus()
    expect(tip(reader)).to_have_text(read_glossary()["allan_deviation"].short)
    reader.page.keyboard.press("Escape")
    expect(tip(reader)).to_have_count(0)
    assert reader.page.evaluate("document.activeElement.dataset.term") == "allan_deviation"
    reader.page.keyboard.press("Tab")
    following = reader.page.evaluate("document.activeElement.dataset.term")
    expect(tip(reader)).to_have_text(read_glossary()[following].short)
    term.focus()
    assert term.get_attribute("aria-describedby") == "tip"


@pytest.mark.release
@pytest.mark.parametrize("width", [390, 1280])
def test_an_explanation_is_seen_whole(width: int, read: Open, bench: Report) -> None:
    path = f"recordings/alpha/{made.NIGHT.recording}.html"
    reader = read(bench.folder, path, width=width, height=700)
    for term in reader.page.locator("main th [data-term]:visible").all()[:8]:
        term.focus()
        box = tip(reader).bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= width
        assert box["y"] >= 0 and box["y"] + box["height"] <= 700
        over = term.bounding_box()
        assert over is not None
        # It does not hide what it explains.
        assert box["y"] >= over["y"] + over["height"] or box["y"] + box["height"] <= over["y"]


def test_every_term_leads_to_the_theory(read: Open, bench: Report) -> None:
    reader = read(bench.folder, "theory.html")
    ids = set(reader.page.evaluate("[...document.querySelectorAll('[id]')].map(one => one.id)"))
    found = set()
    for path in ("index.html", "datasheets.html", f"recordings/alpha/{made.NIGHT.recording}.html"):
        reader.open(path)
        links = reader.page.locator("a[data-term]").evaluate_all(
            "all => all.map(one => [one.dataset.term, one.pathname.split('/').pop(), one.hash])"
        )
        for key, page, section in links:
            assert page == "theory.html" and section[1:] in ids, key
            assert read_glossary()[key].section == section[1:]
            found.add(key)
    assert {"missing_samples", "N", "not_identified", "absent", "likelihood", "tau"} <= found
    reader.open("index.html")
    reader.page.locator("#warnings-head").click()
    reader.show(reader.page.locator("main a[data-term=missing_samples]").first).click()
    row = reader.page.locator("tr#missing_samples, tr:target").first
    expect(row).to_be_in_viewport()
    expect(row).to_contain_text(read_glossary()["missing_samples"].short)
