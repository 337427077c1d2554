"""The decision matrix: the first thing to see, of the tables, and each number leads to its like."""

import math
import re
from collections import Counter
from urllib.parse import unquote

import pytest

from imubench_pipeline.words.verdicts import SHORT_VERDICTS
from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import TOO_WIDE, Open, Reader, toggle, traces
from tests.report.browser.test_numbers import number
from tests.report.browser.test_tables import bar_of, cells, table_of
from tests.report.pages import Element, Read, read_pages

# Of a unit of the pages in SI; a degree is pi / 180.
SIZES = {"°": 180 / math.pi, "m/s": 1.0, "mm/s": 1e3, "m": 1.0, "mm": 1e3, "km": 1e-3, "": 1.0}
KEYS = {
    "ranking": ("requirement", "sensor", "error", "time"),
    "error_budget": ("requirement", "sensor", "recording", "error", "time"),
}
FIRST = ("alpha", "beta", "gamma")


@pytest.fixture(scope="module")
def pages(bench: Report) -> dict[str, Read]:
    return read_pages(bench.folder)


def told(page: Read) -> list[Element]:
    """Return the numbers that say from which value of the tables they are."""
    return [one for one in page.elements if "data-from" in one.attributes]


def value_of(bench: Report, source: str) -> float:
    table, *key, column = source.split("/")
    assert len(key) == len(KEYS[table])
    named = dict(zip(KEYS[table], key, strict=True))
    rows = [
        row
        for row in bench.rows[table]
        if row.get("source", "total") == "total" or table == "ranking"
        if all(f"{row[n]:g}" == t if n == "time" else row[n] == t for n, t in named.items())
    ]
    (row,) = rows
    above, _, below = column.partition(":")
    return row[above] / row[below] if below else row[above]


def equal(shown: float, value: float) -> bool:
    """Tell whether a number is another that is rounded to two digits or more."""
    rounded = (float(f"{value:.{digits}e}") for digits in range(1, 7))
    return any(math.isclose(shown, one, rel_tol=1e-9) for one in rounded)


def test_every_number_of_a_verdict_is_that_of_its_table(
    pages: dict[str, Read], bench: Report
) -> None:
    columns = Counter()
    for path, page in pages.items():
        for one in told(page):
            source = one.attributes["data-from"] or ""
            unit = one.attributes.get("data-in") or ""
            value, text = value_of(bench, source), one.text.split(" ")[0]
            if unit == "%":
                assert number(text) == round(100 * value), (path, source)
            else:
                assert equal(number(text), value * SIZES[unit]), (path, source, one.text, value)
            if " " in one.text:
                assert one.text.split(" ", 1)[1] == unit
            columns[source.rpartition("/")[2]] += 1
    assert columns.keys() >= {
        "margin", "limit:upper", "limit:lower", "sigma", "lower", "upper", "limit", "chance",
    }  # fmt: skip
    assert min(columns.values()) > 2


def test_linked_sections_repeat_the_numbers_of_verdicts(pages: dict[str, Read]) -> None:
    links = [
        (link.attributes["href"] or "").partition("#")
        for link in pages["index.html"].elements
        if link.tag == "a" and "#requirement-" in (link.attributes.get("href") or "")
    ]
    led = {(path, section) for path, _, section in links if path}
    assert len(led) == len(FIRST) * len(made.REQUIREMENTS)
    assert all(section in pages[unquote(path)].ids for path, section in led)
    numbers = Counter()
    for one in told(pages["index.html"]):
        source = one.attributes["data-from"] or ""
        _, requirement, sensor, *_ = source.split("/")
        path = f"sensors/{sensor}.html"
        assert (path, f"requirement-{requirement}") in led
        again = {x.text for x in told(pages[path]) if x.attributes["data-from"] == source}
        assert again == {one.text}, source
        numbers[requirement, sensor] += 1
    assert numbers.keys() == {
        ("rover", "alpha"),
        ("rover", "beta"),
        ("wheels", "alpha"),
        ("wheels", "beta"),
    }


def test_the_windows_at_rest_of_a_verdict_stand_with_it(pages: dict[str, Read]) -> None:
    text = " ".join(pages["sensors/alpha.html"].text.split())
    for one in made.REQUIREMENTS.values():
        assert f"Errors (1σ) after {one.static_window} at rest right before" in text


def test_words_of_the_matrix_are_those_of_the_ranking(start: Reader, bench: Report) -> None:
    reader = start
    table = reader.page.locator("[data-decisions]")
    heads = table.locator("thead th").all_inner_texts()
    assert [head.split("\n")[0].strip() for head in heads] == ["Sensor", "Rover", "Wheels"]
    for row in bench.of("ranking", decides=True):
        name = f"{made.SENSORS[row['sensor']].vendor} {made.SENSORS[row['sensor']].model}"
        line = table.get_by_role("row").filter(has=reader.page.get_by_role("rowheader", name=name))
        cell = line.locator("td").nth(list(made.REQUIREMENTS).index(row["requirement"]))
        word = SHORT_VERDICTS[row["verdict"]]
        assert cell.get_attribute("data-word") == word
        # Word and shape, so that the colour alone tells nothing.
        assert word in cell.inner_text() and cell.locator("svg.shape").count() == 1
        hatched = "hatched" in (cell.get_attribute("class") or "")
        assert hatched == (row["margin"] is not None and row["evidence"] == "weak")
        if hatched:
            assert "weak evidence: " in (cell.text_content() or "")
    gamma = table.get_by_role("row").filter(has_text="Other C")
    assert gamma.get_by_text("no recording at rest").count() == len(made.REQUIREMENTS)


def bars(reader: Reader) -> list[tuple[float, float, float, float]]:
    """Return begin, middle and end of each margin in the picture, and the place of 1, in pixels."""
    found = reader.page.evaluate(
        """() => [...document.querySelectorAll(".margins svg.bar:has(rect.hollow)")].map((bar) => {
          const box = (one) => one.getBoundingClientRect();
          const [, limit, , , span] = bar.querySelectorAll("rect");
          const dot = box(bar.querySelector("circle"));
          return [box(span).left, dot.left + dot.width / 2, box(span).right, box(limit).left,
            box(bar).left];
        })"""
    )
    return [tuple(end - left for end in ends) for *ends, left in found]


def test_bars_are_the_intervals_of_the_margins(start: Reader, bench: Report) -> None:
    drawn = bars(start)
    rows = [row for row in bench.of("ranking", decides=True) if row["margin"] is not None]
    assert len(drawn) == len(rows) > 2
    # A log scale: as many pixels for each decade, in all cells, from 1 on.
    expected = sorted(
        [row["limit"] / row["upper"], row["margin"], row["limit"] / row["lower"]] for row in rows
    )
    found = sorted([begin - one, middle - one, end - one] for begin, middle, end, one in drawn)
    scale = found[0][0] / math.log10(expected[0][0])
    for places, margins in zip(found, expected, strict=True):
        assert [place / scale for place in places] == pytest.approx(
            [math.log10(margin) for margin in margins], abs=0.02
        )


@pytest.mark.parametrize(
    ("width", "height"), few([(390, 844)], [(1280, 900), (1400, 900), (768, 900)])
)
def test_the_answer_is_on_the_first_screen(
    width: int, height: int, read: Open, bench: Report
) -> None:
    reader = read(bench.folder, width=width, height=height)
    page = reader.page
    assert page.locator(".strip li").count() == 5
    for name in ("verdict", "next-steps"):
        if page.locator(f"#{name}").count():
            assert page.locator(f"#{name}").bounding_box()["y"] < height  # type: ignore[index]  # drawn
    # One sentence, and the picture of all margins.
    chosen = page.locator(".chosen").inner_text()
    assert "Best for Rover: Vendor & Sons A-1 (meets the limits)." in chosen
    assert chosen.endswith("No sensor is shown to meet the limits of Wheels.")
    assert page.locator(".margins .row[data-sensor]").count() == len(made.SENSORS)
    last = page.locator(".margins").bounding_box()
    assert last is not None and last["y"] + last["height"] < height
    assert page.evaluate(TOO_WIDE) == []
    # Nothing is cut off, and if there is more to the right the names stay.
    table = page.locator("[data-decisions]").bounding_box()
    assert table is not None and table["x"] + table["width"] <= width
    assert (
        page.locator("[data-decisions] tbody th").first.evaluate(
            "one => getComputedStyle(one).position"
        )
        == "sticky"
    )


@pytest.mark.release
def test_the_matrix_is_sorted_by_the_keyboard(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    table = reader.page.locator("[data-decisions]")
    for name, best in (("Rover", "A-1"), ("Wheels", "A-1")):
        button = table.get_by_role("button", name=f"Sort by {name}")
        button.press("Enter")
        names = cells(table, 1)
        assert best in names[0]  # the best first
        button.press("Enter")
        # What is not judged stands last either way.
        assert "Other C" in cells(table, 1)[-1] and table.locator("th[aria-sort]").count() == 1


def test_what_is_counted_is_what_is_listed(start: Reader, bench: Report) -> None:
    page = start.page
    counts = {
        text.split(" ", 1)[1]: text.split(" ")[0]
        for text in page.locator(".strip li").all_inner_texts()
    }
    rows = bench.rows["recordings"]
    assert counts["sensors"] == str(len(made.SENSORS))
    assert counts["recordings"] == str(len(rows))
    seconds = sum(row.get("duration") or 0 for row in rows)
    (unit,) = (words.split(" ")[0] for words in counts if words.endswith(" of data"))
    shown = number(counts[f"{unit} of data"]) * {"days": 86400, "h": 3600, "min": 60, "s": 1}[unit]
    assert shown == pytest.approx(seconds, rel=5e-3)
    assert counts["rejected"] == str(page.locator("#rejected li").count()) == "2"
    doubted = {r["recording"] for r in bench.rows["findings"] if r["severity"] == "warning"}
    assert counts["in doubt"] == str(page.locator("#warnings li").count()) == str(len(doubted))
    assert page.locator("#warnings h2").inner_text().startswith(f"{len(doubted)} recording")


@pytest.mark.release
def test_curves_that_are_left_out_are_left_out_of_every_figure(start: Reader) -> None:
    reader = start
    figure = reader.figure("overlay")
    forest = reader.figure("forest", symbol="N")
    every = len(traces(forest))
    toggle(figure, "Other B").uncheck()
    assert 0 < len(traces(forest)) < every
    toggle(figure, "Other B").check()
    assert len(traces(forest)) == every


def test_filters_offer_what_the_others_leave(read: Open, bench: Report) -> None:
    table = table_of(read(bench.folder, "recordings.html"), "All recordings")
    bar = bar_of(table)
    bar.get_by_label("Sensor").select_option("Other C")
    status = bar.get_by_label("Status")
    assert status.locator("option:not([disabled])").all_inner_texts() == ["all", "rejected"]
    assert bar.get_by_role("button", name="clear the filters").is_hidden()
    bar.get_by_role("searchbox", name="Find").fill("nothing like it")
    said = bar.locator("output").inner_text()
    assert re.search("^0 of .*: no row has Sensor “Other C” and Find “nothing like it”", said)
    assert said.endswith("; 1 without Find")
    bar.get_by_role("button", name="clear the filters").click()
    assert len(cells(table, 1)) == len(bench.rows["recordings"])
    assert status.locator("option[disabled]").count() == 0


@pytest.mark.parametrize(
    "paths", few([["sensors/alpha.html"]], [["index.html", "sensors/alpha.html"]]), ids=len
)
def test_the_same_model_of_a_log_has_the_same_numbers(
    paths: list[str], read: Open, bench: Report
) -> None:
    for path in paths:
        reader = read(bench.folder, path)
        for method in reader.page.get_by_role("combobox", name="Method").all():
            method.select_option("all")
        seen: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
        for table in reader.page.locator("table[id^=parameters-]").all():
            heads = [text.split("\n")[0] for text in table.locator("thead th").all_inner_texts()]
            model = next(n for n, text in enumerate(heads) if text.startswith("Model"))
            for row in table.locator("tbody tr").all():
                texts = row.locator("> *").all_inner_texts()
                what, numbers = texts[: model + 1], texts[model + 1 : -1]
                seen.setdefault((heads[model + 1], *what), set()).add(tuple(numbers))
        assert len(seen) > 5
        # The likelihood is as wide as all models that the log does not tell apart, and says so.
        assert any("(1 other model fits as well)" in key[-1] for key in seen)
        assert {key: found for key, found in seen.items() if len(found) > 1} == {}
