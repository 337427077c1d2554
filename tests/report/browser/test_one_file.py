"""The report as one file: it needs no other, and its pages are reached as in a folder."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from imubench_pipeline.report.payload import FOREST
from tests.report.browser import made
from tests.report.browser.reader import Open, toggle, traces

NIGHT = made.NIGHT.recording
OF_NIGHT = f"recordings/alpha/{NIGHT}.html"


def head(page: Page) -> str:
    return page.locator("main h1").inner_text()


def turn(page: Page, name: str) -> None:
    """Turn to a page by the menu."""
    page.get_by_role("navigation", name="Pages").get_by_role("link", name=name).click()


@pytest.mark.release
@pytest.mark.parametrize("drawn", [False, True])
def test_one_file_needs_no_other(drawn: bool, read: Open, alone: Path) -> None:
    assert [path.name for path in alone.parent.iterdir()] == [alone.name]
    reader = read(alone.parent, alone.name)
    assert head(reader.page) == made.TITLE
    assert reader.page.locator("figure[data-kind]").count() == 1 + len(FOREST)
    if drawn:  # every day the first alone
        assert reader.draw_all() == 1 + len(FOREST)
    figure = reader.figure("overlay")
    toggle(figure, "Other B").uncheck()
    assert {one["name"] for one in traces(figure) if one["name"]} == {
        f"Vendor & Sons A-1, {NIGHT}", "Vendor & Sons A-1 (simulated), sim_published",
    }  # fmt: skip
    kinds = ("../tables", "figures/", "assets/")
    links = reader.page.locator("a[href]").evaluate_all(
        "all => all.map(a => a.getAttribute('href'))"
    )
    assert not [link for link in links if link.startswith(kinds)]
    # The choice of units lasts from page to page.
    reader.page.get_by_label("Gyroscopes in").select_option("SI: rad/s")
    reader.page.get_by_role("link", name=NIGHT).first.click()
    expect(reader.page.locator("tr.recommended data").first).to_have_text("8.7×10⁻⁵")


@pytest.mark.release
def test_pages_of_one_file_are_turned(read: Open, alone: Path) -> None:
    reader = read(alone.parent, alone.name)
    page = reader.page
    page.get_by_role("link", name=NIGHT).first.click()
    expect(page.locator("main h1")).to_contain_text(NIGHT)
    assert page.title() == f"Vendor & Sons A-1: {NIGHT}"
    assert "#/recordings/alpha/" in page.url
    assert traces(reader.figure("allan", channel="gyro_x"))
    page.get_by_role("tab", name="Accelerometer x").click()
    expect(page.locator("h2#accel_x")).to_be_in_viewport()
    turn(page, "Experiments and method")
    page.get_by_role("main").get_by_role("link", name="Theory").click()
    expect(page.locator("main h1")).to_contain_text("Theory")
    page.get_by_role("link", name="Densities").click()
    expect(page.locator("#sidedness")).to_be_in_viewport()
    for expected in (
        r"#/theory\.html$",
        r"#/experiments\.html$",
        r"#channel=accel_x$",
        r"report\.html$",
    ):
        page.go_back()
        expect(page).to_have_url(re.compile(expected))
    expect(page.locator("main h1")).to_have_text(made.TITLE)
    page.go_forward()
    expect(page.locator("main h1")).to_contain_text(NIGHT)
    assert page.locator("main h1").count() == 1
    expect(page.locator("h2#accel_x")).to_be_visible()


@pytest.mark.release
def test_one_file_is_read_where_nothing_is_unfolded(browser: Browser, alone: Path) -> None:
    page = browser.new_page()
    page.add_init_script("delete window.DecompressionStream")
    page.goto(alone.as_uri())
    for name in ("Datasheets", "Experiments and method"):
        turn(page, name)
        expect(page.locator("main h1")).to_contain_text(name)
        expect(page.get_by_role("alert")).to_contain_text("Firefox 113")
    page.close()


@pytest.mark.release
def test_a_place_in_one_file_has_an_address(read: Open, alone: Path) -> None:
    reader = read(alone.parent, f"{alone.name}#/theory.html#bias-instability")
    page = reader.page
    expect(page.locator("#bias-instability")).to_be_in_viewport()
    page.goto(alone.as_uri() + "#/datasheets.html")
    marked = page.locator("header nav a[aria-current]")
    expect(marked).to_have_text(["Datasheets"])
    page.goto(alone.as_uri() + "#/nothing.html")
    expect(page.locator("main h1")).to_have_text(made.TITLE)


@pytest.mark.release  # every day test_compare.py asks it of the folder
def test_what_is_chosen_stands_behind_the_page(read: Open, alone: Path) -> None:
    reader = read(alone.parent, f"{alone.name}#/compare.html#a=alpha&b=beta&axis=gyro_x")
    page = reader.page
    chosen = page.locator(".pickers select")
    assert [one.input_value() for one in chosen.all()] == ["alpha", "beta"]
    chosen.last.select_option("beta/run_2")
    assert page.url.endswith("#/compare.html#a=alpha&b=beta%2Frun_2&axis=gyro_x")
    turn(page, "Experiments and method")
    assert page.url.endswith("#/experiments.html")
    page.go_back()
    page.wait_for_function("document.querySelector('h1').textContent === 'Side by side'")
    assert chosen.last.input_value() == "beta/run_2"
