"""A reader of the report: a window of the browser, and everything that goes wrong in it."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from playwright.sync_api import Browser, Locator, Route

from tests.report.browser.accessibility import UNFOLD

Scheme = Literal["light", "dark"]
READY = "document.documentElement.dataset.ready === 'yes'"
SETTLED = """() => [...document.querySelectorAll("figure[data-kind]:not([data-drawn])")]
  .every((one) => one.closest("section.channel[hidden], details:not([open])")
    || one.getBoundingClientRect().top > innerHeight + 250
    || one.getBoundingClientRect().bottom < -250)"""
_TRACES = """canvas => canvas.data.map(({type, mode, name, x, y, width, fill, fillcolor, text,
  line, marker, error_x, error_y}) =>
  ({type, mode, name, x: [...x], y: [...y], width, fill, fillcolor, text, line, marker,
    error_x, error_y}))"""
TOO_WIDE = """() => {
  const root = document.documentElement;
  if (root.scrollWidth <= root.clientWidth) return [];
  const beyond = (one) => one.getBoundingClientRect().right > root.clientWidth + 1;
  const scrolled = (one) => one.closest(".scroll, .formula, .js-plotly-plot") !== null;
  return [`${root.scrollWidth} > ${root.clientWidth}`, ...[...document.querySelectorAll("body *")]
    .filter((one) => beyond(one) && !scrolled(one))
    .map((one) => `${one.localName}.${one.className} ${one.textContent.slice(0, 40)}`)];
}"""
"""What is wider than the window, where one has to scroll sideways."""

CUT_CAPTIONS = """() => [...document.querySelectorAll(".scroll caption")].filter((caption) => {
  const text = document.createRange();
  text.selectNodeContents(caption);
  const { left, right } = caption.closest(".scroll").getBoundingClientRect();
  const own = text.getBoundingClientRect();
  return own.left < left || own.right > right + 1;
}).map((caption) => caption.textContent.slice(0, 40))"""
"""The captions of which one has to scroll sideways to read the end."""

OPEN_TAB = """figure => {
  const panel = figure.closest("section.channel[hidden]");
  if (panel) document.querySelector(`[role=tab][aria-controls="${panel.id}"]`).click();
  for (let one = figure.closest("details"); one; one = one.parentElement.closest("details")) {
    one.open = true;
  }
}"""


class Reader:
    """A reader of pages, in one window, who has the script that draws once a figure is wanted.

    It is large: without it a page opens in a third of the time.

    Parameters
    ----------
    browser : Browser

    Attributes
    ----------
    page : Page
    complaints : list of str
        Errors and warnings, and what was asked for beside the files of the report.
    """

    def __init__(self, browser: Browser) -> None:
        self.complaints: list[str] = []
        self.folder = Path()
        self._context = browser.new_context()
        self._context.set_default_timeout(20_000)
        self.page = self._context.new_page()
        self.page.on("console", lambda said: self._complain(said.type, said.text))
        self.page.on("pageerror", lambda error: self._complain("error", str(error)))
        self.page.on("request", lambda asked: self._request(asked.url))
        self.page.on("requestfailed", lambda asked: self._failed(asked.url, asked.failure))
        self._drawing = False
        self._held: list[Route] = []
        self.page.route("**/plotly.min.js", self._hold)

    def _hold(self, asked: Route) -> None:
        if self._drawing:
            asked.continue_()
        else:
            self._held.append(asked)

    def _draw(self) -> None:
        """Let the script that draws come."""
        self._drawing = True
        while self._held:
            self._held.pop().continue_()

    def _complain(self, kind: str, text: str) -> None:
        if kind in ("error", "warning"):
            self.complaints.append(f"{self.page.url}: {kind}: {text}")

    def _failed(self, url: str, reason: str | None) -> None:
        if reason != "net::ERR_ABORTED":  # the reader left before it was there
            self._complain("error", f"no {url}: {reason}")

    def _request(self, url: str) -> None:
        if not url.startswith(("file:", "data:", "blob:")):
            self._complain("error", f"asks for {url}")

    def begin(self, folder: Path, width: int, height: int, scheme: Scheme) -> None:
        """Begin anew with the pages of a folder: nothing is left of an earlier visit."""
        self.complaints.clear()
        self._drawing = False
        self.folder = folder
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.emulate_media(media="screen", color_scheme=scheme)

    def end(self) -> list[str]:
        """Leave, and forget; return the complaints."""
        self.page.evaluate("localStorage.clear()")
        self.page.goto("about:blank")
        return [*self.complaints]

    def open(self, path: str, stored: Mapping[str, str] | None = None) -> None:
        """Open a page; ``stored`` is what the storage of the browser has from an earlier one.

        What is chosen may follow the path, after a ``#``: the page is loaded anew for it.
        """
        self._held.clear()
        file, mark, state = path.partition("#")
        address = (self.folder / file).as_uri() + mark + state
        if self.page.url.partition("#")[0] == address.partition("#")[0]:
            self.page.goto("about:blank")
        if stored:
            self.page.goto(address)
            for pair in stored.items():
                self.page.evaluate("pair => localStorage.setItem(...pair)", pair)
        self.page.goto(address)
        self.page.wait_for_function(READY)

    def show(self, one: Locator) -> Locator:
        """Bring something into view, and wait until no figure beside it changes its height."""
        one.scroll_into_view_if_needed()
        if self._drawing:
            self.page.wait_for_function(SETTLED)
            one.scroll_into_view_if_needed()
        return one

    def figure(self, kind: str, **data: str) -> Locator:
        """Return a figure, drawn."""
        chosen = "".join(f"[data-{key}='{value}']" for key, value in data.items())
        wanted = self.page.locator(f"figure[data-kind={kind}]{chosen}").first
        wanted.evaluate(OPEN_TAB)
        self._draw()
        figure = self.show(wanted)
        figure.locator("xpath=self::*[@data-drawn]").locator("svg.main-svg").first.wait_for()
        return figure

    def draw_all(self) -> int:
        """Bring every figure into view, one after the other; return how many there are."""
        self._draw()
        self.page.evaluate(UNFOLD)
        for everything in self.page.get_by_role("button", name="all channels").all():
            everything.click()
        figures = self.page.locator("figure[data-kind]")
        if figures.count():  # else a figure is out of view again before anything draws
            self.page.wait_for_function("window.Plotly !== undefined")
        for figure in figures.all():
            figure.scroll_into_view_if_needed()
        self.page.wait_for_function(
            "document.querySelectorAll('figure[data-kind]:not([data-drawn])').length === 0"
        )
        return figures.count()


Open = Callable[..., Reader]
"""The fixture ``read``."""


def traces(figure: Locator) -> list[dict[str, Any]]:
    """Return what is drawn, as the plotting script has it."""
    return figure.locator(".canvas").evaluate(_TRACES)


def axis_title(figure: Locator, axis: str) -> str:
    return figure.locator(f".canvas svg .{axis}title").first.text_content() or ""


def toggle(figure: Locator, label: str) -> Locator:
    """Return the box that switches a group on and off."""
    return figure.get_by_role("checkbox", name=label, exact=True)
