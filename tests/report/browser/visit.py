"""A visit of every page of a report, from which several tests know what a reader finds."""

from dataclasses import dataclass
from typing import Any

from tests.report.browser.made import Report
from tests.report.browser.reader import TOO_WIDE, Reader

DRAWN = ("recordings/alpha/night 1",)
"""Where most kinds of figures stand; other tests draw those of other pages one by one. Before a
release, all of them are drawn."""

LOOK = f"""() => ({{
  wide: ({TOO_WIDE})(),
  title: document.title,
  heads: [...document.querySelectorAll("h1")].map((head) => head.textContent),
  ids: [...document.querySelectorAll("[id]")].map((one) => one.id),
  links: [...document.querySelectorAll("a[href], link[href], [src]")]
    .map((one) => one.getAttribute("href") ?? one.getAttribute("src")),
  text: document.querySelector("main").innerText,
  offered: document.querySelectorAll("figure[data-kind]").length,
  empty: [...document.querySelectorAll("figure[data-kind] .canvas")]
    .filter((one) => !one.querySelector("svg.main-svg") || !one.data?.length)
    .map((one) => one.getAttribute("aria-label")),
}})"""


@dataclass
class Seen:
    """What a reader found who opened every page and looked at every figure of some."""

    pages: dict[str, dict[str, Any]]
    figures: dict[str, int]
    complaints: list[str]


def visit(window: Reader, report: Report) -> Seen:
    pages, figures = {}, {}
    drawn = {report.page(kind) for kind in DRAWN}
    window.begin(report.folder, 1280, 900, "light")
    for path in report.pages:
        window.open(path)
        if path in drawn:
            figures[path] = window.draw_all()
        pages[path] = window.page.evaluate(LOOK)
    return Seen(pages, figures, window.end())
