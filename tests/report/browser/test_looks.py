"""On a wide screen and a telephone, by night and on paper."""

import io
import re
from collections.abc import Sequence
from typing import Any

import pytest
from PIL import Image, ImageColor

from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import CUT_CAPTIONS, TOO_WIDE, Open, Reader

OF_NIGHT = f"recordings/alpha/{made.NIGHT.recording}.html"
WRITTEN = ("recordings.html", "datasheets", "theory", "sensors/alpha")
"""Pages at which it is looked without their figures."""

INK = """() => document.querySelector("figure[data-kind=allan] .canvas").data
  .find((one) => one.name === "likelihood").line.color"""


def luminance(colour: str) -> float:
    """Return how light a colour is, from 0 to 1."""
    red, green, blue = ImageColor.getrgb(colour)[:3]
    return (0.2126 * red + 0.7152 * green + 0.0722 * blue) / 255


def background(reader: Reader) -> float:
    return luminance(reader.page.evaluate("getComputedStyle(document.body).backgroundColor"))


def ink(reader: Reader) -> str:
    """Return the colour of the model to use."""
    reader.figure("allan", channel="gyro_x")
    return str(reader.page.evaluate(INK))


def picture(reader: Reader, **how: Any) -> Image.Image:
    return Image.open(io.BytesIO(reader.page.screenshot(**how))).convert("RGB")


@pytest.mark.release
@pytest.mark.parametrize(
    ("drawn", "written"),
    few(
        [(("compare",), ("recordings.html", "datasheets", "recordings/alpha/night 1"))],
        [
            (("compare", "recordings/alpha/night 1"), WRITTEN),
            (
                ("index", "sensors/alpha", "devices/"),
                ("made", "sensors/gamma", "recordings/alpha/night 2", "recordings/beta/run_1"),
            ),
        ],
    ),
    ids=str,
)
def test_no_page_is_wider_than_a_telephone(
    drawn: Sequence[str], written: Sequence[str], read: Open, bench: Report
) -> None:
    reader = read(bench.folder, width=390, height=5000)
    wide = {}
    for begin in (*drawn, *written):
        reader.open(bench.page(begin))
        if begin in drawn:
            reader.draw_all()
        wide[begin] = reader.page.evaluate(TOO_WIDE) + reader.page.evaluate(CUT_CAPTIONS)
    assert {begin: found for begin, found in wide.items() if found} == {}


SCROLLED = """() => [...document.querySelectorAll("main .scroll")]
  .filter((one) => one.scrollWidth > one.clientWidth + 2).map((one) => {
    one.scrollLeft = 150;
    const from = (what) => one.querySelector(what)?.getBoundingClientRect();
    const left = one.getBoundingClientRect().left;
    const [caption, head] = [from("caption"), from("tbody th")];
    return [one.ariaLabel, caption.left >= left - 1 && caption.right <= innerWidth,
            head === undefined || head.left >= left - 1];
  })"""
"""Of each table that is scrolled aside: its name, and whether caption and names of rows stay."""


@pytest.mark.release
def test_caption_and_first_column_stay_where_a_table_is_scrolled(read: Open, bench: Report) -> None:
    reader = read(bench.folder, width=700)
    tables = []
    for begin in ("index", "datasheets", "recordings.html"):
        reader.open(bench.page(begin))
        tables += reader.page.evaluate(SCROLLED)
    assert len(tables) >= 3
    assert [name for name, *stays in tables if stays != [True, True]] == []


@pytest.mark.release
@pytest.mark.parametrize("width", [390, 1280])
def test_there_is_something_to_see(width: int, read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT, width=width)
    for show in (lambda: None, lambda: reader.figure("allan", channel="gyro_x")):
        show()
        seen = picture(reader)
        assert seen.width == width and len(seen.getcolors(1 << 20) or []) > 50
        assert reader.page.evaluate(TOO_WIDE) == []


@pytest.mark.release
def test_a_page_is_dark_by_night(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)
    light = ink(reader)
    assert background(reader) > 0.9 and luminance(light) < 0.2
    # It follows when the evening comes.
    reader.page.emulate_media(color_scheme="dark")
    reader.page.wait_for_function(f"({INK})() !== '{light}'")
    dark = ink(reader)
    assert background(reader) < 0.1 and luminance(dark) > 0.7
    pixels = picture(reader).resize((64, 64)).convert("L").tobytes()
    assert sorted(pixels)[len(pixels) // 2] < 60


@pytest.mark.release  # every day a page turns dark while it is open
def test_a_page_that_is_opened_by_night_is_dark_at_once(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)
    light = ink(reader)
    reader.page.emulate_media(color_scheme="dark")
    reader.page.wait_for_function(f"({INK})() !== '{light}'")
    dark = ink(reader)
    assert ink(read(bench.folder, OF_NIGHT, scheme="dark")) == dark


@pytest.mark.release
@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_a_page_is_printed_light_and_whole(scheme: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT, scheme=scheme)
    ink(reader)  # the script that draws is there from now on
    reader.page.emulate_media(media="print", color_scheme=scheme)
    assert background(reader) > 0.9
    hidden = ("nav", ".units", ".skip")
    assert not any(reader.page.locator(one).first.is_visible() for one in hidden)
    data = reader.page.pdf()
    assert data.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", data)) > 1
    # Printing draws what was not in view yet, with the colours of paper.
    canvases = reader.page.locator("figure[data-kind] .canvas").all()
    assert all(canvas.locator("svg.main-svg").count() for canvas in canvases)
    reader.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert luminance(ink(reader)) < 0.2


@pytest.mark.release
def test_verdicts_are_dark_on_paper_by_night(read: Open, bench: Report) -> None:
    reader = read(bench.folder, "sensors/alpha.html", scheme="dark")
    colours = "all => all.map(one => getComputedStyle(one).color)"
    words = reader.page.locator(".standing h2 b")
    assert min(map(luminance, words.evaluate_all(colours))) > 0.6
    reader.page.emulate_media(media="print", color_scheme="dark")
    assert max(map(luminance, words.evaluate_all(colours))) < 0.4
    assert not reader.page.locator(".links").is_visible()


@pytest.mark.release
def test_no_figure_is_cut_off_on_paper(read: Open, bench: Report) -> None:
    reader = read(bench.folder, "compare.html", width=718)  # of a sheet of A4 between its margins
    reader.draw_all()
    reader.page.emulate_media(media="print")
    reader.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    ends = "figures => figures.map(one => one.getBoundingClientRect().right)"
    drawn = reader.page.locator("figure[data-kind] svg.main-svg").evaluate_all(ends)
    assert len(drawn) >= 4
    assert max(drawn) <= 718
    # With their tables they take two sheets, as whoever hands them on will print them.
    assert len(re.findall(rb"/Type\s*/Page\b", reader.page.pdf(format="A4"))) == 2


def test_the_first_column_of_a_table_stays_in_view(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT, width=768)
    reader.page.get_by_text("All methods").first.click()
    table = reader.page.get_by_role("region", name="parameters by method").first
    assert table.evaluate("one => one.scrollWidth - one.clientWidth") > 100
    table.evaluate("one => { one.scrollLeft = 100; }")
    begin = table.evaluate("one => one.getBoundingClientRect().left")
    first = table.locator("tr > :first-child").evaluate_all(
        "cells => cells.map(one => one.getBoundingClientRect().left)"
    )
    assert len(first) > 2 and max(abs(place - begin) for place in first) < 2
