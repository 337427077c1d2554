"""Tables: sorted and filtered by the reader, and no longer than a page can bear."""

import math
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, expect

from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import READY, Open, Reader

SENSORS, EACH, AXES = 20, 6, 3
COMPARED = 3
"""Recordings of each sensor in figures and tables of all sensors: sixty together."""
PAGES = (
    "index.html", "recordings.html", "sensors/sensor_00.html", "recordings/sensor_00/run_00.html",
)  # fmt: skip


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of more recordings of six channels each than a table shows at first."""
    results = tmp_path_factory.mktemp("many")
    made.publish_some(made.many(results, SENSORS, EACH), results / "report", PAGES)
    return results / "report"


def table_of(reader: Reader, name: str) -> Locator:
    return reader.show(reader.page.get_by_role("table", name=name))


def cells(table: Locator, column: int) -> list[str]:
    return table.locator(f"tbody tr > :nth-child({column})").all_inner_texts()


def bar_of(table: Locator) -> Locator:
    return table.locator("xpath=../preceding-sibling::form[1]")


def count(table: Locator) -> str:
    return bar_of(table).locator("output").inner_text()


def test_how_many_equal_one_is_asked_for_one_averaging_time(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder, "fusion.html"), "Numbers rounded up")
    worse = {
        tau: [row for row in bench.of("fusion", tau=tau) if row["adev"] > row["other_adev"]]
        for tau in (1.0, 10.0)
    }
    assert worse[1.0] and worse[10.0]
    for tau, rows in worse.items():
        bar_of(table).get_by_label("Tau").select_option(f"{tau:.0f} s")
        shown = cells(table, 5)
        assert [text.split("\n")[0] for text in shown] == [str(math.ceil(r["n"])) for r in rows]


def test_a_column_is_sorted_up_and_down(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder, "recordings.html"), "All recordings")
    before = cells(table, 2)
    head = table.get_by_role("columnheader", name="Started")
    assert head.get_attribute("aria-sort") is None
    button = table.get_by_role("button", name="Sort by Started")
    button.click()
    assert head.get_attribute("aria-sort") == "ascending"
    stated = sorted((log.started or "")[:10] for log in (made.NIGHT, *made.DATED))
    dates = [text[:10] for text in cells(table, 5) if text[0].isdigit()]
    assert dates == stated
    button.press("Enter")
    assert head.get_attribute("aria-sort") == "descending"
    assert [text[:10] for text in cells(table, 5) if text[0].isdigit()] == stated[::-1]
    table.get_by_role("button", name="Sort by Recording").click()
    assert head.get_attribute("aria-sort") is None
    assert sorted(cells(table, 2)) == sorted(before) != before


@pytest.mark.parametrize("times", few([2], [1]))
def test_what_is_not_known_stands_last(times: int, read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder, "recordings.html"), "All recordings")
    for column, name, unknown in ((6, "Length", 2), (8, "Temperature", len(made.DATED) + 3)):
        table.get_by_role("button", name="Sort by Recording").click()
        assert cells(table, column)[1] == "–"
        for _ in range(times):
            table.get_by_role("button", name=f"Sort by {name}").click()
        found = cells(table, column)
        assert "–" not in found[:-unknown] and found[-unknown:] == ["–"] * unknown


def test_numbers_are_sorted_as_numbers(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder), "Gyroscope: parameters")
    heads = table.get_by_role("columnheader").all_inner_texts()
    (column,) = (place for place, text in enumerate(heads, start=1) if text.startswith("K"))
    before = [text.split("\n")[0] for text in cells(table, column)]
    table.get_by_role("button", name="Sort by K").click()
    *sizes, last = (text.split("\n")[0] for text in cells(table, column))
    # As texts, 15 would stand before 5.
    missing = "below 1.2 (95 %)"
    assert [float(size) for size in sizes] == sorted(float(t) for t in before if t != missing)
    assert sizes[0] == "5" and last == missing


def test_rows_are_found_and_counted(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder, "recordings.html"), "All recordings")
    bar = bar_of(table)
    rows = len(bench.rows["recordings"])
    search = bar.get_by_role("searchbox", name="Find")
    search.fill("NIGHT")
    assert cells(table, 2) == [made.NIGHT.recording, "night 2"]
    assert count(table) == f"2 of {rows} rows"
    bar.get_by_label("Status").select_option("rejected")
    assert cells(table, 2) == ["night 2"]
    search.fill("")
    assert sorted(cells(table, 2)) == ["night 2", "only"]
    bar.get_by_label("Sensor").select_option("Other C")
    assert cells(table, 2) == ["only"] and count(table) == f"1 of {rows} rows"
    search.fill("nothing like it")
    assert cells(table, 2) == [] and count(table).startswith(f"0 of {rows} rows: no row has")
    for label in ("Status", "Sensor"):
        bar.get_by_label(label).select_option("all")
    search.fill("")
    assert count(table) == f"{rows} rows" and len(cells(table, 2)) == rows


@pytest.mark.release
def test_what_is_asked_of_tables_stands_in_the_address(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    tables = [
        table_of(reader, name) for name in ("Gyroscope: parameters", "Accelerometer: parameters")
    ]
    bars = [bar_of(table) for table in tables]
    bars[0].get_by_label("Method").select_option("all")
    bars[0].get_by_role("searchbox").fill("a-1 & more")
    bars[0].get_by_role("searchbox").fill("A-1")
    tables[0].get_by_role("button", name="Sort by K").click()
    tables[0].get_by_role("button", name="Sort by K").click()
    bars[1].get_by_label("Method").select_option("model N+GM+K")
    before, link = [cells(table, 2) for table in tables], reader.page.url
    assert "gyroscope-parameters.find=A-1" in link
    reader.open("recordings.html")
    reader.page.go_back()
    reader.page.wait_for_function("document.documentElement.dataset.ready === 'yes'")
    assert reader.page.url == link
    reader.open("index.html#" + link.partition("#")[2])
    assert [cells(table, 2) for table in tables] == before
    assert tables[0].locator("th[aria-sort=descending]").count() == 1
    # What there is not is told, and hides no row.
    reader.open("recordings.html#recordings.status=lost&recordings.colour=red&no-table.find=x")
    said = " ".join(reader.page.locator(".unfound").all_inner_texts())
    assert "status “lost”" in said and "colour “red”" in said and "no-table.find" in said
    table = table_of(reader, "All recordings")
    assert len(cells(table, 1)) == len(bench.rows["recordings"])


def test_the_other_method_is_asked_for(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder), "Gyroscope: parameters")
    best = len(bench.of("fixed_bias", channel="gyro_x")) + 1
    assert len(cells(table, 1)) == best
    method = bar_of(table).get_by_label("Method")
    method.select_option("model N+GM+K")
    assert len(cells(table, 1)) == best - 1  # one has it as its best
    method.select_option("all")
    assert count(table) == f"{2 * best - 1} rows"


@pytest.mark.release
def test_a_long_table_shows_its_first_rows(read: Open, many: Path) -> None:
    reader = read(many)
    table = table_of(reader, "Gyroscope: parameters")
    every = 2 * SENSORS * COMPARED * AXES
    reader.page.get_by_label("Gyroscopes in").select_option("SI: rad/s")
    assert table.locator("tbody tr").count() == 100
    bar = bar_of(table)
    assert "first" in count(table)
    last = f"model {SENSORS - 1:02d}"
    assert table.get_by_text(last).count() == 0
    bar.get_by_role("searchbox").fill(last)
    assert table.get_by_text(last).count() == COMPARED * AXES
    assert count(table) == f"{COMPARED * AXES} of {every} rows"
    bar.get_by_role("searchbox").fill("run_00")
    assert count(table) == f"{SENSORS * AXES} of {every} rows"
    bar.get_by_role("searchbox").fill("")
    found = SENSORS * COMPARED * AXES
    assert count(table) == f"the first 100 of {found} of {every} rows"
    bar.get_by_role("button", name=f"show all {found}").click()
    assert table.locator("tbody tr").count() == found
    assert bar.get_by_role("button").count() == 0
    # Numbers of rows that were not in the page are in the unit that was chosen before.
    assert "×10⁻⁵" in table.locator("tbody tr").last.inner_text()


@pytest.mark.release
def test_a_long_table_is_sorted_whole(read: Open, many: Path) -> None:
    table = table_of(read(many, "recordings.html"), "All recordings")
    assert table.locator("tbody tr").count() == 100
    table.get_by_role("button", name="Sort by Recording").click()
    table.get_by_role("button", name="Sort by Recording").click()
    assert set(cells(table, 2)) == {f"run_{r:02d}" for r in range(EACH - 5, EACH)}
    assert count(table) == f"the first 100 of {SENSORS * EACH} rows"


@pytest.mark.release  # every day test_pages.py has a browser that unfolds nothing
@pytest.mark.parametrize("script", [False, True], ids=["without JavaScript", "of 2021"])
def test_browser_without_decompression_shows_the_number_of_rows(
    script: bool, browser: Browser, many: Path
) -> None:
    context = browser.new_context(java_script_enabled=script)
    page = context.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    if script:
        page.add_init_script("delete window.DecompressionStream")
    page.goto((many / "index.html").as_uri())
    if script:
        page.wait_for_function(READY)
        said = page.get_by_role("alert")
        expect(said).to_be_in_viewport()
        for name in ("Chrome or Edge 92", "Firefox 113", "Safari 16.4"):
            expect(said).to_contain_text(name)
        page.get_by_label("Gyroscopes in").select_option("SI: rad/s")
    table = page.get_by_role("table", name="Gyroscope: parameters")
    rows = table.locator("tbody tr").filter(visible=True)
    assert 10 < rows.count() <= 30
    assert ("×10⁻" in rows.last.inner_text()) == script
    # Of each axis the recommended method and that of the papers.
    every = 2 * SENSORS * COMPARED * AXES
    words = f"{rows.count()} of {every} rows. The others need JavaScript"
    expect(page.locator("p.note", has_text=words).first).to_be_visible()
    path = "recordings/sensor_00/run_00.html"
    page.goto((many / path).as_uri())
    words = f"{2 * AXES} sections need JavaScript"
    expect(page.locator("p.note", has_text=words)).to_be_visible()
    assert complaints == []
    context.close()


@pytest.mark.release  # long: three hundred lines in each figure
def test_a_report_of_many_recordings_is_drawn(read: Open, many: Path) -> None:
    reader = read(many)
    figure = reader.figure("overlay")
    names = "canvas => canvas.data.filter(one => one.name).length"
    # So many curves would be a carpet: the reader asks for them.
    assert figure.locator(".canvas").evaluate(names) == SENSORS
    recordings = reader.page.get_by_role("combobox", name="Recordings")
    assert recordings.input_value() == "last"
    recordings.select_option("all")
    assert figure.locator(".canvas").evaluate(names) == SENSORS * COMPARED
    for path in PAGES[1:]:
        reader.open(path)
        reader.draw_all()


def test_figures_of_the_catalogue_are_sorted_and_unfold(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder, "datasheets.html"), "Gyroscopes: published figures")
    assert bar_of(table).get_by_label("Vendor").locator("option").count() == 3
    before = cells(table, 1)
    table.get_by_role("button", name="Sort by B", exact=True).click()
    assert cells(table, 5)[0].strip() == "8 max" and cells(table, 5)[-1].strip() == "?"
    bar_of(table).get_by_label("Vendor").select_option("Vendor & Sons")
    assert len(cells(table, 1)) == 1 < len(before)
    cell = table.locator("tbody td:nth-child(4)")
    assert cell.locator("summary").inner_text().startswith("0.297 typ")
    unfolded = cell.locator("details[open]")
    assert unfolded.count() == 0
    cell.locator("summary").click()
    assert "noise density: 0.007 deg/s/sqrt(Hz) typ" in unfolded.inner_text()
