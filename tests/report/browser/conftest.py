import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, sync_playwright

from imubench_pipeline.report.publish import publish, render_one_file
from imubench_pipeline.report.site import Site
from tests.report.browser import made
from tests.report.browser.made import Report, Rows
from tests.report.browser.reader import Open, Reader, Scheme
from tests.report.browser.visit import Seen, visit

BROWSERS = ("chromium-headless-shell", "chromium")
"""The first that is there: without windows of its own it takes a fifth less of the processor."""


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    there = [os.environ.get("PLAYWRIGHT_CHROMIUM"), *map(shutil.which, BROWSERS)]
    path = next(filter(None, there), None)
    if path is None:
        said = "no Chromium: not on the path, and not in PLAYWRIGHT_CHROMIUM"
        if os.environ.get("CI"):
            pytest.fail(said)
        pytest.skip(said)  # only on a developer's machine: CI fails above
    # As root, Chromium does not start in its sandbox.
    arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=path, args=arguments)
        yield opened
        opened.close()


@pytest.fixture(scope="package")
def window(browser: Browser) -> Reader:
    return Reader(browser)


@pytest.fixture
def read(window: Reader) -> Iterator[Open]:
    """Open a page of a folder, anew; at the end nothing may have complained."""

    def opened(
        folder: Path,
        path: str = "index.html",
        *,
        width: int = 1280,
        height: int = 900,
        scheme: Scheme = "light",
        stored: Mapping[str, str] | None = None,
    ) -> Reader:
        window.begin(folder, width, height, scheme)
        window.open(path, stored)
        return window

    yield opened
    assert window.end() == []


@pytest.fixture
def download(window: Reader) -> Callable[[Locator], bytes]:
    """Press a button that saves a file, and return what is in it."""

    def pressed(button: Locator) -> bytes:
        with window.page.expect_download() as waiting:
            button.click()
        return Path(waiting.value.path()).read_bytes()

    return pressed


def kept(browser: Browser, bench: Report, path: str) -> Iterator[Reader]:
    """A page that is opened once, for tests that leave it as they found it."""
    reader = Reader(browser)
    reader.begin(bench.folder, 1280, 900, "light")
    reader.open(path)
    yield reader
    assert reader.end() == []
    reader.page.context.close()


@pytest.fixture(scope="package")
def start(browser: Browser, bench: Report) -> Iterator[Reader]:
    yield from kept(browser, bench, "index.html")


@pytest.fixture(scope="package")
def night(browser: Browser, bench: Report) -> Iterator[Reader]:
    yield from kept(browser, bench, f"recordings/alpha/{made.NIGHT.recording}.html")


@pytest.fixture(scope="package")
def of_bench(tmp_path_factory: pytest.TempPathFactory) -> tuple[Site, Rows]:
    return made.bench(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="package")
def bench(of_bench: tuple[Site, Rows], tmp_path_factory: pytest.TempPathFactory) -> Report:
    site, rows = of_bench
    folder = tmp_path_factory.mktemp("published") / "report"
    publish(site, folder)
    return Report(folder, rows)


@pytest.fixture(scope="package")
def seen(window: Reader, bench: Report) -> Seen:
    return visit(window, bench)


@pytest.fixture(scope="package")
def alone(of_bench: tuple[Site, Rows], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same report as one file, in a folder of its own."""
    site, _ = of_bench
    path = tmp_path_factory.mktemp("empty") / "report.html"
    path.write_text(render_one_file(site), encoding="utf-8")
    return path
