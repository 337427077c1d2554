"""Take the picture of the README: the top of a report's start page, and its Allan deviations.

    python docs/images/take.py results    (of the demonstration; with what `test` installs)

What lies between is left out, and the colours are reduced to 64.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

WIDTH = 1080


def part(page: Page, first: str, after: str) -> Image.Image:
    """Return what the page shows between two elements."""
    top, end = (
        page.eval_on_selector(one, "e => e.getBoundingClientRect().top + scrollY")
        for one in (first, after)
    )
    clip = {"x": 0, "y": top, "width": WIDTH, "height": end - top}
    return Image.open(io.BytesIO(page.screenshot(full_page=True, clip=clip)))


def main(results: Path) -> None:
    """Write `report.png` beside this file."""
    browser = os.environ.get("PLAYWRIGHT_CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = opened.new_page(viewport={"width": WIDTH, "height": 900})
        page.goto((results / "report/index.html").resolve().as_uri())
        page.locator("#comparison").scroll_into_view_if_needed()  # figures are drawn when seen
        page.wait_for_selector("figure[data-kind=overlay] .main-svg")
        parts = [
            part(page, "body", "#verdict"),
            part(page, "#comparison", "figure[data-kind=overlay] figcaption"),
        ]
        opened.close()
    whole = Image.new("RGB", (WIDTH, sum(one.height for one in parts)), "white")
    for place, one in enumerate(parts):
        whole.paste(one, (0, sum(before.height for before in parts[:place])))
    whole.quantize(64).save(Path(__file__).with_name("report.png"), optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
