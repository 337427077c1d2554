"""Every page of the report: it opens without a complaint, draws what it has, leads somewhere."""

import posixpath
import re
from collections import Counter
from pathlib import Path
from urllib.parse import unquote

import pytest
from playwright.sync_api import Browser

from imubench_pipeline.extensions.figures.figures import list_cross_figures
from imubench_pipeline.report.payload import FOREST
from imubench_pipeline.report.view import gather_recordings
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import READY, Open, traces
from tests.report.browser.visit import LOOK, Seen

OF_ONE = [
    "sensors/beta.html", "recordings/beta/alone.html", "recordings.html", "datasheets.html",
    "theory.html", "made.html",
]  # fmt: skip
"""Those of a report of one recording, beside the start page."""


def test_no_page_complains_or_asks_for_anything_else(seen: Seen) -> None:
    assert seen.complaints == []


def test_there_is_a_page_of_everything(seen: Seen, bench: Report) -> None:
    recordings = {
        f"recordings/{row['sensor']}/{row['recording']}.html" for row in bench.rows["recordings"]
    }
    device = bench.page("devices/")
    assert recordings | {f"sensors/{name}.html" for name in made.SENSORS} < seen.pages.keys()
    assert seen.pages[device]["heads"] == [f"Other B: device {made.DEVICE}"]
    assert all(len(page["heads"]) == 1 for page in seen.pages.values())
    titles = Counter(page["title"] for page in seen.pages.values())
    assert all(title.endswith(f" · {made.TITLE}") for title in titles)


def test_browser_without_decompression_shows_plain_content_and_an_alert(
    browser: Browser, bench: Report
) -> None:
    page = browser.new_page()
    page.add_init_script("delete window.DecompressionStream")
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    for path in ("index.html", "compare.html", f"recordings/alpha/{made.NIGHT.recording}.html"):
        page.goto((bench.folder / path).as_uri())
        page.wait_for_function(READY)
        assert "Firefox 113" in page.get_by_role("alert").inner_text()
    table = page.get_by_role("table", name="Gyroscope: noise parameters")
    assert table.is_visible() and table.locator("data").first.inner_text()
    page.close()
    assert complaints == []


def test_every_figure_is_drawn(seen: Seen, bench: Report) -> None:
    empty = {path: seen.pages[path]["empty"] for path in seen.figures}
    assert {path: found for path, found in empty.items() if found} == {}
    offered = {path: page["offered"] for path, page in seen.pages.items()}
    assert seen.figures.items() <= offered.items()
    night = seen.figures[f"recordings/alpha/{made.NIGHT.recording}.html"]
    of_channel = ("spectrum", "bias over time", "bias against temperature", "allan", "histogram")
    # Of the triads, of the log over time, and of its errors
    assert night == 3 * len(of_channel) + 2 + 1 + 1
    assert offered["index.html"] == 1 + len(FOREST)
    assert offered["sensors/gamma.html"] == offered["recordings/gamma/only.html"] == 0
    followed = {(row["channel"], row["parameter"]) for row in bench.rows["drift"]}
    device = bench.page("devices/")
    assert offered[device] == len(followed)  # test_figures.py draws them


@pytest.mark.release  # long; every day one page of each kind is drawn
def test_every_figure_of_the_others_is_drawn(read: Open, seen: Seen, bench: Report) -> None:
    reader = read(bench.folder)
    for path in seen.pages.keys() - seen.figures.keys():
        reader.open(path)
        assert reader.draw_all() == seen.pages[path]["offered"], path
        looked = reader.page.evaluate(LOOK)
        assert looked["empty"] == looked["wide"] == [], path


def test_every_link_leads_somewhere(seen: Seen, bench: Report) -> None:
    views = gather_recordings(made.tables_of(bench.rows))
    channels = [channel for view in views for channel in view.channels()]
    tables = TABLES.keys() - set(OF_ONE_RECORDING)
    beside = {f"../tables/{name}.{kind}" for name in tables for kind in ("csv", "parquet")}
    beside |= {
        f"figures/{n}.{kind}" for n, _ in list_cross_figures(channels) for kind in ("svg", "pdf")
    }
    lost = []
    for path, page in seen.pages.items():
        for link in page["links"]:
            if link.startswith("data:"):
                continue
            target, _, section = link.partition("#")
            file = posixpath.normpath(posixpath.join(posixpath.dirname(path), unquote(target)))
            file = path if target == "" else file
            if file in beside:
                continue
            there = (bench.folder / file).is_file()
            state = "=" in section  # what is chosen on the page
            if not there or (
                section and not state and unquote(section) not in seen.pages[file]["ids"]
            ):
                lost.append(f"{path}: {link}")
    assert lost == []


def test_every_page_can_be_reached_from_the_first(seen: Seen) -> None:
    reached, waiting = {"index.html"}, ["index.html"]
    while waiting:
        path = waiting.pop()
        for link in seen.pages[path]["links"]:
            target = unquote(link.partition("#")[0])
            file = posixpath.normpath(posixpath.join(posixpath.dirname(path), target))
            if file in seen.pages and file not in reached:
                reached.add(file)
                waiting.append(file)
    assert reached == seen.pages.keys()


def test_no_page_is_wider_than_the_window(seen: Seen) -> None:
    assert {path: page["wide"] for path, page in seen.pages.items() if page["wide"]} == {}


def test_no_id_stands_twice(seen: Seen) -> None:
    twice = {
        f"{path}: {name}"
        for path, page in seen.pages.items()
        for name, count in Counter(page["ids"]).items()
        if count > 1
    }
    assert twice == set()


def test_what_is_wrong_stands_in_words(seen: Seen) -> None:
    for path in (
        "index.html",
        "recordings.html",
        "sensors/gamma.html",
        "recordings/alpha/night 2.html",
    ):
        assert made.REASON in seen.pages[path]["text"], path
    start = seen.pages["index.html"]["text"]
    assert re.search(
        rf"with a changed device.*{re.escape(made.DEVICE)}.*{made.CHANGED}", start, re.S
    )
    assert (
        "12 samples are missing"
        in seen.pages[f"recordings/alpha/{made.NIGHT.recording}.html"]["text"]
    )
    simulated = seen.pages["recordings/alpha/sim_published.html"]["text"]
    assert "not measured" in simulated and "simulated with" in simulated


def test_a_sensor_without_a_datasheet_says_so(seen: Seen) -> None:
    assert "states no figures of a datasheet" in seen.pages["sensors/beta.html"]["text"]


@pytest.mark.release
@pytest.mark.parametrize("others", few([[]], [OF_ONE]), ids=len)
def test_a_report_of_one_recording(others: list[str], read: Open, tmp_path: Path) -> None:
    made.publish_some(made.single(tmp_path), tmp_path / "report", ("index.html", *others))
    reader = read(tmp_path / "report")
    assert reader.page.locator("figure[data-kind]").count() == 1 + len(FOREST)
    assert traces(reader.figure("overlay"))
    for path in (*others, *(["index.html"] if others else [])):
        reader.open(path)
        if path.startswith(("index", "sensors", "recordings/")):
            assert reader.draw_all() > 0
