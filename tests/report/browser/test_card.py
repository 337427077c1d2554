"""The card of a sensor is one picture, and a link opens the evidence of a verdict."""

import struct
from pathlib import Path

from playwright.sync_api import expect

from tests.report.browser.made import Report
from tests.report.browser.reader import Open


def test_the_card_is_saved_as_one_picture(read: Open, bench: Report, tmp_path: Path) -> None:
    reader = read(bench.folder, "sensors/alpha.html")
    reader.figure("axes", quantity="gyro")
    with reader.page.expect_download() as saved:
        reader.page.get_by_role("button", name="Save this summary as PNG").click()
    saved.value.save_as(tmp_path / "card.png")
    data = (tmp_path / "card.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", data[16:24]) == (1600, 900)
    assert len(data) > 50_000  # a blank picture is much smaller


def test_a_link_opens_the_evidence_of_a_verdict(read: Open, bench: Report) -> None:
    reader = read(bench.folder, "sensors/alpha.html")
    headings = reader.page.locator(".standing h2")
    section = headings.first.get_attribute("id")
    evidence = reader.page.locator(".standing > details").first
    expect(evidence).not_to_have_attribute("open", "")
    reader.page.evaluate("id => { location.hash = id; }", section)
    expect(evidence).to_have_attribute("open", "")
