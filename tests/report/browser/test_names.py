"""Sensors, recordings and devices of any name: every page opens, and every figure is drawn."""

from pathlib import Path
from urllib.parse import quote

import pytest

from imubench_pipeline.report.publish import publish, render_one_file
from imubench_pipeline.report.site import Site
from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.reader import Open
from tests.report.pages import sound_pages

NAMES = (
    "constructor",
    "__proto__",
    "toString",
    "hasOwnProperty",
    "length",
    "items",  # of a Python mapping
    "null",
    "index",
    "con",
    "10",  # JavaScript puts it first
    """<b>"q" & 'it' %25 {x} =#1?""",
    "µ-名前",
    "a" * 120,
)
"""Of a sensor, its recording and its device."""


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Site:
    return made.named(tmp_path_factory.mktemp("odd"), NAMES)


@pytest.fixture(scope="module")
def folder(odd: Site, tmp_path_factory: pytest.TempPathFactory) -> Path:
    published: Path = tmp_path_factory.mktemp("published") / "report"
    publish(odd, published)
    return published


def test_pages_of_any_name_are_sound_and_linked(folder: Path) -> None:
    pages = sound_pages(folder, {f"figures/allan_gyro_x.{kind}" for kind in ("svg", "pdf")})
    for name in NAMES:
        assert f"sensors/{name}.html" in pages
        assert f"recordings/{name}/{name}.html" in pages


def test_a_sensor_of_any_name_is_compared_and_found(read: Open, folder: Path) -> None:
    reader = read(folder)
    assert reader.draw_all()
    text = reader.page.locator("main").inner_text()
    assert "native code" not in text and "undefined" not in text
    assert "[object Object]" not in text
    for name in NAMES:
        assert name in text
    field = reader.page.get_by_role("searchbox", name="Search everything")
    field.fill("__proto__")
    link = reader.page.locator(".search a").first
    link.wait_for()
    link.click()
    reader.page.wait_for_function("document.querySelector('h1').textContent.includes('__proto__')")


@pytest.mark.parametrize("name", few(["__proto__"], ["constructor"]))
def test_the_page_of_a_recording_of_any_name_draws_its_figures(
    name: str, read: Open, folder: Path
) -> None:
    for page in (f"recordings/{name}/{name}.html", f"sensors/{name}.html"):
        reader = read(folder, page)
        assert reader.draw_all()
        assert name in reader.page.locator("h1").inner_text()
        assert "native code" not in reader.page.locator("main").inner_text()


def test_any_two_names_are_set_side_by_side(read: Open, folder: Path) -> None:
    reader = read(folder, "compare.html#a=constructor&b=__proto__")
    assert reader.draw_all()
    text = reader.page.locator("main").inner_text()
    assert "constructor" in text and "__proto__" in text and "Not in this report" not in text


@pytest.mark.release
def test_one_file_shows_a_page_of_any_name(read: Open, odd: Site, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text(render_one_file(odd), encoding="utf-8")
    for name in ("__proto__", NAMES[-3]):
        page = quote(f"recordings/{name}/{name}.html")
        reader = read(tmp_path, f"report.html#/{page}")
        assert name in reader.page.locator("h1").inner_text()
